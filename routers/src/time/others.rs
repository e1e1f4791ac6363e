//! Nodes that go by another configuration: of another digest. Where there are time slots, their table is another, and so two times on one wire
//! are slots that overlap.
//!
//! Whoever hears the time of such nodes has a *claim* of its own: whether a time of its configuration is followed, then the greater digest. The
//! lesser claim yields at once: it says nothing, and listens anew when nothing of the others was heard for [`YIELDS_NS`]. The greater one goes
//! on for as long as the others need to hear it; if they go on nevertheless, they do not hear it, and it says nothing either.

use crate::broken::broken;
use crate::frame::NodeIndex;

/// Who yields says nothing for so long after it heard the others last.
const YIELDS_NS: u64 = 1_000_000_000;
/// The same after a refusal: whoever refuses says so only when it hears something.
const REFUSED_NS: u64 = 10_000_000_000;
/// Frames of one node that come so far apart say nothing of the time between.
const APART_NS: u64 = 1_000_000_000;

/// Who has the greater one goes on: whether its time is followed, and its digest.
pub(super) type Claim = (bool, u64);

/// A node that goes by another configuration.
#[derive(Clone, Copy, Debug)]
struct Other {
    digest: u64,
    /// Frames came of it from then to then, local ns.
    since_ns: u64,
    heard_ns: u64,
    /// This node says nothing before that, local ns.
    until_ns: u64,
    /// The same because of what it said of time alone: who follows it goes on sending for a while, also if it stops.
    follows_until_ns: u64,
    /// When it has shown last that it lives and says what time it is, and this node yielded, local ns; 0: never.
    told_ns: u64,
}

impl Other {
    /// It said at that time what time it is.
    fn follows(&mut self, local_ns: u64) {
        self.follows_until_ns = local_ns.saturating_add(YIELDS_NS);
        self.until_ns = self.until_ns.max(self.follows_until_ns);
    }
}

/// Those that were heard.
#[derive(Debug)]
pub(super) struct Others {
    /// By node; the last is for all addresses that no node has.
    all: Box<[Option<Other>]>,
    /// A lesser claim is given so long to yield.
    grace_ns: u64,
    /// Refusals up to then are known, monotonic ns.
    refusals_ns: u64,
}

impl Others {
    pub(super) fn new(nodes: NodeIndex) -> Self {
        Self { all: vec![None; usize::from(nodes) + 1].into(), grace_ns: 0, refusals_ns: 0 }
    }

    /// From now on a lesser claim is given so long.
    pub(super) fn gives(&mut self, grace_ns: u64) {
        self.grace_ns = grace_ns;
    }

    /// A node, or one whose address no node has, says what time it is by another configuration.
    pub(super) fn hears(&mut self, node: Option<NodeIndex>, local_ns: u64, theirs: Claim, own: Claim) {
        let grace_ns = self.grace_ns;
        let other = self.other(node, theirs.1, local_ns);
        if local_ns.saturating_sub(other.heard_ns) > APART_NS {
            other.since_ns = local_ns;
        }
        other.heard_ns = local_ns;
        if (theirs > own && !broken!(NeverYieldsToOthers)) || local_ns.saturating_sub(other.since_ns) > grace_ns {
            other.told_ns = local_ns;
            other.follows(local_ns);
        }
    }

    /// The same, of a node that has not shown now that it lives. It counts if the node has shown that lately, and this one says nothing because of it:
    /// so what somebody has kept of it silences this node no longer than a refusal.
    pub(super) fn overhears(&mut self, node: NodeIndex, local_ns: u64, digest: u64) {
        let other = self.all.get_mut(usize::from(node)).and_then(Option::as_mut);
        let told_lately = |other: &&mut Other| local_ns.saturating_sub(other.told_ns) < REFUSED_NS - YIELDS_NS;
        if let Some(other) = other.filter(|other| other.digest == digest && other.told_ns > 0).filter(told_lately) {
            other.follows(local_ns);
        }
    }

    /// A node takes nothing from this one, since it goes by another configuration.
    pub(super) fn refuses(&mut self, node: NodeIndex, local_ns: u64, digest: u64) {
        let other = self.other(Some(node), digest, local_ns);
        other.heard_ns = local_ns;
        other.until_ns = local_ns.saturating_add(REFUSED_NS);
    }

    /// A node goes by this configuration.
    pub(super) fn agrees(&mut self, node: NodeIndex) {
        self.is_heard(node, u64::MAX);
    }

    /// A node was heard, by this configuration, at that time: what it refused before is over. Who followed it before may not know yet.
    pub(super) fn is_heard(&mut self, node: NodeIndex, local_ns: u64) {
        let other = self.all.get_mut(usize::from(node)).and_then(Option::as_mut);
        if let Some(other) = other.filter(|other| other.heard_ns < local_ns) {
            other.until_ns = other.follows_until_ns;
        }
    }

