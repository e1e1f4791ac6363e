//! A stream of another module, looked at when the module likes.

use super::check::CheckedReader;
use super::error::StreamReadError;
use super::moment::Moment;
use super::noted::{self, NotedAround, NotedNext, NotedRecord, note};
use super::record::Record;
use crate::fusion::{Interpolate, NoValue, Share, Stamp};
use crate::journal::{Question, Tag, nanoseconds};
use crate::runtime::clock::ModuleClock;
use rohrpost_mailbox::{Around, Missed, Next};
use rohrpost_schema::Data;
use std::marker::PhantomData;
use std::time::Duration;

/// Looks for values around a time before it says that they left the ring meanwhile.
const TRIES: usize = 3;

/// A stream of another module, made by [`super::super::Context::stream`]. It has a position of its own, and one of the
/// stream's seats. Nothing is copied and nothing waits: the module looks when it likes.
///
/// ```
/// use rohrpost_modules::fusion::NoValue;
/// use rohrpost_modules::runtime::{Context, ContextError, Stream, StreamReadError};
/// use rohrpost_modules::{interface, types::Pose};
///
/// /// Knows where the crane is.
/// #[interface(class = "crane", crate = rohrpost_modules::macro_support)]
/// pub trait Crane {
///     /// Where its hook hangs.
///     #[stream(1)]
///     fn hook() -> Pose;
/// }
///
/// fn open(context: &mut Context) -> Result<Stream<Pose>, ContextError> {
///     Ok(context.stream(CraneInterface::HOOK, "crane.0")?.with_gap(std::time::Duration::from_millis(200)))
/// }
///
/// fn where_was_it(hook: &mut Stream<Pose>, stamp_ns: u64) -> Result<Option<Pose>, StreamReadError> {
///     match hook.at(stamp_ns)? {
///         Ok(pose) => Ok(Some(pose)),                // interpolated, and final
///         Err(NoValue::NotYet { .. }) => Ok(None),   // ask again later
///         Err(never) => { tracing::debug!("no pose: {never}"); Ok(None) }
///     }
/// }
/// ```
pub struct Stream<T> {
    reader: CheckedReader,
    clock: ModuleClock,
    gap_max_ns: u64,
    data: PhantomData<fn() -> T>,
}

impl<T: Data> Stream<T> {
    pub(in crate::runtime) fn new(reader: CheckedReader, clock: ModuleClock) -> Self {
        Self { reader, clock, gap_max_ns: u64::MAX, data: PhantomData }
    }

    /// Values further apart than this have none in between; without it, however far they are apart.
    #[must_use]
    pub fn with_gap(mut self, longest: Duration) -> Self {
        self.gap_max_ns = u64::try_from(longest.as_nanos()).unwrap_or(u64::MAX);
        self
    }

