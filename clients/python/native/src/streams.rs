//! Streams of other modules.

use crate::calls::apart;
use crate::fails::{failure, misuse};
use crate::lent::{is_forked, require_own_process, with};
use crate::owned::{Owned, drop_left};
use crate::plan::Plan;
use crate::records::{Hand, Record, Way};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rohrpost_native::schema::Field;
use rohrpost_native::{Around, Moment, NativeError, NativeStream, Next, StayingBytes, StayingRecord};
use std::sync::Arc;
use std::time::Duration;

/// Sequence and stamp (ns) of a record.
type Mark = (u64, u64);

const OPENED_ELSEWHERE: &str = "was opened in another thread, that of its module, which alone may read it";

/// A stream of another module, for the thread that opened it.
#[pyclass(module = "rohrpost._node")]
pub(crate) struct Stream {
    owned: Option<Owned>,
    /// None before `reads`.
    way: Option<Arc<Way>>,
    /// A record that was found, and is not read yet.
    found: Option<StayingRecord>,
    /// The record that is being read, or was, as long as it is in hand.
    hand: Option<Hand>,
}

impl Stream {
    /// For the process that opened it.
    fn borrowed<'py>(slf: &Bound<'py, Self>) -> PyResult<PyRefMut<'py, Self>> {
        require_own_process(slf.py())?;
        // It fails while its own thread waits for a record.
        slf.try_borrow_mut().map_err(|_| misuse(slf.py(), &format!("a stream {OPENED_ELSEWHERE}")))
    }

    /// For the thread that opened it, while no record is in hand: it would go.
    fn own(&mut self, py: Python<'_>) -> PyResult<&mut NativeStream> {
        let what = self.way.as_ref().map_or("a stream", |way| &way.what);
        if self.hand.is_some() {
            let why = format!("a record of {what} is in hand; leave its `with` before another is read");
            return Err(misuse(py, &why));
        }
        let elsewhere = || misuse(py, &format!("{what} {OPENED_ELSEWHERE}"));
        self.owned.as_mut().and_then(Owned::stream).ok_or_else(elsewhere)
    }

    /// The record that was found: it is in hand from now on.
    fn take(&mut self) -> Option<StayingRecord> {
        let found = self.found.take()?;
        self.hand = Some(Hand::of(found.info.sequence));
        Some(found)
    }

    /// Finds the newest record; whether there is one.
    fn find_newest(&mut self, py: Python<'_>) -> PyResult<bool> {
        let newest = self.own(py)?.newest().map_err(|error| failure(py, NativeError::Read(error)))?;
        Ok(self.keep(newest))
    }

    /// Keeps what was found; whether there is any.
    fn keep(&mut self, found: Option<StayingRecord>) -> bool {
        self.found = found;
        self.found.is_some()
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        let Some(owned) = self.owned.take() else { return };
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
        let stream = Stream { owned: Some(Owned::new(stream)), way: None, found: None, hand: None };
        Ok((stream, field))
    })
}

#[pymethods]
impl Stream {
    /// Says how its records are read; `what`: which stream, for people. Before anything else.
    fn reads(slf: &Bound<'_, Self>, what: String, plan: Option<Bound<'_, PyAny>>, held: Py<PyAny>) -> PyResult<()> {
        let plan = plan.as_ref().map(Plan::of).transpose()?;
        Self::borrowed(slf)?.way = Some(Arc::new(Way { what, plan, held }));
        Ok(())
    }

    /// A record for a `with`: the newest, or what `find` has found by then.
    #[pyo3(signature = (find=None))]
    fn in_hand(slf: Bound<'_, Self>, find: Option<Py<PyAny>>) -> PyResult<InHand> {
        let way = Self::borrowed(&slf)?.way.clone();
        let way = way.ok_or_else(|| misuse(slf.py(), "nothing says how this stream is read"))?;
        Ok(InHand { stream: slf.unbind(), way, find })
    }

    /// Finds the next record: whether it came in time, or how many were lost.
    fn next(slf: &Bound<'_, Self>, timeout_s: f64) -> PyResult<(bool, u64)> {
        let timeout = Duration::try_from_secs_f64(timeout_s.max(0.0)).unwrap_or(Duration::MAX);
        let py = slf.py();
        let mut stream = Self::borrowed(slf)?;
        let next = apart(py, stream.own(py)?, |stream| stream.next_within(timeout));
        Ok(match next.map_err(|error| failure(py, NativeError::Read(error)))? {
            Next::Record(record) => (stream.keep(Some(record)), 0),
            Next::Lost(lost) => (false, lost),
            Next::Nothing => (false, 0),
        })
    }

