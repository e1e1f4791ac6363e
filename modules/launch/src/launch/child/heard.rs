//! What launch hears of a module while it runs: its last word in the node's table.

use super::Child;
use crate::launcher::Phase;
use rohrpost_mailbox::{ModuleState, Node, ParticipantInfo};
use rohrpost_modules::common::OutputLevel;
use rohrpost_modules::output::plain;
use std::time::Instant;

impl Child {
    /// What its process said last of itself in the node's table.
    pub(super) fn last_word(&self, node: &Node) -> Option<ParticipantInfo> {
        self.process.as_ref()?.last_word(node)
    }

    pub(super) fn state_of(&self, node: &Node) -> Option<ModuleState> {
        self.last_word(node)?.state
    }

    /// Times that it went into error, as it says itself.
    pub(in crate::launch) fn errors(&self, node: &Node) -> u32 {
        self.last_word(node).map_or(0, |word| word.errors)
    }

    /// The number of the error that it says it is in.
    pub(in crate::launch) fn in_error(&self, node: &Node) -> Option<u32> {
        let word = self.last_word(node)?;
        (word.state == Some(ModuleState::Error)).then_some(word.errors)
    }

    /// The number of the error that it is in, or of what it complains of.
    pub(in crate::launch) fn in_trouble(&self, node: &Node) -> Option<u32> {
        let word = self.last_word(node)?;
        (word.state == Some(ModuleState::Error) || word.complains).then_some(word.errors)
    }

    /// The number of the error or complaint of which the cause is not known yet.
    pub(in crate::launch) fn asks_why(&mut self, node: &Node) -> Option<u32> {
        let in_trouble = self.in_trouble(node);
        self.health.asks_why(in_trouble)
    }

    /// That it is in error now, if it is, and why.
    pub(in crate::launch) fn present_error(&self, node: &Node) -> Option<String> {
        let why = self.health.present_error().filter(|_| self.in_error(node).is_some());
        why.map(|why| format!("{} is in error: {}", self.text, plain::line(why)))
    }

    /// What it is instead of on, if it runs and is in error, or is meant to be on.
    pub(in crate::launch) fn not_on(&self, node: &Node) -> Option<String> {
        let state = self.state_of(node);
        let is_wrong = state == Some(ModuleState::Error) || self.turn_on && state != Some(ModuleState::On);
        (self.phase == Phase::Running && is_wrong).then(|| {
            let state = state.map_or("gone", ModuleState::name);
            self.present_error(node).unwrap_or_else(|| format!("{} is {state}", self.text))
        })
    }

    /// Looks whether a part of its own code has not come back for long.
    pub(super) fn note_busy(&mut self, node: &Node, now: Instant) -> Option<String> {
        let word = self.last_word(node)?;
        let working = self.health.look(word.in_hand, now)?;
        let told = format!(
            "is busy: {}; until that comes back it hears nobody, and what is sent to it waits or is lost",
            working.told(node, &self.names)
        );
        self.printed.say(OutputLevel::Warn, &told, None);
        Some(format!("{} {told}", self.text))
    }
}
