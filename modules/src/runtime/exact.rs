//! A module that repeats what is in its journal. No other process takes part: what it is called with and told comes
//! from there, what it sends is compared and goes into mailboxes and streams of a node that it has for itself.

use super::context::Context;
use super::hosted::Hosted;
use super::received::Received;
use super::runner::Running;
use crate::journal::{JournalEvent, JournalReplay};
use crate::made::MadeModule;
use rohrpost_mailbox::{Ready, Watch};

impl<M: MadeModule> Running<M> {
    /// Whether it repeats a journal.
    pub(super) fn is_replayed(&self) -> bool {
        self.context.journal.is_replayed()
    }

    /// Does all that is in the journal, and ends the process with the result.
    pub(super) fn repeat(&mut self) -> ! {
        loop {
            let (next, before) = self.replay(|replay| (replay.next_event(), replay.events()));
            self.repeat_event(&next.event());
            if self.replay(|replay| replay.events()) == before {
                self.give_up("the module is called in a state in which this program does not call it");
            }
        }
    }

    fn replay<T>(&self, part: impl FnOnce(&mut JournalReplay) -> T) -> T {
        self.context.journal.replay(part).expect("only a module with a journal repeats it")
    }

    fn give_up(&self, why: &str) -> ! {
        self.replay(|replay| replay.give_up(why))
    }

    fn repeat_event(&mut self, event: &JournalEvent<'_>) {
        match *event {
            JournalEvent::New => self.give_up("the module is made twice in its journal"),
            JournalEvent::On => drop(self.life.turn_on(&mut self.context)),
            JournalEvent::Off => self.life.turn_off(&mut self.context),
            JournalEvent::Tick => {
                self.life.attempt(JournalEvent::Tick, &mut self.context, M::tick);
            }
            JournalEvent::Received { value, .. } => {
                let value = self.context.journal.bytes(value);
                let Some(received) = Received::of(event, &value) else { return };
                let part = |module: &mut M, context: &mut Context| module.received(context, &received);
                self.life.attempt(*event, &mut self.context, part);
            }
            JournalEvent::Function { endpoint, number, arguments } => {
                let mut reply = Vec::new();
                // What it says is compared by now.
                let _ = self.hosted(endpoint).function(number, arguments.0, &mut reply);
            }
            JournalEvent::Parameters { wish, by } => {
                let mut reply = Vec::new();
                let _ = self.hosted(0).set_parameters(wish.0, by, &mut reply);
            }
            JournalEvent::Ready { watch, readable, writable } => {
                let ready = Ready { watch: Watch::from_number(watch), readable, writable };
                let part = |module: &mut M, context: &mut Context| module.ready(context, ready);
                self.life.attempt(*event, &mut self.context, part);
            }
        }
    }

    fn hosted(&mut self, endpoint: u16) -> Hosted<'_, M> {
        let index = usize::from(endpoint);
        let Some(endpoint) = self.endpoints.get(index) else {
            self.give_up("it runs a function under a name that the module does not have here")
        };
        Hosted { index, offer: &endpoint.offer, life: &mut self.life, context: &mut self.context }
    }
}
