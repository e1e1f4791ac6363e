//! Records of streams as Python has them in hand.

use crate::plan::{LentPart, Plan};
use crate::shared::Shared;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rohrpost_native::{RecordInfo, RecordPlace, StayingBytes};

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

impl Record {
    pub(crate) fn new(value: Py<PyAny>, info: RecordInfo) -> Self {
        Self { value, time_ns: info.stamp.ns, epoch: info.stamp.epoch, sequence: info.sequence }
    }
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

pub(crate) enum Held {
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

    /// Of a record that was read.
    pub(crate) fn holding(sequence: u64, held: Held) -> Self {
        Self { sequence, held }
    }

    /// It is held no more; the record's number, if something of its memory is kept.
    pub(crate) fn release(self, py: Python<'_>) -> PyResult<Option<u64>> {
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
    /// The value of a record, and what Python has of its memory.
    pub(crate) fn read(&self, py: Python<'_>, bytes: StayingBytes) -> PyResult<(Py<PyAny>, Held)> {
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
