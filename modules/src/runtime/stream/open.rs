//! A value on its way into a record.

use super::encode::{self, EncodeError};
use super::error::RecordError;
use super::own::{OwnAbout, OwnStream};
use crate::journal::{NotedItem, NotedValue, Tag};
use crate::runtime::context::Distribution;
use crate::runtime::error::ContextError;
use crate::runtime::newest::Published;
use rohrpost_mailbox::{OpenRecord, RecordPlace, StreamWriter, SuspendedRecord};
use rohrpost_schema::Data;
use std::marker::PhantomData;
use std::ops::Range;

/// A value of a stream that is being written in place; readers do not see it. Dropped before
/// [`OpenValue::finish`], nothing happened.
///
/// ```
/// use rohrpost_modules::runtime::{Context, ContextError};
/// use rohrpost_modules::schema::{Bytes, Schema};
/// use rohrpost_modules::interface;
/// use serde::{Deserialize, Serialize};
/// use std::{error::Error, io::Read};
///
/// #[derive(Serialize, Deserialize, Schema)]
/// pub struct Picture { width_px: u32, height_px: u32, pixels: Bytes }
///
/// #[interface(class = "eye", crate = rohrpost_modules::macro_support)]
/// pub trait Eye {
///     /// What it sees.
///     #[stream(1)]
///     fn picture() -> Picture;
/// }
///
/// /// Takes a picture into shared memory: no byte of it is copied.
/// fn shoot(context: &mut Context, stamp_ns: u64, driver: &mut std::fs::File) -> Result<(), Box<dyn Error>> {
///     let mut open = context.begin(EyeInterface::PICTURE, stamp_ns)?;
///     let front = Picture { width_px: 1920, height_px: 1080, pixels: Bytes::default() };
///     driver.read_exact(open.fill(&front, 1920 * 1080 * 3)?)?; // if it fails, nothing was written
///     open.finish()?;
///     Ok(())
/// }
/// ```
pub struct OpenValue<'a, T> {
    record: OpenRecord<'a>,
    /// Bytes of the value, once it is there.
    len: Option<usize>,
    stamp_ns: u64,
    /// The record's.
    sequence: u64,
    about: &'a OwnAbout,
    outlet: Distribution<'a>,
    data: PhantomData<fn(T)>,
}

/// A value that is being written in place, and does not keep its context meanwhile.
#[must_use = "nothing is published unless it is taken up again"]
pub struct SuspendedValue {
    record: SuspendedRecord,
    len: Option<usize>,
    stamp_ns: u64,
    sequence: u64,
    endpoint: usize,
    number: u16,
}

impl SuspendedValue {
    /// Whether it is of this stream.
    pub(in crate::runtime) fn is_of(&self, stream: &OwnStream) -> bool {
        stream.is(self.endpoint, self.number)
    }
}

impl<'a, T: Data> OpenValue<'a, T> {
    pub(in crate::runtime) fn new(
        record: OpenRecord<'a>,
        (sequence, stamp_ns): (u64, u64),
        about: &'a OwnAbout,
        outlet: Distribution<'a>,
    ) -> Self {
        Self { record, len: None, stamp_ns, sequence, about, outlet, data: PhantomData }
    }

    /// Puts a value in, in place of what was put in before.
    ///
    /// # Errors
    /// [`RecordError::TooLarge`] and [`RecordError::Encode`].
    pub fn put(&mut self, value: &T) -> Result<(), ContextError> {
        let put = encode::put(value, self.record.body_mut());
        self.len = Some(put.map_err(|error| self.explain(error))?);
        Ok(())
    }

    /// Puts in a value that is postcard already, in place of what was put in before; nobody looks whether it is.
    ///
    /// # Errors
    /// [`RecordError::TooLarge`].
    pub fn put_bytes(&mut self, bytes: &[u8]) -> Result<(), ContextError> {
        let Some(room) = self.record.body_mut().get_mut(..bytes.len()) else {
            return Err(self.explain(EncodeError::TooLarge(bytes.len())).into());
        };
        room.copy_from_slice(bytes);
        self.len = Some(bytes.len());
        Ok(())
    }

