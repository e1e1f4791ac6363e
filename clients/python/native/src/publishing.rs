//! What a module gives out, and what it asks its runtime for.

use crate::fails::{failure, misuse};
use crate::lent::{is_forked, with};
use crate::shared::Shared;
use pyo3::prelude::*;
use rohrpost_native::{FollowRate, Moment, RecordRoom, SayLevel};
use std::time::Duration;

/// System time now, ns since 1970, and how far it is off at most, ns; its epoch.
#[pyfunction]
pub(crate) fn now(py: Python<'_>) -> PyResult<(u64, u64, u64)> {
    with(py, |context| {
        let now = context.now();
        let error_ns = u64::try_from(now.error.as_nanos()).unwrap_or(u64::MAX);
        Ok((now.ns, error_ns, now.epoch))
    })
}

/// Asks for ticks.
#[pyfunction]
pub(crate) fn set_period(py: Python<'_>, period_s: f64) -> PyResult<()> {
    let period =
        Duration::try_from_secs_f64(period_s).map_err(|error| misuse(py, &format!("{period_s} s: {error}")))?;
    with(py, |context| {
        context.set_period(period);
        Ok(())
    })
}

/// Publishes data, or a record of a stream.
#[pyfunction]
pub(crate) fn publish(py: Python<'_>, number: u16, stamp_ns: Option<u64>, value: &[u8]) -> PyResult<()> {
    with(py, |context| context.publish(number, stamp_ns.map(Moment::Ns), value).map_err(|error| failure(py, error)))
}

/// Begins a record: where its last bytes go; none if that is memory of Python's.
#[pyfunction]
pub(crate) fn begin(
    py: Python<'_>,
    number: u16,
    stamp_ns: Option<u64>,
    front: &[u8],
    length: usize,
) -> PyResult<Option<Py<PyAny>>> {
    with(py, |context| {
        let room = context.begin(number, stamp_ns.map(Moment::Ns), front, length);
        Ok(match room.map_err(|error| failure(py, error))? {
            RecordRoom::Shared(place, range) => Some(Shared::new(py, place, range, false)?.into_any()),
            RecordRoom::Own(_) => None,
        })
    })
}

/// Makes the record the newest; its sequence. `own`: its last bytes, if they are in memory of Python's.
#[pyfunction]
pub(crate) fn finish(py: Python<'_>, own: &[u8]) -> PyResult<u64> {
    with(py, |context| context.finish(own).map_err(|error| failure(py, error)))
}

/// Gives the record up.
#[pyfunction]
pub(crate) fn abandon(py: Python<'_>) -> PyResult<()> {
    with(py, |context| {
        context.abandon();
        Ok(())
    })
}

/// Follows data or a stream of another module; `period_s`: 0 each value. Which of those it is.
#[pyfunction]
pub(crate) fn follow(
    py: Python<'_>,
    module: &str,
    item: &str,
    period_s: f64,
    newest: bool,
    records: bool,
) -> PyResult<usize> {
    let rate = match (records, newest, period_s) {
        (true, ..) => FollowRate::Records,
        (_, true, _) => FollowRate::Newest,
        (.., 0.0) => FollowRate::Each,
        (.., period_s) => FollowRate::Every(
            Duration::try_from_secs_f64(period_s).map_err(|error| misuse(py, &format!("{period_s} s: {error}")))?,
        ),
    };
    with(py, |context| context.follow(module, item, rate).map_err(|error| failure(py, error)))
}

/// The module sets a parameter of its own.
#[pyfunction]
pub(crate) fn set_parameter(py: Python<'_>, name: &str, value: &[u8]) -> PyResult<()> {
    with(py, |context| context.set_parameter(name, value).map_err(|refusal| misuse(py, &refusal.to_string())))
}

/// A line of output, from any thread; `level`: 0 error to 4 trace.
#[pyfunction]
pub(crate) fn say(py: Python<'_>, level: u8, text: &str, errno: Option<u16>) {
    let level = match level {
        0 => SayLevel::Error,
        1 => SayLevel::Warn,
        2 => SayLevel::Info,
        3 => SayLevel::Debug,
        _ => SayLevel::Trace,
    };
    if is_forked() {
        // The thread that sends lines is its parent's.
        eprintln!("{text}");
        return;
    }
    // Others may be waiting for the same queue.
    py.detach(|| rohrpost_native::say(level, text, errno));
}
