//! Orders in which records of streams may come.

use proptest::prelude::*;
use rohrpost_fusion::Stamp;

/// A record to be pushed: which stream, when, its number there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Coming {
    pub(crate) stream: usize,
    pub(crate) stamp: Stamp,
    pub(crate) sequence: u64,
}

/// Streams of one to two epochs, their records in the order of stamps. Stamps of a stream may be equal.
pub(crate) fn streams(count: usize, records_max: usize) -> impl Strategy<Value = Vec<Vec<Coming>>> {
    let stream = prop::collection::vec((0..6u64, prop::bool::weighted(0.03)), 0..records_max);
    prop::collection::vec((0..8u64, stream), count).prop_map(|all| {
        let streams = all.into_iter().enumerate();
        streams
            .map(|(stream, (begin_ns, steps))| {
                let mut stamp = Stamp::new(1, 1_000 + begin_ns);
                let mut records = Vec::new();
                for (sequence, (step_ns, is_step_of_time)) in (0..).zip(steps) {
                    stamp.ns += step_ns;
                    // All streams count the later epoch from about the same time.
                    if is_step_of_time && stamp.epoch == 1 {
                        stamp = Stamp::new(2, 500 + step_ns);
                    }
                    records.push(Coming { stream, stamp, sequence });
                }
                records
            })
            .collect()
    })
}

/// The records of all streams in an order that keeps each stream's lateness bound. `delays` and `turns` decide.
pub(crate) fn shuffled(streams: &[Vec<Coming>], lateness_ns: &[u64], delays: &[u64], turns: &[usize]) -> Vec<Coming> {
    let mut delays = delays.iter().cycle();
    // Within a stream: each record comes later than it was produced, by less than the bound.
    let mut queues: Vec<_> = streams
        .iter()
        .zip(lateness_ns)
        .map(|(records, lateness_ns)| {
            let mut timed: Vec<_> = records
                .iter()
                .map(|record| {
                    let delay_ns = delays.next().unwrap() % lateness_ns.max(&1);
                    ((record.stamp.epoch, record.stamp.ns + delay_ns), *record)
                })
                .collect();
            timed.sort_by_key(|(due, _)| *due);
            timed.into_iter().map(|(_, record)| record).collect::<std::collections::VecDeque<_>>()
        })
        .collect();
    // Between streams: any order.
    let mut all = Vec::new();
    let mut turns = turns.iter().cycle();
    while queues.iter().any(|queue| !queue.is_empty()) {
        let count = queues.len();
        let turn = turns.next().unwrap() % count;
        let queue = (0..count).map(|more| (turn + more) % count).find(|stream| !queues[*stream].is_empty()).unwrap();
        all.extend(queues[queue].pop_front());
    }
    all
}
