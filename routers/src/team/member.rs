//! A node of another system, as it is heard: which incarnation of it lives, and which sequences of that have come.

use super::frame::{Beat, Echo, TeamHead};
use crate::frame::NodeIndex;
use crate::inbound::window::{Arrival, SequenceWindow};
use crate::security::TeamSeal;
use std::net::SocketAddr;

/// Incarnations of a member that are remembered after their end.
const ENDED: usize = 4;
/// Incarnations of a member that may prove at the same time that they live.
const CANDIDATES: usize = 2;
/// So long an incarnation that proves nothing keeps its place against others.
const CANDIDATE_NS: u64 = 1_000_000_000;
/// Where nothing is sealed: so long after its successor was heard first, an incarnation is not taken for a new one.
const ENDED_NS: u64 = 5_000_000_000;

/// A node of another system.
pub(super) struct TeamMember {
    pub(super) system: u8,
    pub(super) node: NodeIndex,
    /// Where its last datagram came from.
    pub(super) address: SocketAddr,
    /// When something came last that was believed, monotonic ns.
    pub(super) heard_ns: u64,
    /// The incarnation that is believed to live.
    pub(super) present: Option<Present>,
    /// Incarnations of which beats were opened, and that have proved nothing yet.
    candidates: [Option<Candidate>; CANDIDATES],
    /// Those that are over, the last first.
    ended: [Ended; ENDED],
    /// Incarnations so far, and how often one came back after its end.
    pub(super) incarnations: u64,
    pub(super) returns: u64,
}

/// The incarnation of a member that is believed to live.
pub(super) struct Present {
    pub(super) incarnation: u64,
    /// None: nothing is sealed.
    pub(super) seal: Option<TeamSeal>,
    window: SequenceWindow,
    /// Of its newest beat.
    pub(super) challenge: Option<u64>,
    /// Whether it repeated a challenge of ours, so hears us, in its newest beat.
    pub(super) hears_us: bool,
    pub(super) loss: Loss,
}

/// An incarnation that has proved nothing yet.
pub(super) struct Candidate {
    pub(super) incarnation: u64,
    pub(super) seal: TeamSeal,
    pub(super) challenge: u64,
    pub(super) heard_ns: u64,
    /// Beats that were heard of it.
    pub(super) beats: u32,
}

#[derive(Clone, Copy, Default)]
struct Ended {
    incarnation: u64,
    /// Sequences below this one are not taken again.
    next: u64,
    at_ns: u64,
}

/// Datagrams to all systems: how many were sent by an incarnation, and how many of these came.
#[derive(Clone, Copy, Default)]
pub(super) struct Loss {
    /// What the first beat that came said.
    first_sent: Option<u64>,
    newest_sent: u64,
    /// Came since the first beat, the first beat included.
    came: u64,
    /// Came up to the newest beat.
    came_by_newest: u64,
}

impl Loss {
    /// A datagram to all came; of a beat its count.
    fn came(&mut self, sent: Option<u64>) {
        if let Some(sent) = sent {
            let first = *self.first_sent.get_or_insert(sent);
            // A beat that comes after a later one says nothing new.
            if sent >= self.newest_sent.max(first) {
                (self.newest_sent, self.came_by_newest) = (sent, self.came);
            }
        }
        self.came += u64::from(self.first_sent.is_some());
    }

    /// Datagrams that were sent from the first beat to before the newest one.
    pub(super) fn sent(&self) -> u64 {
        self.newest_sent.saturating_sub(self.first_sent.unwrap_or(self.newest_sent))
    }

    /// Of these, those that did not come.
    pub(super) fn lost(&self) -> u64 {
        self.sent().saturating_sub(self.came_by_newest)
    }
}

impl Present {
    fn new(incarnation: u64, seal: Option<TeamSeal>, window: SequenceWindow) -> Self {
        Self { incarnation, seal, window, challenge: None, hears_us: false, loss: Loss::default() }
    }

    /// Whether a sequence came before.
    pub(super) fn has(&self, sequence: u64) -> bool {
        self.window.is_duplicate(sequence)
    }

    /// Takes a datagram that is believed; false: it came before.
    pub(super) fn arrive(&mut self, head: &TeamHead, beat: Option<&Beat<'_>>) -> bool {
        let is_new = self.window.arrive(head.sequence, &mut 0) != Arrival::Duplicate;
        if is_new && head.to == rohrpost_mailbox::ALL_SYSTEMS {
            self.loss.came(beat.map(|beat| beat.sent));
        }
        is_new
    }
}

