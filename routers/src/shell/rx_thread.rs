//! The thread that reads the socket and puts packages from other nodes into the mailboxes of this one. What it does
//! with a datagram says the [driver](crate::driver).

use super::ages::Ages;
use super::answers::ErrorReplier;
use super::peer_events::News;
use super::sender_cache::SenderCache;
use super::socket::{InSocket, LISTEN, LISTEN_SHORTLY, Received};
use super::threads::{Awake, Shared};
use crate::counts::Cause;
use crate::driver::{Answer, RxDriver, RxPlatform};
use crate::frame::NodeIndex;
use crate::inbound::Envelope;
use crate::report::{Deliver, NotDelivered, Report, RouterEvent};
use crate::settings::Settings;
use crate::stats::Stats;
use rohrpost_mailbox::{Head, SendError, monotonic_ns};
use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use std::time::Duration;

/// Room for the largest UDP datagram.
const DATAGRAM_BYTES: usize = 1 << 16;

/// The other thread is rung this often at most.
const RING_EVERY_NS: u64 = 20_000_000;

/// State of the receiving thread.
pub(super) struct RxThread<D = PackageDelivery> {
    pub(super) driver: RxDriver,
    pub(super) system: RxSystem<D>,
    pub(super) stats: Arc<Stats>,
}

/// What the driver has of the system.
pub(super) struct RxSystem<D = PackageDelivery> {
    pub(super) shared: Arc<Shared>,
    pub(super) socket: Arc<InSocket>,
    pub(super) delivery: D,
    pub(super) settings: Arc<Settings>,
    /// With time slots, refusals and hellos leave through them.
    pub(super) answers: Option<SyncSender<Answer>>,
}

impl<D: Deliver> RxPlatform for RxSystem<D> {
    fn delivery(&mut self) -> impl Deliver {
        &mut self.delivery
    }

    fn answer(&mut self, answer: Answer) -> bool {
        if let Some(slots) = &self.answers {
            return slots.try_send(answer).is_ok();
        }
        self.socket.answer(answer.to(&self.settings), answer.datagram());
        true
    }

    fn ring(&mut self) {
        self.shared.ring();
    }
}

impl<D: Deliver> RxThread<D> {
    /// Runs until the socket is closed.
    pub(super) fn run(mut self) {
        let mut datagram = vec![0; DATAGRAM_BYTES];
        let (mut awake, mut ring_ns, mut seen_dropped) = (Awake::default(), 0, 0);
        let mut listens_shortly = false;
        let Self { driver, system, stats } = &mut self;
        loop {
            let began_ns = monotonic_ns();
            let (received, now_ns) = (system.socket.receive(&mut datagram), monotonic_ns());
            awake.slept(Duration::from_nanos(now_ns.saturating_sub(began_ns)));
            match received {
                Received::Closed => return,
                Received::Nothing => {}
                Received::Datagram { waited_ns, dropped, .. } if driver.passes_over(waited_ns) => {
                    seen_dropped = dropped;
                    continue;
                }
                Received::Datagram { bytes, source, waited_ns, dropped } => {
                    if dropped != seen_dropped {
                        stats.dropped.add(dropped.wrapping_sub(seen_dropped).into());
                        seen_dropped = dropped;
                    }
                    let came = Envelope { source, arrived_ns: now_ns.saturating_sub(waited_ns), bytes };
                    driver.take(system, now_ns, &came, &mut datagram[..bytes]);
                }
            }
            driver.poll(system, now_ns);
            let is_due_soon = system.delivery.poll(now_ns);
            // Back only when nothing comes: in a flood of records the socket is not told of each.
            if is_due_soon != listens_shortly && (is_due_soon || received == Received::Nothing) {
                listens_shortly = is_due_soon;
                system.socket.listen_for(if is_due_soon { LISTEN_SHORTLY } else { LISTEN });
            }
            if now_ns >= ring_ns && !driver.is_rest() {
                ring_ns = now_ns + RING_EVERY_NS;
                system.shared.ring_if_due(now_ns);
            }
            // What is not real time shares its processor as the kernel has it.
            if !driver.is_rest() {
                awake.pause_if_long(now_ns);
            }
        }
    }
}

/// Delivers packages, and replies for undeliverable ones.
pub(super) struct PackageDelivery {
    pub(super) sender_cache: SenderCache,
    pub(super) answers: ErrorReplier,
    /// None where another thread reports the same.
    pub(super) news: Option<News>,
    pub(super) ages: Arc<Ages>,
    /// Largest body of the mailbox that refused the last package.
    pub(super) takes_bytes: Option<usize>,
}

impl Report for PackageDelivery {
    fn lost(&mut self, peer: Option<NodeIndex>, head: &Head, body: &[u8], cause: Cause) {
        self.answers.answer_arrived(peer, head, body, cause, self.takes_bytes.take());
    }
}

impl Deliver for PackageDelivery {
    fn deliver(&mut self, _from: NodeIndex, head: &Head, body: &[u8]) -> Result<(), NotDelivered> {
        let Err(error) = self.sender_cache.send(head, body) else {
            self.ages.note(head, body);
            return Ok(());
        };
        if let SendError::TooLarge { max, .. } = error {
            self.takes_bytes = Some(max);
        }
        Err(error.into())
    }

    fn event(&mut self, event: RouterEvent) {
        self.news.iter().for_each(|news| news.event(event));
    }
}
