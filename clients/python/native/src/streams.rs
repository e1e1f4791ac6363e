//! Streams of other modules.

use crate::calls::apart;
use crate::fails::{failure, misuse};
use crate::in_hand::InHand;
use crate::lent::with;
use crate::owned::drop_left;
use crate::plan::Plan;
use crate::records::Way;
use crate::seat::Stream;
use pyo3::PyTraverseError;
use pyo3::prelude::*;
use pyo3::pyclass::PyVisit;
use pyo3::types::PyBytes;
use rohrpost_native::schema::Field;
use rohrpost_native::{Around, Moment, Next, Stamp, StayingBytes, StayingRecord};
use std::time::Duration;

/// Sequence and stamp (ns) of a record.
type Mark = (u64, u64);

/// Opens a stream of another module, which is asked what it offers; the field of its values. None: it does not run yet.
/// `is_late`: it was asked for before.
#[pyfunction]
pub(crate) fn open_stream(
    py: Python<'_>,
    module: &str,
    item: &str,
    timeout_s: f64,
    is_late: bool,
) -> PyResult<Option<(Stream, Py<PyBytes>)>> {
    drop_left();
    with(py, |context| {
        let timeout = Duration::try_from_secs_f64(timeout_s.max(0.0)).unwrap_or(Duration::MAX);
        let opened = apart(py, context, |context| context.stream(module, item, timeout, is_late));
        let Some(stream) = opened.map_err(|error| failure(py, error))? else { return Ok(None) };
        let field: &Field = &stream.item.field;
        let field = PyBytes::new(py, &field.to_bytes()).unbind();
        Ok(Some((Stream::new(stream), field)))
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

    /// Sequence and stamp of the records around a time of this epoch, or of the present one; or in a word why there are
    /// none, and how far it is off (ns), or the epoch that there is.
    fn around(
        &self,
        py: Python<'_>,
        stamp_ns: u64,
        epoch: Option<u64>,
    ) -> PyResult<(Option<[Mark; 2]>, &'static str, u64)> {
        let at = epoch.map_or(Moment::Ns(stamp_ns), |epoch| Stamp { epoch, ns: stamp_ns }.into());
        Ok(match self.find(py, |stream, _| Ok(stream.around(at)?))? {
            Around::Records { before, after } => {
                (Some([before, after].map(|info| (info.sequence, info.stamp.ns))), "", 0)
            }
            Around::Empty => (None, "empty", 0),
            Around::BeforeOldest { by_ns } => (None, "before oldest", by_ns),
            Around::NotYet { by_ns } => (None, "not yet", by_ns),
            Around::OtherEpoch { newest } => (None, "other epoch", newest),
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
