//! Clocks of other robots, from the hellos: two-way exchange, with bounds that contain the errors.
//!
//! ```text
//!  this robot   ──●─ sends hello c ─────────────────────────────▶●─ hears it ──
//!                  ╲                                            ╱
//!  other robot  ────●─ hears c ── holds it for `age` ──────────●─ sends its hello: "c, `age` ago", its clock ──
//! ```
//!
//! The other robot's hello left between `sent(c) + age` and its arrival here: so its clock is known as well as half of
//! that span. A bound grows with time by the greatest drift, so a newer exchange takes its place sooner or later:
//! nothing freezes, nothing is a mean of no rounds. Offsets of several hops are summed, and so are their bounds.
//!
//! The clock of a robot is whatever it was at its start, perhaps years off, and monotonic from then on.

use crate::group::{Hello, Reference};
use crate::ids::{RobotId, Run, Version};
use std::collections::{BTreeMap, VecDeque};

/// Times of own hellos that are kept, for answers to them: half a minute at two a second.
const SENT_MAX: usize = 64;

/// How another clock differs from this robot's.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Offset {
    /// The other clock minus this robot's, ns.
    pub offset_ns: i64,
    /// Greatest error at the time asked for, ns.
    pub bound_ns: u64,
}

impl Offset {
    /// The other clock when this robot's shows `own_ns`.
    pub fn apply(self, own_ns: u64) -> u64 {
        own_ns.saturating_add_signed(self.offset_ns)
    }

    /// The clock that differs by `next` from this other clock.
    #[must_use]
    pub fn then(self, next: Self) -> Self {
        let offset_ns = self.offset_ns.saturating_add(next.offset_ns);
        Self { offset_ns, bound_ns: self.bound_ns.saturating_add(next.bound_ns) }
    }
}

/// An offset as it was at one time.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
struct Sample {
    incarnation: u32,
    at_ns: u64,
    offset: Offset,
}

impl Sample {
    /// The bound at a time: both clocks drift.
    fn at(&self, now_ns: u64, drift_ppb: u32) -> Offset {
        let drift_ns = drift_ns(now_ns.saturating_sub(self.at_ns), drift_ppb);
        Offset { bound_ns: self.offset.bound_ns.saturating_add(drift_ns), ..self.offset }
    }

    /// The better one of two: the new one if the clock was set, or if its bound is not larger.
    fn better(old: Option<Self>, new: Self, drift_ppb: u32) -> Self {
        let Some(old) = old else { return new };
        let before = old.at(new.at_ns, drift_ppb);
        let apart_ns = before.offset_ns.abs_diff(new.offset.offset_ns);
        let is_set = apart_ns > before.bound_ns.saturating_add(new.offset.bound_ns);
        if is_set || new.offset.bound_ns <= before.bound_ns { new } else { old }
    }
}

/// How far two clocks drift apart in a time, ns.
fn drift_ns(span_ns: u64, drift_ppb: u32) -> u64 {
    let drift_ns = u128::from(span_ns) * 2 * u128::from(drift_ppb) / 1_000_000_000;
    u64::try_from(drift_ns).unwrap_or(u64::MAX).saturating_add(1)
}

/// The clocks of the robots that this one hears, and of the leader.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct TeamTime {
    me: RobotId,
    drift_ppb: u32,
    sent: VecDeque<(Version, u64)>,
    neighbours: BTreeMap<RobotId, Sample>,
    leader: Option<(RobotId, Sample)>,
}

impl TeamTime {
    /// Of this robot. No clock of the team runs faster or slower than true time by more than `drift_ppb`, ns a second.
    pub fn new(me: RobotId, drift_ppb: u32) -> Self {
        Self { me, drift_ppb, sent: VecDeque::new(), neighbours: BTreeMap::new(), leader: None }
    }

    /// This robot sends a hello.
    pub(crate) fn sends(&mut self, now_ns: u64, version: Version) {
        if self.sent.len() == SENT_MAX {
            self.sent.pop_front();
        }
        self.sent.push_back((version, now_ns));
    }

    /// A hello came from a robot; the leader is `leader` now.
    pub(crate) fn hear(&mut self, now_ns: u64, hello: &Hello, leader: Run) {
        let Some(sample) = self.exchange(now_ns, hello) else { return };
        let is_same = |known: &Sample| known.incarnation == sample.incarnation;
        let known = self.neighbours.get(&hello.from).copied().filter(is_same);
        let best = Sample::better(known, sample, self.drift_ppb);
        self.neighbours.insert(hello.from, best);
        let is_leaders = |reference: &Reference| reference.robot == leader.robot;
        let Some(reference) = hello.reference.filter(is_leaders) else { return };
        let Reference { incarnation, offset_ns, bound_ns, .. } = reference;
        if leader.robot == self.me || incarnation != leader.incarnation {
            return;
        }
        let offset = best.at(now_ns, self.drift_ppb).then(Offset { offset_ns, bound_ns });
        // What the sender says was so when it sent: since then the leader's clock may have drifted from its own.
        let way_ns = drift_ns(sample.offset.bound_ns.saturating_mul(2), self.drift_ppb);
        let offset = Offset { bound_ns: offset.bound_ns.saturating_add(way_ns), ..offset };
        let sample = Sample { incarnation, at_ns: now_ns, offset };
        let best = Sample::better(self.leader_sample(leader), sample, self.drift_ppb);
        self.leader = Some((leader.robot, best));
    }

    fn leader_sample(&self, leader: Run) -> Option<Sample> {
        let (robot, sample) = self.leader?;
        (robot == leader.robot && sample.incarnation == leader.incarnation).then_some(sample)
    }

    /// The offset that a hello tells: `None` if its sender knows none of this robot's last hellos.
    ///
    /// Ages leave out the time on the air, so also an age that was summed over several robots is never too great.
    fn exchange(&self, now_ns: u64, hello: &Hello) -> Option<Sample> {
        let heard = hello.entry(self.me)?;
        let (_, sent_ns) = self.sent.iter().find(|(version, _)| *version == heard.version)?;
        let held_ns = heard.age_ns.saturating_sub(drift_ns(heard.age_ns, self.drift_ppb));
        let earliest_ns = sent_ns.checked_add(held_ns).filter(|earliest_ns| *earliest_ns <= now_ns)?;
        let bound_ns = (now_ns - earliest_ns) / 2 + 1;
        let offset_ns = i128::from(hello.sent_ns) - i128::from(earliest_ns + (now_ns - earliest_ns) / 2);
        let offset_ns = i64::try_from(offset_ns).ok()?;
        let bound_ns = bound_ns.saturating_add(drift_ns(now_ns - earliest_ns, self.drift_ppb));
        let offset = Offset { offset_ns, bound_ns };
        Some(Sample { incarnation: hello.version.incarnation, at_ns: now_ns, offset })
    }

    /// The clock of a robot, if its hellos come here and it knows this robot's.
    pub fn neighbour(&self, now_ns: u64, robot: Run) -> Option<Offset> {
        let sample = self.neighbours.get(&robot.robot)?;
        (sample.incarnation == robot.incarnation).then(|| sample.at(now_ns, self.drift_ppb))
    }

    /// The leader's clock, over any number of hops: the team's time, for people. The leader's own offset is 0.
    pub fn team(&self, now_ns: u64, leader: Run) -> Option<Offset> {
        if leader.robot == self.me {
            return Some(Offset { offset_ns: 0, bound_ns: 0 });
        }
        self.leader_sample(leader).map(|sample| sample.at(now_ns, self.drift_ppb))
    }
}
