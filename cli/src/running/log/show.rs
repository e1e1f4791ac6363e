//! How the selected lines are shown.

use super::arguments::{Arguments, Filter};
use crate::terminal::{complain, say, say_folded};
use rohrpost::output::OutputLine;
use rohrpost_builtin::format::Format;
use std::collections::VecDeque;

/// The selected lines and their format.
pub(super) struct Show<'a> {
    pub(super) filter: Filter,
    pub(super) format: Format<'a>,
    pub(super) arguments: &'a Arguments,
}

impl Show<'_> {
    /// False when nobody reads any more.
    pub(super) fn line(&self, line: &OutputLine) -> bool {
        if self.arguments.json { say(self.format.json(line)) } else { say_folded(self.format.short(line)) }
    }

    /// A notice of the tool between the lines; programs get only lines.
    pub(super) fn note(&self, note: &str) -> bool {
        if self.arguments.json {
            complain(format_args!("… {note}"));
            return true;
        }
        say_folded(format_args!("… {note}"))
    }
}

/// Adds a line to the last ones, of which so many are kept.
pub(super) fn keep_last(last: &mut VecDeque<OutputLine>, line: OutputLine, count: usize) {
    last.push_back(line);
    if last.len() > count {
        last.pop_front();
    }
}
