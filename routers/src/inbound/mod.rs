//! What comes from other nodes: who sent it, what is missing, what came twice, and where it goes.
//!
//! ```text
//!  datagram ─▶ ours? ─▶ of our version and digest? ─▶ this life of the peer? ─▶ not seen yet? ─┬─ packages ──────────┬─▶ in order? ─▶ deliver
//!              foreign   refused, and told so          old                       copy           └─ part ─▶ Reassembly ┘   late
//! ```

mod order;
mod window;

pub use window::{REORDER_MAX, WINDOW};

use crate::fragment::{Change, Reassembly};
use crate::frame::{self, Alive, BadFrame, Frame, FrameHead, Kind, NodeIndex, Reason, Refusal};
use crate::link::{SILENT_AFTER_NS, State};
use crate::report::{Deliver, Event, Mismatch, NotDelivered};
use crate::settings::Settings;
use crate::stats::{Cause, PeerStats, Stats};
use order::{Order, position};
use rohrpost_mailbox::Head;
use std::net::IpAddr;
use std::sync::Arc;
use window::{Arrival, Window};

/// A refusal is said again to the same node after so long.
pub const REFUSE_EVERY_NS: u64 = 1_000_000_000;
/// Packages that waited longer in the socket are not delivered: this router stood still, and they are old.
pub const SOCKET_MAX_NS: u64 = 400_000_000;
/// Lives of a peer that are known to be over.
const OLD_KEPT: usize = 8;
/// Datagrams of an old life are on their way for so long at most; after that, its router still runs.
const OLD_GONE_NS: u64 = 2_000_000_000;
const SWEEP_EVERY_NS: u64 = 100_000_000;
/// Missing datagrams are given up after one to two of these, if not before.
const TICK_EVERY_NS: u64 = 500_000_000;

/// A datagram as it came.
#[derive(Clone, Copy, Debug)]
pub struct Datagram<'a> {
    /// Who sent it, as the socket says.
    pub source: IpAddr,
    /// When it came to this computer, ns of the monotonic clock; the time of its handling, if that is all that is known.
    pub arrived_ns: u64,
    /// What is in it.
    pub bytes: &'a [u8],
}

/// What to do.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Output {
    /// Send the first bytes of the buffer to the packages' port of an address, then ask again.
    Refuse {
        /// The address.
        to: IpAddr,
        /// How many.
        bytes: usize,
    },
    /// Nothing before this time, unless a datagram comes.
    Wait {
        /// Ns of the monotonic clock.
        until_ns: u64,
    },
}

/// The incoming half of a router. One thread has it.
#[derive(Debug)]
pub struct Inbound {
    settings: Settings,
    stats: Arc<Stats>,
    peers: Box<[Peer]>,
    strangers: Refusing,
    /// Some refusal is to be said.
    must_refuse: bool,
    sweep_ns: u64,
    tick_ns: u64,
}

#[derive(Debug)]
struct Peer {
    /// The life that is heard; 0: none yet.
    incarnation: u64,
    began_ns: u64,
    old: [u64; OLD_KEPT],
    old_next: usize,
    window: Window,
    order: Order,
    reassembly: Reassembly,
    refusing: Refusing,
    told: Told,
}

/// What was said of a peer and is not over.
#[derive(Clone, Copy, Debug, Default)]
struct Told {
    heard: bool,
    silent: bool,
    unheard: bool,
    twice: bool,
    refuses: Option<Mismatch>,
}

/// Refusals to one address.
#[derive(Clone, Copy, Debug, Default)]
struct Refusing {
    /// To whom and why, if it is still to be said.
    due: Option<(IpAddr, Reason)>,
    /// Not before this time again, ns.
    not_before_ns: u64,
    told: Option<(IpAddr, Mismatch)>,
}

impl Inbound {
    /// For the router of `settings.own`.
    pub fn new(settings: &Settings, stats: Arc<Stats>) -> Self {
        Self {
            peers: settings.nodes.iter().map(|_| Peer::new()).collect(),
            strangers: Refusing::default(),
            must_refuse: false,
            sweep_ns: 0,
            tick_ns: 0,
            settings: settings.clone(),
            stats,
        }
    }

