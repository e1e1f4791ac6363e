//! Values on their way to Python.

use crate::shared::Shared;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rohrpost_native::RecordPlace;

/// Shorter values are copied: that is quicker than a view.
const COPIED_MAX: usize = 4096;

/// A value that lies at `place`, if it is a stream's record: `bytes`, or [`Shared`].
pub(crate) fn value(py: Python<'_>, bytes: &[u8], place: Option<RecordPlace>) -> PyResult<Py<PyAny>> {
    match place.filter(|_| bytes.len() > COPIED_MAX) {
        Some(place) => {
            let all = 0..place.len();
            Ok(Shared::new(py, place, all, true)?.into_any())
        }
        None => Ok(PyBytes::new(py, bytes).into_any().unbind()),
    }
}
