//! The sockets to all peers, and their failures.
//!
//! ```text
//!  datagram ─▶ seal ─▶ impair ─▶ socket of the peer ─┬─ taken
//!                                                    └─ no room: kept; the peer is passed over until it has room again
//! ```
//!
//! No thread ever waits in a socket: a stalled device delays only its own peers.

use super::failure::{Failure, Failures};
use super::peer_events::News;
use super::socket::OutSocket;
use crate::frame::NodeIndex;
use crate::impair::{self, Impairment};
use crate::security::{Sealing, TAG_BYTES};
use crate::settings::Settings;
use rohrpost_mailbox::monotonic_ns;
use rohrpost_network::HAND_OVER;
use rohrpost_network::Tdma;
use std::io::IoSlice;
use std::sync::Arc;

/// A peer without socket room is checked this often: in a tenth of the time in which its socket's content leaves at 100
/// Mbit/s.
const RETRY_NS: u64 = 1_000_000;
/// A datagram without room waits this long at most, as in time slots: lateness counts from when it was made.
const STALLED_NS_MAX: u64 = 100_000_000;
/// For a small waiting datagram the kernel counts about a KiB, and it doubles the requested buffer.
const DATAGRAM_KEPT_BYTES: usize = 512;
/// The longest slot of the fastest link fills more than a computer should keep.
const SLOT_BYTES_MAX: usize = 16 << 20;

/// The sockets to all peers, and their failures.
pub(super) struct PeerSockets {
    /// By node; none for the own one.
    sockets: Box<[Option<OutSocket>]>,
    sealing: Option<Sealing>,
    impairment: Option<Impairment<NodeIndex>>,
    failures: Arc<Failures>,
    /// None where another thread reports the same.
    news: Option<News>,
    /// By node: the datagram that waits for room; empty in time slots.
    full: Box<[Stalled]>,
    /// Peers without room, one bit each.
    full_ones: u64,
    /// When they are checked again, ns.
    retry_ns: u64,
    /// A datagram in one piece, for the impairment.
    whole: Vec<u8>,
}

impl PeerSockets {
    pub(super) fn new(
        settings: &Arc<Settings>,
        port: u16,
        sealing: Option<Sealing>,
        impair: Option<impair::ImpairmentSettings>,
        failures: &Arc<Failures>,
    ) -> Self {
        let own = settings.nodes[usize::from(settings.own)].address;
        // In a slot the thread must not sleep until the device has room.
        let waiting_bytes = settings.tdma.as_ref().map(|tdma| slot_bytes_max(tdma, settings.own));
        let socket = |node: NodeIndex| {
            let peer = (settings.nodes[usize::from(node)].address, port).into();
            (node != settings.own).then(|| OutSocket::new(own, peer, waiting_bytes.unwrap_or(0)))
        };
        let bytes = settings.network.datagram_bytes_max + settings.network.security.tag_bytes();
        let stalled = |_| Stalled { datagram: Vec::with_capacity(bytes), since_ns: 0 };
        let nodes = if settings.tdma.is_none() { settings.nodes.len() } else { 0 };
        Self {
            sockets: (0..settings.nodes.len() as NodeIndex).map(socket).collect(),
            sealing,
            // Each node's own stream of the seed.
            impairment: impair.map(|impair| Impairment::new(impair, settings.own.into())),
            failures: failures.clone(),
            news: (port == settings.network.port).then(|| News::new(settings)),
            full: (0..nodes).map(stalled).collect(),
            full_ones: 0,
            retry_ns: u64::MAX,
            whole: Vec::new(),
        }
    }

    /// Whether datagrams are sealed: [`Self::send_made`] does it.
    pub(super) fn seals(&self) -> bool {
        self.sealing.is_some()
    }

    /// Sends the first bytes of a buffer with room for a seal behind them; seals them if configured. An unsent datagram
    /// is unchanged.
    pub(super) fn send_made(
        &mut self,
        now_ns: u64,
        to: NodeIndex,
        buffer: &mut [u8],
        bytes: usize,
    ) -> Result<(), Failure> {
        let Some(sealing) = &mut self.sealing else { return self.send(now_ns, to, &[IoSlice::new(&buffer[..bytes])]) };
        let sealed = &mut buffer[..bytes + TAG_BYTES];
        sealing.close(sealed).map_err(|_| Failure::Unacquainted)?;
        let sent = self.send(now_ns, to, &[IoSlice::new(sealed)]);
        if let (Err(_), Some(sealing)) = (sent, &mut self.sealing) {
            sealing.reopen(sealed);
        }
        sent
    }

