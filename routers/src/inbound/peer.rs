//! Receiving side of one peer: its incarnation, its datagrams, and the results for their packages.

use super::confirmation::Confirmation;
use super::order::{Order, sequence_of};
use super::window::{Arrival, SequenceWindow, WINDOW};
use crate::counts::Cause;
use crate::fragment::{Change, Reassembly};
use crate::frame::{Alive, FrameHead, NodeIndex, RefusalReason};
use crate::link::{PeerLinkState, REFUSED_FOR_NS, SILENT_AFTER_NS};
use crate::report::{Deliver, Mismatch, NotDelivered, RouterEvent};
use crate::stats::{PeerStats, Stats};
use rohrpost_mailbox::{Head, Throttle};
use std::net::IpAddr;

/// Incarnations of a peer that are known to be over.
const OLD_KEPT: usize = 8;
/// Further incarnations within this time are counted, not reported.
const RESTARTS_TOLD_NS: u64 = 5_000_000_000;
/// Datagrams of an old incarnation are in flight for this long at most; after that, its router still runs.
const OLD_GONE_NS: u64 = 2_000_000_000;
/// A leap after which nothing goes on from before for so long was none of a forger: a peer that is there says so twice
/// a second.
pub(super) const LEAP_KEPT_NS: u64 = 10_000_000_000;

/// State of a peer.
#[derive(Debug, Default)]
pub(super) struct PeerReceiver {
    /// The incarnation that is heard; 0: none yet.
    incarnation: u64,
    began_ns: u64,
    /// More than one of its datagrams came.
    is_sure: bool,
    /// The last time that its sequences went on far ahead.
    leap: Option<Leap>,
    doubt: Confirmation,
    /// Bounds the reports that an incarnation began.
    restarts_told: Throttle,
    old: [PastIncarnation; OLD_KEPT],
    old_next: usize,
    pub(super) window: SequenceWindow,
    pub(super) order: Order,
    pub(super) reassembly: Reassembly,
    pub(super) refusing: Refusing,
    told: PeerNotices,
}

/// Sequences that were passed over, since two datagrams were far ahead. They may have been forged.
#[derive(Clone, Copy, Debug)]
struct Leap {
    /// The sequence that was expected before.
    from: u64,
    at_ns: u64,
    /// When something came last of what was passed over; at first when it leapt.
    before_ns: u64,
}

/// Refusals to one address.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Refusing {
    /// Receiver and reason of a refusal that is due.
    pub(super) due: Option<(IpAddr, RefusalReason)>,
    /// No refusal before this time, ns.
    pub(super) not_before_ns: u64,
    pub(super) told: Option<(IpAddr, Mismatch)>,
    pub(super) throttle: Throttle,
    pub(super) last_ns: u64,
}

/// An incarnation that is over.
#[derive(Clone, Copy, Debug, Default)]
struct PastIncarnation {
    /// 0: none.
    incarnation: u64,
    /// Its next expected sequence: earlier ones may have been delivered.
    next: u64,
}

/// Reported conditions of a peer that are not over.
#[derive(Clone, Copy, Debug, Default)]
struct PeerNotices {
    heard: bool,
    silent: bool,
    unheard: bool,
    twice: bool,
    /// It refuses us; and until when that holds.
    refuses: Option<(Mismatch, u64)>,
}

