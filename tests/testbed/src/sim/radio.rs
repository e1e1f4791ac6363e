//! Radio between robots at places: by range, so not from each to each; where something stands between, perhaps one way
//! only; with losses one by one, and in bursts.
//!
//! ```text
//!  place, range, shadows ──▶ hears ──▶ Link: loss, delay, copies, order ──▶ Burst: nothing comes for a while
//! ```
//!
//! Robots are of any type with an order. Here is no event and no clock: [`Radio::send`] says where a message comes out
//! and when.

use super::chance::Chance;
use super::link::{Link, Quality};
use std::collections::{BTreeMap, BTreeSet};

/// A point of the plane, mm.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Place {
    /// Eastward, mm.
    pub x_mm: i32,
    /// Northward, mm.
    pub y_mm: i32,
}

impl Place {
    fn is_within(self, other: Self, distance_mm: u64) -> bool {
        let square = |a: i32, b: i32| u128::from(a.abs_diff(b)).pow(2);
        square(self.x_mm, other.x_mm) + square(self.y_mm, other.y_mm) <= u128::from(distance_mm).pow(2)
    }
}

/// Spans, by chance from a half to three halves of their means, in which a link loses everything.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Bursts {
    /// Mean time between two bursts, ns.
    pub apart_ns: u64,
    /// Mean length of a burst, ns.
    pub length_ns: u64,
}

impl Bursts {
    /// No burst is longer, ns.
    pub fn length_ns_max(self) -> u64 {
        self.length_ns * 3 / 2
    }

    /// Between two bursts there is at least so much time, ns.
    pub fn apart_ns_min(self) -> u64 {
        self.apart_ns / 2
    }
}

/// A direction between two robots.
#[derive(Debug)]
struct Air {
    link: Link,
    is_burst: bool,
    /// When the present burst, or the time without one, is over.
    until_ns: u64,
}

impl Air {
    /// Whether a burst swallows what is sent now.
    fn is_silent(&mut self, now_ns: u64, bursts: Bursts, chance: &mut Chance) -> bool {
        while self.until_ns <= now_ns {
            self.is_burst = !self.is_burst;
            let mean_ns = if self.is_burst { bursts.length_ns } else { bursts.apart_ns };
            self.until_ns += chance.between(mean_ns / 2, mean_ns * 3 / 2).max(1);
        }
        self.is_burst
    }
}

/// Robots that are on the air, and what comes from each to each.
#[derive(Debug)]
pub struct Radio<R> {
    range_mm: u64,
    quality: Quality,
    bursts: Option<Bursts>,
    places: BTreeMap<R, Place>,
    /// Pairs of which the first does not reach the second.
    shadows: BTreeSet<(R, R)>,
    air: BTreeMap<(R, R), Air>,
}

impl<R: Copy + Ord> Radio<R> {
    /// Nobody is on the air. A robot hears others up to so far away, mm.
    pub fn new(range_mm: u64, quality: Quality) -> Self {
        let (places, shadows, air) = (BTreeMap::new(), BTreeSet::new(), BTreeMap::new());
        Self { range_mm, quality, bursts: None, places, shadows, air }
    }

    /// From now on all links are so.
    pub fn set_quality(&mut self, quality: Quality) {
        self.quality = quality;
        self.air.values_mut().for_each(|air| air.link.quality = quality);
    }

    /// From now on each link has such bursts of its own, or none.
    pub fn set_bursts(&mut self, bursts: Option<Bursts>) {
        self.bursts = bursts;
    }

    /// A robot comes, or moves.
    pub fn put(&mut self, robot: R, place: Place) {
        self.places.insert(robot, place);
    }

    /// Where a robot on the air is.
    pub fn place(&self, robot: R) -> Option<Place> {
        self.places.get(&robot).copied()
    }

    /// A robot sends and hears nothing any more. Where it was, if it was on the air.
    pub fn remove(&mut self, robot: R) -> Option<Place> {
        self.places.remove(&robot)
    }

    /// Something stands so that `from` does not reach `to`, though `to` may reach `from`.
    pub fn shade(&mut self, from: R, to: R) {
        self.shadows.insert((from, to));
    }

    /// Robots on the air.
    pub fn robots(&self) -> impl Iterator<Item = R> {
        self.places.keys().copied()
    }

