//! Streams of which the module is given each record.

use super::check::{CheckedReader, Source as Followed};
use super::error::StreamReadError;
use crate::common::DataHead;
use crate::journal::JOURNAL_NAME;
use crate::runtime::received::Received;
use crate::runtime::subscribed::{Origin, Subscribed, seal};
use rohrpost_mailbox::{HeldRecord, Missed, Name, Next, Source, Throttle, monotonic_ns};
use rohrpost_schema::Data;
use std::marker::PhantomData;
use std::time::{Duration, Instant};

/// Losses are told at most so often.
const TELL_EVERY_NS: u64 = 10_000_000_000;
/// A stream that cannot be read is tried again after so long.
const RETRY: Duration = Duration::from_millis(100);

/// Each record of a stream, made by [`super::super::Context::subscribe_stream`]; [`super::super::Received::read`] tells
/// whether data belong to it.
///
/// ```
/// use rohrpost_modules::runtime::{Received, StreamSubscription, Unreadable};
/// use rohrpost_modules::types::Pose;
///
/// fn x_m(data: &Received<'_>, poses: &StreamSubscription<Pose>) -> Result<Option<f64>, Unreadable> {
///     Ok(data.read(poses)?.map(|pose| pose.x_m))
/// }
/// ```
pub struct StreamSubscription<T> {
    id: u16,
    data: PhantomData<fn() -> T>,
}

impl<T> StreamSubscription<T> {
    /// Tells it from others of the module.
    pub(in crate::runtime) fn id(&self) -> u16 {
        self.id
    }
}

impl<T> Clone for StreamSubscription<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for StreamSubscription<T> {}

impl<T: Data> Subscribed for StreamSubscription<T> {
    type Item = T;
}

impl<T> seal::Kind for StreamSubscription<T> {
    fn brought(&self, origin: Origin) -> bool {
        matches!(origin, Origin::Stream { id, .. } if id == self.id)
    }
}

/// A stream that is followed.
pub(crate) struct FollowedStream {
    reader: CheckedReader,
    id: u16,
    /// Nothing of it is to be missing at its ends.
    is_whole: bool,
    notices: Notices,
}

/// What was told of it.
struct Notices {
    /// The stream's name.
    stream: String,
    /// The module that writes it.
    module: String,
    /// What is missed so far.
    missed: Missed,
    /// Of losses.
    throttle: Throttle,
    /// What the last refusal said, so that it is told once.
    refusal: Option<String>,
    /// Not read before then, since it could not be.
    retry: Option<Instant>,
}

/// All that a module follows.
#[derive(Default)]
pub(crate) struct FollowedStreams {
    /// Those that are not being worked off.
    pub(in crate::runtime) list: Vec<FollowedStream>,
    /// To be rewound once they are not being worked off, and to where.
    rewound: Vec<(u16, Rewind)>,
    /// Ever made.
    made: u16,
}

/// Where a followed stream goes on.
#[derive(Clone, Copy)]
enum Rewind {
    /// At the oldest record that is kept of its present writer, and nothing of it is to be missing.
    Oldest,
    /// At this sequence, and nothing of it is to be missing.
    Whole(u64),
    /// At this sequence.
    Resume(u64),
}

/// What a followed stream has for the module.
pub(in crate::runtime) enum Step<'a> {
    /// A record.
    Record(FollowedRecord<'a>),
    /// Not a record, but more may be there.
    Again,
    /// Nothing now.
    Nothing,
}

/// A record in hand.
pub(in crate::runtime) struct FollowedRecord<'a> {
    held: HeldRecord<'a>,
    source: &'a Followed,
    /// Which subscription.
    id: u16,
    /// Missed until now.
    missed: Missed,
}

impl FollowedRecord<'_> {
    pub(in crate::runtime) fn received(&self) -> Received<'_> {
        let info = self.held.info();
        let head = DataHead {
            stamp_ns: info.stamp.ns,
            sequence: info.sequence as u32,
            missed: u32::try_from(lost(&self.missed)).unwrap_or(u32::MAX),
            incarnation: 0,
        };
        let (from, number) = (self.source.id.name, self.source.id.number);
        let origin = Origin::Stream { id: self.id, stamp: info.stamp, is_recorded: self.source.is_recorded };
        Received::new(from, number, origin, head, self.held.body()).held(&self.held, self.missed)
    }
}

impl FollowedStreams {
    /// None when all ids are used up.
    pub(in crate::runtime) fn follow<T>(&mut self, mut reader: CheckedReader) -> Option<StreamSubscription<T>> {
        let id = self.made;
        self.made = id.checked_add(1)?;
        let (stream, module) = (reader.source.name.clone().into_owned(), reader.source.module());
        let is_whole = reader.is_journal();
        if is_whole {
            // From its beginning on, as far as it is there.
            reader.reader.seek(0);
        }
        let (missed, throttle) = (Missed::default(), Throttle::default());
        let notices = Notices { stream, module, missed, throttle, refusal: None, retry: None };
        self.list.push(FollowedStream { reader, id, is_whole, notices });
        Some(StreamSubscription { id, data: PhantomData })
    }

    /// Goes back to this sequence; without one, to the oldest record that a stream keeps of its present writer.
    pub(in crate::runtime) fn rewind<T>(&mut self, of: &StreamSubscription<T>, to: Option<u64>) {
        self.go(of, to.map_or(Rewind::Oldest, Rewind::Whole));
    }

    /// Goes on from this sequence; later, what is written while the module is off is passed over.
    pub(in crate::runtime) fn resume<T>(&mut self, of: &StreamSubscription<T>, sequence: u64) {
        self.go(of, Rewind::Resume(sequence));
    }

