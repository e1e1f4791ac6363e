//! iceoryx2, one way: the publisher and the subscriber of one service, with a notifier and a listener if it is to
//! sleep.

use super::iceoryx::{Service, configuration, events, failed, messages};
use crate::one_way::{Sink, Source};
use iceoryx2::port::backpressure_strategy::BackpressureStrategy;
use iceoryx2::port::{listener::Listener, notifier::Notifier, publisher::Publisher, subscriber::Subscriber};
use iceoryx2::prelude::*;
use rohrpost_bench_local::harness::{Failure, Scratch, copy_whole};

const SERVICE: &str = "stream";

/// Sends; finds it room again and again while the subscriber's buffer is full.
pub struct IceoryxSender {
    publisher: Publisher<Service, [u8], ()>,
    notifier: Option<Notifier<Service>>,
    /// Last: all that is above belongs to it.
    _node: Node<Service>,
}

impl IceoryxSender {
    /// Opens it, when the receiver is there.
    ///
    /// # Errors
    /// What iceoryx2 says.
    pub fn open(scratch: &Scratch, bytes: usize, depth: usize, listens: bool) -> Result<Self, Failure> {
        let node = node(scratch)?;
        let service = messages(&node, SERVICE, depth)?;
        let builder = service.publisher_builder();
        let builder = builder.initial_max_slice_len(bytes).max_loaned_samples(2);
        let publisher = builder.backpressure_strategy(BackpressureStrategy::RetryUntilDelivered).create();
        let notifier = listens.then(|| events(&node, SERVICE)?.notifier_builder().create().map_err(failed));
        Ok(Self { publisher: publisher.map_err(failed)?, notifier: notifier.transpose()?, _node: node })
    }
}

impl Sink for IceoryxSender {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        let loan = self.publisher.loan_slice_uninit(message.len()).map_err(failed)?;
        loan.write_from_slice(message).send().map_err(failed)?;
        if let Some(notifier) = &self.notifier {
            notifier.notify().map_err(failed)?;
        }
        Ok(())
    }
}

/// Receives; spins, or waits for the notifier.
pub struct IceoryxReceiver {
    subscriber: Subscriber<Service, [u8], ()>,
    listener: Option<Listener<Service>>,
    /// Last: all that is above belongs to it.
    _node: Node<Service>,
}

impl IceoryxReceiver {
    /// Opens it.
    ///
    /// # Errors
    /// What iceoryx2 says.
    pub fn open(scratch: &Scratch, depth: usize, listens: bool) -> Result<Self, Failure> {
        let node = node(scratch)?;
        let subscriber = messages(&node, SERVICE, depth)?.subscriber_builder().create().map_err(failed)?;
        let listener = listens.then(|| events(&node, SERVICE)?.listener_builder().create().map_err(failed));
        Ok(Self { subscriber, listener: listener.transpose()?, _node: node })
    }
}

impl Source for IceoryxReceiver {
    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        loop {
            if let Some(sample) = self.subscriber.receive().map_err(failed)? {
                return copy_whole(sample.payload(), message);
            }
            if let Some(listener) = &self.listener {
                listener.blocking_wait(|_| {}).map_err(failed)?;
            }
        }
    }
}

fn node(scratch: &Scratch) -> Result<Node<Service>, Failure> {
    set_log_level(LogLevel::Error);
    NodeBuilder::new().config(&configuration(scratch)?).create::<Service>().map_err(failed)
}
