//! What modules say, on its way to the output collector (seed 002, 2.2.4).
//!
//! ```text
//!  tracing event ─▶ layer: level? ─▶ allowance ─▶ way: queue ─▶ mailbox output.0.3 ─▶ modules/builtin
//!  panic ──────────────────────────────▲             ring, file, journal, subscribers, `rohrpost log` ◀┘
//! ```
//!
//! Every `tracing` event becomes a line. A line goes into a small queue of this process and from there, at once if
//! nobody else is at it, into the collector's mailbox: a module never waits on its own words. What is beyond its
//! allowance is suppressed before it is even written; what finds no room is lost; both are counted, and said as soon as
//! there is room.

mod allowance;
#[doc(hidden)]
pub mod collector_support;
mod errno;
mod layer;
mod out;
mod print;
pub(crate) mod relay;
mod said;
pub(crate) mod trace;
mod way;

pub use errno::{errno_of, errno_text};
pub(crate) use print::print;
pub use rohrpost_schema::plain;
pub(crate) use way::install_quiet;
pub(crate) use way::is_installed;
pub use way::{drain, flush, install, level, lost, retry_at, set_level, suppressed};

use crate::common::OutputLevel;
use rohrpost_mailbox::Name;
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Mailbox of the collector that takes lines; a local id of its own.
pub const LINES: u8 = 3;
/// Class of the collector.
pub const CLASS: &str = "output";
/// Longest text of a line, bytes; what is longer is cut.
pub const TEXT_MAX: usize = 900;

/// Begins each line that a launched module prints although it has sent it, too: launch repeats it, and does not send it
/// again.
#[doc(hidden)]
pub const SENT: char = '\u{1e}';
/// Begins each line that says where a panic came from, of a launched module: launch tells it once, and does not send
/// it.
#[doc(hidden)]
pub const TRACED: char = '\u{1d}';

/// One line of output.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct OutputLine {
    /// System time at which it was said, ns since 1970.
    pub time_ns: u64,
    /// Module that said it: the 32 bits of its name, which is the sender's; or a module of the node of which the sender
    /// is launch.
    pub module: u32,
    /// How important it is.
    pub level: OutputLevel,
    /// Lines of this module that were lost before this one.
    pub lost: u32,
    /// Lines of this module that were suppressed, if this is the line that tells of them; else 0.
    pub suppressed: u32,
    /// Number of the kernel's error that it tells of (28: no space left on device), if it is about one.
    pub errno: Option<u16>,
    /// What it says.
    pub text: String,
}

impl OutputLine {
    /// The module that said it.
    pub fn module(&self) -> Name {
        Name::from_raw(self.module)
    }

    /// What it says; behind it the number and the text of the kernel's error, if what it says has neither.
    pub fn full_text(&self) -> Cow<'_, str> {
        let Some(number) = self.errno else { return Cow::Borrowed(&self.text) };
        let text = errno_text(number);
        if self.text.contains(&text) || self.text.contains(&format!("(os error {number})")) {
            return Cow::Borrowed(&self.text);
        }
        Cow::Owned(format!("{} (errno {number}: {text})", self.text))
    }

    /// The time of day it was said (UTC), to the millisecond.
    pub fn time_text(&self) -> String {
        let ms = self.time_ns / 1_000_000;
        let (seconds, minutes, hours) = (ms / 1000 % 60, ms / 60_000 % 60, ms / 3_600_000 % 24);
        format!("{hours:02}:{minutes:02}:{seconds:02}.{:03}", ms % 1000)
    }
}

impl OutputLevel {
    /// All levels, in the order of their numbers.
    pub const ALL: [Self; 5] = [Self::Error, Self::Warn, Self::Info, Self::Debug, Self::Trace];

    /// The level of this number, as it is cast; the last one if none has it.
    pub(crate) fn of_number(number: u8) -> Self {
        Self::ALL.into_iter().find(|its| *its as u8 == number).unwrap_or(Self::Trace)
    }

    /// One word.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warn => "warn",
            Self::Info => "info",
            Self::Debug => "debug",
            Self::Trace => "trace",
        }
    }
}
