//! The thread that reads the router's mailbox and sends to other nodes.
//!
//! ```text
//!  transit mailbox ─▶ accept ─┬─ at once: head of the frame + body where it lies ─▶ one sendmsg
//!                             └─ queue ─▶ poll ─▶ datagram ─▶ socket of the peer      between any two, the mailbox is looked at
//! ```

use super::answers::Answers;
use super::failure::{Failure, Failures};
use super::news::News;
use super::socket::OutSocket;
use super::threads::{Awake, Shared};
use crate::frame::NodeIndex;
use crate::impair::{self, Impairment};
use crate::outbound::{Accepted, DIRECT_HEAD_BYTES, Outbound, Output, Package};
use crate::report::Report;
use crate::security::{Sealing, TAG_BYTES};
use crate::settings::Settings;
use crate::stats::{Cause, Stats};
use rohrpost_config::Tdma;
use rohrpost_config::wire::HAND_OVER;
use rohrpost_mailbox::{Head, Receiver, monotonic_ns, wait_above, wait_any};
use std::io::IoSlice;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Packages taken from the mailbox before the wire has its turn: enough to fill a datagram with small ones.
const BURST: usize = 64;

/// For a small datagram that waits the kernel counts about a KiB, and it doubles the room that it is asked for.
const DATAGRAM_KEPT_BYTES: usize = 512;
/// The longest slot of the quickest link fills more than a computer should keep.
const SLOT_BYTES_MAX: usize = 16 << 20;

/// What the sending thread has.
pub(super) struct Departures {
    pub(super) shared: Arc<Shared>,
    pub(super) transit: Receiver,
    pub(super) outbound: Outbound,
    pub(super) stats: Arc<Stats>,
    pub(super) answers: Answers,
    pub(super) wire: Wire,
    /// Room for the largest datagram.
    pub(super) datagram: Box<[u8]>,
}

impl Report for Answers {
    fn lost(&mut self, peer: Option<NodeIndex>, head: &Head, body: &[u8], cause: Cause) {
        self.answer(peer, head, body, cause, None);
    }
}

impl Departures {
    /// Until the router ends.
    pub(super) fn run(mut self) {
        let mut awake = Awake::default();
        while !self.shared.ends() {
            let more = self.take();
            let now_ns = monotonic_ns();
            match self.outbound.poll(now_ns, &mut self.datagram, &mut self.answers) {
                Output::Send { to, bytes } => self.send(to, bytes),
                // All that was taken has left, or is lost.
                Output::Wait { .. } if more && self.stats.waiting_bytes.get() == 0 => {}
                Output::Wait { until_ns } if more => awake.slept(self.rest(now_ns, until_ns)),
                Output::Wait { until_ns } => {
                    let delivery_ns = self.wire.deliver(now_ns);
                    let waits = self.stats.waiting_bytes.get() > 0 || delivery_ns < u64::MAX;
                    awake.slept(self.sleep(now_ns, until_ns.min(delivery_ns), waits));
                }
            }
            awake.pause_if_long(now_ns);
        }
    }

    /// Takes what waits in the mailbox, most important first; whether there may be more. With plenty in the queue it takes one: the
    /// most important of all that came since. A flood that is taken in faster than it leaves would only be lost to its quota there, and
    /// cost the processor that modules need; in the mailbox its least important gives way by itself.
    fn take(&mut self) -> bool {
        let Self { transit, outbound, answers, wire, datagram, .. } = self;
        for taken in 0..BURST {
            let Some(waiting) = transit.try_receive() else { return false };
            let (now_ns, body) = (monotonic_ns(), waiting.body());
            let package = Package { head: *waiting.head(), published_ns: waiting.published_ns(), body };
            let alone = taken == 0 && !waiting.is_followed();
            if let Accepted::Send { to, head } = outbound.accept(now_ns, &package, alone, answers) {
                let sent = match wire.seals() {
                    false => wire.send(now_ns, to, &[IoSlice::new(&head), IoSlice::new(body)]),
                    true => {
                        // The one copy that sealing takes: the body must stay as it is.
                        datagram[..head.len()].copy_from_slice(&head);
                        datagram[head.len()..head.len() + body.len()].copy_from_slice(body);
                        wire.send_made(now_ns, to, datagram, head.len() + body.len())
                    }
                };
                settle(sent, outbound, (&head, body), answers);
            }
            if outbound.has_plenty() {
                break;
            }
        }
        true
    }

    fn send(&mut self, to: NodeIndex, bytes: usize) {
        let sent = self.wire.send_made(monotonic_ns(), to, &mut self.datagram, bytes);
        settle(sent, &mut self.outbound, (&self.datagram[..bytes], &[]), &mut self.answers);
    }

    /// The pace holds the wire, and the mailbox holds more. Only what may leave before all that waits is worth waking up for.
    fn rest(&mut self, now_ns: u64, until_ns: u64) -> Duration {
        let until_ns = until_ns.min(self.wire.deliver(now_ns));
        let deadline = Instant::now() + Duration::from_nanos(until_ns.saturating_sub(now_ns));
        wait_above(&mut self.transit, self.outbound.waits_up_to(), Some(deadline), || self.shared.ends())
    }