    /// Takes a datagram, whatever it is.
    pub fn handle(&mut self, now_ns: u64, datagram: &Datagram<'_>, deliver: &mut impl Deliver) {
        let source = datagram.source;
        match Frame::parse(datagram.bytes) {
            Ok((_, Frame::Refusal(refusal))) => self.refused_by(now_ns, source, &refusal, deliver),
            Ok((_, Frame::Time(_))) | Err(BadFrame::Foreign) => self.stats.foreign.add(1),
            Ok((head, frame)) => match self.mismatch(source, &head) {
                None => self.take(now_ns, datagram, &head, frame, deliver),
                Some(mismatch) => self.refuse(now_ns, source, mismatch, deliver),
            },
            Err(BadFrame::Version(version)) => {
                let mismatch = Mismatch { reason: Reason::Version, version, digest: None };
                self.refuse(now_ns, source, mismatch, deliver);
            }
            Err(BadFrame::Damaged(_)) => match self.peer_at(source) {
                Some(peer) => self.stats.peer(peer).received.damaged.add(1),
                None => self.stats.foreign.add(1),
            },
        }
    }

    /// What is to be sent, and when to ask again. `datagram` has room for a refusal, 52 bytes.
    ///
    /// # Panics
    /// If it has not.
    pub fn poll(&mut self, now_ns: u64, datagram: &mut [u8], deliver: &mut impl Deliver) -> Output {
        if now_ns >= self.sweep_ns {
            self.sweep(now_ns, deliver);
        }
        if self.must_refuse
            && let Some((to, reason)) = self.due(now_ns)
        {
            return Output::Refuse { to, bytes: self.refusal(to, reason, datagram) };
        }
        Output::Wait { until_ns: self.sweep_ns }
    }

    fn peer_at(&self, source: IpAddr) -> Option<NodeIndex> {
        self.settings.node_at(source).filter(|node| *node != self.settings.own)
    }

    fn mismatch(&self, source: IpAddr, head: &FrameHead) -> Option<Mismatch> {
        let ours = &self.settings;
        let differs = |reason| Mismatch { reason, version: frame::VERSION, digest: Some(head.digest) };
        if head.digest != ours.digest {
            return Some(differs(Reason::Digest));
        }
        let is_there = ours.nodes.get(usize::from(head.from)).is_some_and(|node| node.address == source);
        let is_known = is_there && head.from != ours.own && head.to == ours.own && head.system == ours.system;
        (!is_known).then(|| differs(Reason::Stranger))
    }

    fn refuse(&mut self, now_ns: u64, source: IpAddr, mismatch: Mismatch, deliver: &mut impl Deliver) {
        let peer = self.peer_at(source);
        let refusing = match peer {
            Some(peer) => {
                let stats = self.stats.peer(peer);
                stats.received.refused.add(1);
                stats.link.refuse(now_ns, mismatch);
                &mut self.peers[usize::from(peer)].refusing
            }
            None => {
                self.stats.foreign.add(1);
                &mut self.strangers
            }
        };
        if refusing.due.is_none() {
            refusing.due = Some((source, mismatch.reason));
            self.must_refuse = true;
        }
        if refusing.told != Some((source, mismatch)) {
            refusing.told = Some((source, mismatch));
            deliver.event(Event::Refused { source, peer, mismatch });
        }
    }

    fn refused_by(&mut self, now_ns: u64, source: IpAddr, refusal: &Refusal, deliver: &mut impl Deliver) {
        let Some(peer) = self.peer_at(source) else { return self.stats.foreign.add(1) };
        let mismatch = Mismatch { reason: refusal.reason, version: refusal.version, digest: Some(refusal.digest) };
        self.stats.peer(peer).link.refuse(now_ns, mismatch);
        let told = &mut self.peers[usize::from(peer)].told;
        if told.refuses != Some(mismatch) {
            told.refuses = Some(mismatch);
            deliver.event(Event::Refuses { peer, mismatch });
        }
    }

