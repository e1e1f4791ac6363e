//! How a module stands, in the words that all tools use: `list`, `status`, `top`, the table of `launch`, JSON and the
//! GUI.
//!
//! Two sources say it. The process itself, in its node's table: that is the present. Its launch: what has become of a
//! process that is not there, and how often it was started again. What the process says goes first.

use super::ModuleSurvey;
use crate::launcher::Phase;
use rohrpost_config::Installation;
use rohrpost_mailbox::{ModuleState, Node, Work};
use rohrpost_modules::common::State;
use rohrpost_modules::description::noted;
use rohrpost_modules::launch_support::in_words;
use serde::{Serialize, Serializer};
use std::fmt;
use std::time::Duration;

/// How a module stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Standing {
    /// The module's process is there or on its way, and takes no commands yet.
    Starting,
    /// The module works.
    On,
    /// The module is ready, and switched off.
    Off,
    /// The module runs, and has stopped working for a reason that it tells.
    Error,
    /// Part of its own code has not come back for long: it hears nobody.
    Busy,
    /// Another node runs it, and this one is there to take over.
    StandsBy,
    /// The module does not run, as it is meant: somebody ended it, it had done its work, or it is left out.
    Stopped,
    /// The module ended, and is not started again by itself.
    Failed,
    /// The module ended, and is to be started again.
    Restarting {
        /// Restarts that count against its policy, the next one included.
        attempt: u32,
        /// At so many it is given up.
        most: u32,
    },
    /// The module's node does not show itself.
    Unreachable,
}

impl Standing {
    /// All words, those that need a person first.
    pub const WORDS: [&str; 10] =
        ["failed", "unreachable", "busy", "error", "restarting", "starting", "stopped", "standby", "off", "on"];

    /// One of [`Standing::WORDS`].
    pub const fn word(self) -> &'static str {
        match self {
            Self::Starting => "starting",
            Self::On => "on",
            Self::Off => "off",
            Self::Error => "error",
            Self::Busy => "busy",
            Self::Stopped => "stopped",
            Self::StandsBy => "standby",
            Self::Failed => "failed",
            Self::Restarting { .. } => "restarting",
            Self::Unreachable => "unreachable",
        }
    }

    /// Index among [`Standing::WORDS`].
    ///
    /// ```
    /// use rohrpost_launch::survey::Standing;
    ///
    /// let mut all = [Standing::On, Standing::Failed, Standing::Off];
    /// all.sort_by_key(|standing| standing.severity());
    /// assert_eq!(all.map(Standing::word), ["failed", "off", "on"]);
    /// ```
    pub fn severity(self) -> usize {
        Self::WORDS.iter().position(|word| *word == self.word()).unwrap_or(Self::WORDS.len())
    }

    /// Whether it answers when it is asked, as far as one can see.
    ///
    /// ```
    /// use rohrpost_launch::survey::Standing;
    ///
    /// assert!(Standing::Error.answers() && !Standing::Busy.answers());
    /// ```
    pub const fn answers(self) -> bool {
        matches!(self, Self::On | Self::Off | Self::Error)
    }
}

impl From<State> for Standing {
    fn from(state: State) -> Self {
        match state {
            State::Starting => Self::Starting,
            State::Off => Self::Off,
            State::On => Self::On,
            State::Error => Self::Error,
            // It goes because somebody wants it so.
            State::Stopping => Self::Stopped,
        }
    }
}

/// As the word alone.
impl Serialize for Standing {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.word())
    }
}

impl fmt::Display for Standing {
    /// The word, and of restarts how many of how many.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Restarting { attempt, most } => f.pad(&format!("restarting ({attempt} of {most})")),
            other => f.pad(other.word()),
        }
    }
}

/// A part of a module's own code that has not come back for long.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Working {
    /// Which: `received`, or the name of a function.
    pub part: String,
    /// For how long.
    pub lasts: Duration,
}