    /// The newest record; none before the first. The position stays.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Stream, StreamReadError};
    /// fn height_now_m(heights: &mut Stream<f64>) -> Result<Option<f64>, StreamReadError> {
    ///     let newest = heights.newest()?;
    ///     Ok(newest.map(|record| record.read()).transpose()?)
    /// }
    /// ```
    ///
    /// # Errors
    /// The stream cannot be read, or is of another interface.
    pub fn newest(&mut self) -> Result<Option<Record<'_, T>>, StreamReadError> {
        let (reader, journal) = (&mut self.reader, self.clock.journal());
        let question = Question::Of(reader.source.id.into());
        if let Some(given) = noted::record(journal, Tag::Newest, question) {
            return Ok(given?.map(|record| Record::given(record, &reader.source)));
        }
        let newest = reader.newest();
        note(journal, Tag::Newest, question, &newest, |newest| NotedRecord::of_some(journal, newest));
        Ok(newest?.map(Record::new))
    }

    /// The next record; the first time the first one written after the stream was opened.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Stream, StreamReadError};
    /// use rohrpost_mailbox::Next;
    ///
    /// fn work_off(heights: &mut Stream<f64>) -> Result<(), StreamReadError> {
    ///     loop {
    ///         match heights.try_next()? {
    ///             Next::Record(record) => println!("{} at {}", record.read()?, record.stamp_ns()),
    ///             Next::Lost(lost) => println!("{lost} are missed; `heights.missed()` tells why"),
    ///             Next::Nothing => return Ok(()),
    ///         }
    ///     }
    /// }
    /// ```
    ///
    /// # Errors
    /// As for [`Stream::newest`].
    pub fn try_next(&mut self) -> Result<Next<Record<'_, T>>, StreamReadError> {
        let (reader, journal) = (&mut self.reader, self.clock.journal());
        let question = Question::Of(reader.source.id.into());
        if let Some(given) = noted::next(journal, question) {
            return Ok(given?.map(|record| Record::given(record, &reader.source)));
        }
        let next = reader.next();
        note(journal, Tag::Next, question, &next, |next| NotedNext::of(journal, next));
        Ok(next?.map(Record::new))
    }

    /// As [`Stream::try_next`]; waits for a record, at most so long. All else of the module waits as well.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Stream, StreamReadError};
    /// # use rohrpost_mailbox::Next;
    /// fn moves(heights: &mut Stream<f64>) -> Result<bool, StreamReadError> {
    ///     Ok(!matches!(heights.next_within(std::time::Duration::from_millis(2))?, Next::Nothing))
    /// }
    /// ```
    ///
    /// # Errors
    /// As for [`Stream::newest`].
    pub fn next_within(&mut self, timeout: Duration) -> Result<Next<Record<'_, T>>, StreamReadError> {
        let (CheckedReader { reader, source }, journal) = (&mut self.reader, self.clock.journal());
        let question = Question::Within(source.id.into(), nanoseconds(timeout));
        if let Some(given) = noted::next(journal, question) {
            return Ok(given?.map(|record| Record::given(record, source)));
        }
        let next = match reader.next_timeout(timeout) {
            Ok(next) => source.check_next(next),
            Err(error) => Err(source.explain(&error)),
        };
        note(journal, Tag::Next, question, &next, |next| NotedNext::of(journal, next));
        Ok(next?.map(Record::new))
    }

    /// Whether [`Stream::try_next`] has something to tell.
    pub fn has_next(&self) -> bool {
        self.clock.journal().answer(Tag::HasNext, self.asked(), || self.reader.reader.has_next())
    }

    /// The record of this sequence; none when it is there no more, or not yet. The position stays.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Stream, StreamReadError};
    /// fn stamp_ns(heights: &mut Stream<f64>, sequence: u64) -> Result<Option<u64>, StreamReadError> {
    ///     Ok(heights.record(sequence)?.map(|record| record.stamp_ns()))
    /// }
    /// ```
    ///
    /// # Errors
    /// As for [`Stream::newest`].
    pub fn record(&mut self, sequence: u64) -> Result<Option<Record<'_, T>>, StreamReadError> {
        let (reader, journal) = (&mut self.reader, self.clock.journal());
        let question = Question::Sequence(reader.source.id.into(), sequence);
        if let Some(given) = noted::record(journal, Tag::Record, question) {
            return Ok(given?.map(|record| Record::given(record, &reader.source)));
        }
        let record = reader.record(sequence);
        note(journal, Tag::Record, question, &record, |record| NotedRecord::of_some(journal, record));
        Ok(record?.map(Record::new))
    }

    /// [`Stream::try_next`] goes on from this sequence. What is there no more counts as lost.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Stream;
    /// fn once_more(heights: &mut Stream<f64>) {
    ///     heights.from(heights.position().saturating_sub(10));
    /// }
    /// ```
    pub fn from(&mut self, sequence: u64) {
        let question = Question::Sequence(self.reader.source.id.into(), sequence);
        self.clock.journal().asked(Tag::Sought, question);
        self.reader.reader.seek(sequence);
    }

    /// Sequence of the next record to read.
    pub fn position(&self) -> u64 {
        self.clock.journal().answer(Tag::Position, self.asked(), || self.reader.reader.position())
    }

    /// Records read by [`Stream::try_next`], and records lost on the way.
    pub fn accounts(&self) -> (u64, u64) {
        self.clock.journal().answer(Tag::Accounts, self.asked(), || self.reader.reader.accounts())
    }

    /// Those lost on the way by cause, in records; what [`Next::Lost`] has just told is among them.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Stream;
    /// fn is_too_slow(heights: &Stream<f64>) -> bool {
    ///     let missed = heights.missed();
    ///     // The network, and what the configuration leaves out, are not this module's doing.
    ///     missed.passed_over > missed.lost + missed.sampled
    /// }
    /// ```
    pub fn missed(&self) -> Missed {
        let ask = || {
            let Missed { lost, sampled, passed_over } = self.reader.reader.missed();
            (lost, sampled, passed_over)
        };
        let (lost, sampled, passed_over) = self.clock.journal().answer(Tag::Missed, self.asked(), ask);
        Missed { lost, sampled, passed_over }
    }

    /// The two records around a time, or exactly why not. [`Stream::record`] reads each.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Stream, StreamReadError};
    /// # use rohrpost_mailbox::Around;
    /// fn nearest(heights: &mut Stream<f64>, at_ns: u64) -> Result<Option<u64>, StreamReadError> {
    ///     let Around::Records { before, after } = heights.around(at_ns)? else { return Ok(None) };
    ///     let is_before = at_ns - before.stamp.ns <= after.stamp.ns - at_ns;
    ///     Ok(Some(if is_before { before.sequence } else { after.sequence }))
    /// }
    /// ```
    ///
    /// # Errors
    /// As for [`Stream::newest`].
    pub fn around(&mut self, at: impl Into<Moment>) -> Result<Around, StreamReadError> {
        let Stamp { epoch, ns } = self.stamp(at.into());
        let (CheckedReader { reader, source }, journal) = (&mut self.reader, self.clock.journal());
        let question = Question::Time(source.id.into(), epoch, ns);
        if let Some(given) = noted::around(journal, question) {
            return given;
        }
        let around = reader.around(rohrpost_mailbox::Stamp { epoch, ns }).map_err(|error| source.explain(&error));
        note(journal, Tag::Around, question, &around, |around| NotedAround(*around));
        around
    }

    /// The value at a time: that of the record with this stamp, or interpolated between the two around it; or exactly
    /// why there is none. A value is final: nothing that is written later changes it.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Received, Stream, StreamReadError};
    /// # use rohrpost_modules::{fusion::NoValue, types::Pose};
    /// fn pose_then(poses: &mut Stream<Pose>, scan: &Received<'_>) -> Result<Result<Pose, NoValue>, StreamReadError> {
    ///     poses.at(scan.moment()) // of the same epoch as the scan
    /// }
    /// ```
    ///
    /// # Errors
    /// As for [`Stream::newest`], and when a record cannot be read.
    pub fn at(&mut self, at: impl Into<Moment>) -> Result<Result<T, NoValue>, StreamReadError>
    where
        T: Interpolate,
    {
        let stamp = self.stamp(at.into());
        let mut by_ns = 0;
        // Again if the writer has put others in their place meanwhile.
        for _ in 0..TRIES {
            let (before, after) = match self.around(stamp)? {
                Around::Records { before, after } => (before, after),
                Around::Empty => return Ok(Err(NoValue::Empty)),
                Around::BeforeOldest { by_ns } => return Ok(Err(NoValue::BeforeOldest { by_ns })),
                Around::NotYet { by_ns } => return Ok(Err(NoValue::NotYet { by_ns })),
                Around::OtherEpoch { newest } => {
                    return Ok(Err(NoValue::OtherEpoch { asked: stamp.epoch, known: newest }));
                }
            };
            let gap_ns = after.stamp.ns.saturating_sub(before.stamp.ns);
            if gap_ns > self.gap_max_ns {
                return Ok(Err(NoValue::Gap { gap_ns, gap_max_ns: self.gap_max_ns }));
            }
            by_ns = after.stamp.ns.saturating_sub(stamp.ns);
            let Some(from) = self.value(before.sequence)? else { continue };
            let share = Share::between(before.stamp.ns, stamp.ns, after.stamp.ns);
            let Some(share) = share.filter(|_| before.sequence != after.sequence) else { return Ok(Ok(from)) };
            let Some(to) = self.value(after.sequence)? else { continue };
            return Ok(Ok(T::interpolate(&from, &to, share)));
        }
        Ok(Err(NoValue::BeforeOldest { by_ns }))
    }

    fn value(&mut self, sequence: u64) -> Result<Option<T>, StreamReadError> {
        let record = self.record(sequence)?;
        Ok(record.map(|record| record.read()).transpose()?)
    }

    /// Asks something of the stream.
    fn asked(&self) -> Question<'static> {
        Question::Of(self.reader.source.id.into())
    }

    fn stamp(&self, moment: Moment) -> Stamp {
        match moment {
            Moment::Stamp(stamp) => stamp,
            Moment::Ns(ns) => Stamp::new(self.clock.now().epoch, ns),
        }
    }
}
