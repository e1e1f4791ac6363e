//! How far a command is, on a terminal.

use crate::terminal::complain_in_place;
use rohrpost_recording::Progress;
use std::io::{self, IsTerminal};
use std::time::{Duration, Instant};

/// Nothing is shown of what takes no longer, and then no more often.
const PERIOD: Duration = Duration::from_millis(500);

/// A line on the standard error that is written over and over, if that is a terminal.
pub(crate) struct ProgressLine {
    is_shown: bool,
    has_shown: bool,
    said: Instant,
}

impl ProgressLine {
    pub(crate) fn new() -> Self {
        Self { is_shown: io::stderr().is_terminal(), has_shown: false, said: Instant::now() }
    }

    /// So many bytes are read, of so many.
    pub(crate) fn tell(&mut self, read: u64, all: u64) {
        if !self.is_shown || self.said.elapsed() < PERIOD {
            return;
        }
        self.said = Instant::now();
        self.has_shown = true;
        complain_in_place(format_args!("{} %", read.saturating_mul(100).checked_div(all).unwrap_or(100)));
    }
}

/// Does what tells how far it is; its end takes the line away.
pub(super) fn with_progress<T>(act: impl FnOnce(&mut Progress<'_>) -> T) -> T {
    let mut line = ProgressLine::new();
    act(&mut |read, all| line.tell(read, all))
}

impl Drop for ProgressLine {
    fn drop(&mut self) {
        if self.has_shown {
            complain_in_place("");
        }
    }
}
