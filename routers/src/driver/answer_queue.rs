//! What waits for a slot besides time and packages: refusals where nothing is sealed, else hellos.

use super::answer::{ANSWER_BYTES, Answer};
use super::platform::{Platform, SlotEvent};
use crate::frame::{NodeIndex, RefusalReason};
use crate::inbound::write_refusal;
use crate::security::{HELLO_SLOT_BYTES, HelloQueue, PeerSessions};
use crate::settings::Settings;
use crate::tdma::{Carries, TransmitWindow};
use std::net::IpAddr;
use std::sync::Arc;

/// An address that no node has is refused so often at most.
const REFUSE_EVERY_NS: u64 = 50_000_000;

/// Used by the sending thread.
pub(super) struct AnswerQueue {
    /// The refusal with the next turn.
    refusal: Option<Answer>,
    /// When an address that no node has was refused last, ns.
    refused_ns: u64,
    /// Where all is sealed.
    hellos: Option<HelloQueue>,
    settings: Arc<Settings>,
}

impl AnswerQueue {
    pub(super) fn new(settings: &Arc<Settings>, peer_sessions: Option<&Arc<PeerSessions>>) -> Self {
        Self { refusal: None, refused_ns: 0, hellos: peer_sessions.map(HelloQueue::new), settings: settings.clone() }
    }

    /// Keeps the newest hellos of each peer; refusals wait in the channel, one after the other.
    pub(super) fn look(&mut self, on: &mut impl Platform, now_ns: u64) {
        while self.refusal.is_none()
            && let Some(answer) = on.next_answer()
        {
            match (answer, &mut self.hellos) {
                (Answer::Hello { said, datagram }, Some(hellos)) => hellos.put(now_ns, said, &datagram),
                (refusal, _) => self.refusal = Some(refusal),
            }
        }
    }

    /// Refuses time of another configuration from an address that is no node's, once in a while. With sealing nothing
    /// is sent: the sender could not trust the refusal.
    pub(super) fn refuse(&mut self, now_ns: u64, to: IpAddr) {
        if self.refusal.is_none() && self.hellos.is_none() && self.refused_ns + REFUSE_EVERY_NS <= now_ns {
            self.refused_ns = now_ns;
            let mut datagram = [0; ANSWER_BYTES];
            let bytes = write_refusal(&self.settings, None, RefusalReason::Digest, &mut datagram);
            self.refusal = Some(Answer::Refusal { to, bytes, datagram });
        }
    }

    /// Sends one, if it fits: refusals and hellos, however many are asked for, must not take the slots of packages.
    pub(super) fn answer(&mut self, on: &mut impl Platform, tx_window: &mut TransmitWindow) {
        let (now_ns, asks) = (on.local_ns(), tx_window.carries == Carries::Hello);
        let overheard = if asks { on.clock().overheard(now_ns) } else { None };
        if let Some((fitted_ns, bytes)) = self.send_next(on, tx_window, overheard.map(|(from, _)| from)) {
            tx_window.takes(fitted_ns, bytes);
            if asks {
                on.happened(SlotEvent::AnsweredOverheard(tx_window));
                on.time().0.asked_overheard(now_ns);
            }
        }
    }

    /// Sends the next that the window carries and that fits, a hello to the node `first` before others; when it was
    /// found to fit, and as how many bytes slots count it.
    fn send_next(
        &mut self,
        on: &mut impl Platform,
        tx_window: &mut TransmitWindow,
        first: Option<NodeIndex>,
    ) -> Option<(u64, usize)> {
        let now_ns = on.monotonic_ns();
        self.look(on, now_ns);
        // What was looked through before takes its time.
        let local_ns = on.local_ns();
        let fits = |bytes| tx_window.fits(local_ns, bytes);
        if let Some(hellos) = &mut self.hellos {
            let (said, datagram) = if fits(HELLO_SLOT_BYTES) { hellos.take(now_ns, first) } else { None }?;
            on.send_answer(self.settings.nodes[usize::from(said.to)].address, &datagram);
            tx_window.returns(on.local_ns());
            hellos.left(said);
            return Some((local_ns, HELLO_SLOT_BYTES));
        }
        match self.refusal.take()? {
            Answer::Refusal { to, bytes, datagram } if tx_window.carries_refusal() && fits(bytes) => {
                on.send_answer(to, &datagram[..bytes]);
                tx_window.returns(on.local_ns());
                Some((local_ns, bytes))
            }
            refusal => {
                self.refusal = Some(refusal);
                None
            }
        }
    }
}