impl TeamMember {
    pub(super) fn new(now_ns: u64, head: &TeamHead, address: SocketAddr) -> Self {
        Self {
            system: head.system,
            node: head.node,
            address,
            heard_ns: now_ns,
            present: None,
            candidates: [const { None }; CANDIDATES],
            ended: [Ended::default(); ENDED],
            incarnations: 0,
            returns: 0,
        }
    }

    /// Whether an incarnation was over so short a time ago that a datagram of it may have been delayed.
    pub(super) fn has_just_ended(&self, now_ns: u64, incarnation: u64) -> bool {
        let is_it = |ended: &&Ended| ended.incarnation == incarnation;
        self.ended.iter().find(is_it).is_some_and(|ended| now_ns.saturating_sub(ended.at_ns) < ENDED_NS)
    }

    /// Whether a datagram is from this node.
    pub(super) fn is(&self, head: &TeamHead) -> bool {
        (self.system, self.node) == (head.system, head.node)
    }

    /// What its incarnations said that were heard since then.
    pub(super) fn echoes(&self, since_ns: u64) -> impl Iterator<Item = Echo> {
        let present = self.present.as_ref().filter(move |_| self.heard_ns >= since_ns);
        let candidates = self.candidates.iter().flatten().filter(move |candidate| candidate.heard_ns >= since_ns);
        let challenges = present.and_then(|present| present.challenge).into_iter();
        let all = challenges.chain(candidates.map(|candidate| candidate.challenge));
        all.map(|challenge| Echo { system: self.system, node: self.node, challenge })
    }

    /// The candidate of an incarnation.
    pub(super) fn candidate(&self, incarnation: u64) -> Option<&Candidate> {
        self.candidates.iter().flatten().find(|candidate| candidate.incarnation == incarnation)
    }

    /// Gives an incarnation of which a beat was opened a free place, or that of one that proved nothing for long;
    /// false: there is none.
    pub(super) fn add_candidate(&mut self, now_ns: u64, incarnation: u64, seal: TeamSeal) -> bool {
        let age = |place: &Option<Candidate>| {
            place.as_ref().map_or(u64::MAX, |candidate| now_ns.saturating_sub(candidate.heard_ns))
        };
        let oldest = self.candidates.iter_mut().max_by_key(|place| age(place));
        let Some(place) = oldest.filter(|place| age(place) > CANDIDATE_NS) else { return false };
        *place = Some(Candidate { incarnation, seal, challenge: 0, heard_ns: now_ns, beats: 0 });
        true
    }

    /// A candidate said a challenge; returns how many of its beats were heard.
    pub(super) fn heard_as_candidate(&mut self, now_ns: u64, incarnation: u64, challenge: u64) -> u32 {
        if self.present.is_none() {
            self.heard_ns = now_ns;
        }
        let mut all = self.candidates.iter_mut().flatten();
        let Some(candidate) = all.find(|candidate| candidate.incarnation == incarnation) else { return u32::MAX };
        (candidate.challenge, candidate.heard_ns) = (challenge, now_ns);
        candidate.beats = candidate.beats.saturating_add(1);
        candidate.beats
    }

    /// A sealed incarnation has proved by the datagram of this sequence that it lives; false: that proof is an old one.
    pub(super) fn promote(&mut self, now_ns: u64, incarnation: u64, sequence: u64) -> bool {
        let before = self.ended.iter().find(|ended| ended.incarnation == incarnation).copied();
        let next = before.map_or(0, |ended| ended.next);
        let is_it = |place: &&mut Option<Candidate>| place.as_ref().is_some_and(|it| it.incarnation == incarnation);
        let candidate = self.candidates.iter_mut().find(is_it).filter(|_| sequence >= next).and_then(Option::take);
        let Some(Candidate { seal, challenge, .. }) = candidate else { return false };
        let window = SequenceWindow::going_on(sequence);
        self.begin(now_ns, Present { challenge: Some(challenge), ..Present::new(incarnation, Some(seal), window) });
        self.returns += u64::from(before.is_some());
        true
    }

    /// Where nothing is sealed: takes an incarnation as soon as it is heard.
    pub(super) fn believe(&mut self, now_ns: u64, incarnation: u64, sequence: u64) {
        let is_back = self.ended.iter().any(|ended| ended.incarnation == incarnation);
        self.begin(now_ns, Present::new(incarnation, None, SequenceWindow::joining(sequence)));
        self.returns += u64::from(is_back);
    }

    fn begin(&mut self, now_ns: u64, present: Present) {
        if let Some(before) = self.present.replace(present) {
            self.ended.rotate_right(1);
            let (incarnation, next) = (before.incarnation, before.window.next());
            self.ended[0] = Ended { incarnation, next, at_ns: now_ns };
        }
        self.incarnations += 1;
    }
}
