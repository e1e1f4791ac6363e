//! Commands that a module ran, with its answers: for a player that stands in for it.

use super::entry::Entries;
use super::event::{EventAt, JournalEvent};
use super::outputs::NotedReply;
use super::run::{ExactRun, RunError};
use super::tag::Tag;
use super::value::NotedValue;
use rohrpost_schema::Bytes;
use serde::{Deserialize, Serialize};
use std::io::Read;

/// A command that a module ran, and its answer.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct NotedAnswer {
    /// Under which of the module's names it came: their order is that of [`rohrpost_config::Module::names`].
    pub endpoint: u16,
    /// Its number.
    pub function: u16,
    /// Postcard of all arguments.
    pub arguments: Bytes,
    /// When it ran, in the node's time, ns since 1970.
    pub at_ns: u64,
    /// What came of it.
    pub outcome: NotedOutcome,
}

/// What came of a command.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum NotedOutcome {
    /// Postcard of the result.
    Result(Bytes),
    /// It was refused, in words.
    Fault(String),
    /// The result had so many bytes: more than a journal keeps.
    Long(u64),
}

impl ExactRun {
    /// Gives the commands that the module has answered, as far as the journal can be read, in their order, and until
    /// `take` says false.
    ///
    /// # Errors
    /// The journal's file cannot be opened.
    pub fn each_answer(&self, take: impl FnMut(NotedAnswer) -> bool) -> Result<(), RunError> {
        each(Entries::new(self.open()?), take);
        Ok(())
    }
}

impl NotedAnswer {
    /// Bytes that it takes, about.
    pub fn bytes(&self) -> usize {
        let outcome = match &self.outcome {
            NotedOutcome::Result(bytes) => bytes.0.len(),
            NotedOutcome::Fault(text) => text.len(),
            NotedOutcome::Long(_) => 0,
        };
        size_of::<Self>() + self.arguments.0.len() + outcome
    }
}

fn each<R: Read>(mut entries: Entries<R>, mut take: impl FnMut(NotedAnswer) -> bool) {
    let mut command = None;
    while let Ok(tag) = entries.look() {
        match tag {
            Tag::Event => command = command_of(entries.content()),
            Tag::Replied => {
                let answer = command.take().and_then(|command| answered(command, entries.content()));
                if answer.is_some_and(|answer| !take(answer)) {
                    return;
                }
            }
            _ => {}
        }
        entries.pass();
    }
}

/// A command without its answer, if the event is one.
fn command_of(content: &[u8]) -> Option<NotedAnswer> {
    let EventAt { at_ns, event } = postcard::from_bytes(content).ok()?;
    let JournalEvent::Function { endpoint, number: function, arguments } = event else { return None };
    let outcome = NotedOutcome::Long(0);
    Some(NotedAnswer { endpoint, function, arguments: arguments.0.to_vec().into(), at_ns, outcome })
}

fn answered(command: NotedAnswer, content: &[u8]) -> Option<NotedAnswer> {
    let NotedReply { is_fault, result } = postcard::from_bytes(content).ok()?;
    let outcome = match (is_fault, result) {
        (false, NotedValue::Whole(bytes)) => NotedOutcome::Result(bytes.0.to_vec().into()),
        (false, NotedValue::Sum(sum)) => NotedOutcome::Long(sum.len),
        (true, NotedValue::Whole(bytes)) => NotedOutcome::Fault(String::from_utf8_lossy(bytes.0).into_owned()),
        (true, NotedValue::Sum(sum)) => NotedOutcome::Fault(format!("a text of {} bytes", sum.len)),
    };
    Some(NotedAnswer { outcome, ..command })
}

#[cfg(test)]
mod tests {
    use super::super::bytes::Blob;
    use super::super::entry::append;
    use super::*;

    /// Appends entries as a module's journal has them.
    struct JournalBytes(Vec<u8>, u32);

    impl JournalBytes {
        fn add(&mut self, tag: Tag, content: &impl Serialize) {
            self.1 = append(&mut self.0, self.1, tag, content).unwrap();
        }

        fn call(&mut self, at_ns: u64, arguments: &[u8]) {
            let event = JournalEvent::Function { endpoint: 1, number: 16, arguments: Blob(arguments) };
            self.add(Tag::Event, &EventAt { at_ns, event });
        }

        fn reply(&mut self, is_fault: bool, result: &[u8]) {
            self.add(Tag::Replied, &NotedReply { is_fault, result: NotedValue::of(result) });
        }
    }

    #[test]
    fn commands_have_the_answers_that_follow_them() {
        let mut journal = JournalBytes(Vec::new(), 0);
        journal.call(5, b"a");
        journal.add(Tag::Time, &7u64);
        journal.reply(false, b"one");
        journal.call(6, b"b");
        journal.reply(true, b"not now");
        journal.call(7, b"c");
        journal.reply(false, &[0; 5_000]);
        // Of something else, and of what has no answer.
        journal.add(Tag::Event, &EventAt { at_ns: 8, event: JournalEvent::Tick });
        journal.reply(false, b"no command");
        journal.call(9, b"d");
        let run = |journal: &[u8]| {
            let mut answers = Vec::new();
            each(Entries::new(journal), |answer| {
                answers.push(answer);
                true
            });
            answers
        };
        let answer = |at_ns, arguments: &[u8], outcome| NotedAnswer {
            endpoint: 1,
            function: 16,
            arguments: arguments.to_vec().into(),
            at_ns,
            outcome,
        };
        let all = [
            answer(5, b"a", NotedOutcome::Result(b"one".to_vec().into())),
            answer(6, b"b", NotedOutcome::Fault("not now".into())),
            answer(7, b"c", NotedOutcome::Long(5_000)),
        ];
        assert_eq!(run(&journal.0), all);
        // Cut off, it has those before the cut.
        for len in 0..journal.0.len() {
            let read = run(&journal.0[..len]);
            assert_eq!(read, all[..read.len()], "{len} bytes");
        }
    }
}
