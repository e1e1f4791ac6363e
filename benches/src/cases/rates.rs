//! Packages a second: one sender or four, the mailbox always about to be full.
//!
//! A full mailbox rejects, and its sender tries again, so nothing is lost. The rings and queues beside it make
//! their senders wait, too.

use crate::floors::ring::{BareRing, DEPTH, Futex, RingReceiver, RingSender, SharedRing as Ring};
use crate::floors::{Queue, QueueSink};
use crate::one_way::{OwnNode, Retry, Stream, rate};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Failure, Scheduling, Shared};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_least, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_mailbox::OverflowPolicy;
use std::time::Duration;

/// Long enough for some hundred thousand packages, short enough that the kernel's fair server stays out.
const TURN: Duration = Duration::from_millis(500);
/// Turns of an empty loop before a refused sender tries again: about the time that the receiver needs for some
/// packages.
const RETRY: Retry = Retry::Spin(64);
const PRIORITIES: [u8; 4] = [20, 50, 80, 110];

/// All cases of this file.
pub(super) fn cases() -> Vec<Case> {
    let one = |spins, bytes, bound| {
        let name = if spins { "rate-spinning" } else { "rate-blocking" };
        let sender = OneSender { spins, bytes, bound };
        Case::new(name, bytes, "packages/s", move |settings, subject| Ok(sender.measure(settings, subject)))
    };
    vec![
        one(false, 64, 1.0),
        one(false, 4096, 1.0),
        one(true, 64, 0.25),
        one(true, 4096, 0.85),
        Case::new("rate-four-senders", 64, "packages/s", four_senders),
    ]
}

struct OneSender {
    /// Whether the receiver spins; else it sleeps.
    spins: bool,
    bytes: usize,
    /// Share of the floor's rate.
    bound: f64,
}

impl OneSender {
    fn measure(&self, settings: &Settings, subject: &Subject) -> Vec<Row> {
        let stream = stream(settings, self.bytes, 1);
        let ours = Contender::single("rohrpost", || ours(&stream, self.spins, RETRY));
        let futex = Contender::single("futex ring", || {
            let ring = Shared::<Ring>::new()?;
            rate(&stream, |_| Ok(Futex::<RingSender>::sender(&ring)), || Ok(Futex::<RingReceiver>::receiver(&ring)))
        });
        let bare = Contender::single("ring", || {
            let ring = Shared::<Ring>::new()?;
            rate(
                &stream,
                |_| Ok(BareRing::<RingSender>::sender(&ring)),
                || Ok(BareRing::<RingReceiver>::receiver(&ring)),
            )
        });
        let queue = Contender::single("posix-mq", || {
            let queue = Queue::new(DEPTH, self.bytes)?;
            rate(&stream, |_| Ok(QueueSink::new(&queue, 0)), || Ok(&queue))
        });
        let floor = if self.spins { bare } else { futex };
        let mut contenders = vec![ours, floor.beside(at_least(self.bound), None), queue];
        contenders.extend(self.peers(&stream));
        compare(settings, subject, &contenders)
    }

    fn peers<'a>(&self, stream: &'a Stream) -> Vec<Contender<'a>> {
        use crate::one_way::{channel_rate, iceoryx_rate};
        if self.spins {
            vec![
                Contender::single("iceoryx2 spinning", || iceoryx_rate(stream, false)),
                Contender::single("crossbeam, 1 process", || channel_rate(stream)),
            ]
        } else {
            vec![Contender::single("iceoryx2 listener", || iceoryx_rate(stream, true))]
        }
    }
}

fn four_senders(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let (one, four) = (stream(settings, 64, 1), stream(settings, 64, PRIORITIES.len()));
    // All senders share a processor: a refused sender yields to the others.
    let four = Contender::single("rohrpost", move || ours(&four, true, Retry::Yield));
    let one = Contender::single("one sender", move || ours(&one, true, Retry::Yield));
    Ok(compare(settings, subject, &[four, one.beside(at_least(0.5), None)]))
}

fn stream(settings: &Settings, bytes: usize, senders: usize) -> Stream {
    let messages = if settings.quick { settings.count(usize::MAX) as u64 } else { u64::MAX };
    Stream { bytes, messages, senders, scheduling: Scheduling::Fifo, cap: TURN }
}

fn ours(stream: &Stream, spins: bool, retry: Retry) -> Result<f64, Failure> {
    let ground = OwnNode::new(DEPTH, stream.bytes, OverflowPolicy::Reject)?;
    rate(stream, |sender| ground.sink(PRIORITIES[sender % PRIORITIES.len()], retry), || ground.source(spins))
}