    fn go<T>(&mut self, of: &StreamSubscription<T>, to: Rewind) {
        match self.list.iter_mut().find(|stream| stream.id == of.id) {
            Some(stream) => stream.rewind(to),
            None => self.rewound.push((of.id, to)),
        }
    }

    /// Whether one that is being worked off is to be rewound first.
    pub(in crate::runtime) fn is_rewound(&self) -> bool {
        !self.rewound.is_empty()
    }

    /// Those that were worked off come back.
    pub(in crate::runtime) fn put_back(&mut self, mut worked: Vec<FollowedStream>) {
        worked.append(&mut self.list);
        self.list = worked;
        for (id, to) in std::mem::take(&mut self.rewound) {
            self.list.iter_mut().filter(|stream| stream.id == id).for_each(|stream| stream.rewind(to));
        }
    }

    /// Passes over what was written until now, but of those of which nothing is to be missing.
    pub(in crate::runtime) fn pass_over(&mut self) {
        for stream in self.list.iter_mut().filter(|stream| !stream.is_whole) {
            if let Err(error) = stream.reader.reader.pass_over() {
                stream.notices.refused(&stream.reader.source.explain(&error));
            }
        }
    }

    /// For each the publisher, the number of the data, records received and records lost.
    pub(in crate::runtime) fn tallies(&self) -> impl Iterator<Item = (Name, u16, u64, u64)> {
        self.list.iter().map(|stream| {
            let (id, reader) = (stream.reader.source.id, &stream.reader.reader);
            (id.name, id.number, reader.accounts().0, lost(&reader.missed()))
        })
    }

    /// Records that did not come to this node, or were overwritten before the module came to them.
    pub(in crate::runtime) fn lost(&self) -> u64 {
        self.tallies().map(|(_, _, _, lost)| lost).sum()
    }

    /// A stream of which the last records could not be read.
    pub(in crate::runtime) fn complaint(&self) -> Option<&str> {
        self.list.iter().find_map(|stream| stream.notices.refusal.as_deref())
    }

    /// When one that could not be read is tried again.
    pub(in crate::runtime) fn retry(&self) -> Option<Instant> {
        self.list.iter().filter_map(|stream| stream.notices.retry).min()
    }

    /// What wakes the module. Journals wait for its next turn: those that write them must not pay for waking it.
    pub(in crate::runtime) fn sources(&mut self) -> impl Iterator<Item = &mut (dyn Source + 'static)> {
        let is_awaited = |stream: &&mut FollowedStream| stream.notices.retry.is_none() && !stream.is_journal();
        let awaited = self.list.iter_mut().filter(is_awaited);
        awaited.map(|stream| -> &mut (dyn Source + 'static) { &mut stream.reader.reader })
    }
}

impl FollowedStream {
    /// Whether it is the journal of a module.
    fn is_journal(&self) -> bool {
        self.reader.is_journal()
    }

    /// Whether what is there at the module's end is read before.
    pub(in crate::runtime) fn is_whole(&self) -> bool {
        self.is_whole
    }

    fn rewind(&mut self, to: Rewind) {
        self.is_whole |= !matches!(to, Rewind::Resume(_));
        match to {
            Rewind::Whole(sequence) | Rewind::Resume(sequence) => self.reader.reader.seek(sequence),
            Rewind::Oldest => self.reader.rewind(),
        }
    }

    /// The next record, or what there is instead.
    pub(in crate::runtime) fn step(&mut self) -> Step<'_> {
        let Self { reader, id, notices, .. } = self;
        if notices.retry.is_some_and(|retry| Instant::now() < retry) {
            return Step::Nothing;
        }
        notices.retry = None;
        // Of what is lost, this is all before the next record.
        let (id, missed) = (*id, reader.reader.missed());
        if lost(&missed) != lost(&notices.missed) {
            notices.tell_missed(missed);
        }
        match reader.next() {
            Ok(Next::Record((held, source))) => {
                notices.refusal = None;
                Step::Record(FollowedRecord { held, source, id, missed })
            }
            Ok(Next::Lost(_)) => Step::Again,
            Ok(Next::Nothing) => Step::Nothing,
            Err(error) => {
                notices.refused(&error);
                // That record is passed over, and the next one looked at.
                if let StreamReadError::InterfaceDiffers { .. } = error { Step::Again } else { Step::Nothing }
            }
        }
    }
}

/// What a replica leaves out on purpose is not lost.
fn lost(missed: &Missed) -> u64 {
    missed.lost.saturating_add(missed.passed_over)
}

impl Notices {
    #[cold]
    fn tell_missed(&mut self, missed: Missed) {
        let new = missed.since(&self.missed);
        self.missed = missed;
        if self.throttle.note(monotonic_ns(), TELL_EVERY_NS).is_none() {
            return;
        }
        let Self { stream, module, .. } = self;
        if new.passed_over == 0 {
            let lost = missed.lost;
            return tracing::warn!(
                "{lost} records of stream `{stream}` of {module} were lost on the way to this node; `rohrpost net` \
                 says where"
            );
        }
        let remedy = if stream == JOURNAL_NAME {
            format!("it is replayed exactly up to there, and no further; let {module} take and say less at once")
        } else {
            format!("raise `keep` in [module.stream.{stream}] of {module}, or read only the newest")
        };
        tracing::warn!(
            "{} records of stream `{stream}` of {module} were overwritten before this module came to them: it is \
             slower than they are written; {remedy}",
            missed.passed_over
        );
    }

    #[cold]
    fn refused(&mut self, error: &StreamReadError) {
        if let StreamReadError::Ring(_) = error {
            self.retry = Some(Instant::now() + RETRY);
        }
        let text = error.to_string();
        if self.refusal.as_ref() != Some(&text) {
            tracing::warn!("{text}");
            self.refusal = Some(text);
        }
    }
}
