//! What follows when a process has ended, and what is said about it.

use super::ending::{ChildShutdown, EndCause, Then};
use super::{Child, Phase, ProcessEnd, cut};
use crate::launch::policy::Next;
use crate::launch::repeats::Tell;
use rohrpost_config::Restart;
use rohrpost_mailbox::monotonic_ns;
use rohrpost_modules::common::OutputLevel;
use rohrpost_modules::runtime::StartError;
use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;
use std::time::Instant;

impl Child {
    /// The process has ended: again, or not, as was asked for, or as its policy has it.
    pub(super) fn ended(&mut self, status: ExitStatus, now: Instant) -> Option<String> {
        let how = match (status.code(), status.signal()) {
            (Some(code), _) => format!("ended with {code}"),
            (None, Some(signal)) => format!("was killed by signal {signal}"),
            (None, None) => "ended".to_owned(),
        };
        let told = self.ending.take();
        if told.is_none() && self.off_ns.is_some_and(|off_ns| monotonic_ns() >= off_ns) {
            self.printed.pass_on(false);
            return self.ended_as_told(Then::StandBy, false, &how, now);
        }
        let hang = match told {
            Some(ChildShutdown { cause: EndCause::Told(then), killed, .. }) => {
                self.printed.pass_on(false);
                return self.ended_as_told(then, killed.is_some(), &how, now);
            }
            Some(ChildShutdown { cause: EndCause::Hang(hang), .. }) => Some(hang),
            None => None,
        };
        // Modules that wait for its work expect it to go on as configured; but what a person has switched off stays
        // off.
        self.turn_on &= self.configured_on;
        let printed = self.printed.below();
        // Started again, it would find the same configuration, and the same program.
        let misconfigured = hang.is_none() && status.code() == Some(i32::from(StartError::CONFIGURATION));
        let is_hopeless = misconfigured || !self.has_joined && cannot_begin(status, &self.printed.last());
        // One that stood by has done no work yet: with any code, its end is none that it meant.
        let success = hang.is_none() && status.success() && self.phase != Phase::StandsBy;
        let next = if is_hopeless || self.last_incarnation { Next::Stay } else { self.policy.ended(success, now) };
        let how = match hang {
            Some(hang) => format!("{hang}, and {how}"),
            None if is_hopeless => format!("{how}; not started again, since that would end in the same way"),
            None => how,
        };
        self.follow(next, &ProcessEnd { is_success: success, how: &how, errno: None, printed: &printed }, now)
    }

    /// What follows an end of its own accord; what there is to say about it.
    pub(super) fn follow(&mut self, next: Next, end: &ProcessEnd<'_>, now: Instant) -> Option<String> {
        let ProcessEnd { is_success: success, how, errno, printed } = *end;
        self.last_end = format!("{how}{printed}");
        let (told, tell) = match next {
            Next::Stay => {
                self.rest(if success { Phase::Ended } else { Phase::Failed });
                (how.to_owned(), self.repeats.is_over())
            }
            Next::GivenUp => {
                let Restart { at_most, within, .. } = self.policy.restart();
                self.rest(Phase::Failed);
                let told = format!("{how}; given up after {at_most} restarts within {within:?}");
                self.last_end = format!("{told}{printed}");
                (told, self.repeats.is_over())
            }
            Next::Again(pause) => {
                self.restarts += 1;
                self.begin_waiting(now + pause);
                let tell = self.repeats.ended(self.policy.in_a_row(), &self.last_end, now);
                (format!("{how}; starts again in {pause:?}"), tell)
            }
        };
        self.health.ended((!success).then_some(&self.last_end));
        let (told, below) = match tell {
            Tell::Whole(0) => (told, format!("{printed}{}", self.printed.trace_below())),
            Tell::Whole(untold) => {
                (format!("{told} ({})", unsaid(untold)), format!("{printed}{}", self.printed.trace_below()))
            }
            Tell::AsBefore => (format!("{told}; as before"), String::new()),
            Tell::Sum(times, within) => {
                let last = self.printed.last();
                let words = if last.is_empty() { String::new() } else { format!("; its last words: {}", cut(&last)) };
                let row = self.policy.in_a_row();
                self.printed.drop_quiet(now);
                (format!("{told} ({times} times in {within:.1?}, {row} in a row{words})"), String::new())
            }
            Tell::Nothing => {
                self.printed.drop_quiet(now);
                self.printed.pass_on(!success);
                return None;
            }
        };
        self.printed.pass_on(!success);
        if !success {
            self.printed.say(OutputLevel::Error, &told, errno);
        }
        Some(format!("{} {told}{below}", self.text))
    }
}

/// Whether a process that never became a module can become none as its program is now. Of a program that its
/// interpreter cannot read, that misses a package or uses one as it must not, the interpreter's exit code does not
/// tell; its last line does.
fn cannot_begin(status: ExitStatus, last_line: &str) -> bool {
    const CLASSES: [&str; 7] = [
        "SyntaxError",
        "IndentationError",
        "TabError",
        "ModuleNotFoundError",
        "ImportError",
        "rohrpost.errors.Misuse",
        "rohrpost.errors.Misconfigured",
    ];
    let error = last_line.split_once(':').map_or("", |(class, _)| class.trim());
    match status.code() {
        Some(1) => CLASSES.contains(&error),
        // Of a shell, `env` and the loader of programs: a program or a library is not there.
        Some(127) => true,
        _ => false,
    }
}

/// That ends were not told.
fn unsaid(ends: u32) -> String {
    if ends == 1 { "1 end before it was not told".into() } else { format!("{ends} ends before it were not told") }
}