    /// Puts a value in, in place of what was put in before; `len` bytes of its last field are to be filled in what this
    /// returns. What they are at first is not told. In `value` that field, of type [`rohrpost_schema::Bytes`], is
    /// empty.
    ///
    /// # Errors
    /// [`RecordError::TooLarge`], [`RecordError::Encode`], and [`RecordError::NotEmpty`] when its type has no such
    /// field at its end, or there are bytes in it.
    pub fn fill(&mut self, value: &T, len: usize) -> Result<&mut [u8], ContextError> {
        self.fill_room(|body| encode::put_open(value, len, body))
    }

    /// As [`OpenValue::fill`]; the value, of which the last field is empty, is postcard already.
    ///
    /// # Errors
    /// As for [`OpenValue::fill`].
    pub fn fill_bytes(&mut self, value: &[u8], len: usize) -> Result<&mut [u8], ContextError> {
        self.fill_room(|body| encode::put_open_bytes(value, len, body))
    }

    fn fill_room(
        &mut self,
        put: impl FnOnce(&mut [u8]) -> Result<Range<usize>, EncodeError>,
    ) -> Result<&mut [u8], ContextError> {
        let put = match self.about.item.ends_with_bytes {
            true => put(self.record.body_mut()),
            false => Err(EncodeError::NotEmpty),
        };
        let room = put.map_err(|error| self.explain(error))?;
        self.len = Some(room.end);
        Ok(&mut self.record.body_mut()[room])
    }

    /// Where all of it is in the stream's memory, as long as a record may be; none of a stream with small records,
    /// which are filled elsewhere.
    pub fn place(&self) -> Option<RecordPlace> {
        self.record.at()
    }

    /// Lets go of the context, until [`super::super::Context::resume`]; what was put in stays, until another record of
    /// the stream is begun or published.
    pub fn suspend(self) -> SuspendedValue {
        let (endpoint, number) = (self.about.endpoint, self.about.item.number);
        let (record, len) = (self.record.suspend(), self.len);
        SuspendedValue { record, len, stamp_ns: self.stamp_ns, sequence: self.sequence, endpoint, number }
    }

    pub(in crate::runtime) fn resumed(
        suspended: SuspendedValue,
        writer: &'a mut StreamWriter,
        about: &'a OwnAbout,
        outlet: Distribution<'a>,
    ) -> Option<Self> {
        let SuspendedValue { record, len, stamp_ns, sequence, .. } = suspended;
        let record = writer.resume(record)?;
        Some(Self { record, len, stamp_ns, sequence, about, outlet, data: PhantomData })
    }

    /// Makes it the stream's newest record; its sequence, which counts the stream's records. It is counted as
    /// published, and goes to subscribers where it fits a package.
    ///
    /// # Errors
    /// [`RecordError::NothingPut`].
    pub fn finish(mut self) -> Result<u64, ContextError> {
        let Some(len) = self.len else {
            return Err(RecordError::NothingPut { stream: self.about.item.name.clone() }.into());
        };
        let (_, bytes) = self.record.finish_seen(len).map_err(|error| self.about.explain(error))?;
        let (endpoint, number) = (self.about.endpoint as u16, self.about.item.number);
        let stamp_ns = self.stamp_ns;
        let noted = || NotedItem { endpoint, number, stamp_ns, value: NotedValue::of(bytes) };
        self.outlet.journal.output_of(Tag::Written, noted);
        self.outlet.published(&Published {
            endpoint: self.about.endpoint,
            number: self.about.item.number,
            name: &self.about.item.name,
            stamp_ns: self.stamp_ns,
            value: bytes,
        });
        Ok(self.sequence)
    }

    #[cold]
    fn explain(&mut self, error: EncodeError) -> RecordError {
        let (stream, module) = (self.about.item.name.clone(), self.about.module.clone());
        let max_bytes = self.record.body_mut().len();
        match error {
            EncodeError::TooLarge(len_bytes) => RecordError::TooLarge { stream, module, len_bytes, max_bytes },
            EncodeError::NotEmpty => RecordError::NotEmpty { stream },
            EncodeError::Postcard(error) => RecordError::Encode { stream, error },
        }
    }
}
