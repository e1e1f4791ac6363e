//! Answers of modules that are played: those that were recorded for the same commands.

use rohrpost::Fault;
use rohrpost::interface::StandInCommand;
use rohrpost::output::plain::line;
use rohrpost_modules::journal::{NotedAnswer, NotedOutcome};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// What modules have answered.
#[derive(Default, Serialize, Deserialize)]
pub struct JournalAnswers {
    /// Names of modules of which the files have a journal, from its beginning on.
    pub names: BTreeSet<String>,
    /// Names of modules of which a journal cannot be read, and why.
    pub unreadable: BTreeMap<String, String>,
    /// Names under which commands came, in the order of each journal.
    pub answers: Vec<(String, NotedAnswer)>,
}

/// A command: to which name, which function, and with which arguments.
type CommandKey = (String, u16, Vec<u8>);

/// Answers by command.
#[derive(Default)]
pub(super) struct PlayedAnswers {
    /// Names of modules that have a journal.
    names: BTreeSet<String>,
    /// Names of those of which it cannot be read, and why.
    unreadable: BTreeMap<String, String>,
    by_command: BTreeMap<CommandKey, Vec<(u64, NotedOutcome)>>,
}

impl PlayedAnswers {
    pub(super) fn new(recorded: JournalAnswers) -> Self {
        let mut by_command: BTreeMap<CommandKey, Vec<(u64, NotedOutcome)>> = BTreeMap::new();
        for (name, NotedAnswer { function, arguments, at_ns, outcome, .. }) in recorded.answers {
            by_command.entry((name, function, arguments.0)).or_default().push((at_ns, outcome));
        }
        Self { names: recorded.names, unreadable: recorded.unreadable, by_command }
    }

    /// What the module of this name answered to the same command at the time that is nearest to this one: postcard of
    /// the result.
    pub(super) fn find(&self, name: &str, command: &StandInCommand<'_>, now_ns: u64) -> Result<&[u8], Fault> {
        let refused = |why: &str| {
            let instead = format!("`rohrpost replay --run {name}` runs it instead");
            Fault::ModuleError(format!("{name} is played from a recording and {why}; {instead}"))
        };
        let key = (name.to_owned(), command.number, command.arguments.to_vec());
        let answers = self.by_command.get(&key).map(Vec::as_slice).unwrap_or_default();
        match answers.iter().min_by_key(|(at_ns, _)| at_ns.abs_diff(now_ns)) {
            Some((_, NotedOutcome::Result(bytes))) => Ok(bytes),
            Some((_, NotedOutcome::Fault(text))) => {
                Err(Fault::ModuleError(format!("as it was recorded: {}", line(text))))
            }
            Some((_, NotedOutcome::Long(len))) => {
                Err(refused(&format!("has no answer: that of {len} bytes was more than a journal keeps")))
            }
            None if self.names.contains(name) => {
                Err(refused("has no answer: its journal has no such command with these arguments"))
            }
            None => Err(match self.unreadable.get(name) {
                Some(why) => refused(&format!("takes no commands: {}", line(why))),
                None => refused(
                    "takes no commands: the journal that would have its answers is not recorded; name it in `exact` \
                     of [record]",
                ),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost::Name;

    #[test]
    fn a_command_gets_the_answer_that_is_nearest_or_a_fault_that_says_why() {
        let answer = |at_ns, arguments: &[u8], outcome| {
            let arguments = arguments.to_vec().into();
            ("motor.0".to_owned(), NotedAnswer { endpoint: 0, function: 16, arguments, at_ns, outcome })
        };
        let result = |text: &str| NotedOutcome::Result(text.as_bytes().to_vec().into());
        let answers = PlayedAnswers::new(JournalAnswers {
            names: ["motor.0".to_owned()].into(),
            unreadable: [("arm.0".to_owned(), "its journal began late\nFORGED".to_owned())].into(),
            answers: vec![
                answer(100, b"a", result("early")),
                answer(200, b"a", result("late")),
                answer(150, b"b", NotedOutcome::Fault("too fast".into())),
                answer(150, b"c", NotedOutcome::Long(9_000)),
            ],
        });
        let find = |name: &str, number, arguments: &[u8], now_ns| {
            let command = StandInCommand { to: Name::NONE, number, arguments };
            match answers.find(name, &command, now_ns) {
                Ok(bytes) => String::from_utf8_lossy(bytes).into_owned(),
                Err(fault) => fault.to_string(),
            }
        };
        for (now_ns, found) in [(0, "early"), (100, "early"), (149, "early"), (151, "late"), (9_999, "late")] {
            assert_eq!(find("motor.0", 16, b"a", now_ns), found, "{now_ns}");
        }
        for (name, number, arguments, told) in [
            ("motor.0", 16, b"b", "as it was recorded: too fast"),
            ("motor.0", 16, b"c", "that of 9000 bytes was more than a journal keeps"),
            ("motor.0", 16, b"d", "motor.0 is played from a recording and has no answer: its journal has no such"),
            ("motor.0", 17, b"a", "motor.0 is played from a recording and has no answer: its journal has no such"),
            ("laser.0", 16, b"a", "laser.0 is played from a recording and takes no commands: the journal that would"),
            ("arm.0", 16, b"a", "arm.0 is played from a recording and takes no commands: its journal began late\\nF"),
        ] {
            let found = find(name, number, arguments, 150);
            assert!(found.contains(told), "{found}");
        }
    }
}
