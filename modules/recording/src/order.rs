//! What the thread that writes is asked for, at its place among the messages: marks, and another file.

use crate::error::DiskError;
use crate::format::key;
use rohrpost_schema::plain::ForeignText;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::time::Duration;
use thiserror::Error;

/// Bytes of a mark's text.
pub const MARK_BYTES_MAX: usize = 500;

/// A place in a recording that is to be found again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mark {
    /// When it was set, in nanoseconds of system time.
    pub time_ns: u64,
    /// Which stretch of system time between two steps of it that is of.
    pub epoch: u64,
    /// What it says.
    pub text: ForeignText,
}

impl Mark {
    /// Whether it can be set.
    pub(crate) fn check(&self) -> Result<(), OrderError> {
        match &self.text {
            text if text.trim().is_empty() => Err(OrderError::NoText),
            text if text.len() > MARK_BYTES_MAX => Err(OrderError::LongText(text.len())),
            text if text.contains(char::is_control) => Err(OrderError::ControlText),
            _ => Ok(()),
        }
    }

    /// As a file has it.
    pub(crate) fn texts(&self) -> BTreeMap<String, String> {
        let texts = [
            ("text", self.text.as_str().to_owned()),
            ("time-ns", self.time_ns.to_string()),
            (key::EPOCH, self.epoch.to_string()),
        ];
        texts.into_iter().map(|(key, text)| (key.to_owned(), text)).collect()
    }

    /// As a file has it; none if that is no mark.
    pub(crate) fn of_texts(texts: &BTreeMap<String, String>) -> Option<Self> {
        let number = |key: &str| texts.get(key)?.parse().ok();
        Some(Self { time_ns: number("time-ns")?, epoch: number(key::EPOCH)?, text: texts.get("text")?.as_str().into() })
    }
}

/// What became of the files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileChange {
    /// The file that was closed, if one was.
    pub closed: Option<PathBuf>,
    /// The file that is written now.
    pub file: PathBuf,
}

/// Why an order was not carried out.
#[derive(Clone, Debug, Error)]
pub enum OrderError {
    /// A mark that says nothing.
    #[error("a mark needs a text; write what happened")]
    NoText,
    /// A mark that says too much.
    #[error("the text of a mark has {0} bytes; at most {MARK_BYTES_MAX} are taken")]
    LongText(usize),
    /// It would be several lines, or move the cursor of a terminal.
    #[error("the text of a mark has a control character; write it in one line, without tabs")]
    ControlText,
    /// The disk is slower than what comes, or fails.
    #[error("the queue is full: the disk is slower than what comes, or fails (see the status)")]
    Full,
    /// The recording ended before.
    #[error("the recording has ended before that")]
    Ended,
    /// The disk did not take it.
    #[error(transparent)]
    Disk(#[from] DiskError),
}

/// An order on its way through the queue. Dropped, it is carried out all the same.
#[derive(Debug)]
pub struct PendingOrder(Receiver<Result<FileChange, DiskError>>);

impl PendingOrder {
    /// What became of it, once; none: not yet.
    ///
    /// # Errors
    /// When it was not carried out.
    pub fn poll(&self) -> Option<Result<FileChange, OrderError>> {
        match self.0.try_recv() {
            Ok(told) => Some(told.map_err(OrderError::from)),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Err(OrderError::Ended)),
        }
    }

    /// Waits for it; none: it takes longer.
    ///
    /// # Errors
    /// When it was not carried out.
    pub fn wait(&self, patience: Duration) -> Option<Result<FileChange, OrderError>> {
        use std::sync::mpsc::RecvTimeoutError::{Disconnected, Timeout};
        match self.0.recv_timeout(patience) {
            Ok(told) => Some(told.map_err(OrderError::from)),
            Err(Timeout) => None,
            Err(Disconnected) => Some(Err(OrderError::Ended)),
        }
    }
}

/// What is asked for.
pub(crate) enum OrderKind {
    Mark(Mark),
    /// Closes the file, and opens the next.
    Rotate,
    /// The same, in another folder.
    Move(PathBuf),
}

/// What is asked for, and where the answer goes.
pub(crate) struct Order {
    pub(crate) kind: OrderKind,
    answer: SyncSender<Result<FileChange, DiskError>>,
}

impl Order {
    pub(crate) fn new(kind: OrderKind) -> (Self, PendingOrder) {
        let (answer, told) = sync_channel(1);
        (Self { kind, answer }, PendingOrder(told))
    }

    /// Tells what became of it.
    pub(crate) fn answer(self, told: Result<FileChange, DiskError>) {
        // Nobody may wait for it any more.
        let _ = self.answer.try_send(told);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_is_one_line_that_says_something() {
        let mark = |text: &str| Mark { time_ns: 7, epoch: 2, text: text.into() };
        for (text, is_taken) in [
            ("door open", true),
            ("Tür auf", true),
            (&"x".repeat(MARK_BYTES_MAX), true),
            (&"x".repeat(MARK_BYTES_MAX + 1), false),
            ("", false),
            (" ", false),
            ("two\nlines", false),
            ("\u{1b}[2J", false),
        ] {
            assert_eq!(mark(text).check().is_ok(), is_taken, "{text:?}");
        }
        assert_eq!(Mark::of_texts(&mark("a").texts()), Some(mark("a")));
        let mut texts = mark("a").texts();
        texts.insert("time-ns".into(), "soon".into());
        assert_eq!(Mark::of_texts(&texts), None);
    }
}
