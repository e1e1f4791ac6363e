//! What the reader of a stream said, as a journal has it.

use super::check::Source;
use super::error::StreamReadError;
use crate::journal::{ModuleJournal, NotedValue, Question, Tag};
use rohrpost_mailbox::{Around, HeldRecord, Next, RecordInfo, Stamp};
use serde::{Deserialize, Serialize};

/// What is said of a record.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) struct NotedInfo {
    sequence: u64,
    epoch: u64,
    ns: u64,
    written_ns: u64,
    len_bytes: usize,
    incarnation: u32,
}

/// A record.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) struct NotedRecord<'a> {
    info: NotedInfo,
    #[serde(borrow)]
    bytes: NotedValue<'a>,
}

/// What is next.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) enum NotedNext<'a> {
    Record(#[serde(borrow)] NotedRecord<'a>),
    Lost(u64),
    Nothing,
}

/// What is around a time.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) enum NotedAround {
    Records { before: NotedInfo, after: NotedInfo },
    Empty,
    BeforeOldest { by_ns: u64 },
    NotYet { by_ns: u64 },
    OtherEpoch { newest: u64 },
}

/// Why it could not be read. That a value cannot be read is found by the module, and not noted.
#[derive(Clone, Serialize, Deserialize)]
pub(in crate::runtime) enum NotedReadError {
    Ring(String),
    InterfaceDiffers { stream: String, module: String, theirs: u32, ours: u32 },
}

/// A record that is given back.
pub(super) type GivenRecord = (RecordInfo, Vec<u8>);

impl From<RecordInfo> for NotedInfo {
    fn from(info: RecordInfo) -> Self {
        let RecordInfo { sequence, stamp: Stamp { epoch, ns }, written_ns, len_bytes, incarnation } = info;
        Self { sequence, epoch, ns, written_ns, len_bytes, incarnation }
    }
}

impl From<NotedInfo> for RecordInfo {
    fn from(info: NotedInfo) -> Self {
        let NotedInfo { sequence, epoch, ns, written_ns, len_bytes, incarnation } = info;
        Self { sequence, stamp: Stamp { epoch, ns }, written_ns, len_bytes, incarnation }
    }
}

impl<'a> NotedRecord<'a> {
    /// As this journal is to have it.
    pub(super) fn of(journal: &ModuleJournal, (held, source): &'a (HeldRecord<'_>, &Source)) -> Self {
        let info = held.info();
        let bytes = journal.record(source.id, info.sequence, source.is_recorded, held.body());
        Self { info: info.into(), bytes }
    }

    /// The same of one that is there, perhaps.
    pub(super) fn of_some(journal: &ModuleJournal, record: &'a Option<(HeldRecord<'_>, &Source)>) -> Option<Self> {
        record.as_ref().map(|record| Self::of(journal, record))
    }

    fn given(self, journal: &ModuleJournal) -> GivenRecord {
        (self.info.into(), journal.bytes(self.bytes).into_owned())
    }
}

impl<'a> NotedNext<'a> {
    /// As this journal is to have it.
    pub(super) fn of(journal: &ModuleJournal, next: &'a Next<(HeldRecord<'_>, &Source)>) -> Self {
        match next {
            Next::Record(record) => Self::Record(NotedRecord::of(journal, record)),
            Next::Lost(lost) => Self::Lost(*lost),
            Next::Nothing => Self::Nothing,
        }
    }
}

impl From<Around> for NotedAround {
    fn from(around: Around) -> Self {
        match around {
            Around::Records { before, after } => Self::Records { before: before.into(), after: after.into() },
            Around::Empty => Self::Empty,
            Around::BeforeOldest { by_ns } => Self::BeforeOldest { by_ns },
            Around::NotYet { by_ns } => Self::NotYet { by_ns },
            Around::OtherEpoch { newest } => Self::OtherEpoch { newest },
        }
    }
}

impl From<NotedAround> for Around {
    fn from(around: NotedAround) -> Self {
        match around {
            NotedAround::Records { before, after } => Self::Records { before: before.into(), after: after.into() },
            NotedAround::Empty => Self::Empty,
            NotedAround::BeforeOldest { by_ns } => Self::BeforeOldest { by_ns },
            NotedAround::NotYet { by_ns } => Self::NotYet { by_ns },
            NotedAround::OtherEpoch { newest } => Self::OtherEpoch { newest },
        }
    }
}

impl From<&StreamReadError> for NotedReadError {
    fn from(error: &StreamReadError) -> Self {
        match error.clone() {
            StreamReadError::InterfaceDiffers { stream, module, theirs, ours } => {
                Self::InterfaceDiffers { stream, module, theirs, ours }
            }
            StreamReadError::Ring(text) => Self::Ring(text),
            StreamReadError::Unreadable(error) => Self::Ring(error.to_string()),
        }
    }
}

impl From<NotedReadError> for StreamReadError {
    fn from(error: NotedReadError) -> Self {
        match error {
            NotedReadError::Ring(text) => Self::Ring(text),
            NotedReadError::InterfaceDiffers { stream, module, theirs, ours } => {
                Self::InterfaceDiffers { stream, module, theirs, ours }
            }
        }
    }
}

/// Notes what a reader said.
pub(in crate::runtime) fn note<'r, R, N: Serialize>(
    journal: &ModuleJournal,
    tag: Tag,
    question: Question<'_>,
    answer: &'r Result<R, StreamReadError>,
    content: impl FnOnce(&'r R) -> N,
) {
    if !journal.is_none() {
        journal.note(tag, question, &answer.as_ref().map(content).map_err(NotedReadError::from));
    }
}

/// Whether it was opened then.
pub(in crate::runtime) fn opened(
    journal: &ModuleJournal,
    question: Question<'_>,
) -> Option<Result<(), StreamReadError>> {
    let given = journal.given(Tag::Opened, question)?;
    let opened: Result<(), NotedReadError> = given.read();
    Some(opened.map_err(StreamReadError::from))
}

/// The record that was read then, if there was one.
pub(super) fn record(
    journal: &ModuleJournal,
    tag: Tag,
    question: Question<'_>,
) -> Option<Result<Option<GivenRecord>, StreamReadError>> {
    let given = journal.given(tag, question)?;
    let record: Result<Option<NotedRecord<'_>>, NotedReadError> = given.read();
    Some(record.map(|record| record.map(|record| record.given(journal))).map_err(StreamReadError::from))
}

/// What was next then.
pub(super) fn next(
    journal: &ModuleJournal,
    question: Question<'_>,
) -> Option<Result<Next<GivenRecord>, StreamReadError>> {
    let given = journal.given(Tag::Next, question)?;
    let next: Result<NotedNext<'_>, NotedReadError> = given.read();
    let next = next.map(|next| match next {
        NotedNext::Record(record) => Next::Record(record.given(journal)),
        NotedNext::Lost(lost) => Next::Lost(lost),
        NotedNext::Nothing => Next::Nothing,
    });
    Some(next.map_err(StreamReadError::from))
}

/// What was around a time then.
pub(super) fn around(journal: &ModuleJournal, question: Question<'_>) -> Option<Result<Around, StreamReadError>> {
    let given = journal.given(Tag::Around, question)?;
    let around: Result<NotedAround, NotedReadError> = given.read();
    Some(around.map(Around::from).map_err(StreamReadError::from))
}
