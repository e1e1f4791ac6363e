//! Streams of other modules.

use crate::calls::apart;
use crate::fails::{failure, misuse};
use crate::lent::{is_forked, require_own_process, with};
use crate::owned::{Owned, drop_left};
use crate::values::staying;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rohrpost_native::schema::Field;
use rohrpost_native::{Around, Moment, NativeError, NativeStream, Next, StayingRecord};
use std::time::Duration;

/// Sequence, stamp (ns), epoch, and the value as `bytes` or `Shared`.
type RecordParts = (u64, u64, u64, Py<PyAny>);

/// Sequence and stamp (ns) of a record.
type Mark = (u64, u64);

/// A stream of another module, for the thread that opened it.
#[pyclass(module = "rohrpost._node")]
pub(crate) struct Stream(Option<Owned>);

impl Stream {
    /// For the thread that opened it, in the process that did.
    fn own(&mut self, py: Python<'_>) -> PyResult<&mut NativeStream> {
        require_own_process(py)?;
        let elsewhere = || misuse(py, "a stream is for the thread that opened it, that of its module");
        self.0.as_mut().and_then(Owned::stream).ok_or_else(elsewhere)
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        let Some(owned) = self.0.take() else { return };
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
        Ok((Stream(Some(Owned::new(stream))), field))
    })
}

#[pymethods]
impl Stream {
    /// The newest record.
    fn newest(&mut self, py: Python<'_>) -> PyResult<Option<RecordParts>> {
        let newest = self.own(py)?.newest().map_err(|error| failure(py, NativeError::Read(error)))?;
        newest.map(|record| parts(py, record)).transpose()
    }

    /// The next record: it, or how many were lost; neither if none came in time.
    fn next(&mut self, py: Python<'_>, timeout_s: f64) -> PyResult<(Option<RecordParts>, u64)> {
        let timeout = Duration::try_from_secs_f64(timeout_s.max(0.0)).unwrap_or(Duration::MAX);
        let next = apart(py, self.own(py)?, |stream| stream.next_within(timeout));
        Ok(match next.map_err(|error| failure(py, NativeError::Read(error)))? {
            Next::Record(record) => (Some(parts(py, record)?), 0),
            Next::Lost(lost) => (None, lost),
            Next::Nothing => (None, 0),
        })
    }

    /// The record of this sequence.
    fn record(&mut self, py: Python<'_>, sequence: u64) -> PyResult<Option<RecordParts>> {
        let record = self.own(py)?.record(sequence).map_err(|error| failure(py, NativeError::Read(error)))?;
        record.map(|record| parts(py, record)).transpose()
    }

    /// Sequence and stamp of the records around a time; or in words why there are none.
    fn around(&mut self, py: Python<'_>, stamp_ns: u64) -> PyResult<(Option<[Mark; 2]>, &'static str)> {
        let around =
            self.own(py)?.around(Moment::Ns(stamp_ns)).map_err(|error| failure(py, NativeError::Read(error)))?;
        Ok(match around {
            Around::Records { before, after } => (Some([before, after].map(|info| (info.sequence, info.stamp.ns))), ""),
            Around::Empty => (None, "empty"),
            Around::BeforeOldest { .. } => (None, "before oldest"),
            Around::NotYet { .. } => (None, "not yet"),
            Around::OtherEpoch { .. } => (None, "other epoch"),
        })
    }

    /// Records lost on the way, sampled out, and passed over.
    fn missed(&mut self, py: Python<'_>) -> PyResult<(u64, u64, u64)> {
        let missed = self.own(py)?.missed();
        Ok((missed.lost, missed.sampled, missed.passed_over))
    }
}

fn parts(py: Python<'_>, record: StayingRecord) -> PyResult<RecordParts> {
    let StayingRecord { info, bytes } = record;
    Ok((info.sequence, info.stamp.ns, info.stamp.epoch, staying(py, bytes)?))
}