impl PeerReceiver {
    /// Whether a datagram is of the present incarnation. An unknown incarnation begins. An incarnation that is over is
    /// ignored, unless it sends more while its supposed successor is silent: then the order was the other way round.
    /// What it sent before it was over says nothing: that may be a duplicate from the wire or a replay. Unauthenticated
    /// claims need a second datagram: see [`Doubt`]. `first`: where datagrams are sealed, the handshake has shown that
    /// this incarnation is the present one, and that it counts from this sequence on.
    pub(super) fn is_present(
        &mut self,
        now_ns: u64,
        head: &FrameHead,
        first: Option<u64>,
        way: &PeerContext<'_>,
        deliver: &mut impl Deliver,
    ) -> bool {
        let is_silent = way.peer.link.heard_ns.get() + SILENT_AFTER_NS <= now_ns;
        if head.incarnation == self.incarnation {
            return first.is_some() || self.is_plausible(now_ns, head, is_silent);
        }
        let was = self.old.iter().position(|old| old.incarnation == head.incarnation);
        let goes_on = was.is_some_and(|place| head.sequence >= self.old[place].next);
        let may_go_on = first.is_some() || (is_silent && goes_on);
        if was.is_some() && !may_go_on {
            if goes_on && now_ns.saturating_sub(self.began_ns) > OLD_GONE_NS && !self.told.twice {
                self.told.twice = true;
                deliver.event(RouterEvent::Twice { peer: way.from });
            }
            return false;
        }
        let is_first = self.incarnation == 0;
        let is_vouched_for = first.is_some() || way.stats.is_known_incarnation(way.from, head.incarnation);
        let is_doubted = !is_vouched_for && was.is_none() && !is_first;
        if is_doubted && !self.doubt.is_confirmed(now_ns, head) {
            return false;
        }
        if !is_first {
            let next = self.window.next();
            self.end_incarnation(way, deliver);
            let place = was.unwrap_or(self.old_next % OLD_KEPT);
            self.old_next += usize::from(was.is_none());
            self.old[place] = PastIncarnation { incarnation: self.incarnation, next };
            self.told = PeerNotices { heard: true, twice: self.told.twice, ..PeerNotices::default() };
            if self.restarts_told.note(now_ns, RESTARTS_TOLD_NS).is_some() {
                deliver.event(RouterEvent::Restarted { peer: way.from });
            }
        }
        self.window = match (first, was) {
            // What is missing from there on was sent to this incarnation of ours, and is lost.
            (Some(first), _) => SequenceWindow::going_on(first),
            // Earlier ones may have been delivered.
            (None, Some(_)) => SequenceWindow::going_on(head.sequence),
            (None, None) if is_first => SequenceWindow::joining(head.sequence),
            (None, None) => SequenceWindow::default(),
        };
        (self.incarnation, self.began_ns, self.is_sure) = (head.incarnation, now_ns, !is_first);
        self.leap = None;
        way.peer.link.incarnation.set(head.incarnation);
        way.peer.link.begin();
        way.peer.link.accept();
        true
    }

    /// Whether the sequence of a datagram is plausible. A peer that did not reach us for long is far ahead, too. One is
    /// far behind if the only datagram of it so far was forged; or if those were that were far ahead: then nothing
    /// follows them for a second, and the peer goes on from before. Once it has not for [`LEAP_KEPT_NS`], they are true
    /// for good: what comes from before then is a duplicate.
    fn is_plausible(&mut self, now_ns: u64, head: &FrameHead, is_silent: bool) -> bool {
        let next = self.window.next();
        let is_ahead = head.sequence >= next + WINDOW;
        self.leap = self.leap.filter(|leap| now_ns.saturating_sub(leap.before_ns) < LEAP_KEPT_NS);
        let passed_over = |leap: &Leap| (leap.from..next.saturating_sub(WINDOW)).contains(&head.sequence);
        if let Some(leap) = self.leap.as_mut().filter(|leap| passed_over(leap)) {
            leap.before_ns = now_ns;
        }
        let goes_on = is_silent && self.leap.is_some_and(|leap| head.sequence >= leap.from);
        let is_behind = head.sequence + WINDOW < next && (!self.is_sure || goes_on);
        if !is_ahead && !is_behind {
            self.is_sure |= head.sequence + 1 != next;
            return true;
        }
        if !self.doubt.is_confirmed(now_ns, head) {
            return false;
        }
        if is_behind {
            let restart = if goes_on { SequenceWindow::going_on } else { SequenceWindow::joining };
            self.window = restart(head.sequence);
            self.order.clear();
        }
        self.leap = is_ahead.then(|| self.leap_from(now_ns, next));
        self.is_sure = true;
        true
    }

    /// A leap from this sequence on. One shortly after another is a part of it.
    fn leap_from(&self, now_ns: u64, next: u64) -> Leap {
        let before = self.leap.filter(|leap| now_ns.saturating_sub(leap.at_ns) < OLD_GONE_NS);
        Leap { from: before.map_or(next, |leap| leap.from), at_ns: now_ns, before_ns: now_ns }
    }

    fn end_incarnation(&mut self, way: &PeerContext<'_>, deliver: &mut impl Deliver) {
        way.peer.received.lost.add(self.window.close());
        way.peer.received.restarts.add(1);
        self.reassembly.clear(|head, body, change| way.partial(head, body, change, deliver));
        self.order.clear();
    }

    /// Whether a package came after a newer one of its flow; if not, it is the newest.
    pub(super) fn is_late(&mut self, package: &Head, position: u64) -> bool {
        let is_late = !self.order.admit(package, position);
        if !is_late {
            self.reassembly.delivers(package, sequence_of(position));
        }
        is_late
    }

