//! The calls of `top`: to switch modules on and off, for output lines, for the causes of errors. Nothing here blocks:
//! calls are begun, and polled in each round, so that a module that hangs freezes no screen.

use crate::look::control::STATE;
use crate::look::observer::{PATIENCE, Silence, Tool, silence};
use crate::look::target::Running;
use rohrpost::CallError;
use rohrpost::Name;
use rohrpost::common::{self, Status};
use rohrpost::interfaces::{CollectorInterface, ControlState, Page, SupervisorInterface};
use rohrpost::wire::{append, from_bytes};
use rohrpost_launch::launcher::{AskLaunch, ControlError, SnapshotRequest, launcher_of};
use rohrpost_launch::survey::{Distant, Scope, Snapshot, Survey};

struct Call {
    sequence: u32,
    to: Name,
    purpose: Purpose,
}

enum Purpose {
    Switch(bool),
    Lines,
    Why,
    Control,
    Restart(Name),
}

/// The result of a call.
pub(super) enum Answer {
    /// What came of a key.
    Done(String),
    Lines(Result<Page, String>),
    Why(Name, String),
    /// How it stands with a motor, by its supervisor.
    Control(Name, ControlState),
    /// Another node's report, or why it does not answer.
    Snapshot(String, Result<Survey, Silence>),
}

/// The place of `top` among the callers.
pub(super) struct Calls {
    tool: Tool,
    under_way: Vec<Call>,
    /// Observes other nodes.
    looks: Vec<(String, Distant)>,
}

impl Calls {
    /// Takes part as a tool.
    pub(super) fn join(running: &Running) -> Result<Self, crate::terminal::Failure> {
        Ok(Self { tool: running.join(PATIENCE)?, under_way: Vec::new(), looks: Vec::new() })
    }

    pub(super) fn switch(&mut self, running: &Running, module: Name, on: bool) -> Option<Answer> {
        let begun = self.tool.begin_switch(module, on);
        self.begun(running, module, Purpose::Switch(on), begun)
    }

    /// Asks the collector for the lines from this number on.
    pub(super) fn lines(&mut self, running: &Running, collector: Name, from: u64) -> Option<Answer> {
        if self.under_way.iter().any(|call| matches!(call.purpose, Purpose::Lines)) {
            return None;
        }
        let write = |body: &mut Vec<u8>| append(body, &(from,));
        let function = crate::running::log::LINES_FROM;
        let begun = self.tool.begin(collector, function, CollectorInterface::hash(), write);
        self.begun(running, collector, Purpose::Lines, begun)
    }

    pub(super) fn restart(&mut self, running: &Running, module: Name) -> Option<Answer> {
        let launcher = running.launcher_of(module).unwrap_or(self.tool.launcher());
        let begun = self.tool.begin_restart(launcher, &running.text(module));
        self.begun(running, launcher, Purpose::Restart(module), begun)
    }

    /// Begins to observe other nodes, except those with an unfinished request.
    pub(super) fn look(&mut self, running: &Running, nodes: &[&str]) {
        for node in nodes {
            let launcher = launcher_of(&running.installation, node);
            let Some(launcher) = launcher.filter(|_| self.looks.iter().all(|(known, _)| known != node)) else {
                continue;
            };
            let distant = Distant::new(launcher, SnapshotRequest::Survey(Scope::All), PATIENCE, nodes.len());
            self.looks.push(((*node).into(), distant));
        }
    }

    /// Asks a module in error for the cause.
    pub(super) fn why(&mut self, running: &Running, module: Name) -> Option<Answer> {
        let begun = self.tool.begin(module, common::STATUS, common::HASH, |_| Ok(()));
        self.begun(running, module, Purpose::Why, begun)
    }

    /// Asks a supervisor how it stands with its motor.
    pub(super) fn control(&mut self, running: &Running, supervisor: Name) -> Option<Answer> {
        let begun = self.tool.begin(supervisor, STATE, SupervisorInterface::hash(), |_| Ok(()));
        self.begun(running, supervisor, Purpose::Control, begun)
    }

