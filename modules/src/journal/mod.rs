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
//! The runtime, proxies, readers of streams and clocks of a module share one `ModuleJournal`. Without one each of them
//! pays for a branch. Whatever no journal sees is noted as a hole, and a replay ends there, with the reason.

mod bytes;
mod commands;
mod entry;
mod event;
mod files;
mod list;
mod outputs;
mod question;
mod records;
mod replay;
mod run;
mod tag;
mod value;
mod verdict;
mod write;

pub(crate) use bytes::Blob;
pub use commands::{NotedAnswer, NotedOutcome};
use event::EventAt;
pub(crate) use event::{JournalEvent, NotedOrigin};
pub(crate) use outputs::{Begin, NotedCommand, NotedItem, NotedReply};
pub(crate) use question::{AskedInterest, AskedStream, Question, nanoseconds};
use records::NamedRecord;
pub use records::{RecordSum, RecordWriter};
pub(crate) use replay::{Given, JournalReplay};
pub use run::{ExactRun, Piece, RunError, VARIABLE};
pub(crate) use tag::Tag;
pub(crate) use value::NotedValue;
pub use value::WHOLE_BYTES_MAX;
pub use verdict::{Difference, ReplayReport, ReplayVerdict};
pub(crate) use write::JournalWriter;

use rohrpost_config::RECORDED_BYTES_MAX;
use rohrpost_mailbox::{StreamId, monotonic_ns};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::borrow::Cow;
use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Number of the stream, under the module's own name. Interfaces have numbers from 1 to 16384.
pub const JOURNAL_NUMBER: u16 = u16::MAX;
/// Its name.
pub const JOURNAL_NAME: &str = "journal";

/// A module's journal, or none; all that share it have a copy of this. The journal itself is its thread's. What another
/// thread does with a copy is seen by no journal: that is marked here, and noted by the module's thread.
#[derive(Clone, Default)]
pub(crate) struct ModuleJournal(Option<Arc<AtomicBool>>);

enum JournalMode {
    Write(Box<JournalWriter>),
    Replay(Box<JournalReplay>),
}

thread_local! {
    static PRESENT: RefCell<Option<JournalMode>> = const { RefCell::new(None) };
}

const STRAYED: &str = "the module reads the clock, or a stream, in another thread or within `take_in`";

/// The module was not made: it failed, or panicked. With that its journal ends.
pub(crate) fn end_unmade(tag: Tag, why: &str) {
    PRESENT.with_borrow_mut(|present| match present {
        Some(JournalMode::Write(writer)) => {
            writer.put(tag, why);
            writer.put(Tag::End, &());
            writer.flush();
        }
        Some(JournalMode::Replay(replay)) => {
            replay.output(tag, why);
            replay.end()
        }
        None => {}
    });
}

/// The module could not be started, for a reason that is none of its own.
pub(crate) fn end_unstarted(why: &str) {
    PRESENT.with_borrow_mut(|present| match present {
        Some(JournalMode::Write(writer)) => writer.put(Tag::Hole, &format!("the module could not be started: {why}")),
        Some(JournalMode::Replay(replay)) => replay.give_up(&format!("the module cannot be started here: {why}")),
        None => {}
    });
}

/// The journal of this thread, put aside; it comes back also if the module panics meanwhile.
struct Aside(Option<JournalMode>);

impl Drop for Aside {
    fn drop(&mut self) {
        if let Some(JournalMode::Write(writer)) = self.0.as_mut().filter(|_| std::thread::panicking()) {
            writer.put(Tag::Hole, "the module panicked within `take_in`, or the like, which a replay does not call");
        }
        PRESENT.set(self.0.take());
    }
}

impl ModuleJournal {
    pub(crate) fn written(writer: JournalWriter) -> Self {
        Self::of(JournalMode::Write(Box::new(writer)))
    }

    pub(crate) fn replayed(replay: JournalReplay) -> Self {
        Self::of(JournalMode::Replay(Box::new(replay)))
    }

    /// The one of this thread.
    fn of(mode: JournalMode) -> Self {
        PRESENT.set(Some(mode));
        Self(Some(Arc::default()))
    }

    /// Whether nothing is noted.
    pub(crate) fn is_none(&self) -> bool {
        self.0.is_none()
    }

    /// Whether events and answers are taken from it.
    pub(crate) fn is_replayed(&self) -> bool {
        self.replay(|_| ()).is_some()
    }

    fn mode<T>(&self, part: impl FnOnce(&mut JournalMode, bool) -> Option<T>) -> Option<T> {
        let has_strayed = self.0.as_ref()?;
        PRESENT.with_borrow_mut(|present| match present {
            Some(mode) => part(mode, has_strayed.load(Ordering::Acquire)),
            None => {
                has_strayed.store(true, Ordering::Release);
                None
            }
        })
    }

    fn write<T>(&self, part: impl FnOnce(&mut JournalWriter) -> T) -> Option<T> {
        self.mode(|mode, has_strayed| match mode {
            JournalMode::Write(writer) => {
                if has_strayed {
                    writer.put(Tag::Hole, STRAYED);
                }
                Some(part(writer))
            }
            JournalMode::Replay(_) => None,
        })
    }