    fn take(
        &mut self,
        now_ns: u64,
        datagram: &Datagram<'_>,
        head: &FrameHead,
        frame: Frame<'_>,
        deliver: &mut impl Deliver,
    ) {
        let from = head.from;
        let way = Way { from, stats: &self.stats, peer: self.stats.peer(from) };
        let peer = &mut self.peers[usize::from(from)];
        if head.incarnation != peer.incarnation && !peer.lives_anew(now_ns, head, &way, deliver) {
            return way.peer.received.old.add(1);
        }
        peer.is_heard(now_ns, &way, deliver);
        if !peer.is_new(head.sequence, &way) {
            return;
        }
        way.peer.received.datagrams.add(1);
        way.peer.received.bytes.add(datagram.bytes.len() as u64);
        let is_old = now_ns.saturating_sub(datagram.arrived_ns) > SOCKET_MAX_NS;
        match frame {
            Frame::Packages(packages) => {
                for (index, (package, body)) in (0..).zip(packages) {
                    way.stats.inn.came(package.priority);
                    way.pass(is_old, &mut peer.order, position(head.sequence, index), &package, body, deliver);
                }
            }
            Frame::Fragment(part) => {
                way.peer.received.fragments.add(1);
                let whole =
                    peer.reassembly.take(now_ns, &part, |head, body, change| way.partial(head, body, change, deliver));
                if let Some(whole) = whole {
                    way.pass(is_old, &mut peer.order, position(whole.first, 0), &whole.head, whole.body, deliver);
                }
            }
            Frame::Alive(alive) => way.hears_of_us(now_ns, self.settings.incarnation, &alive),
            // Taken out before.
            Frame::Refusal(_) | Frame::Time(_) => {}
        }
    }

    /// What time alone brings about: losses, silence, parts that never came.
    fn sweep(&mut self, now_ns: u64, deliver: &mut impl Deliver) {
        self.sweep_ns = now_ns + SWEEP_EVERY_NS;
        let is_tick = now_ns >= self.tick_ns;
        if is_tick {
            self.tick_ns = now_ns + TICK_EVERY_NS;
        }
        for from in self.settings.peers() {
            let way = Way { from, stats: &self.stats, peer: self.stats.peer(from) };
            let peer = &mut self.peers[usize::from(from)];
            peer.reassembly.expire(now_ns, |head, body, change| way.partial(head, body, change, deliver));
            if is_tick {
                way.peer.received.lost.add(peer.window.tick());
            }
            peer.look_after(now_ns, &way, deliver);
        }
    }

    fn due(&mut self, now_ns: u64) -> Option<(IpAddr, Reason)> {
        let all = self.peers.iter_mut().map(|peer| &mut peer.refusing).chain([&mut self.strangers]);
        let mut waiting = false;
        for refusing in all {
            if refusing.due.is_some() && refusing.not_before_ns <= now_ns {
                refusing.not_before_ns = now_ns + REFUSE_EVERY_NS;
                return refusing.due.take();
            }
            waiting |= refusing.due.is_some();
        }
        self.must_refuse = waiting;
        None
    }

    fn refusal(&self, to: IpAddr, reason: Reason, datagram: &mut [u8]) -> usize {
        let Settings { system, own, digest, incarnation, .. } = self.settings;
        let peer = self.peer_at(to).unwrap_or(NodeIndex::MAX);
        let head = FrameHead { kind: Kind::Refusal, system, from: own, to: peer, digest, incarnation, sequence: 0 };
        let said = Refusal { version: frame::VERSION, reason, digest }.to_bytes();
        let end = frame::HEAD_BYTES + said.len();
        datagram[..frame::HEAD_BYTES].copy_from_slice(&head.to_bytes(&[&said]));
        datagram[frame::HEAD_BYTES..end].copy_from_slice(&said);
        end
    }
}

impl Peer {
    fn new() -> Self {
        Self {
            incarnation: 0,
            began_ns: 0,
            old: [0; OLD_KEPT],
            old_next: 0,
            window: Window::new(0),
            order: Order::new(),
            reassembly: Reassembly::default(),
            refusing: Refusing::default(),
            told: Told::default(),
        }
    }

    /// Begins another life of the peer; false if it is one that is over.
    fn lives_anew(&mut self, now_ns: u64, head: &FrameHead, way: &Way<'_>, deliver: &mut impl Deliver) -> bool {
        if self.old.contains(&head.incarnation) {
            if now_ns.saturating_sub(self.began_ns) > OLD_GONE_NS && !self.told.twice {
                self.told.twice = true;
                deliver.event(Event::Twice { peer: way.from });
            }
            return false;
        }
        if self.incarnation != 0 {
            way.peer.received.lost.add(self.window.close());
            way.peer.received.restarts.add(1);
            self.reassembly.clear(|head, body, change| way.partial(head, body, change, deliver));
            self.order.clear();
            self.old[self.old_next % OLD_KEPT] = self.incarnation;
            self.old_next += 1;
            self.told = Told { heard: true, ..Told::default() };
            deliver.event(Event::Restarted { peer: way.from });
        }
        (self.incarnation, self.began_ns) = (head.incarnation, now_ns);
        self.window = Window::new(head.sequence);
        way.peer.link.incarnation.set(head.incarnation);
        way.peer.link.since_ns.set(now_ns);
        way.peer.link.accept();
        true
    }

