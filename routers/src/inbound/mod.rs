//! Datagrams from other nodes: checks of sender, loss and duplicates, and delivery.
//!
//! ```text
//!  datagram ─▶ ours? ─▶ our digest? ─▶ this incarnation? ─▶ not seen yet? ─┬─ packages ───────┬─▶ in order? ─▶ deliver
//!              foreign  refused, told so   old               duplicate      └ fragment ▶ whole ┘   late
//! ```

mod confirmation;
mod order;
mod peer;
mod refusing;
pub(crate) mod window;

pub(crate) use refusing::write_refusal;
pub use window::{REORDER_MAX, WINDOW};

use crate::admission::capped;
use crate::counts::Cause;
use crate::frame::{BadFrame, Fragment, Frame, FrameHead, NodeIndex, RefusalReason, VERSION};
use crate::port::SEQUENCES;
use crate::report::{Deliver, Mismatch};
use crate::settings::Settings;
use crate::stats::Stats;
use order::position;
use peer::{PeerContext, PeerReceiver, Refusing};
use rohrpost_mailbox::Head;
use std::net::IpAddr;
use std::sync::Arc;

/// Shortest time between two refusals to one node.
pub const REFUSE_EVERY_NS: u64 = 1_000_000_000;
/// Packages that waited longer in the socket are dropped as old: this router was stalled.
pub const SOCKET_MAX_NS: u64 = 400_000_000;
const SWEEP_EVERY_NS: u64 = 100_000_000;
/// A sweep that comes this late shows that this router was stalled itself: silence then says nothing.
const STOOD_STILL_NS: u64 = 400_000_000;
/// Missing datagrams are given up after two to three of these, if not before.
pub const TICK_EVERY_NS: u64 = 500_000_000;

/// A received datagram.
#[derive(Clone, Copy, Debug)]
pub struct Datagram<'a> {
    /// Source address.
    pub source: IpAddr,
    /// When it came to this computer, ns of the monotonic clock; the time of its handling, if only that is known.
    pub arrived_ns: u64,
    /// Content.
    pub bytes: &'a [u8],
}

/// Envelope of a datagram that was opened: as [`Datagram`] has it.
#[derive(Clone, Copy, Debug)]
pub struct Envelope {
    /// Source address.
    pub source: IpAddr,
    /// Arrival.
    pub arrived_ns: u64,
    /// Its length.
    pub bytes: usize,
}

/// Next step for the code around the core, from [`Inbound::poll`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum InboundStep {
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
    peers: Box<[PeerReceiver]>,
    strangers: Refusing,
    /// A refusal is due.
    must_refuse: bool,
    sweep_ns: u64,
    tick_ns: u64,
}

impl Inbound {
    /// State for the router of `settings.own`.
    pub fn new(settings: &Settings, stats: Arc<Stats>) -> Self {
        Self {
            peers: settings.nodes.iter().map(|_| PeerReceiver::default()).collect(),
            strangers: Refusing::default(),
            must_refuse: false,
            sweep_ns: 0,
            tick_ns: 0,
            settings: settings.clone(),
            stats,
        }
    }

    /// Handles any datagram.
    pub fn handle(&mut self, now_ns: u64, datagram: &Datagram<'_>, deliver: &mut impl Deliver) {
        let Datagram { source, arrived_ns, bytes } = *datagram;
        let came = Envelope { source, arrived_ns, bytes: bytes.len() };
        match self.parse(datagram.bytes) {
            Ok((_, Frame::Refusal(refusal))) => self.refused_by(now_ns, source, &refusal, deliver),
            Ok((_, Frame::Time(_))) | Err(BadFrame::Foreign) => self.stats.foreign.add(1),
            Ok((head, frame)) => match self.mismatch(source, &head) {
                None => self.take(now_ns, &came, (&head, None), frame, deliver),
                Some(mismatch) => self.refuse(now_ns, source, mismatch, deliver),
            },
            Err(BadFrame::Version(version)) => {
                let mismatch = Mismatch { reason: RefusalReason::Version, version, digest: None };
                self.refuse(now_ns, source, mismatch, deliver);
            }
            Err(BadFrame::Sealed) => {
                let mismatch = Mismatch { reason: RefusalReason::Sealed, version: VERSION, digest: None };
                self.refuse(now_ns, source, mismatch, deliver);
            }
            Err(BadFrame::Damaged(_)) => self.damaged(source),
        }
    }

