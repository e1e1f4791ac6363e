//! Values on their way to Python.

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rohrpost_native::{RecordPlace, StayingBytes};
use std::ops::Range;

/// Shorter values are copied: that is quicker than a view.
const COPIED_MAX: usize = 4096;

/// Bytes in shared memory, which stays mapped as long as this is there.
#[pyclass(frozen, module = "rohrpost._node")]
pub(crate) struct Shared {
    place: RecordPlace,
    range: Range<usize>,
}

#[pymethods]
impl Shared {
    /// Where they begin.
    #[getter]
    fn address(&self) -> usize {
        self.place.address().addr().get() + self.range.start
    }

    /// How many there are.
    #[getter]
    fn length(&self) -> usize {
        self.range.len()
    }
}

impl Shared {
    /// A part of a record.
    pub(crate) fn part(place: RecordPlace, range: Range<usize>) -> Self {
        Self { place, range }
    }
}

/// A value that lies at `place`, if it is a stream's record: `bytes`, or [`Shared`].
pub(crate) fn value(py: Python<'_>, bytes: &[u8], place: Option<RecordPlace>) -> PyResult<Py<PyAny>> {
    match place.filter(|_| bytes.len() > COPIED_MAX) {
        Some(place) => {
            let range = 0..place.len();
            Ok(Py::new(py, Shared { place, range })?.into_any())
        }
        None => Ok(PyBytes::new(py, bytes).into_any().unbind()),
    }
}

/// The value of a record that stays held.
pub(crate) fn staying(py: Python<'_>, bytes: StayingBytes) -> PyResult<Py<PyAny>> {
    match bytes {
        StayingBytes::Ring(place) => {
            let range = 0..place.len();
            Ok(Py::new(py, Shared { place, range })?.into_any())
        }
        StayingBytes::Journal(bytes) => Ok(PyBytes::new(py, &bytes).into_any().unbind()),
    }
}
