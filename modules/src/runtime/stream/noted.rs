//! What the reader of a stream said, as a journal has it.

use super::check::Source;
use super::error::StreamReadError;
use crate::journal::{ModuleJournal, NotedValue, Question, Tag};
use rohrpost_mailbox::{Around, HeldRecord, Next, RecordInfo, Stamp};
use serde::{Deserialize, Serialize};

/// How what is said of a record is written and read; `rohrpost-mailbox` knows no serialization.
#[derive(Serialize, Deserialize)]
#[serde(remote = "RecordInfo")]
struct NotedInfo {
    sequence: u64,
    #[serde(with = "NotedStamp")]
    stamp: Stamp,
    written_ns: u64,
    len_bytes: usize,
    incarnation: u32,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Stamp")]
struct NotedStamp {
    epoch: u64,
    ns: u64,
}

/// A record.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) struct NotedRecord<'a> {
    #[serde(with = "NotedInfo")]
    info: RecordInfo,
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

/// How what is around a time is written and read.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Around")]
enum AroundForm {
    Records {
        #[serde(with = "NotedInfo")]
        before: RecordInfo,
        #[serde(with = "NotedInfo")]
        after: RecordInfo,
    },
    Empty,
    BeforeOldest {
        by_ns: u64,
    },
    NotYet {
        by_ns: u64,
    },
    OtherEpoch {
        newest: u64,
    },
}

/// What is around a time.
#[derive(Serialize, Deserialize)]
pub(super) struct NotedAround(#[serde(with = "AroundForm")] pub(super) Around);

/// A record that is given back.
pub(super) type GivenRecord = (RecordInfo, Vec<u8>);

impl<'a> NotedRecord<'a> {
    /// As this journal is to have it.
    pub(super) fn of(journal: &ModuleJournal, (held, source): &'a (HeldRecord<'_>, &Source)) -> Self {
        let info = held.info();
        let bytes = journal.record(source.id, info.sequence, source.is_recorded, held.body());
        Self { info, bytes }
    }

    /// The same of one that is there, perhaps.
    pub(super) fn of_some(journal: &ModuleJournal, record: &'a Option<(HeldRecord<'_>, &Source)>) -> Option<Self> {
        record.as_ref().map(|record| Self::of(journal, record))
    }

    fn given(self, journal: &ModuleJournal) -> GivenRecord {
        (self.info, journal.bytes(self.bytes).into_owned())
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

/// Notes what a reader said.
pub(in crate::runtime) fn note<'r, R, N: Serialize>(
    journal: &ModuleJournal,
    tag: Tag,
    question: Question<'_>,
    answer: &'r Result<R, StreamReadError>,
    content: impl FnOnce(&'r R) -> N,
) {
    if !journal.is_none() {
        journal.note(tag, question, &answer.as_ref().map(content));
    }
}

/// Whether it was opened then.
pub(in crate::runtime) fn opened(
    journal: &ModuleJournal,
    question: Question<'_>,
) -> Option<Result<(), StreamReadError>> {
    Some(journal.given(Tag::Opened, question)?.read())
}

/// The record that was read then, if there was one.
pub(super) fn record(
    journal: &ModuleJournal,
    tag: Tag,
    question: Question<'_>,
) -> Option<Result<Option<GivenRecord>, StreamReadError>> {
    let given = journal.given(tag, question)?;
    let record: Result<Option<NotedRecord<'_>>, StreamReadError> = given.read();
    Some(record.map(|record| record.map(|record| record.given(journal))))
}

/// What was next then.
pub(super) fn next(
    journal: &ModuleJournal,
    question: Question<'_>,
) -> Option<Result<Next<GivenRecord>, StreamReadError>> {
    let given = journal.given(Tag::Next, question)?;
    let next: Result<NotedNext<'_>, StreamReadError> = given.read();
    Some(next.map(|next| match next {
        NotedNext::Record(record) => Next::Record(record.given(journal)),
        NotedNext::Lost(lost) => Next::Lost(lost),
        NotedNext::Nothing => Next::Nothing,
    }))
}

/// What was around a time then.
pub(super) fn around(journal: &ModuleJournal, question: Question<'_>) -> Option<Result<Around, StreamReadError>> {
    let around: Result<NotedAround, StreamReadError> = journal.given(Tag::Around, question)?.read();
    Some(around.map(|noted| noted.0))
}
