//! A record in hand: from the beginning of a `with` of Python's to its end.

use crate::fails::misuse;
use crate::plan::{LentPart, Plan};
use crate::shared::Shared;
use crate::streams::Stream;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rohrpost_native::{RecordPlace, StayingBytes};
use std::sync::Arc;

/// A record in hand.
#[pyclass(frozen, module = "rohrpost._node")]
pub(crate) struct Record {
    /// Its value; many `bytes` in it are a view, which is there as long as the record is in hand.
    #[pyo3(get)]
    value: Py<PyAny>,
    /// When it was true, ns since 1970.
    #[pyo3(get)]
    time_ns: u64,
    /// Epoch of system time; times of different ones cannot be subtracted.
    #[pyo3(get)]
    epoch: u64,
    /// Its number in the stream.
    #[pyo3(get)]
    sequence: u64,
}

#[pymethods]
impl Record {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let Self { value, time_ns, epoch, sequence } = self;
        let value = value.bind(py).repr()?;
        Ok(format!("Record(value={value}, time_ns={time_ns}, epoch={epoch}, sequence={sequence})"))
    }
}

/// How the records of a stream are read.
pub(crate) struct Way {
    /// Which stream, for people.
    pub(crate) what: String,
    /// None: its type is not simple.
    pub(crate) plan: Option<Plan>,
    /// Makes a `rohrpost.node.views.Held` of bytes or [`Shared`], or says what is wrong with them.
    pub(crate) held: Py<PyAny>,
}

/// What of a record Python has, and which record.
pub(crate) struct Hand {
    sequence: u64,
    held: Held,
}

enum Held {
    Nothing,
    Part(LentPart),
    /// What Python has read, and looks after.
    Python(Py<PyAny>),
}

impl Hand {
    /// Of a record before it is read: that may run code of an author.
    pub(crate) fn of(sequence: u64) -> Self {
        Self { sequence, held: Held::Nothing }
    }

    /// It is held no more; the record's number, if something of its memory is kept.
    fn release(self, py: Python<'_>) -> PyResult<Option<u64>> {
        let is_free = match &self.held {
            Held::Nothing => true,
            Held::Part(part) => {
                part.release(py) || {
                    // What nothing leads to any more may wait for it, such as an exception in a local of its frame.
                    py.import("gc")?.call_method0("collect")?;
                    part.release(py)
                }
            }
            Held::Python(held) => held.call_method0(py, "release")?.extract(py)?,
        };
        Ok((!is_free).then_some(self.sequence))
    }
}

impl Way {
    fn read(&self, py: Python<'_>, bytes: StayingBytes) -> PyResult<(Py<PyAny>, Held)> {
        let place = match bytes {
            StayingBytes::Ring(place) => place,
            StayingBytes::Journal(bytes) => return self.by_python(py, PyBytes::new(py, &bytes).into_any().unbind()),
        };
        match self.planned(py, &place)? {
            Some((value, part)) => Ok((value.unbind(), part.map_or(Held::Nothing, Held::Part))),
            None => {
                let all = 0..place.len();
                self.by_python(py, Shared::new(py, place, all, true)?.into_any())
            }
        }
    }

    fn planned<'py>(
        &self,
        py: Python<'py>,
        place: &RecordPlace,
    ) -> PyResult<Option<(Bound<'py, PyAny>, Option<LentPart>)>> {
        self.plan.as_ref().map_or(Ok(None), |plan| plan.read(py, place))
    }

    fn by_python(&self, py: Python<'_>, data: Py<PyAny>) -> PyResult<(Py<PyAny>, Held)> {
        let held = self.held.call1(py, (data,))?;
        Ok((held.getattr(py, "value")?, Held::Python(held)))
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

impl InHand {
    pub(crate) fn new(stream: Py<Stream>, way: Arc<Way>, find: Option<Py<PyAny>>) -> Self {
        Self { stream, way, find }
    }
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
        stream.hand = Some(Hand { sequence: info.sequence, held });
        Ok(Record { value, time_ns: info.stamp.ns, epoch: info.stamp.epoch, sequence: info.sequence })
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