    /// Finds the record of this sequence; whether it is there.
    fn record(slf: &Bound<'_, Self>, sequence: u64) -> PyResult<bool> {
        let py = slf.py();
        let mut stream = Self::borrowed(slf)?;
        let record = stream.own(py)?.record(sequence).map_err(|error| failure(py, NativeError::Read(error)))?;
        Ok(stream.keep(record))
    }

    /// The bytes of the record of this sequence, copied.
    fn copied(slf: &Bound<'_, Self>, sequence: u64) -> PyResult<Option<Py<PyBytes>>> {
        let py = slf.py();
        let mut stream = Self::borrowed(slf)?;
        let record = stream.own(py)?.record(sequence).map_err(|error| failure(py, NativeError::Read(error)))?;
        let copied = |record: StayingRecord| match record.bytes {
            StayingBytes::Ring(place) => {
                // SAFETY: so many bytes of a mapping that `place` keeps; the record is held until the next one is read.
                PyBytes::new(py, unsafe { std::slice::from_raw_parts(place.address().as_ptr(), place.len()) }).unbind()
            }
            StayingBytes::Journal(bytes) => PyBytes::new(py, &bytes).unbind(),
        };
        Ok(record.map(copied))
    }

    /// Sequence and stamp of the records around a time; or in words why there are none.
    fn around(slf: &Bound<'_, Self>, stamp_ns: u64) -> PyResult<(Option<[Mark; 2]>, &'static str)> {
        let py = slf.py();
        let mut stream = Self::borrowed(slf)?;
        let around =
            stream.own(py)?.around(Moment::Ns(stamp_ns)).map_err(|error| failure(py, NativeError::Read(error)))?;
        Ok(match around {
            Around::Records { before, after } => (Some([before, after].map(|info| (info.sequence, info.stamp.ns))), ""),
            Around::Empty => (None, "empty"),
            Around::BeforeOldest { .. } => (None, "before oldest"),
            Around::NotYet { .. } => (None, "not yet"),
            Around::OtherEpoch { .. } => (None, "other epoch"),
        })
    }

    /// Records lost on the way, sampled out, and passed over.
    fn missed(slf: &Bound<'_, Self>) -> PyResult<(u64, u64, u64)> {
        let missed = Self::borrowed(slf)?.own(slf.py())?.missed();
        Ok((missed.lost, missed.sampled, missed.passed_over))
    }
}

/// A record, from the beginning of a `with` to its end.
#[pyclass(frozen, module = "rohrpost._node")]
pub(crate) struct InHand {
    stream: Py<Stream>,
    way: Arc<Way>,
    /// Finds it in the stream, or raises why not; none: it is the newest.
    find: Option<Py<PyAny>>,
}

#[pymethods]
impl InHand {
    fn __enter__(&self, py: Python<'_>) -> PyResult<Record> {
        let stream = self.stream.bind(py);
        match &self.find {
            Some(find) => drop(find.call0(py)?),
            None if Stream::borrowed(stream)?.find_newest(py)? => {}
            None => return Err(told(py, "streams", "no_newest", (&self.way.what,))),
        }
        let taken = Stream::borrowed(stream)?.take();
        let record = taken.ok_or_else(|| misuse(py, "no record was found"))?;
        let info = record.info;
        let read = self.way.read(py, record.bytes);
        // Not borrowed while code of an author ran.
        let mut stream = Stream::borrowed(stream)?;
        let (value, held) = read.inspect_err(|_| stream.hand = None)?;
        stream.hand = Some(Hand::holding(info.sequence, held));
        Ok(Record::new(value, info))
    }

    fn __exit__(
        &self,
        py: Python<'_>,
        error: &Bound<'_, PyAny>,
        _value: &Bound<'_, PyAny>,
        _trace: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let hand = self.stream.bind(py).try_borrow_mut()?.hand.take();
        match hand.map_or(Ok(None), |hand| hand.release(py))? {
            Some(sequence) if error.is_none() => {
                let what = format!("record {sequence} of {}", self.way.what);
                Err(told(py, "views", "kept", (what,)))
            }
            _ => Ok(()),
        }
    }
}

/// An exception that a function of `rohrpost.node` makes.
fn told<'py>(py: Python<'py>, module: &str, function: &str, arguments: impl pyo3::call::PyCallArgs<'py>) -> PyErr {
    let made = py.import(format!("rohrpost.node.{module}")).and_then(|it| it.getattr(function)?.call1(arguments));
    made.map_or_else(|error| error, PyErr::from_value)
}
