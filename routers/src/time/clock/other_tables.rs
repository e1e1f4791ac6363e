//! A clock in time slots beside nodes of another configuration: which part continues its time, and which is silent.

use super::Clock;
use crate::frame::{FrameHead, NodeIndex};
use crate::stats::Stats;
use crate::time::election::ElectionState;
use crate::time::message::TimeMessage;
use crate::time::others::TimelineClaim;
use crate::time::{Ignored, Stamp};

impl Clock {
    /// Takes a datagram of time with another digest than this node's. `node`: the owner of its source address; none if
    /// no node has it. Its content is no time for this node, but a reason to be silent.
    ///
    /// # Errors
    /// [`Ignored`]: it changed nothing.
    pub fn handle_other(
        &mut self,
        now_ns: u64,
        received: Stamp,
        node: Option<NodeIndex>,
        head: &FrameHead,
        rest: &[u8],
    ) -> Result<(), Ignored> {
        if head.system != self.settings.system || head.digest == self.settings.digest {
            return Err(Ignored::Stranger);
        }
        let theirs = claim(head, &TimeMessage::parse(head.kind, rest)?).ok_or(Ignored::OtherTable)?;
        // Without slots two times do not disturb each other.
        if self.slots.is_none() {
            return Err(Ignored::OtherTable);
        }
        let own = self.claim(now_ns);
        self.others.hears(node, received.ns, theirs, own);
        self.part(now_ns);
        Ok(())
    }

    /// Handles refusals of this node's configuration that the counters of packages report. `now_ns`: now by the clock
    /// of these counters; `local_ns`: now by the clock of time. A master with followers lets refusers be; with the
    /// greater claim it continues its time.
    pub(super) fn refused_by(&mut self, packages: &Stats, now_ns: u64, local_ns: u64) {
        if self.slots.is_none() {
            return;
        }
        let own = self.claim(local_ns);
        let local_ns_of = |then_ns: u64| local_ns.saturating_sub(now_ns.saturating_sub(then_ns));
        for node in (0..self.settings.nodes).filter(|node| *node != self.settings.own) {
            let link = &packages.peer(node).link;
            let (refused_ns, told_ns) = (link.refuses_us_ns.get(), link.tells_other_ns.get());
            if self.others.is_news(refused_ns) && !own.0 {
                self.others.refuses(node, local_ns_of(refused_ns), link.refuses_us_digest.get());
            }
            // One forged or misdirected datagram must not silence this node for long.
            self.others.is_heard(node, local_ns_of(link.heard_ns.get()));
            if self.others.is_news(told_ns) {
                // A refusal does not say whether its time is followed.
                self.others.hears(Some(node), local_ns_of(told_ns), (true, link.tells_other_digest.get()), own);
            }
        }
        self.others.knows_refusals(now_ns);
        self.part(local_ns);
    }

    /// The nodes that keep this one from beginning or continuing a time, and their digests. The node is none if no node
    /// has the address. Empty unless that is so.
    pub fn parted_by(&self, now_ns: u64) -> impl Iterator<Item = (Option<NodeIndex>, u64)> {
        self.others.because_of(now_ns)
    }

    /// Digest of this node's configuration.
    pub fn digest(&self) -> u64 {
        self.settings.digest
    }

    pub(super) fn is_parted(&self, now_ns: u64) -> bool {
        self.parted_until_ns(now_ns).is_some()
    }

    pub(super) fn parted_until_ns(&self, now_ns: u64) -> Option<u64> {
        self.others.silent_until_ns(now_ns)
    }

    /// While it must be silent, this node follows no master and is none; then it listens anew.
    fn part(&mut self, now_ns: u64) {
        let Some(until_ns) = self.parted_until_ns(now_ns) else { return };
        self.step_back(now_ns);
        self.election.steps_back(until_ns);
        if let Some(slots) = &mut self.slots {
            slots.goes_by_nobody();
            self.election.overhears(&slots.overheard);
        }
    }

    /// A node that hears no time of its own configuration, or a master without followers, has the lesser claim.
    pub(super) fn claim(&self, now_ns: u64) -> TimelineClaim {
        let is_followed = match self.election.state() {
            ElectionState::Listening => false,
            ElectionState::Slave(_) => true,
            ElectionState::Master(_) => self.is_followed(now_ns),
        };
        // Of two configurations without time neither may begin one.
        let digest = if self.election.state() == ElectionState::Listening { 0 } else { self.settings.digest };
        (is_followed, digest)
    }
}

/// What a datagram of another configuration says of the time there; none if it says that there is none.
pub(super) fn claim(head: &FrameHead, message: &TimeMessage) -> Option<TimelineClaim> {
    let is_followed = match message {
        TimeMessage::Sync(sync) => sync.followed || sync.replacement,
        TimeMessage::Request(hello) if hello.id == 0 && !hello.timed => return None,
        // These go between a master and its follower, or say that the sender has time.
        TimeMessage::WarmUp | TimeMessage::Request(_) | TimeMessage::Reply(_) => true,
    };
    Some((is_followed, head.digest))
}