    /// Notes that the peer is alive, and whether it takes our packets.
    pub(super) fn is_heard(&mut self, now_ns: u64, way: &PeerContext<'_>, deliver: &mut impl Deliver) {
        let link = &way.peer.link;
        if !self.told.heard {
            self.told = PeerNotices { heard: true, silent: false, ..self.told };
            link.begin();
            deliver.event(RouterEvent::Heard { peer: way.from });
        }
        link.heard_ns.set(now_ns);
        match self.told.refuses {
            // It does not know our address; that says nothing of its own datagrams.
            Some((Mismatch { reason: RefusalReason::Stranger, .. }, until_ns)) if now_ns < until_ns => {}
            _ => {
                self.told.refuses = None;
                link.accept();
            }
        }
    }

    /// Notes that it refuses our packets; returns whether to report that.
    pub(super) fn is_refused_anew(&mut self, now_ns: u64, mismatch: Mismatch) -> bool {
        let before = self.told.refuses.replace((mismatch, now_ns + REFUSED_FOR_NS));
        before.is_none_or(|(before, _)| before != mismatch)
    }

    /// Counts a datagram by its sequence; returns whether to read it.
    pub(super) fn is_new(&mut self, sequence: u64, way: &PeerContext<'_>) -> bool {
        let received = &way.peer.received;
        let mut lost = 0;
        let arrival = self.window.arrive(sequence, &mut lost);
        if lost > 0 {
            received.lost.add(lost);
        }
        way.peer.link.next.set(self.window.next());
        match arrival {
            Arrival::Newest => return true,
            Arrival::Reordered => received.reordered.add(1),
            Arrival::Returned => {
                received.reordered.add(1);
                received.returned.add(1);
            }
            Arrival::Duplicate => received.duplicates.add(1),
        }
        arrival != Arrival::Duplicate
    }

    /// Restarts the wait for it: this router could not have heard it.
    pub(super) fn excuse(&self, now_ns: u64, way: &PeerContext<'_>) {
        if self.told.heard {
            way.peer.link.heard_ns.set(now_ns);
            way.peer.link.denied_ns.set(0);
        }
    }

    /// Notices silence, and that our datagrams do not reach it.
    pub(super) fn look_after(&mut self, now_ns: u64, way: &PeerContext<'_>, deliver: &mut impl Deliver) {
        let peer = way.from;
        let state = way.stats.state(peer, now_ns);
        if state == PeerLinkState::Silent && !self.told.silent {
            self.told = PeerNotices { silent: true, heard: false, ..self.told };
            deliver.event(RouterEvent::Silent { peer });
        }
        let is_unheard = state == PeerLinkState::Unheard;
        if is_unheard && !self.told.unheard {
            deliver.event(RouterEvent::Unheard { peer });
        }
        self.told.unheard = is_unheard;
    }
}

/// The sender of a datagram, and its counters.
#[derive(Clone, Copy)]
pub(super) struct PeerContext<'a> {
    pub(super) from: NodeIndex,
    pub(super) stats: &'a Stats,
    pub(super) peer: &'a PeerStats,
}

impl PeerContext<'_> {
    /// Delivers a complete package, unless it is `refused`; reports the cause if it does not.
    pub(super) fn pass(&self, refused: Option<Cause>, head: &Head, body: &[u8], deliver: &mut impl Deliver) {
        self.peer.received.packages.add(1);
        if let Some(cause) = refused {
            return self.lose(head, body, cause, deliver);
        }
        match deliver.deliver(self.from, head, body) {
            Ok(()) => self.stats.inn.passed(head.priority, head.len),
            Err(NotDelivered::NoMailbox) => self.lose(head, body, Cause::NoMailbox, deliver),
            Err(NotDelivered::MailboxFull) => self.lose(head, body, Cause::MailboxFull, deliver),
            Err(NotDelivered::TooLarge) => self.lose(head, body, Cause::TooLarge, deliver),
        }
    }

    /// Counts a package that arrives in fragments.
    pub(super) fn partial(&self, head: &Head, body: &[u8], change: Change, deliver: &mut impl Deliver) {
        match change {
            Change::Began => self.stats.inn.came(head.priority),
            Change::GivenUp => self.lose(head, body, Cause::Incomplete, deliver),
        }
    }

    /// Takes the peer's report on what it hears of us.
    pub(super) fn hears_of_us(&self, now_ns: u64, own: u64, alive: &Alive) {
        let hears = alive.heard_incarnation == own;
        self.peer.link.hears_us(now_ns, hears);
        if hears {
            self.peer.link.missed_by_it.set(alive.heard_lost);
        }
    }

    fn lose(&self, head: &Head, body: &[u8], cause: Cause, deliver: &mut impl Deliver) {
        self.stats.inn.lost(head.priority, cause);
        deliver.lost(Some(self.from), head, body, cause);
    }
}