    /// Sends a datagram as it is, or lets the impairment delay it.
    pub(super) fn send(&mut self, now_ns: u64, to: NodeIndex, parts: &[IoSlice<'_>]) -> Result<(), Failure> {
        let Some(impairment) = &mut self.impairment else { return self.send_now(to, parts) };
        self.whole.clear();
        parts.iter().for_each(|part| self.whole.extend_from_slice(part));
        impairment.push(now_ns, to, &self.whole);
        self.deliver(now_ns);
        Ok(())
    }

    /// Sends datagrams that the impairment delayed long enough; returns when it has more.
    pub(super) fn deliver(&mut self, now_ns: u64) -> u64 {
        loop {
            let Some(impairment) = &mut self.impairment else { return u64::MAX };
            match impairment.poll(now_ns) {
                impair::ImpairmentStep::Wait { until_ns } => return until_ns,
                impair::ImpairmentStep::Send { to, datagram } => {
                    self.whole.clear();
                    self.whole.extend_from_slice(datagram);
                    let whole = std::mem::take(&mut self.whole);
                    // For the sender, the network has lost it.
                    let _ = self.send_now(to, &[IoSlice::new(&whole)]);
                    self.whole = whole;
                }
            }
        }
    }

    fn send_now(&mut self, to: NodeIndex, parts: &[IoSlice<'_>]) -> Result<(), Failure> {
        let Some(Some(socket)) = self.sockets.get_mut(usize::from(to)) else { return Ok(()) };
        let is_full = self.full_ones & 1 << to != 0;
        let sent = if is_full { Err(Failure::Full) } else { socket.send(parts) };
        match (sent, self.full.get_mut(usize::from(to))) {
            (Err(Failure::Full), Some(stalled)) if !is_full => {
                // Kept, and sent when there is room. No other datagram is made for this peer until then.
                stalled.keep(parts);
                self.full_ones |= 1 << to;
                self.retry_ns = self.retry_ns.min(stalled.since_ns + RETRY_NS);
                return Ok(());
            }
            (Ok(()), _) => self.news.iter_mut().for_each(|news| news.works(to)),
            (Err(failure), _) => {
                self.failures.count(failure);
                self.news.iter_mut().for_each(|news| news.fails(to, failure));
            }
        }
        sent
    }

    /// The peers without room, one bit each, and when they are checked again.
    pub(super) fn full(&self) -> (u64, u64) {
        (self.full_ones, self.retry_ns)
    }

    /// Checks which peers have room again, if it is due.
    pub(super) fn retry(&mut self, now_ns: u64) {
        if now_ns < self.retry_ns {
            return;
        }
        self.retry_ns = now_ns + RETRY_NS;
        for (to, (socket, stalled)) in (0..).zip(self.sockets.iter_mut().zip(&mut self.full)) {
            let (Some(socket), true) = (socket, self.full_ones & 1 << to != 0) else { continue };
            if stalled.is_old(now_ns) {
                // For its packages' accounts it has left; it is lost on its way, and its receiver will miss it.
                stalled.datagram.clear();
                self.failures.count(Failure::Full);
                self.news.iter_mut().for_each(|news| news.fails(to, Failure::Full));
            }
            let has_room = match stalled.datagram.is_empty() {
                true => socket.has_room(),
                false => socket.send(&[IoSlice::new(&stalled.datagram)]) != Err(Failure::Full),
            };
            if has_room {
                stalled.datagram.clear();
                self.full_ones &= !(1 << to);
            }
        }
        if self.full_ones == 0 {
            self.retry_ns = u64::MAX;
        }
    }
}

/// A datagram without room in its socket.
struct Stalled {
    /// Empty once it is lost.
    datagram: Vec<u8>,
    since_ns: u64,
}

impl Stalled {
    fn keep(&mut self, parts: &[IoSlice<'_>]) {
        self.since_ns = monotonic_ns();
        self.datagram.clear();
        parts.iter().for_each(|part| self.datagram.extend_from_slice(part));
    }

    fn is_old(&self, now_ns: u64) -> bool {
        !self.datagram.is_empty() && now_ns.saturating_sub(self.since_ns) > STALLED_NS_MAX
    }
}

/// Largest kernel buffer for a node's datagrams of one slot, with the kernel's overhead for small ones.
fn slot_bytes_max(tdma: &Tdma, own: NodeIndex) -> usize {
    let own = tdma.slots.iter().filter(|slot| slot.node == own);
    let longest = own.map(|slot| slot.length).max().unwrap_or_default();
    let datagrams = longest.as_nanos().div_ceil(HAND_OVER.as_nanos()) as usize;
    (tdma.budget_bytes(longest) as usize).max(datagrams * DATAGRAM_KEPT_BYTES).min(SLOT_BYTES_MAX)
}
