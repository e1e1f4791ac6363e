//! The course of a replay that can be paused, stepped, sought and repeated: what is to be done next, by the node's
//! time. It has no clock.

use rohrpost_recording::{Cue, Message, Player, ReadError, RecordedChannel};
use std::sync::Arc;

/// What is to be done next.
#[derive(Debug)]
pub(super) enum Move<'a> {
    /// The node's time begins anew.
    Begin {
        /// There.
        system_ns: u64,
        /// As it was recorded.
        epoch: u64,
    },
    /// A value is to be published.
    Play {
        /// Of a step: time goes on to this first.
        time_ns: Option<u64>,
        channel: Arc<RecordedChannel>,
        message: Message<'a>,
    },
    /// Time goes on to this at once: the end of a step.
    Advance { time_ns: u64 },
    /// Nothing before this time.
    Wait { until_ns: u64 },
    /// Ask again at once.
    Again,
    /// The course begins anew: what comes next is of another round.
    Round,
    /// It is at its end just now.
    End,
    /// Nothing, until it is told something.
    Rest,
}

/// A step while it is paused.
#[derive(Clone, Copy, Debug)]
enum CourseStep {
    /// To the next value.
    Next,
    /// To this time.
    Until(u64),
}

/// Which part is played.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Part {
    /// What arrived from then on.
    pub(super) from_ns: Option<u64>,
    /// Until the first value that arrived then or later.
    pub(super) until_ns: Option<u64>,
    /// Over and over.
    pub(super) repeats: bool,
}

/// A replay.
pub(super) struct Course {
    player: Player,
    part: Part,
    is_paused: bool,
    step: Option<CourseStep>,
    /// Time has begun since the last seek.
    has_begun: bool,
    /// The course was told something, so those that are to hear what is played listen. Before that nothing is played.
    is_told: bool,
    /// There is no further value in this round.
    is_over: bool,
    /// And none will be.
    has_ended: bool,
    /// A value was played in this round: rounds without one would never end.
    has_played: bool,
    rounds: u32,
}

impl Course {
    /// At the beginning of its part, paused.
    pub(super) fn new(player: Player, part: Part) -> Result<Self, ReadError> {
        let mut course = Self {
            player,
            part,
            is_paused: true,
            step: None,
            has_begun: false,
            is_told: false,
            is_over: false,
            has_ended: false,
            has_played: false,
            rounds: 0,
        };
        course.go_to_begin()?;
        Ok(course)
    }

    pub(super) fn is_paused(&self) -> bool {
        self.is_paused
    }

    pub(super) fn has_ended(&self) -> bool {
        self.has_ended
    }

    /// Times that it began anew.
    pub(super) fn rounds(&self) -> u32 {
        self.rounds
    }

    /// Time stands still; what is older than the place where it stands is played.
    pub(super) fn pause(&mut self) {
        (self.is_paused, self.is_told) = (true, true);
    }

    pub(super) fn resume(&mut self) {
        (self.is_paused, self.is_told, self.step) = (false, true, None);
    }

    /// Pauses, and plays the next value.
    pub(super) fn step(&mut self) {
        self.pause();
        self.step = Some(CourseStep::Next);
    }

    /// Pauses, and plays what is due until this time.
    pub(super) fn step_until(&mut self, until_ns: u64) {
        self.pause();
        self.step = Some(CourseStep::Until(until_ns));
    }

    /// Goes to the first value that arrived then or later, and plays the newest of before; to the end if there is none.
    pub(super) fn seek(&mut self, arrival_ns: u64) -> Result<(), ReadError> {
        self.is_told = true;
        self.go_to(arrival_ns)
    }

    fn go_to(&mut self, arrival_ns: u64) -> Result<(), ReadError> {
        (self.has_begun, self.has_ended, self.has_played, self.step) = (false, false, false, None);
        self.is_over = true;
        self.is_over = !self.player.seek(arrival_ns)?;
        Ok(())
    }

    fn go_to_begin(&mut self) -> Result<(), ReadError> {
        self.go_to(self.part.from_ns.unwrap_or_default())
    }

    /// What is to be done, when the node's time is this one.
    ///
    /// # Errors
    /// When a file is not readable here; asked again, it goes on behind that.
    pub(super) fn next(&mut self, now_ns: u64) -> Result<Move<'_>, ReadError> {
        if self.is_over {
            return self.end_round();
        }
        let is_older = self.is_told && self.player.has_older();
        if self.has_ended || (self.has_begun && self.is_paused && self.step.is_none() && !is_older) {
            return Ok(Move::Rest);
        }
        let due_ns = match self.step {
            None => now_ns,
            Some(CourseStep::Next) => u64::MAX,
            Some(CourseStep::Until(until_ns)) => until_ns,
        };
        let end_ns = self.part.until_ns.unwrap_or(u64::MAX);
        Ok(match self.player.poll(due_ns)? {
            Cue::Begin { system_ns, .. } if system_ns >= end_ns => {
                self.is_over = true;
                Move::Again
            }
            Cue::Begin { system_ns, epoch } => {
                self.has_begun = true;
                if let Some(CourseStep::Until(until_ns)) = &mut self.step {
                    // What is left of the step is left after the step of time.
                    *until_ns = system_ns.saturating_add(until_ns.saturating_sub(now_ns));
                }
                Move::Begin { system_ns, epoch }
            }
            Cue::Message(_, message) if message.arrival_ns >= end_ns => {
                self.is_over = true;
                Move::Again
            }
            Cue::Message(channel, message) => {
                self.has_played = true;
                let time_ns = self.step.map(|_| message.arrival_ns);
                // What is older is no step.
                self.step = self.step.filter(|step| is_older || matches!(step, CourseStep::Until(_)));
                Move::Play { time_ns, channel, message }
            }
            Cue::Wait { .. } if self.step.is_some() => {
                self.step = None;
                Move::Advance { time_ns: due_ns }
            }
            Cue::Wait { .. } if now_ns >= end_ns => {
                self.is_over = true;
                Move::Again
            }
            Cue::Wait { until_ns } => Move::Wait { until_ns: until_ns.min(end_ns) },
            Cue::Busy => Move::Again,
            Cue::End => {
                self.is_over = true;
                Move::Again
            }
        })
    }

    fn end_round(&mut self) -> Result<Move<'_>, ReadError> {
        (self.is_over, self.step) = (false, None);
        if self.part.repeats && self.has_played {
            self.rounds = self.rounds.saturating_add(1);
            self.go_to_begin()?;
            return Ok(Move::Round);
        }
        self.has_ended = true;
        Ok(Move::End)
    }
}

#[cfg(test)]
#[path = "course_tests.rs"]
mod tests;