    /// Does this if it is replayed.
    pub(crate) fn replay<T>(&self, part: impl FnOnce(&mut JournalReplay) -> T) -> Option<T> {
        self.mode(|mode, has_strayed| match mode {
            JournalMode::Write(_) => None,
            JournalMode::Replay(replay) if has_strayed => replay.give_up(STRAYED),
            JournalMode::Replay(replay) => Some(part(replay)),
        })
    }

    /// Something that the module is told: asked now, and noted; or, replayed, what was noted then.
    pub(crate) fn answer<T: Serialize + DeserializeOwned>(
        &self,
        tag: Tag,
        question: Question<'_>,
        ask: impl FnOnce() -> T,
    ) -> T {
        if self.0.is_none() {
            return ask();
        }
        if let Some(given) = self.given(tag, question) {
            return given.read();
        }
        let answer = ask();
        self.note(tag, question, &answer);
        answer
    }

    /// Notes an answer that was given already; nothing, unless it is written.
    pub(crate) fn note<T: Serialize + ?Sized>(&self, tag: Tag, question: Question<'_>, answer: &T) {
        self.put(tag, &(question, answer));
    }

    /// The answer that was noted then; none unless it is replayed. What is asked is what was asked then.
    pub(crate) fn given(&self, tag: Tag, question: Question<'_>) -> Option<Given> {
        self.replay(|replay| replay.answer(tag, &question))
    }

    /// The module wants something that has no answer.
    pub(crate) fn asked(&self, tag: Tag, question: Question<'_>) {
        self.answer(tag, question, || ());
    }

    fn put<T: Serialize + ?Sized>(&self, tag: Tag, content: &T) {
        self.write(|writer| writer.put(tag, content));
    }

    /// A record that the module is given, as what comes next has it. Its bytes, or if it `is_recorded` and long, its
    /// sum.
    pub(crate) fn record<'b>(&self, id: StreamId, sequence: u64, is_recorded: bool, bytes: &'b [u8]) -> NotedValue<'b> {
        if self.is_none() || !is_recorded {
            return NotedValue::Whole(Blob(bytes));
        }
        let value = NotedValue::of(bytes);
        if bytes.len() > RECORDED_BYTES_MAX {
            self.hole(&format!("it is given a record of {} bytes, which is more than a recording takes", bytes.len()));
        } else if let NotedValue::Sum(sum) = value {
            self.put(Tag::Named, &NamedRecord { stream: id.into(), sequence, sum });
        }
        value
    }

    /// The bytes of a record that was noted so; only if it is replayed.
    pub(crate) fn bytes<'b>(&self, value: NotedValue<'b>) -> Cow<'b, [u8]> {
        match value {
            NotedValue::Whole(bytes) => bytes.0.into(),
            NotedValue::Sum(sum) => self.replay(|replay| replay.named(sum)).unwrap_or_default().into(),
        }
    }

    /// How it begins.
    pub(crate) fn begin(&self, begin: &Begin<'_>) {
        if self.replay(|replay| replay.begin(begin)).is_none() {
            self.put(Tag::Begin, begin);
        }
    }

    /// The module is called; `now_ns` is asked for if that is noted.
    pub(crate) fn event(&self, event: &JournalEvent<'_>, now_ns: impl FnOnce() -> u64) {
        if !self.is_none() && self.replay(|replay| replay.event(event)).is_none() {
            self.put(Tag::Event, &EventAt { at_ns: now_ns(), event: *event });
        }
    }

    /// The module sends something, or says something of itself.
    pub(crate) fn output<T: Serialize + ?Sized>(&self, tag: Tag, output: &T) {
        if !self.is_none() && self.replay(|replay| replay.output(tag, output)).is_none() {
            self.put(tag, output);
        }
    }

    /// The same, made only if there is a journal: a long value would be read for it.
    pub(crate) fn output_of<T: Serialize>(&self, tag: Tag, output: impl FnOnce() -> T) {
        if !self.is_none() {
            self.output(tag, &output());
        }
    }

    /// Does this without the journal. What it asks of the module's runtime meanwhile is a hole, since a replay does not
    /// ask it.
    pub(crate) fn apart<T>(&self, part: impl FnOnce() -> T) -> T {
        let _aside = Aside(PRESENT.take());
        part()
    }

    /// What comes now is seen by no journal.
    pub(crate) fn hole(&self, why: &str) {
        self.output(Tag::Hole, why);
    }

    /// A file that the module's settings name: a replay wants one with the same content.
    pub(crate) fn file(&self, named: &str, path: &Path) {
        if self.is_none() {
            return;
        }
        let (question, found) = (Question::File(named), files::digest_of(path));
        if self.replay(|replay| replay.file(&question, path, found)).is_none() {
            self.note(Tag::File, question, &found);
        }
    }

    /// Hands entries on to readers that have waited long enough for them.
    pub(crate) fn pass_on(&self) {
        self.write(|writer| writer.pass_on(monotonic_ns()));
    }

    /// When [`ModuleJournal::pass_on`] has something to do, by the monotonic clock.
    pub(crate) fn due_ns(&self) -> Option<u64> {
        self.write(|writer| writer.due_ns()).flatten()
    }

    /// The module has ended as it should, and its journal with it.
    pub(crate) fn end(&self) {
        self.replay(|replay| replay.end());
        self.write(|writer| {
            writer.put(Tag::End, &());
            writer.flush();
        });
    }
}

#[cfg(test)]
mod tests;
