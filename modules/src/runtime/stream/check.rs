//! A reader of another module's stream that takes records of one interface alone.

use super::error::{StreamReadError, in_words};
use crate::interface::StreamPort;
use crate::journal::JOURNAL_NUMBER;
use rohrpost_config::Installation;
use rohrpost_mailbox::{
    HeldRecord, Name, Next, Participant, RecordInfo, StreamError, StreamId, StreamInfo, StreamReader,
};
use rohrpost_schema::Description;
use std::borrow::Cow;
use std::sync::Arc;

/// What a program knows of a stream that it reads.
pub(in crate::runtime) struct KnownStream {
    /// Number in its interface.
    pub(in crate::runtime) number: u16,
    /// Its name.
    pub(in crate::runtime) name: Cow<'static, str>,
    /// Hash of the interface.
    pub(in crate::runtime) interface: u32,
}

impl<T> From<StreamPort<T>> for KnownStream {
    fn from(port: StreamPort<T>) -> Self {
        Self { number: port.number, name: port.name.into(), interface: (port.hash)() }
    }
}

/// What is read, and by which interface.
pub(super) struct Source {
    pub(super) id: StreamId,
    /// The stream's name.
    pub(super) name: Cow<'static, str>,
    /// Each of its records is recorded.
    pub(super) is_recorded: bool,
    /// Hash of the interface that this program knows.
    interface: u32,
    installation: Arc<Installation>,
    participant: Arc<Participant>,
    /// The writer's incarnation that was last seen to have the same interface.
    checked: Option<u32>,
    /// The newest epoch of system time that a record was of; 0 before the first.
    epoch: u64,
}

/// A reader that checks which interface the records have that it takes.
pub(in crate::runtime) struct CheckedReader {
    pub(super) reader: StreamReader,
    pub(super) source: Source,
}

impl CheckedReader {
    pub(in crate::runtime) fn open(
        participant: &Arc<Participant>,
        installation: &Arc<Installation>,
        known: KnownStream,
        from: Name,
    ) -> Result<Self, StreamReadError> {
        let KnownStream { number, name, interface } = known;
        let source = Source {
            id: StreamId { name: from.module(), number },
            is_recorded: installation.records_each(from.module(), &name),
            name,
            interface,
            installation: installation.clone(),
            participant: participant.clone(),
            checked: None,
            epoch: 0,
        };
        let reader = participant.stream_reader(source.id).map_err(|error| source.explain(&error))?;
        Ok(Self { reader, source })
    }

    /// Goes back to the oldest record of its present writer that is kept. A stream that cannot be looked at says why
    /// when it is read.
    pub(super) fn rewind(&mut self) {
        let Source { participant, id, .. } = &self.source;
        let info = participant.node().inspect_stream(*id).ok().flatten();
        let Some(StreamInfo { oldest: Some(oldest), newest: Some(newest), .. }) = info else { return };
        let (mut from, mut to) = (oldest.sequence, newest.sequence);
        // What is not there any more counts as older.
        while from < to {
            let middle = from.midpoint(to);
            let record = self.reader.record(middle);
            match record.is_some_and(|record| record.info().incarnation == newest.incarnation) {
                true => to = middle,
                false => from = middle + 1,
            }
        }
        self.reader.seek(from);
    }

    /// Whether it reads a module's journal.
    pub(super) fn is_journal(&self) -> bool {
        self.source.id.number == JOURNAL_NUMBER
    }

    pub(super) fn next(&mut self) -> Result<Next<(HeldRecord<'_>, &Source)>, StreamReadError> {
        let Self { reader, source } = self;
        let next = reader.try_next().map_err(|error| source.explain(&error))?;
        source.check_next(next)
    }

    pub(super) fn newest(&mut self) -> Result<Option<(HeldRecord<'_>, &Source)>, StreamReadError> {
        let Self { reader, source } = self;
        let newest = reader.newest().map_err(|error| source.explain(&error))?;
        newest.map(|record| source.check(record)).transpose()
    }

    pub(super) fn record(&mut self, sequence: u64) -> Result<Option<(HeldRecord<'_>, &Source)>, StreamReadError> {
        let Self { reader, source } = self;
        reader.record(sequence).map(|record| source.check(record)).transpose()
    }
}

impl Source {
    pub(super) fn check_next<'r>(
        &'r mut self,
        next: Next<HeldRecord<'r>>,
    ) -> Result<Next<(HeldRecord<'r>, &'r Self)>, StreamReadError> {
        Ok(match next {
            Next::Record(record) => Next::Record(self.check(record)?),
            Next::Lost(lost) => Next::Lost(lost),
            Next::Nothing => Next::Nothing,
        })
    }

    /// Hands a record on if its writer has the interface that this program knows.
    fn check<'r>(&'r mut self, record: HeldRecord<'r>) -> Result<(HeldRecord<'r>, &'r Self), StreamReadError> {
        let RecordInfo { incarnation, stamp, .. } = record.info();
        if self.checked != Some(incarnation) {
            self.compare()?;
            self.checked = Some(incarnation);
        }
        if stamp.epoch > self.epoch {
            self.tell_epoch(stamp.epoch);
        }
        Ok((record, self))
    }

    /// Compares interfaces: once for each incarnation of the writer. A module that begins with another interface than
    /// the one before it makes its streams anew, so all records of a ring are of the interface that it describes now.
    #[cold]
    fn compare(&self) -> Result<(), StreamReadError> {
        // What says nothing of itself is a tool that writes a stream, or had no room to say it.
        let Some(about) = self.participant.node().about(self.id.name) else { return Ok(()) };
        let theirs = Description::from_bytes(&about).map_or(0, |description| description.hash());
        if theirs == self.interface {
            return Ok(());
        }
        Err(StreamReadError::InterfaceDiffers {
            stream: self.name.clone().into_owned(),
            module: self.module(),
            theirs,
            ours: self.interface,
        })
    }

    /// System time was set: said once, and not for the first record.
    #[cold]
    fn tell_epoch(&mut self, epoch: u64) {
        if std::mem::replace(&mut self.epoch, epoch) != 0 {
            let (stream, module) = (&self.name, self.module());
            tracing::warn!(
                "system time was set: records of stream `{stream}` of {module} are of epoch {epoch} from now on, and \
                 not put together with earlier ones"
            );
        }
    }

    #[cold]
    pub(super) fn explain(&self, error: &StreamError) -> StreamReadError {
        StreamReadError::Ring(in_words(error, self.id, &self.name, &self.installation.classes))
    }

    /// The module, as the configuration has it.
    pub(super) fn module(&self) -> String {
        self.installation.classes.format(self.id.name)
    }
}