    fn is_heard(&mut self, now_ns: u64, way: &Way<'_>, deliver: &mut impl Deliver) {
        let link = &way.peer.link;
        if !self.told.heard {
            self.told = Told { heard: true, ..self.told };
            self.told.silent = false;
            link.since_ns.set(now_ns);
            deliver.event(Event::Heard { peer: way.from });
        }
        link.heard_ns.set(now_ns);
        self.refusing.told = None;
        // That it does not know our address says nothing of what it sends.
        if self.told.refuses.is_none_or(|mismatch| mismatch.reason != Reason::Stranger) {
            self.told.refuses = None;
            link.accept();
        }
    }

    /// Counts a datagram by its sequence; whether it is to be read.
    fn is_new(&mut self, sequence: u64, way: &Way<'_>) -> bool {
        let received = &way.peer.received;
        let mut lost = 0;
        let arrival = self.window.arrive(sequence, &mut lost);
        if lost > 0 {
            received.lost.add(lost);
        }
        way.peer.link.next.set(self.window.next());
        match arrival {
            Arrival::Newest => return true,
            Arrival::Overtaken => received.overtaken.add(1),
            Arrival::Returned => {
                received.overtaken.add(1);
                received.returned.add(1);
            }
            Arrival::Copy => received.copies.add(1),
        }
        arrival != Arrival::Copy
    }

    fn look_after(&mut self, now_ns: u64, way: &Way<'_>, deliver: &mut impl Deliver) {
        let peer = way.from;
        let link = &way.peer.link;
        if !self.told.silent && link.heard_ns.get().max(way.stats.started_ns) + SILENT_AFTER_NS <= now_ns {
            self.told = Told { silent: true, heard: false, ..self.told };
            deliver.event(Event::Silent { peer });
        }
        let is_unheard = way.stats.state(peer, now_ns) == State::Unheard;
        if is_unheard && !self.told.unheard {
            deliver.event(Event::Unheard { peer });
        }
        self.told.unheard = is_unheard;
    }
}

/// Who something came from, and where it is counted.
#[derive(Clone, Copy)]
struct Way<'a> {
    from: NodeIndex,
    stats: &'a Stats,
    peer: &'a PeerStats,
}

impl Way<'_> {
    /// Delivers a package that is there as a whole, or says why not.
    fn pass(
        &self,
        is_old: bool,
        order: &mut Order,
        position: u64,
        head: &Head,
        body: &[u8],
        deliver: &mut impl Deliver,
    ) {
        self.peer.received.packages.add(1);
        if is_old {
            return self.lose(head, body, Cause::Stale, deliver);
        }
        if !order.admit(head, position) {
            return self.lose(head, body, Cause::Late, deliver);
        }
        match deliver.deliver(self.from, head, body) {
            Ok(()) => self.stats.inn.passed(head.priority, head.len),
            Err(NotDelivered::NoMailbox) => self.lose(head, body, Cause::NoMailbox, deliver),
            Err(NotDelivered::MailboxFull) => self.lose(head, body, Cause::MailboxFull, deliver),
            Err(NotDelivered::TooLarge) => self.lose(head, body, Cause::TooLarge, deliver),
        }
    }

    fn partial(&self, head: &Head, body: &[u8], change: Change, deliver: &mut impl Deliver) {
        match change {
            Change::Began => self.stats.inn.came(head.priority),
            Change::GivenUp => self.lose(head, body, Cause::Incomplete, deliver),
        }
    }

    fn hears_of_us(&self, now_ns: u64, own: u64, alive: &Alive) {
        if alive.heard_incarnation == own {
            self.peer.link.hears_us_ns.set(now_ns);
            self.peer.link.missed_by_it.set(alive.heard_lost);
        }
    }

    fn lose(&self, head: &Head, body: &[u8], cause: Cause, deliver: &mut impl Deliver) {
        self.stats.inn.lost(head.priority, cause);
        deliver.lost(Some(self.from), head, body, cause);
    }
}
