//! Nodes of another configuration, that is, with another digest. With time slots they have another slot table: two
//! times on one wire are slots that overlap.
//!
//! A node that hears the time of such nodes has a *claim*, compared in this order: whether a time of its configuration
//! is followed, then the greater digest. The lesser claim yields at once: it is silent, and listens anew when it heard
//! nothing of the others for [`YIELDS_NS`]. The greater claim continues until the others must have heard it. If they
//! continue nevertheless, they do not hear it, and it falls silent, too.

use crate::frame::NodeIndex;

/// Silence of a node that yields, after it last heard the others.
const YIELDS_NS: u64 = 1_000_000_000;
/// The same after a refusal: a node refuses only when it receives something.
const REFUSED_NS: u64 = 10_000_000_000;
/// Frames of one node with a larger gap say nothing of the time between.
const APART_NS: u64 = 1_000_000_000;

/// The greater one continues: whether its time is followed, and its digest.
pub(super) type TimelineClaim = (bool, u64);

/// A node of another configuration.
#[derive(Clone, Copy, Debug)]
struct Other {
    digest: u64,
    /// First and last frame, local ns.
    since_ns: u64,
    heard_ns: u64,
    /// This node is silent until then, local ns.
    until_ns: u64,
    /// The same because of its frames of time alone: its followers go on sending for a while, even when it stops.
    follows_until_ns: u64,
    /// When a verified frame of time last made this node yield, local ns; 0: never.
    told_ns: u64,
}

impl Other {
    /// It sent a frame of time then.
    fn follows(&mut self, local_ns: u64) {
        self.follows_until_ns = local_ns.saturating_add(YIELDS_NS);
        self.until_ns = self.until_ns.max(self.follows_until_ns);
    }
}

/// All nodes of another configuration.
#[derive(Debug)]
pub(super) struct Others {
    /// By node; the last is for all addresses that no node has.
    all: Box<[Option<Other>]>,
    /// How long a lesser claim has to yield.
    grace_ns: u64,
    /// Refusals until then are known, monotonic ns.
    refusals_ns: u64,
}

impl Others {
    pub(super) fn new(nodes: NodeIndex) -> Self {
        Self { all: vec![None; usize::from(nodes) + 1].into(), grace_ns: 0, refusals_ns: 0 }
    }

    /// Sets how long a lesser claim has to yield.
    pub(super) fn gives(&mut self, grace_ns: u64) {
        self.grace_ns = grace_ns;
    }

    /// A node, or an address that no node has, sends time of another configuration.
    pub(super) fn hears(&mut self, node: Option<NodeIndex>, local_ns: u64, theirs: TimelineClaim, own: TimelineClaim) {
        let grace_ns = self.grace_ns;
        let other = self.other(node, theirs.1, local_ns);
        if local_ns.saturating_sub(other.heard_ns) > APART_NS {
            other.since_ns = local_ns;
        }
        other.heard_ns = local_ns;
        if theirs > own || local_ns.saturating_sub(other.since_ns) > grace_ns {
            other.told_ns = local_ns;
            other.follows(local_ns);
        }
    }

    /// The same for an unverified frame. It counts only if a verified one of that node came lately and this node is
    /// silent because of it. So a replayed frame silences this node no longer than a refusal.
    pub(super) fn overhears(&mut self, node: NodeIndex, local_ns: u64, digest: u64) {
        let other = self.all.get_mut(usize::from(node)).and_then(Option::as_mut);
        let told_lately = |other: &&mut Other| local_ns.saturating_sub(other.told_ns) < REFUSED_NS - YIELDS_NS;
        if let Some(other) = other.filter(|other| other.digest == digest && other.told_ns > 0).filter(told_lately) {
            other.follows(local_ns);
        }
    }

    /// A node refuses this one's packets because of the digest.
    pub(super) fn refuses(&mut self, node: NodeIndex, local_ns: u64, digest: u64) {
        let other = self.other(Some(node), digest, local_ns);
        other.heard_ns = local_ns;
        other.until_ns = local_ns.saturating_add(REFUSED_NS);
    }

    /// A node has this configuration.
    pub(super) fn agrees(&mut self, node: NodeIndex) {
        self.is_heard(node, u64::MAX);
    }

    /// A frame of this configuration came from a node: its earlier refusals are void. Its followers may not know yet.
    pub(super) fn is_heard(&mut self, node: NodeIndex, local_ns: u64) {
        let other = self.all.get_mut(usize::from(node)).and_then(Option::as_mut);
        if let Some(other) = other.filter(|other| other.heard_ns < local_ns) {
            other.until_ns = other.follows_until_ns;
        }
    }

    /// Whether refusals of this moment are new, monotonic ns; from now on they are known.
    pub(super) fn is_news(&self, refused_ns: u64) -> bool {
        refused_ns > self.refusals_ns
    }

    pub(super) fn knows_refusals(&mut self, until_ns: u64) {
        self.refusals_ns = self.refusals_ns.max(until_ns);
    }

    /// End of this node's silence, if it is silent.
    pub(super) fn silent_until_ns(&self, local_ns: u64) -> Option<u64> {
        let until_ns = self.all.iter().flatten().map(|other| other.until_ns).max();
        until_ns.filter(|until_ns| local_ns < *until_ns)
    }

    /// The cause of the silence: the node, none if no node has the address, and its digest.
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
        assert!(silent(&refused, MS), "its followers may go on for a while");
        assert!(!silent(&refused, MS + YIELDS_NS));
        let mut refused = others();
        refused.refuses(0, MS, 9);
        refused.agrees(0);
        assert!(!silent(&refused, MS));
    }

    #[test]
    fn a_replay_of_a_verified_node_counts_no_longer_than_a_refusal() {
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
