//! The very core as a robot of the model.

use super::super::Team;
use super::bounds::{Bounds, Loss, Store};
use super::key::Key;
use super::promises;
use super::team::{MAP, Message, settings};
use super::world::{Robot, Step, Teams};
use stateright::Property;

impl Robot for Team {
    type Message = Message;
    const ANSWERS: bool = false;
    const ARE_ALIKE: bool = true;

    fn restarted(&self, store: Store) -> Self {
        let incarnation = match store {
            Store::Kept => self.incarnation() + 1,
            Store::Lost => self.incarnation(),
            Store::Old => self.incarnation() - 1,
        };
        Self::new(self.group().me(), incarnation, MAP, settings())
    }

    fn beat(&mut self, now_ns: u64) -> Vec<Message> {
        let beat = Self::beat(self, now_ns, None);
        let records = [beat.objects, beat.synchro].into_iter().flatten().map(Message::Records);
        records.chain([Message::Hello(beat.hello)]).collect()
    }

    fn hear(&mut self, now_ns: u64, message: &Message) -> Option<Message> {
        match message {
            Message::Hello(hello) => self.hear_hello(now_ns, hello),
            Message::Records(records) => self.hear_records(now_ns, records.clone()),
        }
        None
    }

    fn may_be_lost(message: &Message, loss: Loss) -> bool {
        match loss {
            Loss::Nothing => false,
            Loss::Records => matches!(message, Message::Records(_)),
            Loss::Anything => true,
        }
    }

    fn incarnation(&self) -> u32 {
        self.group().version().incarnation
    }

    fn key(&self, now_ns: u64, key: &mut Key) {
        Self::key(self, now_ns, key);
    }

    fn message_key(message: &Message, key: &mut Key) {
        match message {
            Message::Hello(hello) => hello.key(key),
            Message::Records(records) => records.key(key),
        }
    }

    fn broken(step: &Step<'_, Self>) -> Vec<&'static str> {
        promises::broken(step)
    }

    fn properties(bounds: Bounds) -> Vec<Property<Teams<Self>>> {
        promises::properties(bounds)
    }
}
