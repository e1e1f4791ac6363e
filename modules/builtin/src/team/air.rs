//! Messages between this module and its teammates: which data number each kind has, and the robot that each names.

use rohrpost_mailbox::{ALL_SYSTEMS, Name, Shape};
use rohrpost_modules::ModuleError;
use rohrpost_modules::common::DataHead;
use rohrpost_modules::interfaces::TeamCounts;
use rohrpost_modules::runtime::{Context, Received};
use rohrpost_payload::sender;
use rohrpost_team::RobotId;
use rohrpost_team::view::RECORDS_BYTES_MAX;

/// Mailbox for messages of teammates: local id 3.
pub(super) const MESSAGES: u8 = 3;
/// Data numbers of the messages; 1 is the state.
pub(super) const HELLO: u16 = 2;
pub(super) const RECORDS: u16 = 3;
/// Messages that may wait: several beats of a large team.
pub(super) const SLOTS: u16 = 256;
/// Data numbers of messages that a module `team` does not send.
const TRAFFIC: u16 = 4;
const EVENT: u16 = 5;

/// The way to teammates: modules of the same class and instance in all systems.
pub(crate) struct Air {
    me: RobotId,
    to: Name,
    pub(crate) counts: TeamCounts,
}

impl Air {
    /// Opens the mailbox for messages.
    ///
    /// # Errors
    /// There is no room for it, or its system has no number.
    pub(crate) fn open(context: &mut Context) -> Result<Self, ModuleError> {
        let name = context.me();
        let me = RobotId::new(name.system()).ok_or_else(|| ModuleError::configuration("its system has no number"))?;
        let body_bytes_max = (DataHead::BYTES + RECORDS_BYTES_MAX) as u16;
        context.open_mailbox_to_all(MESSAGES, Shape { slots: SLOTS, body_bytes_max, ..Shape::default() })?;
        let to = Name::new(ALL_SYSTEMS, name.class().0, name.instance(), MESSAGES);
        Ok(Self { me, to, counts: TeamCounts::default() })
    }

    /// This robot or station.
    pub(crate) fn me(&self) -> RobotId {
        self.me
    }

    /// Sends each of these messages, whatever becomes of one; why the last that did not leave did not.
    pub(crate) fn send(&mut self, context: &Context, messages: Vec<Vec<u8>>) -> Option<String> {
        let mut trouble = None;
        let counts = &mut self.counts;
        for message in messages {
            let (number, count) = match message.first() {
                Some(b'H') => (HELLO, Some(&mut counts.hellos_sent)),
                Some(b'R') if message.get(4) == Some(&1) => (RECORDS, Some(&mut counts.synchros_sent)),
                Some(b'R') => (RECORDS, Some(&mut counts.records_sent)),
                Some(b'T') => (TRAFFIC, None),
                _ => (EVENT, None),
            };
            match (context.send_data(self.to, number, &message), count) {
                (Ok(()), Some(count)) => *count += 1,
                (Ok(()), None) => {}
                (Err(error), _) => {
                    counts.unsent += 1;
                    trouble = Some(format!("teammates do not hear it: {error}"));
                }
            }
        }
        trouble
    }

    /// Whether data are a message of a teammate.
    pub(crate) fn is_message(&self, data: &Received<'_>) -> bool {
        data.from.class() == self.to.class() && data.mailbox == MESSAGES
    }

    /// Hands a message on; one that is none, or in the name of another robot than its sender, is counted.
    pub(crate) fn hear(&mut self, data: &Received<'_>, take: impl FnOnce(&[u8]) -> bool) {
        let is_own = data.from.system() == self.me.get();
        let is_senders = sender(data.value).is_some_and(|from| from.get() == data.from.system());
        // Of messages in its own name it takes hellos alone: they tell that another robot has the same number.
        if is_own && data.number != HELLO {
            return;
        }
        match (is_senders && take(data.value), data.number) {
            (false, _) => self.counts.malformed += 1,
            (true, HELLO) => self.counts.hellos_heard += u64::from(!is_own),
            (true, RECORDS) => self.counts.records_heard += 1,
            _ => {}
        }
    }
}
