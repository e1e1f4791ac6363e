//! Frames of time from peers that are not verified: some incarnation sent them at some time, perhaps not now. Where
//! datagrams are sealed, a node that joins a network with time slots hears only these.

use super::TimeEstimate;
use super::coarse::{Coarse, JOINING_SYNCS};
use crate::frame::NodeIndex;

/// Incarnations of one node that are kept apart; of more, the one that was silent for longest is forgotten.
const INCARNATIONS: usize = 2;
/// How long, and for how many cycles, unverified frames may keep a node from beginning a time: a live peer has answered
/// by then. Longer if the handshake takes longer.
const PATIENCE_NS: u64 = 2_000_000_000;
const PATIENCE_CYCLES: u64 = 64;
/// Hellos to and from each other node until the two know each other.
const HELLOS: u64 = 4;

/// Samples of one incarnation.
#[derive(Clone, Debug, Default)]
struct SyncSample {
    /// 0: none.
    incarnation: u64,
    /// The latest frame of it: repeated ones say nothing.
    sequence: u64,
    heard_ns: u64,
    coarse: Coarse,
}

/// What a frame says of the time.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimeReport {
    pub(super) epoch: u64,
    pub(super) system_ns: u64,
    /// The sender's largest distance from the time of the others.
    pub(super) error_ns: u64,
}

/// Unverified samples since the time was last known.
#[derive(Clone, Debug)]
pub(super) struct UnverifiedPeers {
    /// By node, [`INCARNATIONS`] of each: a busy sender takes no other node's place.
    voices: Box<[SyncSample]>,
    /// The next one to ask.
    turn: usize,
    /// A live peer has answered after this long.
    joins_ns: u64,
    patience_ns: u64,
    /// When the first and the last frame came, ns.
    span_ns: Option<(u64, u64)>,
}

impl UnverifiedPeers {
    /// State for this many nodes, each of which may send a hello at least once in `hello_every_ns`.
    pub(super) fn new(nodes: NodeIndex, cycle_ns: u64, hello_every_ns: u64) -> Self {
        let others = u64::from(nodes.saturating_sub(1));
        let joins_ns = hello_every_ns.saturating_mul(u64::from(JOINING_SYNCS) + HELLOS * others);
        let waits_ns = joins_ns.max(cycle_ns.saturating_mul(PATIENCE_CYCLES));
        Self {
            voices: vec![SyncSample::default(); INCARNATIONS * usize::from(nodes)].into(),
            turn: 0,
            joins_ns,
            patience_ns: PATIENCE_NS.saturating_add(waits_ns),
            span_ns: None,
        }
    }

    /// The time is known: unverified frames count anew from now on.
    pub(super) fn forget(&mut self) {
        if self.span_ns.take().is_some() {
            self.voices.fill(SyncSample::default());
        }
    }

    /// Takes the frame with this `sequence` of an incarnation of a node. A frame without time takes no place. Returns
    /// whether it is later than all known frames of that incarnation.
    pub(super) fn hears(
        &mut self,
        (from, incarnation, sequence): (NodeIndex, u64, u64),
        local_ns: u64,
        told: Option<TimeReport>,
    ) -> bool {
        let first = INCARNATIONS * usize::from(from);
        let lives = self.voices[first..first + INCARNATIONS].iter_mut();
        let life = lives.min_by_key(|voice| (voice.incarnation != incarnation, voice.heard_ns));
        if let Some(voice) = life.filter(|voice| voice.incarnation == incarnation || told.is_some()) {
            if voice.incarnation != incarnation {
                *voice = SyncSample { incarnation, ..SyncSample::default() };
            } else if sequence <= voice.sequence {
                return false;
            }
            (voice.sequence, voice.heard_ns) = (sequence, local_ns);
            if let Some(TimeReport { epoch, system_ns, error_ns }) = told {
                voice.coarse.add(epoch, system_ns, local_ns, error_ns);
            }
        }
        let (first_ns, last_ns) = self.span_ns.unwrap_or((local_ns, local_ns));
        self.span_ns = Some((first_ns, last_ns.max(local_ns)));
        true
    }

