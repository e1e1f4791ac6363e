//! Takes packages of this node: each leaves at once, waits in the queue, or is lost with a cause.

use super::{Accepted, DIRECT_HEAD_BYTES, Outbound, Package, lose};
use crate::admission::capped;
use crate::counts::Cause;
use crate::frame::{self, NodeIndex};
use crate::queue::QueuedPackage;
use crate::report::Report;
use rohrpost_mailbox::{HEAD_BYTES as PACKAGE_HEAD_BYTES, Head};

impl Outbound {
    /// Takes a package of this node. `alone`: no other waits behind it, so it need not be combined; nor must one that
    /// is so large that no second of its size would fit. With time slots each package waits for a slot. A package to a
    /// peer without a keep-alive so far waits, too: the peer doubts the first datagram of an incarnation.
    pub fn accept(&mut self, now_ns: u64, package: &Package<'_>, alone: bool, report: &mut impl Report) -> Accepted {
        let head = capped(&package.head);
        self.accept_capped(now_ns, &Package { head, ..*package }, alone, report)
    }

    /// The same for a head that [`capped`] has been applied to.
    pub fn accept_capped(
        &mut self,
        now_ns: u64,
        package: &Package<'_>,
        alone: bool,
        report: &mut impl Report,
    ) -> Accepted {
        let head = package.head;
        self.stats.out.came(head.priority);
        let peer = match self.admit(now_ns, &head, package.published_ns) {
            Ok(peer) => peer,
            Err((peer, cause)) => {
                lose(&self.stats, peer, &head, package.body, cause, report);
                return Accepted::Lost;
            }
        };
        let needs_no_company = alone || self.fills_a_datagram(package.body.len());
        let (level, sender) = (self.levels[usize::from(head.priority.0)], self.sender_of(head.from));
        let is_told = self.stats.peer(peer).sent.datagrams.get() > 0;
        if needs_no_company
            && is_told
            && self.reaches(peer)
            && self.may_leave_at_once(now_ns, level, package.body.len())
        {
            return Accepted::Send { to: peer, head: self.direct(now_ns, peer, &head, package) };
        }
        let waiting =
            QueuedPackage { head, published_ns: package.published_ns, peer, sender, level, ..QueuedPackage::default() };
        let stats = &self.stats;
        let taken = self.queue.push(waiting, package.body, |gone, body| {
            stats.waiting[usize::from(gone.level)].take_back(1);
            lose(stats, Some(gone.peer), &gone.head, body, Cause::Quota, report);
        });
        if taken {
            self.stats.waiting[usize::from(level)].add(1);
        } else {
            lose(&self.stats, Some(peer), &head, package.body, Cause::Quota, report);
        }
        self.stats.waiting_bytes.set(self.queue.used_bytes());
        if taken { Accepted::Waits } else { Accepted::Lost }
    }

    /// Loses a package instead of taking it: its sender has too many.
    pub fn displace(&self, package: &Package<'_>, report: &mut impl Report) {
        let head = capped(&package.head);
        self.stats.out.came(head.priority);
        lose(&self.stats, self.settings.node_of(head.to), &head, package.body, Cause::Quota, report);
    }

    fn admit(&self, now_ns: u64, head: &Head, published_ns: u64) -> Result<NodeIndex, (Option<NodeIndex>, Cause)> {
        let peer = self.settings.node_of(head.to).filter(|node| *node != self.settings.own);
        let peer = peer.ok_or((None, Cause::NoRoute))?;
        match self.why_not(now_ns, peer, published_ns) {
            Some(cause) => Err((Some(peer), cause)),
            None => Ok(peer),
        }
    }

    fn may_leave_at_once(&self, now_ns: u64, level: u8, body_bytes: usize) -> bool {
        let bytes = DIRECT_HEAD_BYTES + body_bytes;
        self.queue.is_empty()
            && bytes <= self.datagram_bytes
            && !self.in_slots
            && self.pace.may_leave(now_ns, level).is_ok()
    }

    /// Two of this size do not fit in a datagram: the queue has no gain.
    fn fills_a_datagram(&self, body_bytes: usize) -> bool {
        frame::HEAD_BYTES + 2 * (PACKAGE_HEAD_BYTES + body_bytes) > self.datagram_bytes
    }
}