    /// Reads a datagram that is for this port; its sequence counts from 0 then. What is for another port says nothing
    /// of its sender here: at each port it counts anew, and says something else.
    fn parse<'a>(&self, bytes: &'a [u8]) -> Result<(FrameHead, Frame<'a>), BadFrame> {
        let (head, frame) = Frame::parse(bytes)?;
        let port = self.stats.port;
        if !port.has_sequence(head.sequence) {
            return Err(BadFrame::Foreign);
        }
        Ok((FrameHead { sequence: head.sequence % SEQUENCES, ..head }, frame))
    }

    /// Handles a datagram that was sealed, and opened: `text` is what follows its head, `first` the first sequence that
    /// counts of its incarnation.
    pub fn handle_opened(
        &mut self,
        now_ns: u64,
        came: &Envelope,
        (head, text, first): (&FrameHead, &[u8], u64),
        deliver: &mut impl Deliver,
    ) {
        match Frame::read(head.kind, VERSION, text) {
            Ok(frame @ (Frame::Packages(_) | Frame::Fragment(_) | Frame::Alive(_) | Frame::Replica(_))) => {
                match self.mismatch(came.source, head) {
                    None => self.take(now_ns, came, (head, Some(first)), frame, deliver),
                    Some(mismatch) => self.refuse(now_ns, came.source, mismatch, deliver),
                }
            }
            Ok(Frame::Refusal(_) | Frame::Time(_)) | Err(_) => self.damaged(came.source),
        }
    }

    /// Whether a node has this address.
    pub(crate) fn is_address_of(&self, node: NodeIndex, address: IpAddr) -> bool {
        self.settings.nodes.get(usize::from(node)).is_some_and(|node| node.address == address)
    }

    /// Bytes of the longest datagram that a router seals.
    pub(crate) fn sealed_bytes_max(&self) -> usize {
        let network = &self.settings.network;
        network.datagram_bytes_max + network.security.tag_bytes()
    }

    /// Whether an incarnation of a peer with this head may begin: it may if all that must be equal is.
    pub(crate) fn may_handshake(
        &mut self,
        now_ns: u64,
        source: IpAddr,
        head: &FrameHead,
        deliver: &mut impl Deliver,
    ) -> bool {
        let mismatch = self.mismatch(source, head);
        mismatch.inspect(|mismatch| self.refuse(now_ns, source, *mismatch, deliver)).is_none()
    }

    /// A verified peer sends time of another configuration.
    pub(crate) fn tells_other(&self, now_ns: u64, head: &FrameHead) {
        self.stats.peer(head.from).link.tells_other(now_ns, head.digest);
    }

    /// Whether a sealed head is from a peer of another configuration.
    pub(crate) fn is_of_other(&self, source: IpAddr, head: &FrameHead) -> bool {
        head.digest != self.settings.digest && self.is_address_of(head.from, source)
    }

    /// Counts a foreign or a damaged datagram.
    pub(crate) fn bad(&self, source: IpAddr, why: BadFrame) {
        match why {
            BadFrame::Foreign => self.stats.foreign.add(1),
            BadFrame::Version(_) | BadFrame::Sealed | BadFrame::Damaged(_) => self.damaged(source),
        }
    }

    fn damaged(&self, source: IpAddr) {
        match self.peer_at(source) {
            Some(peer) => self.stats.peer(peer).received.damaged.add(1),
            None => self.stats.foreign.add(1),
        }
    }

    /// The next step, and when to ask again. `datagram` has room for a refusal, 52 bytes.
    ///
    /// # Panics
    /// If it has not.
    pub fn poll(&mut self, now_ns: u64, datagram: &mut [u8], deliver: &mut impl Deliver) -> InboundStep {
        if now_ns >= self.sweep_ns {
            self.sweep(now_ns, deliver);
        }
        if self.must_refuse
            && let Some((to, reason)) = self.due(now_ns)
        {
            return InboundStep::Refuse { to, bytes: self.refusal(to, reason, datagram) };
        }
        InboundStep::Wait { until_ns: self.sweep_ns }
    }

    /// Packages with missing fragments.
    pub fn partial(&self) -> u64 {
        self.peers.iter().map(|peer| peer.reassembly.len() as u64).sum()
    }

    /// `first`: see [`PeerReceiver::is_present`].
    fn take(
        &mut self,
        now_ns: u64,
        came: &Envelope,
        (head, first): (&FrameHead, Option<u64>),
        frame: Frame<'_>,
        deliver: &mut impl Deliver,
    ) {
        let from = head.from;
        let way = PeerContext { from, stats: &self.stats, peer: self.stats.peer(from) };
        let peer = &mut self.peers[usize::from(from)];
        let is_other = first.is_none() && self.stats.is_other_incarnation(from, head.incarnation);
        if is_other || !peer.is_present(now_ns, head, first, &way, deliver) {
            return way.peer.received.old.add(1);
        }
        if !peer.is_new(head.sequence, &way) {
            return;
        }
        // A duplicate does not show that its sender is still there.
        peer.is_heard(now_ns, &way, deliver);
        way.peer.received.datagrams.add(1);
        way.peer.received.bytes.add(came.bytes as u64);
        let is_old = now_ns.saturating_sub(came.arrived_ns) > SOCKET_MAX_NS;
        let settings = &self.settings;
        let refused = |head: &Head, body: &[u8]| settings.refuses(from, head, body).or(is_old.then_some(Cause::Stale));
        let admitted = |head: &Head| capped(head);
        match frame {
            Frame::Packages(packages) => {
                for (index, (package, body)) in (0..).zip(packages) {
                    let package = admitted(&package);
                    way.stats.inn.came(package.priority);
                    let position = position(head.sequence, index);
                    let cause =
                        refused(&package, body).or_else(|| peer.is_late(&package, position).then_some(Cause::Late));
                    way.pass(cause, &package, body, deliver);
                }
            }
            Frame::Fragment(part) => {
                way.peer.received.fragments.add(1);
                let part = Fragment { head: admitted(&part.head), ..part };
                let PeerReceiver { order, reassembly, .. } = peer;
                let is_late = || order.is_late(&part.head, position(part.first, 0));
                let tell = |head: &Head, body: &[u8], change| way.partial(head, body, change, deliver);
                if let Some(whole) = reassembly.take(now_ns, &part, is_late, tell) {
                    let refused = refused(&whole.head, whole.body);
                    let cause = refused.or_else(|| order.is_whole_late(&whole).then_some(Cause::Late));
                    way.pass(cause, &whole.head, whole.body, deliver);
                }
            }
            Frame::Alive(alive) => way.hears_of_us(now_ns, self.settings.incarnation, &alive),
            Frame::Replica(part) => {
                if !deliver.replica(head, &part) {
                    way.peer.received.refused.add(1);
                }
            }
            // Handled before.
            Frame::Refusal(_) | Frame::Time(_) => {}
        }
    }

    /// Effects of time alone: losses, silence, fragments that never came.
    fn sweep(&mut self, now_ns: u64, deliver: &mut impl Deliver) {
        let stood_still = self.sweep_ns > 0 && now_ns > self.sweep_ns + STOOD_STILL_NS;
        self.sweep_ns = now_ns + SWEEP_EVERY_NS;
        let is_tick = now_ns >= self.tick_ns;
        if is_tick {
            self.tick_ns = now_ns + TICK_EVERY_NS;
        }
        for from in self.settings.peers() {
            let way = PeerContext { from, stats: &self.stats, peer: self.stats.peer(from) };
            let peer = &mut self.peers[usize::from(from)];
            peer.reassembly.expire(now_ns, |head, body, change| way.partial(head, body, change, deliver));
            if is_tick {
                way.peer.received.lost.add(peer.window.tick());
            }
            if stood_still {
                peer.excuse(now_ns, &way);
            }
            peer.look_after(now_ns, &way, deliver);
        }
    }
}

#[cfg(test)]
mod tests;
