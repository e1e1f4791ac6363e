//! What waits for a slot besides time and packages: refusals where nothing is sealed, else hellos.

use super::super::socket::InSocket;
use super::speech;
use crate::frame::{NodeIndex, RefusalReason};
use crate::inbound::write_refusal;
use crate::security::{HELLO_SLOT_BYTES, HelloQueue, Said};
use crate::settings::Settings;
use crate::tdma::TransmitWindow;
use std::net::IpAddr;
use std::sync::Arc;
use std::sync::mpsc::Receiver;

/// Senders without a number here are refused so often at most.
const REFUSE_EVERY_NS: u64 = 50_000_000;

/// Room for the longest refusal.
pub(in crate::shell) const REFUSAL_BYTES: usize = 128;
/// Refusals that wait for a slot, and hellos that the thread has not looked at yet; more are lost, and said again a
/// second later.
pub(in crate::shell) const ANSWERS: usize = 32;

/// An answer from the receiving thread, to be sent.
pub(in crate::shell) enum Answer {
    /// Where nothing is sealed: a refusal of another configuration or version, and its receiver.
    Refusal { to: IpAddr, bytes: usize, datagram: [u8; REFUSAL_BYTES] },
    /// Where all is sealed.
    Hello { said: Said, datagram: [u8; REFUSAL_BYTES] },
}

/// In the hands of the thread that sends.
pub(in crate::shell) struct AnswerQueue {
    answers: Receiver<Answer>,
    /// The refusal that is next.
    refusal: Option<Answer>,
    /// When somebody without a number was refused last, ns.
    refused_ns: u64,
    /// Where all is sealed.
    hellos: Option<HelloQueue>,
    /// By which they leave.
    socket: Arc<InSocket>,
    settings: Arc<Settings>,
}

impl AnswerQueue {
    pub(in crate::shell) fn new(
        answers: Receiver<Answer>,
        hellos: Option<HelloQueue>,
        socket: Arc<InSocket>,
        settings: Arc<Settings>,
    ) -> Self {
        Self { answers, refusal: None, refused_ns: 0, hellos, socket, settings }
    }

    /// Of each peer the newest hellos wait; refusals wait where they are, one after the other.
    pub(super) fn look(&mut self, now_ns: u64) {
        while self.refusal.is_none()
            && let Ok(answer) = self.answers.try_recv()
        {
            match (answer, &mut self.hellos) {
                (Answer::Hello { said, datagram }, Some(hellos)) => hellos.put(now_ns, said, &datagram),
                (refusal, _) => self.refusal = Some(refusal),
            }
        }
    }

    /// Somebody without a number here says what time it is by another configuration. It is told once in a while;
    /// sealed, it could not believe it.
    pub(super) fn refuse(&mut self, now_ns: u64, to: IpAddr) {
        if self.refusal.is_none() && self.hellos.is_none() && self.refused_ns + REFUSE_EVERY_NS <= now_ns {
            self.refused_ns = now_ns;
            let mut datagram = [0; REFUSAL_BYTES];
            let bytes = write_refusal(&self.settings, None, RefusalReason::Digest, &mut datagram);
            self.refusal = Some(Answer::Refusal { to, bytes, datagram });
        }
    }

    /// Which nodes have another configuration than this one, in words.
    pub(super) fn parted_by(&self, others: impl Iterator<Item = (Option<NodeIndex>, u64)>) -> String {
        speech::parted(&self.settings, others)
    }

    /// Sends the next that the window carries and that fits, a hello to this node before others; as how many bytes
    /// slots count it.
    pub(super) fn answer(
        &mut self,
        now_ns: u64,
        first: Option<NodeIndex>,
        tx_window: &TransmitWindow,
        local_ns: impl Fn() -> u64,
    ) -> Option<usize> {
        self.look(now_ns);
        // What was looked through before takes its time.
        let fits = |bytes| tx_window.fits(local_ns(), bytes);
        if let Some(hellos) = &mut self.hellos {
            let (said, datagram) = if fits(HELLO_SLOT_BYTES) { hellos.take(now_ns, first) } else { None }?;
            self.socket.answer(self.settings.nodes[usize::from(said.to)].address, &datagram);
            hellos.left(said);
            return Some(HELLO_SLOT_BYTES);
        }
        match self.refusal.take()? {
            Answer::Refusal { to, bytes, datagram } if tx_window.carries_refusal() && fits(bytes) => {
                self.socket.answer(to, &datagram[..bytes]);
                Some(bytes)
            }
            refusal => {
                self.refusal = Some(refusal);
                None
            }
        }
    }
}
