//! What a module may know of the command that it runs, besides the arguments.

use super::server::Command;
use crate::journal::{ModuleJournal, Question, Tag};
use rohrpost_mailbox::Name;
use std::cell::Cell;
use std::rc::Rc;

/// Of the command that is being run, or was run last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommandFacts {
    /// The module that sent it.
    pub from: Name,
    /// Run of that module: a later one on the same node has a higher number.
    pub incarnation: u32,
    /// The sender's own number of it, over all that it calls.
    pub sequence: u32,
    /// At least so long ago it was sent first, ns.
    pub age_ns: u64,
}

/// Tells of the command that is being run. See [`super::Context::running_command`].
#[derive(Clone)]
pub struct RunningCommand {
    facts: Rc<Cell<CommandFacts>>,
    journal: ModuleJournal,
}

/// As a journal has them.
type NotedFacts = (u32, u32, u32, u64);

impl RunningCommand {
    pub(super) fn new(journal: ModuleJournal) -> Self {
        let none = CommandFacts { from: Name::from_raw(0), incarnation: 0, sequence: 0, age_ns: 0 };
        Self { facts: Rc::new(Cell::new(none)), journal }
    }

    pub(super) fn begin(&self, command: &Command<'_>) {
        let Command { head, incarnation, sequence, age_ns, .. } = *command;
        self.facts.set(CommandFacts { from: head.from.module(), incarnation, sequence, age_ns });
    }

    /// Of the command that is being run; outside of one, of the last.
    pub fn get(&self) -> CommandFacts {
        let ask = || -> NotedFacts {
            let CommandFacts { from, incarnation, sequence, age_ns } = self.facts.get();
            (from.raw(), incarnation, sequence, age_ns)
        };
        let (from, incarnation, sequence, age_ns) = self.journal.answer(Tag::RunningCommand, Question::Plain, ask);
        CommandFacts { from: Name::from_raw(from), incarnation, sequence, age_ns }
    }
}