    /// Whether refusals of this moment are news, monotonic ns; from now on they are none.
    pub(super) fn is_news(&self, refused_ns: u64) -> bool {
        refused_ns > self.refusals_ns
    }

    pub(super) fn knows_refusals(&mut self, until_ns: u64) {
        self.refusals_ns = self.refusals_ns.max(until_ns);
    }

    /// Until when this node says nothing, if it does not.
    pub(super) fn silent_until_ns(&self, local_ns: u64) -> Option<u64> {
        let until_ns = self.all.iter().flatten().map(|other| other.until_ns).max();
        until_ns.filter(|until_ns| local_ns < *until_ns)
    }

    /// Because of whom: which node, none if its address is no node's; and its digest.
    pub(super) fn because_of(&self, local_ns: u64) -> impl Iterator<Item = (Option<NodeIndex>, u64)> {
        let last = self.all.len() - 1;
        let all = self.all.iter().enumerate().filter_map(move |(at, other)| Some((at, (*other)?)));
        let all = all.filter(move |(_, other)| local_ns < other.until_ns);
        all.map(move |(at, other)| ((at < last).then_some(at as NodeIndex), other.digest))
    }

    fn other(&mut self, node: Option<NodeIndex>, digest: u64, local_ns: u64) -> &mut Other {
        let last = self.all.len() - 1;
        let at = node.map_or(last, |node| usize::from(node).min(last));
        let new =
            Other { digest, since_ns: local_ns, heard_ns: local_ns, until_ns: 0, follows_until_ns: 0, told_ns: 0 };
        let other = self.all[at].get_or_insert(new);
        if other.digest != digest {
            *other = Other { until_ns: other.until_ns, follows_until_ns: other.follows_until_ns, ..new };
        }
        other
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const GRACE_NS: u64 = 100 * MS;

    fn others() -> Others {
        let mut others = Others::new(3);
        others.gives(GRACE_NS);
        others
    }

    fn silent(others: &Others, local_ns: u64) -> bool {
        others.silent_until_ns(local_ns).is_some()
    }

    #[test]
    fn the_lesser_claim_yields_at_once_and_the_greater_one_if_the_other_goes_on() {
        let mut lesser = others();
        lesser.hears(Some(1), MS, (true, 7), (true, 6));
        assert!(silent(&lesser, MS) && !silent(&lesser, MS + YIELDS_NS));
        assert_eq!(lesser.because_of(MS).collect::<Vec<_>>(), [(Some(1), 7)]);
        let mut greater = others();
        for ms in (1..=101).step_by(5) {
            greater.hears(None, ms * MS, (false, 9), (true, 6));
            assert!(!silent(&greater, ms * MS), "followed, and the other is given some time");
        }
        greater.hears(None, 102 * MS, (false, 9), (true, 6));
        assert_eq!(greater.because_of(102 * MS).collect::<Vec<_>>(), [(None, 9)]);
    }

    #[test]
    fn frames_that_are_far_apart_are_no_time_that_goes_on() {
        let mut greater = others();
        for n in 1..10 {
            greater.hears(Some(2), n * 2 * APART_NS, (true, 5), (true, 6));
            assert!(!silent(&greater, n * 2 * APART_NS));
        }
    }

    #[test]
    fn a_refusal_holds_until_its_node_agrees() {
        let mut refused = others();
        refused.refuses(0, MS, 9);
        refused.hears(Some(2), MS, (true, 9), (false, 6));
        refused.is_heard(0, MS);
        assert_eq!(refused.because_of(MS).count(), 2, "what it said before was heard before");
        refused.is_heard(0, MS + 1);
        assert!(silent(&refused, MS), "another goes by it still");
        refused.agrees(2);
        assert!(silent(&refused, MS), "who followed it may go on for a while");
        assert!(!silent(&refused, MS + YIELDS_NS));
        let mut refused = others();
        refused.refuses(0, MS, 9);
        refused.agrees(0);
        assert!(!silent(&refused, MS));
    }

    #[test]
    fn who_has_shown_that_it_lives_is_overheard_for_no_longer_than_a_refusal() {
        let mut lesser = others();
        lesser.overhears(1, MS, 9);
        assert!(!silent(&lesser, MS), "it has shown nothing");
        lesser.hears(Some(1), MS, (true, 9), (false, 6));
        lesser.overhears(1, 900 * MS, 8);
        assert!(!silent(&lesser, MS + YIELDS_NS), "that was of another file");
        for ms in (100..100_000).step_by(100) {
            lesser.overhears(1, ms * MS, 9);
            assert_eq!(silent(&lesser, ms * MS), ms * MS < REFUSED_NS, "{ms} ms");
        }
    }
}
