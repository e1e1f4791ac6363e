//! The clock of the node that writes is set: its replicas go on with the next record, and say so once.

use super::*;
use std::sync::atomic::{AtomicU64, Ordering};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Metadata, Subscriber};

const S: u64 = 1_000_000_000;
/// From one record to the next, ns.
const EVERY_NS: u64 = 10 * MS;

/// Counts lines of output.
#[derive(Clone, Default)]
pub(super) struct Lines(Arc<AtomicU64>);

impl Lines {
    pub(super) fn count(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

impl Subscriber for Lines {
    fn enabled(&self, _: &Metadata<'_>) -> bool {
        true
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, _: &Event<'_>) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}

/// What the writer's clock does after half of the records.
#[derive(Clone, Copy)]
struct Stepped {
    /// By how much it is set, ns.
    by_ns: i64,
    /// Its node has begun another epoch, as a router does that starts with such a clock.
    epoch: u64,
    /// The epoch of stamps then.
    stamped: u64,
    /// How far off it is at most, as its node says, ns.
    error_ns: u64,
}

/// Writes records for two seconds, and sets the clock after one: sequences that were read, lines of output, and records
/// that were counted as late.
fn stepped(stepped: Stepped) -> (Vec<u64>, u64, u64) {
    let lines = Lines::default();
    let replicas = [image()];
    let (mut origin, mut holder) = (Origin::new(&replicas), Holder::new(&replicas));
    let (mut writer, mut reader) = (origin.writer(ID, SHAPE), holder.reader());
    let mut sequences = Vec::new();
    tracing::subscriber::with_default(lines.clone(), || {
        for step in 0..2 * S / EVERY_NS {
            let now_ns = START + 10 * S + step * EVERY_NS;
            let is_set = step * EVERY_NS >= S;
            let (by_ns, epoch) = if is_set { (stepped.by_ns, stepped.epoch) } else { (0, 1) };
            let error = Duration::from_nanos(stepped.error_ns);
            // The record's own moment is written a moment ago, by the monotonic clock of the computer that tests.
            let system = |_: u64| SystemTime { ns: now_ns.saturating_add_signed(by_ns), epoch, error, ..time(now_ns) };
            let stamp = match if is_set { stepped.stamped } else { 1 } {
                1 => at(now_ns),
                epoch => Stamp { epoch, ns: system(now_ns).ns },
            };
            writer.write(stamp, &[step as u8; 64]).unwrap();
            origin.router.stats.peer(HOLDER).link.heard_ns.set(now_ns);
            let mut datagram = vec![0; 1472];
            while let ReplicaStep::Send { bytes, .. } =
                origin.router.sender.poll(now_ns, system, &mut origin.router.outbound, &mut datagram)
            {
                holder.take(now_ns, &datagram[..bytes]);
            }
            holder.pass(now_ns);
            let before = sequences.len();
            sequences.extend(super::sequences(&mut reader));
            assert_eq!(sequences.len(), before + 1, "record {step} is read as soon as it is written");
        }
    });
    (sequences, lines.count(), holder.counts().delayed.get())
}

#[test]
fn a_writers_clock_that_is_set_back_by_a_second_stops_no_record_and_is_told_once() {
    let records = 2 * S / EVERY_NS;
    // Its node takes some time to find that out: meanwhile each record seems to have been on its way for a second.
    let back = Stepped { by_ns: -1_000_000_000, epoch: 1, stamped: 1, error_ns: 10_000 };
    let (sequences, lines, late) = stepped(back);
    assert!(sequences.into_iter().eq(0..records), "each record is read, in order");
    assert_eq!((lines, late), (1, records / 2), "all are counted, and one line tells of them in a second");
    // Times of two epochs are not compared, though the stamps go back by a second.
    for (set, why) in [
        (Stepped { epoch: 2, stamped: 2, ..back }, "its modules know that"),
        (Stepped { epoch: 2, ..back }, "its modules do not know that yet"),
        (Stepped { error_ns: S, ..back }, "its node says that it may be"),
    ] {
        let (sequences, lines, late) = stepped(set);
        assert!(sequences.into_iter().eq(0..records), "{why}");
        assert_eq!((lines, late), (0, 0), "{why}");
    }
}
