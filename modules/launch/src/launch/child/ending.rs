//! A process on its way to its end, because somebody wants it so.

use super::{Child, Phase, Repeats};
use crate::launch::leftovers::KILL_TIME;
use rohrpost_mailbox::Node;
use rohrpost_modules::common::OutputLevel;
use std::time::{Duration, Instant};

/// What becomes of a module that is told to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::launch) enum Then {
    /// The module stays ended until somebody starts it.
    Stay,
    /// The module is started again.
    Start,
    /// The module stands by: another of its nodes may run it from now on.
    StandBy,
    /// Launch itself ends.
    End,
}

/// Why a process is on its way to its end.
pub(super) enum EndCause {
    /// Somebody wants it so.
    Told(Then),
    /// A hang, in these words. Its restart policy says what becomes of it.
    Hang(String),
}

/// A process on its way to its end.
pub(super) struct ChildShutdown {
    pub(super) cause: EndCause,
    /// When it was told.
    since: Instant,
    /// Time after which the process is killed.
    within: Duration,
    /// When it was killed, since it did not obey.
    pub(super) killed: Option<Instant>,
    /// Not even that helped.
    left_behind: bool,
}

impl ChildShutdown {
    /// Of a process that was asked to end.
    pub(super) fn begin(cause: EndCause, within: Duration, now: Instant) -> Self {
        Self { cause, since: now, within, killed: None, left_behind: false }
    }

    /// Somebody wants its end now: one that hangs has no more time from here on than any other that is told to end.
    fn wanted(&mut self, then: Then, stop_within: Duration, now: Instant) {
        if matches!(self.cause, EndCause::Hang(_)) {
            self.within = self.within.min(now.saturating_duration_since(self.since) + stop_within);
        }
        self.cause = EndCause::Told(then);
    }

    /// When there is something to do about it, if it has not ended by then.
    pub(super) fn press_at(&self) -> Option<Instant> {
        match self.killed {
            _ if self.left_behind => None,
            Some(at) => Some(at + KILL_TIME),
            None => Some(self.since + self.within),
        }
    }
}

impl Child {
    pub(super) fn ended_as_told(&mut self, then: Then, was_killed: bool, how: &str, now: Instant) -> Option<String> {
        let obeyed = if was_killed { "since it did not stop when told to" } else { "when told to" };
        self.last_end = format!("{how} {obeyed}");
        match then {
            Then::End => {
                self.rest(Phase::Ended);
                None
            }
            Then::Stay => {
                self.rest(Phase::Stopped);
                Some(format!("{} is stopped, as asked", self.text))
            }
            Then::Start => {
                self.begin_waiting(now);
                Some(format!("{} is started again, as asked", self.text))
            }
            Then::StandBy => {
                // Switched off or on by somebody, it was for as long as its node held the lease.
                self.turn_on = self.configured_on;
                self.rest(Phase::StandsBy);
                Some(format!("{} stands by: this node does not hold its lease any more", self.text))
            }
        }
    }

    /// Tells its process to end; `step` sees to it that it does. A later wish replaces an earlier one.
    pub(in crate::launch) fn tell_to_end(&mut self, then: Then, node: &Node, now: Instant) {
        self.last_incarnation |= then == Then::End;
        if then == Then::Start {
            self.policy.begin_anew();
            self.repeats = Repeats::default();
        }
        if let Some(ending) = &mut self.ending {
            ending.wanted(then, self.stop_within, now);
            return;
        }
        self.note_switch(node);
        if self.phase.is_over() {
            self.turn_on = self.configured_on;
        }
        if self.process.is_some() || self.over.is_some() {
            self.process.iter_mut().for_each(|process| process.terminate(node));
            self.phase = Phase::Stopping;
            let within = if then == Then::StandBy { self.off_within } else { self.stop_within };
            self.ending = Some(ChildShutdown::begin(EndCause::Told(then), within, now));
        } else if then == Then::Start {
            self.begin_waiting(now);
        } else if !self.phase.is_over() {
            self.rest(match then {
                Then::Stay => Phase::Stopped,
                Then::StandBy => Phase::StandsBy,
                Then::Start | Then::End => Phase::Ended,
            });
        }
    }