impl Working {
    /// What the module has in hand, if that lasts longer than its configuration finds normal.
    pub(super) fn of(module: &ModuleSurvey, node: &Node, installation: &Installation, now_ns: u64) -> Option<Self> {
        let in_hand = module.process.as_ref()?.in_hand?;
        let (lasts, limit) = (in_hand.lasts(now_ns), installation.module(module.name)?.busy_after);
        (lasts >= limit).then(|| Self::new(in_hand.work, lasts, node, module.names()))
    }

    /// The name of a function is in what the module noted beside its mailboxes.
    pub(crate) fn new(
        work: Work,
        lasts: Duration,
        node: &Node,
        mut names: impl Iterator<Item = rohrpost_mailbox::Name>,
    ) -> Self {
        let mut named = |number: u16| {
            names.find_map(|name| {
                let functions = noted(node, name)?.functions;
                functions.into_iter().find(|function| function.number == number)
            })
        };
        let functions = match work {
            Work::Function(number) => named(number).map(|function| (number, function.name)).into_iter().collect(),
            _ => Vec::new(),
        };
        Self { part: in_words(work, &functions), lasts }
    }
}

impl fmt::Display for Working {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "in {} for {:.1} s", self.part, self.lasts.as_secs_f64())
    }
}

impl ModuleSurvey {
    /// The module's name and its aliases.
    pub fn names(&self) -> impl Iterator<Item = rohrpost_mailbox::Name> {
        std::iter::once(self.name).chain(self.aliases.iter().copied())
    }

    /// How it stands.
    pub fn standing(&self) -> Standing {
        if self.at_ns.is_none() {
            return Standing::Unreachable;
        }
        let Some(process) = &self.process else { return self.without_process() };
        let state = match process.state {
            Some(ModuleState::StandsBy) => Standing::StandsBy,
            state => state.map_or(Standing::Starting, |state| State::from(state).into()),
        };
        if state.answers() && self.working.is_some() { Standing::Busy } else { state }
    }

    fn without_process(&self) -> Standing {
        let Some(child) = &self.child else { return Standing::Stopped };
        match child.phase {
            Phase::Failed => Standing::Failed,
            Phase::Waiting if child.attempt > 0 => {
                Standing::Restarting { attempt: child.attempt, most: child.attempts_max }
            }
            Phase::Waiting | Phase::Starting => Standing::Starting,
            Phase::StandsBy => Standing::StandsBy,
            Phase::Ready | Phase::Running | Phase::Stopping | Phase::Stopped | Phase::Ended | Phase::LeftOut => {
                Standing::Stopped
            }
        }
    }

    /// The last that went wrong with it, in words: what it is stuck in, why it is in error, or how its last process
    /// ended. Empty if nothing did, or nobody knows.
    pub fn last_error(&self, installation: &Installation) -> String {
        if let Some(working) = &self.working {
            return working.to_string();
        }
        if self.is_left_out(installation) {
            return "left out: its program is missing".into();
        }
        let told = self.child.as_ref().map(|child| match self.process {
            Some(_) => &child.error,
            None => &child.last_end,
        });
        let told = told.into_iter().chain(&self.error).find(|error| !error.is_empty());
        let lines = |told: &String| -> Vec<String> {
            told.lines().map(|line| line.trim().to_owned()).filter(|line| !line.is_empty()).collect()
        };
        told.map(lines).unwrap_or_default().join("; ")
    }

    /// How often its restart policy has started it again.
    pub fn restarts(&self) -> u32 {
        let by_process = self.process.as_ref().map_or(0, |process| process.restarts);
        by_process.max(self.child.as_ref().map_or(0, |child| child.restarts))
    }

    /// Whether it does not run and need not: it is optional, and its program is not there. Where no launch runs, that
    /// is only likely.
    pub fn is_left_out(&self, installation: &Installation) -> bool {
        let is_optional = || installation.module(self.name).is_some_and(|configured| configured.optional);
        let is_left_out = self.child.as_ref().map_or_else(is_optional, |child| child.phase == Phase::LeftOut);
        self.at_ns.is_some() && self.process.is_none() && is_left_out
    }
}
