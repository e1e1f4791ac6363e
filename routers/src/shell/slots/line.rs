//! What waits for a slot besides time and packages: refusals where nothing is sealed, else hellos.

use super::super::socket::InSocket;
use super::Answer;
use crate::frame::NodeIndex;
use crate::security::{HELLO_SLOT_BYTES, Waiting};
use crate::settings::Settings;
use std::sync::Arc;
use std::sync::mpsc::Receiver;

/// In the hands of the thread that sends.
pub(in crate::shell) struct Line {
    answers: Receiver<Answer>,
    /// The refusal whose turn is next.
    refusal: Option<Answer>,
    /// Where all is sealed.
    hellos: Option<Waiting>,
    /// By which they leave.
    socket: Arc<InSocket>,
    settings: Arc<Settings>,
}

impl Line {
    pub(in crate::shell) fn new(
        answers: Receiver<Answer>,
        hellos: Option<Waiting>,
        socket: Arc<InSocket>,
        settings: Arc<Settings>,
    ) -> Self {
        Self { answers, refusal: None, hellos, socket, settings }
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

    /// Sends the next that fits, a hello to this node before others; as how many bytes slots count it.
    pub(super) fn answer(
        &mut self,
        now_ns: u64,
        first: Option<NodeIndex>,
        fits: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        self.look(now_ns);
        if let Some(hellos) = &mut self.hellos {
            let (said, datagram) = if fits(HELLO_SLOT_BYTES) { hellos.take(now_ns, first) } else { None }?;
            self.socket.answer(self.settings.nodes[usize::from(said.to)].address, &datagram);
            hellos.left(said);
            return Some(HELLO_SLOT_BYTES);
        }
        match self.refusal.take()? {
            Answer::Refusal { to, bytes, datagram } if fits(bytes) => {
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
