//! What the driver that receives has of the simulated computer.

use super::watch::{Came, Watch};
use crate::sim::station::Io;
use rohrpost_mailbox::Head;
use rohrpost_routers::driver::{ANSWERS, Answer, RxPlatform};
use rohrpost_routers::report::Deliver;
use std::collections::VecDeque;

pub(super) struct RxSystem<'a, 'b> {
    pub(super) io: &'a mut Io<'b>,
    /// The datagram that is being looked at.
    pub(super) came: Option<Came>,
    pub(super) is_young: bool,
    pub(super) undelivered: &'a mut Vec<Head>,
    pub(super) answers: &'a mut VecDeque<Answer>,
    pub(super) is_rung: &'a mut bool,
}

impl RxPlatform for RxSystem<'_, '_> {
    fn delivery(&mut self) -> impl Deliver {
        let Self { io, came, is_young, undelivered, .. } = self;
        Watch { io, came: *came, is_out: false, is_young: *is_young, undelivered }
    }

    fn answer(&mut self, answer: Answer) -> bool {
        match &answer {
            Answer::Refusal { .. } => self.io.oracle.saw("refused"),
            Answer::Hello { said, .. } if !said.is_reply => self.io.oracle.saw("asked"),
            Answer::Hello { .. } => {}
        }
        // Without slots it is sent at once.
        let has_room = self.io.plan.slots.is_none() || self.answers.len() < ANSWERS;
        if has_room {
            self.answers.push_back(answer);
        }
        has_room
    }

    fn ring(&mut self) {
        *self.is_rung = true;
    }
}