    /// This node was stalled for this long: silence during the stall says nothing.
    pub(super) fn awakes(&mut self, stood_ns: u64) {
        self.span_ns = self.span_ns.map(|(first_ns, last_ns)| (first_ns + stood_ns, last_ns + stood_ns));
    }

    /// End of the time in which a frame of a peer that may be alive counts; 0: there was none.
    pub(super) fn until_ns(&self) -> u64 {
        self.span_ns.map_or(0, |(first_ns, last_ns)| last_ns.min(self.ends_ns(first_ns)))
    }

    /// Whether unverified frames still count.
    pub(super) fn is_patient(&self, now_ns: u64) -> bool {
        self.span_ns.is_none_or(|(first_ns, _)| now_ns < self.ends_ns(first_ns))
    }

    fn ends_ns(&self, first_ns: u64) -> u64 {
        first_ns.saturating_add(self.patience_ns)
    }

    /// If frames came after patience was over: the distance between two nodes that begin a time, so that the second
    /// hears the first.
    pub(super) fn apart_ns(&self) -> u64 {
        let is_over = |(first_ns, last_ns): (u64, u64)| last_ns >= self.ends_ns(first_ns);
        if self.span_ns.is_some_and(is_over) { self.joins_ns } else { 0 }
    }

    /// The next node to ask, and its time, among those with enough samples for this bound.
    pub(super) fn estimate(
        &self,
        now_ns: u64,
        delay_max_ns: u64,
        allowance_ns: u64,
    ) -> Option<(NodeIndex, TimeEstimate)> {
        let (place, estimate) = self.turn(now_ns, delay_max_ns, allowance_ns)?;
        Some(((place / INCARNATIONS) as NodeIndex, estimate))
    }

    /// [`Self::estimate`] was used to ask: the next call is about another node.
    pub(super) fn next_turn(&mut self, now_ns: u64, delay_max_ns: u64, allowance_ns: u64) {
        if let Some((place, _)) = self.turn(now_ns, delay_max_ns, allowance_ns) {
            self.turn = (place + 1) % self.voices.len();
        }
    }