    /// Whether its node is to hold its lease, or could. One that is on its way to its end still holds it; so does one
    /// that has done its work, or another node would do that again.
    pub(in crate::launch) fn may_hold(&self) -> bool {
        let has_left = self.last_incarnation && self.process.is_none() && self.over.is_none();
        !has_left && (!self.phase.is_over() || self.phase == Phase::Ended)
    }

    /// The node holds the module's lease until then, ns of the monotonic clock, or does not: what runs without one is
    /// killed if it is not off by itself.
    pub(in crate::launch) fn hold(&mut self, until_ns: Option<u64>, node: &Node, now: Instant) {
        let holds = until_ns.is_some();
        self.off_ns = until_ns.or(self.off_ns);
        let had = !std::mem::replace(&mut self.stands_by, !holds);
        if holds && self.phase == Phase::StandsBy && !self.last_incarnation {
            match self.process.is_some() {
                // Its timer and its event have told it so.
                true => (self.phase, self.since) = (Phase::Starting, now),
                false => self.begin_waiting(now),
            }
        }
        if had && !holds && self.phase == Phase::Ended {
            self.phase = Phase::StandsBy;
        }
        if !had || holds || self.phase.is_over() {
            return;
        }
        match self.ending.is_some() {
            true => _ = self.force(node, now),
            false => self.tell_to_end(Then::StandBy, node, now),
        }
    }

    /// From then on it may be started, as soon as its node holds its lease if others may run it.
    pub(super) fn begin_waiting(&mut self, from: Instant) {
        self.since = from;
        if self.stands_by {
            self.rest(Phase::StandsBy);
        } else {
            self.phase = Phase::Waiting;
        }
    }

    /// Sees to it that a process that was told to end does.
    pub(super) fn press(&mut self, node: &Node, now: Instant) -> Option<String> {
        let pid = self.pid()?;
        let ending = self.ending.as_mut()?;
        let within = ending.within;
        match ending.killed {
            None if now >= ending.press_at()? => {
                self.force(node, now);
                // Without any time it was not told to stop before.
                (!within.is_zero()).then(|| format!("{} did not stop within {within:?}; killed", self.text))
            }
            Some(_) if now >= ending.press_at()? => {
                // It waits for broken hardware, say. The others still have to be looked after.
                ending.left_behind = true;
                let left = "cannot even be killed; left behind";
                let EndCause::Hang(hang) = &ending.cause else {
                    return Some(format!("{} (process {pid}) {left}", self.text));
                };
                let told = format!("{hang}, and its process {pid} {left}: none is started beside it");
                self.printed.say(OutputLevel::Error, &told, None);
                Some(format!("{} {told}", self.text))
            }
            _ => None,
        }
    }

    /// Kills a process that was told to end; false when there is none, or it was killed before.
    pub(in crate::launch) fn force(&mut self, node: &Node, now: Instant) -> bool {
        let Some(ending) = self.ending.as_mut().filter(|ending| ending.killed.is_none()) else { return false };
        ending.killed = Some(now);
        // A stopped process obeys this one too.
        self.process.iter().for_each(|process| process.kill(node));
        true
    }

    /// Whether it was told to end and did not within its time.
    pub(in crate::launch) fn overran(&self) -> bool {
        self.ending.as_ref().is_some_and(|ending| ending.killed.is_some())
    }

    /// Whether there is nothing more to wait for.
    pub(in crate::launch) fn is_gone(&self) -> bool {
        let left_behind = self.ending.as_ref().is_some_and(|ending| ending.left_behind);
        left_behind || self.process.is_none() && self.over.is_none()
    }
}
