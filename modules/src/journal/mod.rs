//! The journal of a module: all that its thread is called with and told, and all that it sends, in the order in which
//! it happens. With it the same program runs again, alone, and does the same.
//!
//! ```text
//!             ┌───────────────── the module's own code ─────────────────┐
//!  event ────▶│ on, off, tick, received, a command, parameters          │────▶ output: published, written, called,
//!             │        asks: what time is it? which record? ▲           │      replied, failed
//!             └─────────────────────────────────────────────┼───────────┘
//!                                                         answer
//!
//!  written:   each is an entry ──▶ a stream of the module, 4 KiB records ──▶ `logd` ──▶ a recording
//!  replayed:  events and answers are taken from there, outputs are compared with it, bit by bit
//! ```
//!
//! The runtime, proxies, readers of streams and clocks of a module share one [`ModuleJournal`]. Without one each of them
//! pays for a branch. Whatever no journal sees is noted as a hole, and a replay ends there, with the reason.

mod bytes;
mod entry;
mod event;
mod files;
mod list;
mod outputs;
mod replay;
mod run;
mod verdict;
mod write;

pub(crate) use bytes::Blob;
pub(crate) use entry::Tag;
use event::EventAt;
pub(crate) use event::{JournalEvent, NotedOrigin};
pub(crate) use outputs::{Begin, NotedCommand, NotedItem, NotedReply, NotedValue};
pub(crate) use replay::{Given, Replay};
pub use run::{ExactRun, Piece, RunError, VARIABLE};
pub use verdict::{Difference, ReplayReport, ReplayVerdict};
pub(crate) use write::{JournalWriter, SHAPE};

use rohrpost_mailbox::monotonic_ns;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::cell::{RefCell, RefMut};
use std::path::Path;
use std::rc::Rc;

/// Number of the stream, under the module's own name. Interfaces have numbers from 1 to 16384.
pub const JOURNAL_NUMBER: u16 = u16::MAX;
/// Its name.
pub const JOURNAL_NAME: &str = "journal";

/// A module's journal, or none; all that share it have a copy of this.
#[derive(Clone, Default)]
pub(crate) struct ModuleJournal(Option<Rc<RefCell<JournalMode>>>);

enum JournalMode {
    Write(Box<JournalWriter>),
    Replay(Box<Replay>),
}

impl ModuleJournal {
    pub(crate) fn written(writer: JournalWriter) -> Self {
        Self(Some(Rc::new(RefCell::new(JournalMode::Write(Box::new(writer))))))
    }

    pub(crate) fn replayed(replay: Replay) -> Self {
        Self(Some(Rc::new(RefCell::new(JournalMode::Replay(Box::new(replay))))))
    }

    /// Whether nothing is noted.
    pub(crate) fn is_none(&self) -> bool {
        self.0.is_none()
    }

    /// Whether events and answers are taken from it.
    pub(crate) fn is_replayed(&self) -> bool {
        self.0.as_ref().is_some_and(|mode| matches!(*mode.borrow(), JournalMode::Replay(_)))
    }

    fn writer(&self) -> Option<RefMut<'_, JournalWriter>> {
        let mode = self.0.as_ref()?.borrow_mut();
        RefMut::filter_map(mode, |mode| match mode {
            JournalMode::Write(writer) => Some(&mut **writer),
            JournalMode::Replay(_) => None,
        })
        .ok()
    }

    pub(crate) fn replay(&self) -> Option<RefMut<'_, Replay>> {
        let mode = self.0.as_ref()?.borrow_mut();
        RefMut::filter_map(mode, |mode| match mode {
            JournalMode::Write(_) => None,
            JournalMode::Replay(replay) => Some(&mut **replay),
        })
        .ok()
    }

    /// Something that the module is told: asked now, and noted; or, replayed, what was noted then.
    pub(crate) fn answer<T: Serialize + DeserializeOwned>(&self, tag: Tag, ask: impl FnOnce() -> T) -> T {
        if self.0.is_none() {
            return ask();
        }
        if let Some(given) = self.given(tag) {
            return given.read();
        }
        let answer = ask();
        self.note(tag, &answer);
        answer
    }

    /// Notes an answer that was given already; nothing, unless it is written.
    pub(crate) fn note<T: Serialize + ?Sized>(&self, tag: Tag, answer: &T) {
        if let Some(mut writer) = self.writer() {
            writer.put(tag, answer);
        }
    }

    /// The answer that was noted then; none unless it is replayed.
    pub(crate) fn given(&self, tag: Tag) -> Option<Given> {
        self.replay().map(|mut replay| replay.answer(tag))
    }

    /// The module is called; `now_ns` is asked for if that is noted.
    pub(crate) fn event(&self, event: &JournalEvent<'_>, now_ns: impl FnOnce() -> u64) {
        if self.0.is_none() {
            return;
        }
        if let Some(mut replay) = self.replay() {
            replay.event(event);
        } else {
            self.note(Tag::Event, &EventAt { at_ns: now_ns(), event: *event });
        }
    }

    /// The module sends something, or says something of itself.
    pub(crate) fn output<T: Serialize + ?Sized>(&self, tag: Tag, output: &T) {
        if self.0.is_none() {
            return;
        }
        if let Some(mut replay) = self.replay() {
            replay.output(tag, output);
        } else {
            self.note(tag, output);
        }
    }

    /// What comes now is seen by no journal.
    pub(crate) fn hole(&self, why: &str) {
        if self.0.is_some() {
            self.output(Tag::Hole, why);
        }
    }

    /// A file that the module's settings name: a replay wants one with the same content.
    pub(crate) fn file(&self, path: &Path) {
        if self.0.is_none() {
            return;
        }
        let found = files::digest_of(path);
        if let Some(mut replay) = self.replay() {
            replay.file(path, found);
        } else {
            self.note(Tag::File, &found);
        }
    }

    /// Hands entries on to readers that have waited long enough for them.
    pub(crate) fn pass_on(&self) {
        if let Some(mut writer) = self.writer() {
            writer.pass_on(monotonic_ns());
        }
    }

    /// When [`ModuleJournal::pass_on`] has something to do, by the monotonic clock.
    pub(crate) fn due_ns(&self) -> Option<u64> {
        self.writer().and_then(|writer| writer.due_ns())
    }

    /// Hands all entries on.
    pub(crate) fn flush(&self) {
        if let Some(mut writer) = self.writer() {
            writer.flush();
        }
    }

    /// The module has ended as it should, and its journal with it.
    pub(crate) fn end(&self) {
        if let Some(replay) = self.replay() {
            replay.end();
        }
        self.note(Tag::End, &());
        self.flush();
    }

    /// What begins with this.
    pub(crate) fn begin(&self, begin: &Begin<'_>) {
        if let Some(mut replay) = self.replay() {
            replay.begin(begin);
        } else {
            self.note(Tag::Begin, begin);
        }
    }
}

#[cfg(test)]
mod tests;
