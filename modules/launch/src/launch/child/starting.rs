//! The start of a module's process.

use super::process::ModuleProcess;
use super::{Child, Mailboxes, Phase, ProcessEnd};
use crate::launch::policy::STEADY;
use rohrpost_config::Standby;
use rohrpost_mailbox::Node;
use std::io;
use std::time::Instant;

impl Child {
    /// Starts the process; what there is to say if that fails. That is an end without success: the program may be
    /// replaced just now, or the computer be short of something for moments.
    pub(in crate::launch) fn spawn(&mut self, node: &Node, now: Instant) -> Option<String> {
        match self.try_spawn(node, now) {
            Ok(process) => {
                (self.process, self.has_joined) = (Some(process), false);
                self.phase = if self.stands_by { Phase::StandsBy } else { Phase::Starting };
                self.since = now;
                // It was of the lease before, if this process stands by.
                self.off_ns = self.off_ns.filter(|_| !self.stands_by);
                self.was_on = false;
                self.mailboxes = Mailboxes::Used;
                self.lives += 1;
                None
            }
            Err(error) => {
                let how = format!("could not be started: {}: {error}", self.program.path().display());
                let next = self.policy.ended(false, now);
                let errno = error.raw_os_error().and_then(|number| u16::try_from(number).ok());
                self.follow(next, &ProcessEnd { is_success: false, how: &how, errno, printed: "" }, now)
            }
        }
    }

    fn try_spawn(&mut self, node: &Node, now: Instant) -> io::Result<ModuleProcess> {
        // First: if nobody reads what it prints, a process is stuck as soon as the pipe is full.
        let quiet = self.repeats.is_quiet().then_some(STEADY);
        let pipes = self.printed.begin(quiet.map(|quiet| now + quiet))?;
        // Of a module that has ended by itself others expect that it works, and what waits in its mailboxes comes
        // before any word of launch's: so it switches itself on, and so does one that takes over. At the first start
        // launch does, when all are ready.
        let switches_itself_on = (self.lives > 0 || self.stands_by) && self.turn_on;
        let before = node.next_incarnation();
        let started = self.program.spawn(switches_itself_on, self.restarts, quiet, pipes)?;
        Ok(ModuleProcess::new(self.name, started, before))
    }

    pub(super) fn may_spawn(&self, now: Instant) -> bool {
        self.process.is_none() && now >= self.since && !self.last_incarnation && !self.has_left_mailboxes()
    }

    /// Whether it is to be started when its time has come.
    pub(super) fn may_be_due(&self) -> bool {
        self.process.is_none() && !self.last_incarnation && (self.phase == Phase::Waiting || self.wants_standby())
    }

    /// Whether its process is to be there although another node runs it.
    pub(super) fn wants_standby(&self) -> bool {
        self.phase == Phase::StandsBy && self.standby == Standby::Hot
    }
}