    fn turn(&self, now_ns: u64, delay_max_ns: u64, allowance_ns: u64) -> Option<(usize, TimeEstimate)> {
        let places = (0..self.voices.len()).map(|turn| (self.turn + turn) % self.voices.len());
        let estimate = |place: usize| self.voices[place].coarse.estimate(now_ns, delay_max_ns);
        let mut heard = places.filter_map(|place| Some((place, estimate(place)?)));
        heard.find(|(_, estimate)| estimate.bound_ns(now_ns) <= allowance_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CYCLE_NS: u64 = 5_000_000;
    const DELAY_NS: u64 = 50_000;
    const ALLOWED_NS: u64 = 75_000;

    /// Of seven nodes, each of which has a slot in each cycle.
    fn new() -> UnverifiedPeers {
        UnverifiedPeers::new(7, CYCLE_NS, 4 * CYCLE_NS)
    }

    /// A frame of an incarnation with a clock `ahead_ns` later than here.
    fn tell(overheard: &mut UnverifiedPeers, from: NodeIndex, incarnation: u64, sequence: u64, ahead_ns: u64) -> bool {
        let local_ns = (sequence + 1) * CYCLE_NS;
        let told = TimeReport { epoch: 1, system_ns: local_ns + ahead_ns, error_ns: 0 };
        overheard.hears((from, incarnation, sequence), local_ns, Some(told))
    }

    fn next_peer(overheard: &UnverifiedPeers, now_ns: u64) -> Option<NodeIndex> {
        overheard.estimate(now_ns, DELAY_NS, ALLOWED_NS).map(|(from, _)| from)
    }

    #[test]
    fn eight_frames_of_one_life_tell_a_time_and_repeated_ones_do_not() {
        let mut overheard = new();
        assert!((0..7).all(|sequence| tell(&mut overheard, 2, 9, sequence, 1000)));
        assert!((0..7).all(|sequence| !tell(&mut overheard, 2, 9, sequence, 99_000_000)), "each once");
        assert_eq!(next_peer(&overheard, 8 * CYCLE_NS), None);
        assert!(tell(&mut overheard, 2, 9, 7, 1000));
        let (from, estimate) = overheard.estimate(8 * CYCLE_NS, DELAY_NS, ALLOWED_NS).unwrap();
        assert_eq!(from, 2);
        assert!(estimate.system_ns(8 * CYCLE_NS).abs_diff(8 * CYCLE_NS + 1000) <= DELAY_NS);
        assert_eq!(next_peer(&overheard, 200 * CYCLE_NS), None, "what is old may have drifted");
    }

    #[test]
    fn all_nodes_take_turns_and_of_one_the_most_silent_life_gives_way() {
        let mut overheard = new();
        for sequence in 0..8 {
            (0..=6).for_each(|node| assert!(tell(&mut overheard, node, 9, sequence, 0)));
        }
        let turns = [(); 8].map(|()| {
            let peer = next_peer(&overheard, 8 * CYCLE_NS);
            overheard.next_turn(8 * CYCLE_NS, DELAY_NS, ALLOWED_NS);
            peer
        });
        assert_eq!(turns, [0, 1, 2, 3, 4, 5, 6, 0].map(Some));
        assert!(
            tell(&mut overheard, 1, 10, 8, 0) && tell(&mut overheard, 1, 11, 9, 0),
            "two incarnations of one are told apart"
        );
        assert!(tell(&mut overheard, 1, 9, 7, 0), "its first was heard least of late, and is forgotten");
        assert!(
            !tell(&mut overheard, 1, 11, 9, 0) && !tell(&mut overheard, 2, 9, 7, 0),
            "the others are known as before"
        );
    }

    #[test]
    fn what_tells_no_time_takes_nobodys_place_and_says_that_somebody_is_there() {
        let mut overheard = new();
        (0..8).for_each(|sequence| assert!(tell(&mut overheard, 2, 9, sequence, 0)));
        for sequence in 0..8 {
            (10..13).for_each(|life| assert!(overheard.hears((2, life, sequence), 9 * CYCLE_NS, None)));
        }
        assert_eq!((next_peer(&overheard, 8 * CYCLE_NS), overheard.until_ns()), (Some(2), 9 * CYCLE_NS));
        assert!(
            overheard.hears((2, 9, 8), 9 * CYCLE_NS, None) && !tell(&mut overheard, 2, 9, 8, 0),
            "of a known incarnation each counts once"
        );
    }

    #[test]
    fn the_rarer_the_slots_and_the_more_the_nodes_the_longer_patience_lasts() {
        let patience_ns = |nodes, hello_every_ns| UnverifiedPeers::new(nodes, CYCLE_NS, hello_every_ns).patience_ns;
        assert_eq!(patience_ns(2, 4 * CYCLE_NS), PATIENCE_NS + PATIENCE_CYCLES * CYCLE_NS);
        assert_eq!(patience_ns(2, 100 * CYCLE_NS), PATIENCE_NS + 12 * 100 * CYCLE_NS);
        assert_eq!(patience_ns(6, 100 * CYCLE_NS), PATIENCE_NS + 28 * 100 * CYCLE_NS);
    }

    #[test]
    fn patience_ends_however_much_is_heard_and_begins_anew_when_the_time_was_known() {
        let mut overheard = new();
        let patience_ns = overheard.patience_ns;
        assert_eq!(overheard.until_ns(), 0);
        (0..1000).for_each(|sequence| assert!(tell(&mut overheard, 2, 9, sequence, 0)));
        assert_eq!(overheard.until_ns(), CYCLE_NS + patience_ns);
        assert!(overheard.is_patient(patience_ns) && !overheard.is_patient(CYCLE_NS + patience_ns));
        overheard.awakes(CYCLE_NS);
        assert!(overheard.is_patient(CYCLE_NS + patience_ns), "not by what it slept through");
        overheard.forget();
        assert!(overheard.until_ns() == 0 && overheard.is_patient(u64::MAX));
    }
}
