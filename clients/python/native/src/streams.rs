//! Streams of other modules.

use crate::calls::apart;
use crate::fails::{failure, misuse};
use crate::in_hand::InHand;
use crate::lent::{is_forked, require_own_process, with};
use crate::owned::{Owned, drop_left};
use crate::plan::Plan;
use crate::records::{Hand, Held, Way};
use pyo3::PyTraverseError;
use pyo3::prelude::*;
use pyo3::pyclass::PyVisit;
use pyo3::types::PyBytes;
use rohrpost_native::schema::Field;
use rohrpost_native::{Around, Moment, NativeError, NativeStream, Next, StayingBytes, StayingRecord};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;

/// Sequence and stamp (ns) of a record.
type Mark = (u64, u64);

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
struct Kept {
    /// None before `reads`.
    way: Option<Py<Way>>,
    /// The record that is being read, or was, as long as it is in hand.
    hand: Option<Hand>,
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
    fn new(stream: NativeStream) -> Self {
        let seat = Seat { owned: Some(Owned::new(stream)), found: None };
        Self { seat: Mutex::new(seat), kept: Mutex::default() }
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reads of it, in the thread and the process that opened it, while no record is in hand: it would go.
    fn read_once<T>(
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
    fn find<T>(
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

/// Opens a stream of another module, which is asked what it offers; the field of its values.
#[pyfunction]
pub(crate) fn open_stream(py: Python<'_>, module: &str, item: &str, timeout_s: f64) -> PyResult<(Stream, Py<PyBytes>)> {
    drop_left();
    with(py, |context| {
        let timeout = Duration::try_from_secs_f64(timeout_s.max(0.0)).unwrap_or(Duration::MAX);
        let opened = apart(py, context, |context| context.stream(module, item, timeout));
        let stream = opened.map_err(|error| failure(py, error))?;
        let field: &Field = &stream.item.field;
        let field = PyBytes::new(py, &field.to_bytes()).unbind();
        Ok((Stream::new(stream), field))
    })
}

#[pymethods]
impl Stream {
    /// Says how its records are read; `what`: which stream, for people. Before anything else.
    fn reads(&self, py: Python<'_>, what: String, plan: Option<Bound<'_, PyAny>>, held: Py<PyAny>) -> PyResult<()> {
        let plan = plan.as_ref().map(Plan::of).transpose()?;
        let way = Py::new(py, Way { what, plan, held })?;
        let before = self.kept().way.replace(way);
        drop(before);
        Ok(())
    }

    /// A record for a `with`: the newest, or what `find` has found by then.
    #[pyo3(signature = (find=None))]
    fn in_hand(slf: Bound<'_, Self>, find: Option<Py<PyAny>>) -> PyResult<InHand> {
        let way = slf.get().kept().way.as_ref().map(|way| way.clone_ref(slf.py()));
        let way = way.ok_or_else(|| misuse(slf.py(), "nothing says how this stream is read"))?;
        Ok(InHand::new(slf.unbind(), way, find))
    }

    /// Finds the next record: whether it came in time, or how many were lost.
    fn next(&self, py: Python<'_>, timeout_s: f64) -> PyResult<(bool, u64)> {
        let timeout = Duration::try_from_secs_f64(timeout_s.max(0.0)).unwrap_or(Duration::MAX);
        self.find(py, |stream, found| {
            Ok(match apart(py, stream, |stream| stream.next_within(timeout))? {
                Next::Record(record) => {
                    *found = Some(record);
                    (true, 0)
                }
                Next::Lost(lost) => (false, lost),
                Next::Nothing => (false, 0),
            })
        })
    }

    /// Finds the record of this sequence; whether it is there.
    fn record(&self, py: Python<'_>, sequence: u64) -> PyResult<bool> {
        self.find(py, |stream, found| {
            *found = stream.record(sequence)?;
            Ok(found.is_some())
        })
    }

    /// The bytes of the record of this sequence, copied.
    fn copied(&self, py: Python<'_>, sequence: u64) -> PyResult<Option<Py<PyBytes>>> {
        let copied = |record: StayingRecord| match record.bytes {
            StayingBytes::Ring(place) => {
                // SAFETY: so many bytes of a mapping that `place` keeps; the record is held until the next one is read,
                // which waits: the stream is locked, and no code of Python runs.
                PyBytes::new(py, unsafe { std::slice::from_raw_parts(place.address().as_ptr(), place.len()) }).unbind()
            }
            StayingBytes::Journal(bytes) => PyBytes::new(py, &bytes).unbind(),
        };
        self.find(py, |stream, _| Ok(stream.record(sequence)?.map(copied)))
    }

    /// Sequence and stamp of the records around a time; or in words why there are none.
    fn around(&self, py: Python<'_>, stamp_ns: u64) -> PyResult<(Option<[Mark; 2]>, &'static str)> {
        Ok(match self.find(py, |stream, _| Ok(stream.around(Moment::Ns(stamp_ns))?))? {
            Around::Records { before, after } => (Some([before, after].map(|info| (info.sequence, info.stamp.ns))), ""),
            Around::Empty => (None, "empty"),
            Around::BeforeOldest { .. } => (None, "before oldest"),
            Around::NotYet { .. } => (None, "not yet"),
            Around::OtherEpoch { .. } => (None, "other epoch"),
        })
    }

    /// Records lost on the way, sampled out, and passed over.
    fn missed(&self, py: Python<'_>) -> PyResult<(u64, u64, u64)> {
        let missed = self.read_once(py, |stream, _| Ok(stream.missed()))?;
        Ok((missed.lost, missed.sampled, missed.passed_over))
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        // Nobody has locked it: that takes the interpreter's lock.
        let kept = self.kept();
        visit.call(&kept.way)?;
        kept.hand.as_ref().map_or(Ok(()), |hand| hand.visit(&visit))
    }

    fn __clear__(&self) {
        let mut kept = self.kept();
        let before = (kept.way.take(), kept.hand.take());
        drop(kept);
        drop(before);
    }
}
