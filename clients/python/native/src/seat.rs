//! Which record of a stream is in hand, and when its stream may be read.

use crate::fails::{failure, misuse};
use crate::lent::{is_forked, require_own_process};
use crate::owned::Owned;
use crate::records::{Hand, Held, Way};
use pyo3::prelude::*;
use rohrpost_native::{NativeError, NativeStream, StayingRecord};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

/// A stream of another module, for the thread that opened it.
#[pyclass(frozen, module = "rohrpost._node")]
pub(crate) struct Stream {
    /// Locked by its own thread alone, also while that waits without the interpreter's lock: nobody waits for it.
    seat: Mutex<Seat>,
    /// Locked for moments in which no code of Python runs, with the interpreter's lock.
    kept: Mutex<Kept>,
}

struct Seat {
    owned: Option<Owned>,
    /// A record that was found, and is not taken in hand yet.
    found: Option<StayingRecord>,
}

/// What of Python's a stream has.
#[derive(Default)]
pub(crate) struct Kept {
    /// None before `reads`.
    pub(crate) way: Option<Py<Way>>,
    /// The record that is being read, or was, as long as it is in hand.
    pub(crate) hand: Option<Hand>,
    /// The number of the last hand.
    hands: u64,
}

/// Why a stream is not read.
enum Refused {
    Elsewhere,
    InHand,
    Failed(NativeError),
}

impl Stream {
    pub(crate) fn new(stream: NativeStream) -> Self {
        let seat = Seat { owned: Some(Owned::new(stream)), found: None };
        Self { seat: Mutex::new(seat), kept: Mutex::default() }
    }

    pub(crate) fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reads of it, in the thread and the process that opened it, while no record is in hand: it would go.
    pub(crate) fn read_once<T>(
        &self,
        py: Python<'_>,
        part: impl FnOnce(&mut NativeStream, &mut Option<StayingRecord>) -> Result<T, NativeError>,
    ) -> PyResult<T> {
        require_own_process(py)?;
        // Exceptions are made when it is locked no more: that may run code of Python.
        self.unless_refused(part).map_err(|refused| self.told(py, refused))
    }

    fn unless_refused<T>(
        &self,
        part: impl FnOnce(&mut NativeStream, &mut Option<StayingRecord>) -> Result<T, NativeError>,
    ) -> Result<T, Refused> {
        let mut seat = match self.seat.try_lock() {
            Ok(seat) => seat,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            // Its own thread waits for a record.
            Err(TryLockError::WouldBlock) => return Err(Refused::Elsewhere),
        };
        let Seat { owned, found } = &mut *seat;
        let stream = owned.as_mut().and_then(Owned::stream).ok_or(Refused::Elsewhere)?;
        if self.kept().hand.is_some() {
            return Err(Refused::InHand);
        }
        part(stream, found).map_err(Refused::Failed)
    }

    /// The same for what finds another record, or none: one that was found before is held no more.
    pub(crate) fn find<T>(
        &self,
        py: Python<'_>,
        part: impl FnOnce(&mut NativeStream, &mut Option<StayingRecord>) -> Result<T, NativeError>,
    ) -> PyResult<T> {
        self.read_once(py, |stream, found| {
            *found = None;
            part(stream, found)
        })
    }

    fn told(&self, py: Python<'_>, refused: Refused) -> PyErr {
        let what = self.kept().way.as_ref().map_or_else(|| "a stream".to_owned(), |way| way.get().what.clone());
        match refused {
            Refused::Elsewhere => {
                let why = "was opened in another thread, that of its module, which alone may read it";
                misuse(py, &format!("{what} {why}"))
            }
            Refused::InHand => {
                misuse(py, &format!("a record of {what} is in hand; leave its `with` before another is read"))
            }
            Refused::Failed(error) => failure(py, error),
        }
    }

    /// The newest record, or the one that was found, and the number of its hand, which it is in from now on.
    pub(crate) fn take(&self, py: Python<'_>, is_newest: bool) -> PyResult<Option<(StayingRecord, u64)>> {
        self.read_once(py, |stream, found| {
            let before = found.take();
            let record = if is_newest { stream.newest()? } else { before };
            Ok(record.map(|record| {
                let mut kept = self.kept();
                kept.hands += 1;
                let number = kept.hands;
                kept.hand = Some(Hand { number, sequence: record.info.sequence, held: None });
                (record, number)
            }))
        })
    }

    /// The record of this hand was read; or else it is in hand no more.
    pub(crate) fn read(&self, number: u64, held: Held) -> Result<(), Held> {
        match &mut self.kept().hand {
            Some(hand) if hand.number == number && hand.held.is_none() => {
                hand.held = Some(held);
                Ok(())
            }
            _ => Err(held),
        }
    }

    /// The record of this hand, if it is being read, is in hand no more.
    pub(crate) fn give_up(&self, number: u64) {
        // There is nothing of Python's in it, so no code of Python runs.
        self.kept().hand.take_if(|hand| hand.number == number && hand.held.is_none());
    }

    /// The record of this hand, if it was read, is in hand no more.
    pub(crate) fn let_go(&self, number: u64) -> Option<Hand> {
        self.kept().hand.take_if(|hand| hand.number == number && hand.held.is_some())
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        let seat = self.seat.get_mut().unwrap_or_else(PoisonError::into_inner);
        let Some(owned) = seat.owned.take() else { return };
        if is_forked() {
            // Its seat is the parent's.
            std::mem::forget(owned);
        } else {
            owned.end();
        }
    }
}
