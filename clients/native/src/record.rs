//! A record that is filled in place by another language, between two calls of it.

use crate::error::NativeError;
use rohrpost_mailbox::{Name, RecordPlace};
use rohrpost_modules::runtime::{Context, ContextError, Moment, SuspendedValue};
use std::ops::Range;

/// Where the bytes of a record are to be put.
pub enum RecordRoom {
    /// Into this part of the stream's memory. What is there at first is not told.
    Shared(RecordPlace, Range<usize>),
    /// Into memory of the author's, which [`crate::NativeContext::finish`] takes: the stream's records are small.
    Own(usize),
}

/// Postcard of a value without its last bytes. Kept for one record after the other, so that none takes from the heap.
#[derive(Default)]
pub(crate) struct Front(Vec<u8>);

/// The record that is being filled.
pub(crate) struct OpenedRecord {
    suspended: SuspendedValue,
    /// The value without its last bytes is in [`Front`], since those come at the end.
    is_own: bool,
}

impl OpenedRecord {
    /// Begins one: `front` is postcard of a value of which the last field is empty bytes; `len` of them are to be
    /// filled.
    pub(crate) fn begin(
        context: &mut Context,
        (name, number): (Name, u16),
        at: Moment,
        (front, kept): (&[u8], &mut Front),
        len: usize,
    ) -> Result<(Self, RecordRoom), ContextError> {
        let mut open = context.begin_as(name, number, at)?;
        let place = open.place();
        let base = place.as_ref().map(|place| place.address().addr().get());
        let room = open.fill_bytes(front, len)?;
        let from = base.map(|base| room.as_ptr().addr() - base);
        let (is_own, room) = match (place, from) {
            (Some(place), Some(from)) => (false, RecordRoom::Shared(place, from..from + len)),
            _ => {
                kept.0.clear();
                kept.0.extend_from_slice(front);
                (true, RecordRoom::Own(len))
            }
        };
        Ok((Self { suspended: open.suspend(), is_own }, room))
    }

    /// Makes it the newest record; its sequence. `own`: its last bytes, if they are in the author's memory.
    pub(crate) fn finish(self, context: &mut Context, front: &Front, own: &[u8]) -> Result<u64, NativeError> {
        let Self { suspended, is_own } = self;
        let mut open = context.resume(suspended).ok_or(NativeError::NoRecordOpen)?;
        if is_own {
            open.fill_bytes(&front.0, own.len())?.copy_from_slice(own);
        }
        Ok(open.finish()?)
    }

    /// Nothing happened.
    pub(crate) fn abandon(self, context: &mut Context) {
        drop(context.resume(self.suspended));
    }
}
