//! Packages a second: one sender or four, the mailbox always about to be full.
//!
//! A full mailbox rejects, and its sender tries again, so nothing is lost. The rings and queues beside it make
//! their senders wait, too.

use crate::floors::Queue;
use crate::floors::ring::{BareRing, DEPTH, Futex, RingReceiver, RingSender, SharedRing as Ring};
use crate::one_way::{OwnNode, QueueSink, Retry, Stream, rate};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Failure, Scheduling, Shared};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, Target, Versus, compare};
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
pub(super) fn cases() -> Vec<Box<dyn Case>> {
    let one = |spins, bytes, bound| -> Box<dyn Case> { Box::new(OneSender { spins, bytes, bound }) };
    vec![one(false, 64, 1.0), one(false, 4096, 1.0), one(true, 64, 0.25), one(true, 4096, 0.85), Box::new(FourSenders)]
}

struct OneSender {
    /// Whether the receiver spins; else it sleeps.
    spins: bool,
    bytes: usize,
    /// Share of the floor's rate.
    bound: f64,
}

impl Case for OneSender {
    fn name(&self) -> String {
        if self.spins { "rate-spinning" } else { "rate-blocking" }.into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
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
        let subject = Subject { case: self.name(), bytes: Some(self.bytes), unit: "packages/s" };
        let floor = if self.spins { bare } else { futex };
        let versus = [Versus { name: floor.name, p50: Some(Target::AtLeast(self.bound)), p99: None }];
        let mut contenders = vec![ours, floor, queue];
        contenders.extend(self.peers(&stream));
        Ok(compare(settings, &subject, &contenders, &versus))
    }
}

impl OneSender {
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

struct FourSenders;

impl Case for FourSenders {
    fn name(&self) -> String {
        "rate-four-senders".into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let (one, four) = (stream(settings, 64, 1), stream(settings, 64, PRIORITIES.len()));
        // All senders share a processor: a refused sender yields to the others.
        let four = Contender::single("rohrpost", move || ours(&four, true, Retry::Yield));
        let one = Contender::single("one sender", move || ours(&one, true, Retry::Yield));
        let subject = Subject { case: self.name(), bytes: Some(64), unit: "packages/s" };
        let versus = [Versus { name: one.name, p50: Some(Target::AtLeast(0.5)), p99: None }];
        Ok(compare(settings, &subject, &[four, one], &versus))
    }
}

fn stream(settings: &Settings, bytes: usize, senders: usize) -> Stream {
    let messages = if settings.quick { settings.count(usize::MAX) as u64 } else { u64::MAX };
    Stream { bytes, messages, senders, scheduling: Scheduling::Fifo, cap: TURN }
}

fn ours(stream: &Stream, spins: bool, retry: Retry) -> Result<f64, Failure> {
    let ground = OwnNode::new(DEPTH, stream.bytes, OverflowPolicy::Reject)?;
    rate(stream, |sender| ground.sink(PRIORITIES[sender % PRIORITIES.len()], retry), || ground.source(spins))
}