    /// Records a call that was begun; a call that could not begin gets its error as the answer.
    fn begun(
        &mut self,
        running: &Running,
        to: Name,
        purpose: Purpose,
        begun: Result<u32, CallError>,
    ) -> Option<Answer> {
        match begun {
            Ok(sequence) => {
                self.under_way.push(Call { sequence, to, purpose });
                None
            }
            Err(error) => failed(running, to, purpose, &error),
        }
    }

    /// Whether any answer is outstanding.
    pub(super) fn waits(&self) -> bool {
        !self.under_way.is_empty() || !self.looks.is_empty()
    }

    /// The answers that arrived, and the calls that timed out.
    pub(super) fn poll(&mut self, running: &Running) -> Vec<Answer> {
        self.tool.link.collect();
        let mut answers = Vec::new();
        for call in std::mem::take(&mut self.under_way) {
            let Some(outcome) = self.tool.link.poll_for(call.sequence, |bytes| Ok(bytes.to_vec())) else {
                self.under_way.push(call);
                continue;
            };
            answers.extend(match outcome {
                Ok(bytes) => self.answer(running, call.to, call.purpose, &bytes),
                Err(error) => failed(running, call.to, call.purpose, &error),
            });
        }
        for (node, mut look) in std::mem::take(&mut self.looks) {
            match look.poll(&mut self.tool.link) {
                None => self.looks.push((node, look)),
                Some(Ok(Snapshot::Survey(survey))) => answers.push(Answer::Snapshot(node, Ok(*survey))),
                // This call requested no data.
                Some(Ok(Snapshot::Mailbox(_))) => {}
                Some(Err(failure)) => {
                    let silence = silence(&running.installation, &node, &failure);
                    answers.push(Answer::Snapshot(node, Err(silence)));
                }
            }
        }
        answers
    }

    fn answer(&mut self, running: &Running, to: Name, purpose: Purpose, bytes: &[u8]) -> Option<Answer> {
        let unread = |error: &dyn std::fmt::Display| CallError::BadReply(to, error.to_string());
        match purpose {
            Purpose::Switch(on) => {
                Some(Answer::Done(format!("{} is {}", running.text(to), if on { "on" } else { "off" })))
            }
            Purpose::Lines => match from_bytes::<Page>(bytes) {
                Ok(page) => Some(Answer::Lines(Ok(page))),
                Err(error) => failed(running, to, purpose, &unread(&error)),
            },
            Purpose::Why => from_bytes::<Status>(bytes).ok().map(|status| Answer::Why(to, status.error)),
            Purpose::Control => from_bytes(bytes).ok().map(|state| Answer::Control(to, state)),
            Purpose::Restart(module) => match from_bytes::<Result<u32, ControlError>>(bytes) {
                Ok(Ok(_)) => Some(Answer::Done(format!("{} is being restarted", running.text(module)))),
                Ok(Err(error)) => Some(Answer::Done(error.to_string())),
                Err(error) => failed(running, to, purpose, &unread(&error)),
            },
        }
    }
}

/// The result of a failed call. Periodic queries report nothing; a failure is shown only for a call that a key started.
fn failed(running: &Running, to: Name, purpose: Purpose, error: &CallError) -> Option<Answer> {
    let asked = match purpose {
        Purpose::Restart(_) => "launch".into(),
        _ => running.text(to),
    };
    let told = match error {
        CallError::Timeout(..) => format!("{asked}: no answer within {} s", PATIENCE.as_secs()),
        error => error.to_string().replace(&to.to_string(), &asked),
    };
    match purpose {
        Purpose::Switch(_) | Purpose::Restart(_) => Some(Answer::Done(told)),
        Purpose::Lines => Some(Answer::Lines(Err(told))),
        Purpose::Why | Purpose::Control => None,
    }
}
