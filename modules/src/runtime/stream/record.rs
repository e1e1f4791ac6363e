//! A record of another module's stream, in hand.

use super::check::Source;
use super::noted::GivenRecord;
use crate::fusion::Stamp;
use crate::runtime::unreadable::Unreadable;
use rohrpost_mailbox::{HeldRecord, RecordInfo, RecordPlace};
use rohrpost_schema::{Data, View};
use std::marker::PhantomData;

/// A record in hand, read where it lies: its writer goes round it. Dropped, the writer may have its place; so do not
/// keep it for long.
///
/// ```
/// use rohrpost_modules::runtime::{Record, Unreadable};
/// use rohrpost_modules::schema::View;
/// use rohrpost_modules::types::Pose;
///
/// fn heading_rad(record: &Record<'_, Pose>) -> Result<f64, Unreadable> {
///     Ok(record.read()?.heading_rad)
/// }
///
/// /// Decodes the fields alone; bytes stay where they are.
/// fn look<T: View>(record: &Record<'_, T>, see: impl Fn(T::View<'_>)) -> Result<(), Unreadable> {
///     see(record.view()?);
///     Ok(())
/// }
/// ```
pub struct Record<'a, T> {
    body: RecordBody<'a>,
    source: &'a Source,
    data: PhantomData<fn() -> T>,
}

/// Bytes of a record that stays held.
pub enum StayingBytes {
    /// In its ring.
    Ring(RecordPlace),
    /// Of a journal that is replayed.
    Journal(Vec<u8>),
}

/// Where a record is.
enum RecordBody<'a> {
    /// In its ring.
    Held(HeldRecord<'a>),
    /// In a journal that is replayed.
    Given(GivenRecord),
}

impl<'a, T: Data> Record<'a, T> {
    pub(super) fn new((held, source): (HeldRecord<'a>, &'a Source)) -> Self {
        Self { body: RecordBody::Held(held), source, data: PhantomData }
    }

    pub(super) fn given(given: GivenRecord, source: &'a Source) -> Self {
        Self { body: RecordBody::Given(given), source, data: PhantomData }
    }

    /// What is said of it: sequence, stamp, when it was written.
    pub fn info(&self) -> RecordInfo {
        match &self.body {
            RecordBody::Held(held) => held.info(),
            RecordBody::Given((info, _)) => *info,
        }
    }

    /// When it was true, with the epoch of system time.
    pub fn stamp(&self) -> Stamp {
        let stamp = self.info().stamp;
        Stamp::new(stamp.epoch, stamp.ns)
    }

    /// When it was true, ns since 1970.
    pub fn stamp_ns(&self) -> u64 {
        self.stamp().ns
    }

    /// The value.
    ///
    /// # Errors
    /// It is not what the interface says.
    pub fn read(&self) -> Result<T, Unreadable> {
        self.decode()
    }

    /// The value, with its bytes where they lie.
    ///
    /// # Errors
    /// It is not what the interface says.
    pub fn view(&self) -> Result<T::View<'_>, Unreadable>
    where
        T: View,
    {
        self.decode()
    }

    /// The value, in postcard.
    pub fn bytes(&self) -> &[u8] {
        match &self.body {
            RecordBody::Held(held) => held.body(),
            RecordBody::Given((_, bytes)) => bytes,
        }
    }

    /// Stays held until its stream reads another record; what is said of it, and where its bytes are. For programs in
    /// other languages that hand out a view of it.
    pub fn stay(self) -> (RecordInfo, StayingBytes) {
        let info = self.info();
        match self.body {
            RecordBody::Held(held) => (info, StayingBytes::Ring(held.stay())),
            RecordBody::Given((_, bytes)) => (info, StayingBytes::Journal(bytes)),
        }
    }

    fn decode<'r, V: serde::Deserialize<'r>>(&'r self) -> Result<V, Unreadable> {
        let id = self.source.id;
        postcard::from_bytes(self.bytes()).map_err(|error| Unreadable::new(id.name, id.number, error))
    }
}