    /// Whether what `from` sends comes to `to`, if it is not lost.
    pub fn hears(&self, to: R, from: R) -> bool {
        let (Some(there), Some(here)) = (self.place(to), self.place(from)) else { return false };
        there.is_within(here, self.range_mm) && !self.shadows.contains(&(from, to))
    }

    /// Robots from which something comes to this one, over any number of others; itself included.
    pub fn sources(&self, robot: R) -> BTreeSet<R> {
        let (mut found, mut todo) = (BTreeSet::from([robot]), vec![robot]);
        while let Some(to) = todo.pop() {
            for from in self.robots().filter(|from| self.hears(to, *from)) {
                if found.insert(from) {
                    todo.push(from);
                }
            }
        }
        found
    }

    /// A robot sends a message of so many bytes: to which robots it comes, and when, true ns.
    pub fn send(&mut self, now_ns: u64, from: R, bytes: usize, chance: &mut Chance) -> Vec<(R, u64)> {
        let mut arrivals = Vec::new();
        let others: Vec<R> = self.robots().filter(|to| *to != from && self.hears(*to, from)).collect();
        for to in others {
            let new = || Air { link: Link::new(self.quality), is_burst: true, until_ns: now_ns };
            let air = self.air.entry((from, to)).or_insert_with(new);
            if self.bursts.is_none_or(|bursts| !air.is_silent(now_ns, bursts, chance)) {
                let passages = air.link.pass(now_ns, bytes, chance).into_iter().flatten();
                arrivals.extend(passages.map(|passage| (to, passage.at_ns)));
            }
        }
        arrivals
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERFECT: Quality =
        Quality { delay_ns: 0, jitter_ns: 0, loss_ppm: 0, copy_ppm: 0, reorder_ppm: 0, damage_ppm: 0, rate_bytes_s: 0 };

    fn row() -> Radio<u8> {
        let mut radio = Radio::new(100, PERFECT);
        (0..3).for_each(|robot| radio.put(robot, Place { x_mm: i32::from(robot) * 100, y_mm: 0 }));
        radio
    }

    fn hearers(radio: &mut Radio<u8>, from: u8) -> Vec<u8> {
        radio.send(5, from, 1, &mut Chance::new(0)).into_iter().map(|(to, _)| to).collect()
    }

    #[test]
    fn radio_reaches_as_far_as_its_range_and_not_from_each_to_each() {
        let mut radio = row();
        assert_eq!((hearers(&mut radio, 0), hearers(&mut radio, 1)), (vec![1], vec![0, 2]));
        assert_eq!(radio.sources(0), BTreeSet::from([0, 1, 2]), "by the one in the middle");
        radio.put(2, Place { x_mm: 201, y_mm: 0 });
        assert_eq!((hearers(&mut radio, 1), radio.sources(0)), (vec![0], BTreeSet::from([0, 1])));
        radio.remove(1);
        assert_eq!((hearers(&mut radio, 0), hearers(&mut radio, 1)), (vec![], vec![]), "it is not on the air");
    }

    #[test]
    fn a_shadow_goes_one_way() {
        let mut radio = row();
        radio.shade(1, 0);
        assert_eq!((hearers(&mut radio, 1), hearers(&mut radio, 0)), (vec![2], vec![1]));
        assert_eq!((radio.sources(0), radio.sources(2)), (BTreeSet::from([0]), BTreeSet::from([0, 1, 2])));
    }

    #[test]
    fn a_burst_swallows_all_for_as_long_as_it_may_and_not_longer() {
        let (mut radio, mut chance) = (row(), Chance::new(7));
        let bursts = Bursts { apart_ns: 1000, length_ns: 200 };
        radio.set_bursts(Some(bursts));
        let mut comes = |now_ns| !radio.send(now_ns, 0, 1, &mut chance).is_empty();
        let all: Vec<bool> = (0..100_000).map(&mut comes).collect();
        let lost = all.iter().filter(|comes| !**comes).count();
        assert!((14_000..19_000).contains(&lost), "{lost} of 100000, of which a sixth should be");
        let runs: Vec<&[bool]> = all.chunk_by(|a, b| a == b).collect();
        for run in &runs[1..runs.len() - 1] {
            let (length, mean) = (run.len() as u64, if run[0] { 1000 } else { 200 });
            assert!((mean / 2..=mean * 3 / 2).contains(&length), "{length} ns");
        }
        assert!(runs.len() > 100, "{} runs", runs.len());
    }
}
