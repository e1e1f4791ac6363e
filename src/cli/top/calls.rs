//! What `top` asks for: to switch modules on and off, what was said, why a module is in error. Nothing here waits:
//! calls are begun, and looked after each time round, so that a module that hangs freezes no screen.

use super::super::target::Running;
use rohrpost::CallError;
use rohrpost::common::{self, Status};
use rohrpost::interfaces::{CollectorInterface, Page};
use rohrpost::macro_support::{append, from_bytes};
use rohrpost::{Name, ToolLink};
use std::time::Duration;

/// An answer comes within this time, or it does not come.
pub(super) const PATIENCE: Duration = Duration::from_secs(1);

/// A call that is under way.
struct Call {
    sequence: u32,
    to: Name,
    wants: Wants,
}

/// What its answer is for.
enum Wants {
    Switch(bool),
    Lines,
    Why,
}

/// What came of a call.
pub(super) enum Answer {
    Switched(Name, bool, Result<(), String>),
    Lines(Result<Page, String>),
    Why(Name, String),
}

/// Top's place among those that call.
pub(super) struct Calls {
    tool: ToolLink,
    under_way: Vec<Call>,
}

impl Calls {
    /// Takes part as a tool.
    pub(super) fn join(running: &Running) -> Result<Self, super::Failure> {
        Ok(Self { tool: running.join(PATIENCE)?, under_way: Vec::new() })
    }

    /// Gives the place back.
    pub(super) fn close(self) {
        self.tool.close();
    }

    pub(super) fn switch(&mut self, running: &Running, module: Name, on: bool) -> Option<Answer> {
        let begun = self.tool.begin_switch(module, on);
        self.begun(running, module, Wants::Switch(on), begun)
    }

    /// Asks the collector for the lines from this number on.
    pub(super) fn lines(&mut self, running: &Running, collector: Name, from: u64) -> Option<Answer> {
        if self.under_way.iter().any(|call| matches!(call.wants, Wants::Lines)) {
            return None;
        }
        let write = |body: &mut Vec<u8>| append(body, &(from,));
        let function = super::super::log::LINES_FROM;
        let begun = self.tool.link.begin(collector, function, CollectorInterface::hash(), PATIENCE, write);
        self.begun(running, collector, Wants::Lines, begun)
    }

    /// Asks a module in error why.
    pub(super) fn why(&mut self, running: &Running, module: Name) -> Option<Answer> {
        let begun = self.tool.link.begin(module, common::STATUS, common::HASH, PATIENCE, |_| Ok(()));
        self.begun(running, module, Wants::Why, begun)
    }

    /// Keeps a call that was begun; one that could not be is answered by that.
    fn begun(&mut self, running: &Running, to: Name, wants: Wants, begun: Result<u32, CallError>) -> Option<Answer> {
        match begun {
            Ok(sequence) => {
                self.under_way.push(Call { sequence, to, wants });
                None
            }
            Err(error) => failed(running, to, wants, &error),
        }
    }

    /// Whether answers are awaited.
    pub(super) fn waits(&self) -> bool {
        !self.under_way.is_empty()
    }

    /// The answers that have come, and the calls whose time is over.
    pub(super) fn poll(&mut self, running: &Running) -> Vec<Answer> {
        self.tool.link.collect();
        let mut answers = Vec::new();
        for call in std::mem::take(&mut self.under_way) {
            let Some(outcome) = self.tool.link.poll_for(call.sequence, |bytes| Ok(bytes.to_vec())) else {
                self.under_way.push(call);
                continue;
            };
            answers.extend(match outcome {
                Ok(bytes) => answer(running, call.to, call.wants, &bytes),
                Err(error) => failed(running, call.to, call.wants, &error),
            });
        }
        answers
    }
}

fn answer(running: &Running, to: Name, wants: Wants, bytes: &[u8]) -> Option<Answer> {
    match wants {
        Wants::Switch(on) => Some(Answer::Switched(to, on, Ok(()))),
        Wants::Lines => match from_bytes::<Page>(bytes) {
            Ok(page) => Some(Answer::Lines(Ok(page))),
            Err(error) => failed(running, to, wants, &CallError::BadReply(to, error.to_string())),
        },
        Wants::Why => from_bytes::<Status>(bytes).ok().map(|status| Answer::Why(to, status.error)),
    }
}

/// What a call that failed comes to. Why a module is in error is asked again the next time; that alone is not told.
fn failed(running: &Running, to: Name, wants: Wants, error: &CallError) -> Option<Answer> {
    let told = match error {
        CallError::Timeout(..) => format!("{}: no answer within {} s", running.text(to), PATIENCE.as_secs()),
        error => running.told(to, error).to_string(),
    };
    match wants {
        Wants::Switch(on) => Some(Answer::Switched(to, on, Err(told))),
        Wants::Lines => Some(Answer::Lines(Err(told))),
        Wants::Why => None,
    }
}
