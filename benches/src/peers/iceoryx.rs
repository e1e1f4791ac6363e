//! iceoryx2: publish and subscribe between two processes.

use iceoryx2::port::backpressure_strategy::BackpressureStrategy;
use iceoryx2::port::{listener::Listener, notifier::Notifier, publisher::Publisher, subscriber::Subscriber};
use iceoryx2::prelude::*;
use rohrpost_bench_local::harness::{End, Failure, Link, Meetings, Scratch};
use std::fmt::Debug;

pub(super) type Service = ipc::Service;

/// Samples that may wait; in ping-pong more than one never does.
const DEPTH: usize = 16;
/// The same where samples are larger than this, of which the shared memory would have to hold forty.
const DEPTH_OF_LARGE: usize = 2;
const LARGE_BYTES: usize = 65_536;

/// How messages are received, and whether they are copied.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Waits {
    /// Copied; a notifier wakes a listener.
    Listener,
    /// Copied; the subscriber looks again and again.
    Spinning,
    /// The same, written and read in place.
    Loaned,
}

/// One end.
pub struct Iceoryx {
    publisher: Publisher<Service, [u8], ()>,
    subscriber: Subscriber<Service, [u8], ()>,
    bell: Option<(Notifier<Service>, Listener<Service>)>,
    /// Bytes of each message, of which the link's user sees the head when they are loaned.
    bytes: usize,
    waits: Waits,
    /// Last: all that is above belongs to it.
    _node: Node<Service>,
}

pub(super) fn failed(error: impl Debug) -> Failure {
    Failure::Failed(format!("iceoryx2: {error:?}"))
}

/// All that it makes lies in the scratch directory, or has the scratch's name in shared memory.
pub(super) fn configuration(scratch: &Scratch) -> Result<Config, Failure> {
    let mut config = Config::default();
    config.global.prefix = FileName::new(scratch.name().as_bytes()).map_err(failed)?;
    let directory = scratch.directory();
    config.global.set_root_path(&Path::new(directory.as_os_str().as_encoded_bytes()).map_err(failed)?);
    Ok(config)
}

impl Iceoryx {
    /// Opens an end for messages of so many bytes.
    ///
    /// # Errors
    /// What iceoryx2 says.
    pub fn open(
        scratch: &Scratch,
        end: End,
        bytes: usize,
        waits: Waits,
        meetings: &mut Meetings,
    ) -> Result<Self, Failure> {
        set_log_level(LogLevel::Error);
        let node = NodeBuilder::new().config(&configuration(scratch)?).create::<Service>().map_err(failed)?;
        let (out, back) = if end == End::Ping { ("there", "back") } else { ("back", "there") };
        let depth = if bytes > LARGE_BYTES { DEPTH_OF_LARGE } else { DEPTH };
        let publisher = messages(&node, out, depth)?
            .publisher_builder()
            .initial_max_slice_len(bytes)
            .max_loaned_samples(2)
            .backpressure_strategy(BackpressureStrategy::RetryUntilDelivered)
            .create()
            .map_err(failed)?;
        let subscriber = messages(&node, back, depth)?.subscriber_builder().create().map_err(failed)?;
        let bell = match waits {
            Waits::Listener => {
                let notifier = events(&node, out)?.notifier_builder().create().map_err(failed)?;
                let listener = events(&node, back)?.listener_builder().create().map_err(failed)?;
                Some((notifier, listener))
            }
            Waits::Spinning | Waits::Loaned => None,
        };
        // What is published before the other end subscribes would be lost.
        meetings.meet()?;
        Ok(Self { publisher, subscriber, bell, bytes, waits, _node: node })
    }
}

pub(super) type Messages = iceoryx2::service::port_factory::publish_subscribe::PortFactory<Service, [u8], ()>;
pub(super) type Events = iceoryx2::service::port_factory::event::PortFactory<Service>;

pub(super) fn messages(node: &Node<Service>, name: &str, depth: usize) -> Result<Messages, Failure> {
    let name = ServiceName::new(name).map_err(failed)?;
    let builder = node.service_builder(&name).publish_subscribe::<[u8]>();
    let builder = builder.enable_safe_overflow(false).subscriber_max_buffer_size(depth).history_size(0);
    builder.max_publishers(2).max_subscribers(2).open_or_create().map_err(failed)
}

pub(super) fn events(node: &Node<Service>, name: &str) -> Result<Events, Failure> {
    let name = ServiceName::new(&format!("{name}-bell")).map_err(failed)?;
    node.service_builder(&name).event().open_or_create().map_err(failed)
}

impl Link for Iceoryx {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        let mut loan = self.publisher.loan_slice_uninit(self.bytes).map_err(failed)?;
        let sample = match self.waits {
            Waits::Loaned => {
                for (byte, value) in loan.payload_mut().iter_mut().zip(message) {
                    byte.write(*value);
                }
                // SAFETY: bytes; those that were not written are what the shared memory had, zeroes or an older
                // message.
                unsafe { loan.assume_init() }
            }
            Waits::Listener | Waits::Spinning => loan.write_from_slice(message),
        };
        sample.send().map_err(failed)?;
        if let Some((notifier, _)) = &self.bell {
            notifier.notify().map_err(failed)?;
        }
        Ok(())
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        loop {
            if let Some(sample) = self.subscriber.receive().map_err(failed)? {
                let payload = sample.payload();
                if payload.len() != self.bytes || payload.len() < message.len() {
                    return Err(Failure::Failed(format!("{} bytes came, not {}", payload.len(), self.bytes)));
                }
                message.copy_from_slice(&payload[..message.len()]);
                return Ok(());
            }
            if let Some((_, listener)) = &self.bell {
                listener.blocking_wait(|_| {}).map_err(failed)?;
            } else {
                std::hint::spin_loop();
            }
        }
    }
}