    /// Sleeps until a package comes, or until then. If something `waits` to leave, that is exact, and costs a timer of the kernel; else
    /// the thread that receives rings, within its own patience.
    fn sleep(&mut self, now_ns: u64, until_ns: u64, waits: bool) -> Duration {
        let deadline = waits.then(|| Instant::now() + Duration::from_nanos(until_ns.saturating_sub(now_ns)));
        // Before the look at the mailbox: who rings because of this time changes the bell that is slept on.
        self.shared.departures_due_ns.store(until_ns, Ordering::Release);
        wait_any(&mut [&mut self.transit], deadline, || self.shared.ends())
    }
}

/// Says what became of the datagram that was made last, and of the body besides if it left from where it lay.
fn settle(sent: Result<(), Failure>, outbound: &mut Outbound, (datagram, body): (&[u8], &[u8]), answers: &mut Answers) {
    if sent.is_err_and(Failure::is_loss) {
        outbound.unsent(datagram, body, answers);
    } else if outbound.is_measured() {
        outbound.sent(monotonic_ns());
    }
}

/// The sockets to all peers, and what goes wrong with them.
pub(super) struct Wire {
    /// By node; none for the own one.
    sockets: Box<[Option<OutSocket>]>,
    sealing: Option<Sealing>,
    impairment: Option<Impairment<NodeIndex>>,
    failures: Arc<Failures>,
    news: News,
    /// A datagram in one piece, for the impairment.
    whole: Vec<u8>,
}

impl Wire {
    pub(super) fn new(
        settings: &Arc<Settings>,
        sealing: Option<Sealing>,
        impair: Option<impair::Settings>,
        failures: &Arc<Failures>,
    ) -> Self {
        let own = settings.nodes[usize::from(settings.own)].address;
        // In a slot the thread must not sleep until the device has room.
        let waiting_bytes = settings.tdma.as_ref().map(|tdma| slot_bytes_max(tdma, settings.own));
        let socket = |node: NodeIndex| {
            let peer = (settings.nodes[usize::from(node)].address, settings.network.port).into();
            (node != settings.own).then(|| match waiting_bytes {
                Some(bytes) => OutSocket::that_never_waits(own, peer, bytes),
                None => OutSocket::new(own, peer),
            })
        };
        Self {
            sockets: (0..settings.nodes.len() as NodeIndex).map(socket).collect(),
            sealing,
            // Each node's own stream of the seed.
            impairment: impair.map(|impair| Impairment::new(impair, settings.own.into())),
            failures: failures.clone(),
            news: News::new(settings),
            whole: Vec::new(),
        }
    }

    /// Whether what leaves is sealed: [`Self::send_made`] does.
    fn seals(&self) -> bool {
        self.sealing.is_some()
    }

    /// Sends the first bytes of a buffer, with room for a seal behind them; sealed, if that is to be. What could not be sent is as it was.
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

    /// Sends a datagram as it is, or has the impairment keep it for a while.
    pub(super) fn send(&mut self, now_ns: u64, to: NodeIndex, parts: &[IoSlice<'_>]) -> Result<(), Failure> {
        let Some(impairment) = &mut self.impairment else { return self.send_now(to, parts) };
        self.whole.clear();
        parts.iter().for_each(|part| self.whole.extend_from_slice(part));
        impairment.push(now_ns, to, &self.whole);
        self.deliver(now_ns);
        Ok(())
    }

    /// Sends what the impairment has kept for long enough; when it has more.
    pub(super) fn deliver(&mut self, now_ns: u64) -> u64 {
        loop {
            let Some(impairment) = &mut self.impairment else { return u64::MAX };
            match impairment.poll(now_ns) {
                impair::Output::Wait { until_ns } => return until_ns,
                impair::Output::Send { to, datagram } => {
                    self.whole.clear();
                    self.whole.extend_from_slice(datagram);
                    let whole = std::mem::take(&mut self.whole);
                    // As far as anybody knows, the network has lost it.
                    let _ = self.send_now(to, &[IoSlice::new(&whole)]);
                    self.whole = whole;
                }
            }
        }
    }

    fn send_now(&mut self, to: NodeIndex, parts: &[IoSlice<'_>]) -> Result<(), Failure> {
        let Some(Some(socket)) = self.sockets.get_mut(usize::from(to)) else { return Ok(()) };
        let sent = socket.send(parts);
        match sent {
            Ok(()) => self.news.works(to),
            Err(failure) => {
                self.failures.count(failure);
                self.news.fails(to, failure);
            }
        }
        sent
    }
}

/// What the kernel keeps at most of what a node hands over in one of its slots, as it counts: small datagrams with what it needs for each.
fn slot_bytes_max(tdma: &Tdma, own: NodeIndex) -> usize {
    let own = tdma.slots.iter().filter(|slot| slot.node == own);
    let longest = own.map(|slot| slot.length).max().unwrap_or_default();
    let datagrams = longest.as_nanos().div_ceil(HAND_OVER.as_nanos()) as usize;
    (tdma.budget_bytes(longest) as usize).max(datagrams * DATAGRAM_KEPT_BYTES).min(SLOT_BYTES_MAX)
}

const _: () = assert!(DIRECT_HEAD_BYTES < 128);
