//! Streams of a simulated network with their replicas, drawn from its seed.

use super::super::chance::Chance;
use super::super::fault::{Fault, Planned};
use super::super::plan::Plan;
use super::super::spans::{MS, S};
use super::stream::StreamPlan;
use rohrpost_config::Sampling;
use rohrpost_mailbox::{StreamId, StreamShape};
use rohrpost_network::RECORD_PART_HEAD_BYTES;
use rohrpost_routers::frame::HEAD_BYTES;
use std::time::Duration;

/// A record is so long at most, bytes.
const RECORD_BYTES_MAX: u64 = 400_000;
/// A ring is so large at most, but for its least number of records.
const RING_BYTES_MAX: u64 = 1 << 20;
/// Nodes that have a replica of a stream, at most.
const COPIES_MAX: usize = 3;
/// Readers of a replica on a node, at most.
const READERS_MAX: u64 = 3;

impl Plan {
    /// The same network, in which some nodes have streams of others beside all else.
    #[must_use]
    pub fn replicated(mut self) -> Self {
        let mut chance = Chance::new(self.seed ^ 0x5e9_11ca);
        let count = chance.between(1, 4);
        for number in 1..=count {
            let stream = self.draw_stream(number, count, &mut chance);
            self.streams.push(stream);
        }
        self.draw_hostile(&mut chance);
        self
    }

    /// Each node writes a stream that all others have, faster than its slots carry it.
    pub(in crate::sim) fn draw_endless(&mut self) {
        let record_bytes = 20 * self.shape.datagram_bytes_max as u32;
        for node in 0..self.nodes.len() {
            let others = (0..self.nodes.len()).filter(|other| *other != node);
            self.streams.push(StreamPlan {
                id: StreamId { name: self.nodes[node].modules[0], number: node as u16 + 1 },
                node,
                shape: StreamShape { record_bytes, keep: 4, readers: 8, late: Duration::ZERO },
                to: others.fold(0, |all, other| all | 1 << other),
                sampling: Sampling::Each,
                changed: false,
                deadline_ns: 100 * MS,
                period_ns: 10 * MS,
                bytes: (record_bytes.into(), record_bytes.into()),
                same_percent: 0,
                is_carried: false,
                readers: vec![((node + 1) % self.nodes.len(), 20 * MS)],
            });
        }
    }

    fn draw_stream(&self, number: u64, count: u64, chance: &mut Chance) -> StreamPlan {
        let nodes = self.nodes.len();
        let node = chance.below(nodes as u64) as usize;
        let name = chance.pick(&self.nodes[node].modules);
        let mut others: Vec<usize> = (0..nodes).filter(|other| *other != node).collect();
        let copies = chance.between(1, COPIES_MAX.min(others.len()) as u64) as usize;
        while others.len() > copies {
            others.remove(chance.below(others.len() as u64) as usize);
        }
        // What the wire carries of it in a second, beside all else.
        let share_bytes_s = self.shape.rate_bytes_s / (4 * count * copies as u64);
        let part_bytes = (self.shape.datagram_bytes_max - HEAD_BYTES - RECORD_PART_HEAD_BYTES) as u64;
        let most = match chance.below(10) {
            0..4 => chance.between(0, part_bytes),
            4..8 => chance.between(part_bytes, 20 * part_bytes),
            _ => chance.between(part_bytes, 400 * part_bytes),
        };
        let most = most.min(RECORD_BYTES_MAX).min(share_bytes_s / 2);
        let least = if chance.percent(50) { 0 } else { most / 2 };
        let fits_ns = (most + 200) * S / share_bytes_s;
        // Some are written faster than they leave.
        let hurries = if chance.percent(20) { 8 } else { 1 };
        let period_ns = (fits_ns / hurries).max(chance.scale(4 * MS, 150 * MS));
        let keep = chance.between(2, 24).min((RING_BYTES_MAX / most.max(1)).max(2)) as u32;
        let late = if chance.percent(30) { Duration::from_millis(10) } else { Duration::ZERO };
        let readers = others.iter().flat_map(|node| (0..chance.between(1, READERS_MAX)).map(move |_| *node));
        let readers: Vec<usize> = readers.collect();
        StreamPlan {
            id: StreamId { name, number: number as u16 },
            node,
            shape: StreamShape { record_bytes: most.max(1) as u32, keep, readers: 8, late },
            to: others.iter().fold(0, |all, node| all | 1 << node),
            sampling: match chance.below(10) {
                0..6 => Sampling::Each,
                6 | 7 => Sampling::Every(chance.between(2, 5) as u32),
                _ => Sampling::Rate(chance.between(2, 100) as f64),
            },
            changed: chance.percent(20),
            deadline_ns: if chance.percent(10) { 0 } else { chance.scale(20 * MS, S / 2) },
            period_ns,
            bytes: (least, most),
            same_percent: chance.pick(&[0, 0, 50]),
            is_carried: true,
            readers: readers.into_iter().map(|node| (node, chance.scale(MS, 300 * MS))).collect(),
        }
    }

    /// In every second network a node sends parts and requests that nobody should send, to nodes that get none of it.
    fn draw_hostile(&mut self, chance: &mut Chance) {
        let nodes = self.nodes.len();
        if chance.percent(50) {
            return;
        }
        for _ in 0..chance.between(1, 6) {
            let [from, to] = [0; 2].map(|_| chance.below(nodes as u64) as usize);
            // What it sends there rightly would come behind it.
            let talks = |stream: &StreamPlan| {
                stream.node == from && stream.is_on(to) || stream.node == to && stream.is_on(from)
            };
            if from == to || self.streams.iter().any(talks) {
                continue;
            }
            let from_ns = chance.between(S, self.fixed_ns.max(S + 1));
            let fault = Fault::Parts { from, to, count: chance.scale(1, 200) };
            self.faults.push(Planned { from_ns, until_ns: from_ns, fault });
        }
    }
}
