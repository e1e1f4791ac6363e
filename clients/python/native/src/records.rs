//! Records of streams as Python has them in hand.

use crate::plan::{LentPart, Plan};
use crate::shared::Shared;
use pyo3::PyTraverseError;
use pyo3::prelude::*;
use pyo3::pyclass::PyVisit;
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

    fn __eq__(&self, py: Python<'_>, other: &Self) -> PyResult<bool> {
        let of = |it: &Self| (it.time_ns, it.epoch, it.sequence);
        Ok(of(self) == of(other) && self.value.bind(py).eq(&other.value)?)
    }

    /// Nothing of it changes, so something else of a cycle can be cleared, as with a tuple.
    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.value)
    }
}

/// How the records of a stream are read. An object of its own: a garbage collector counts what refers to what.
#[pyclass(frozen, module = "rohrpost._node")]
pub(crate) struct Way {
    /// Which stream, for people.
    pub(crate) what: String,
    /// None: its type is not simple.
    pub(crate) plan: Option<Plan>,
    /// Makes a `rohrpost.node.views.Held` of bytes or [`Shared`], or says what is wrong with them.
    pub(crate) held: Py<PyAny>,
}

#[pymethods]
impl Way {
    /// Its stream can be cleared.
    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.plan.as_ref().map_or(Ok(()), |plan| plan.visit(&visit))?;
        visit.call(&self.held)
    }
}

/// Which record Python has, and what of it.
pub(crate) struct Hand {
    /// Of its stream's hands.
    pub(crate) number: u64,
    pub(crate) sequence: u64,
    /// None: it is being read, which may run code of an author.
    pub(crate) held: Option<Held>,
}

/// What Python has of a record's memory.
#[derive(Default)]
pub(crate) struct Held {
    parts: Vec<LentPart>,
    /// What Python has read, and looks after.
    python: Option<Py<PyAny>>,
}

impl Hand {
    /// It is held no more; the record's number, if something of its memory is kept. `is_told`: it matters.
    pub(crate) fn release(self, py: Python<'_>, is_told: bool) -> PyResult<Option<u64>> {
        let is_free = self.held.map_or(Ok(true), |held| held.release(py, is_told))?;
        Ok((!is_free).then_some(self.sequence))
    }

    pub(crate) fn visit(&self, visit: &PyVisit<'_>) -> Result<(), PyTraverseError> {
        let Some(Held { parts, python }) = &self.held else { return Ok(()) };
        parts.iter().try_for_each(|part| part.visit(visit))?;
        visit.call(python)
    }
}

impl Held {
    /// It is held no more; whether nothing of its memory is kept, if that `is_told`.
    pub(crate) fn release(self, py: Python<'_>, is_told: bool) -> PyResult<bool> {
        let Self { parts, python } = self;
        let are_free = || parts.iter().filter(|part| !part.release(py)).count() == 0;
        let mut is_free = are_free();
        if !is_free && is_told {
            // What nothing leads to any more may wait for it, such as an exception in a local of its frame.
            py.import("gc")?.call_method0("collect")?;
            is_free = are_free();
        }
        if let Some(python) = python {
            is_free &= python.call_method1(py, "release", (is_told,))?.extract::<bool>(py)?;
        }
        Ok(is_free)
    }
}

impl Way {
    /// The value of a record, and what Python has of its memory.
    pub(crate) fn read(&self, py: Python<'_>, bytes: StayingBytes) -> PyResult<(Py<PyAny>, Held)> {
        let mut held = Held::default();
        let data = match bytes {
            StayingBytes::Journal(bytes) => PyBytes::new(py, &bytes).into_any().unbind(),
            StayingBytes::Ring(place) => {
                if let Some(value) = self.planned(py, &place, &mut held.parts)? {
                    return Ok((value.unbind(), held));
                }
                let all = 0..place.len();
                Shared::new(py, place, all, true)?.into_any()
            }
        };
        let python = self.held.call1(py, (data,))?;
        let value = python.getattr(py, "value")?;
        held.python = Some(python);
        Ok((value, held))
    }

    /// What it is by its plan. What was lent of a record that Python is to read, and is not free, is in `lent`.
    fn planned<'py>(
        &self,
        py: Python<'py>,
        place: &RecordPlace,
        lent: &mut Vec<LentPart>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(plan) = &self.plan else { return Ok(None) };
        let value = plan.read(py, place, lent);
        if !matches!(value, Ok(Some(_))) {
            // An author's class may have kept it.
            lent.retain(|part| !part.release(py));
        }
        value
    }
}
