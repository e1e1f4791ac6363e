//! A program beside the robot, as `rohrpost.connect` makes it.

use crate::calls::{answer, timeout};
use crate::fails::tool_failure;
use crate::lent::{is_forked, require_own_process};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rohrpost_native::{CopiedRecord, Name, NativeTool, Next, ToolError, ToolStream};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A tool's place on a node; for any thread of the process that made it.
#[pyclass(frozen, module = "rohrpost._node")]
pub(crate) struct Tool {
    /// None once it is closed.
    place: Mutex<Option<NativeTool>>,
}

/// A record as Python takes it: sequence, incarnation, time (ns), epoch, value.
type RecordParts = (u64, u32, u64, u64, Py<PyBytes>);

/// A value of a subscription: sender, item, subscription, time (ns), sequence, missed, value.
type DataParts = (u32, u16, u16, u64, u32, u32, Py<PyBytes>);

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[pymethods]
impl Tool {
    #[new]
    fn join(py: Python<'_>, installation: Option<&str>, node: Option<&str>) -> PyResult<Self> {
        require_own_process(py)?;
        let joined = py.detach(|| NativeTool::join(installation, node)).map_err(|error| tool_failure(py, &error))?;
        Ok(Self { place: Mutex::new(Some(joined)) })
    }

    /// A module's name as a number.
    fn name(&self, py: Python<'_>, text: &str) -> PyResult<u32> {
        self.with(py, |tool| Ok(tool.name(text)?.raw()))
    }

    fn modules(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.with(py, |tool| Ok(tool.modules()))
    }

    /// The bytes of a module's description.
    fn describe(&self, py: Python<'_>, module: u32, timeout_s: f64) -> PyResult<Py<PyBytes>> {
        let described =
            self.with(py, |tool| Ok(tool.describe(Name::from_raw(module), timeout(timeout_s))?.to_bytes()))?;
        Ok(PyBytes::new(py, &described).unbind())
    }

    /// Calls a function of an interface; arguments and result are postcard.
    fn call(
        &self,
        py: Python<'_>,
        module: u32,
        interface: u32,
        function: u16,
        arguments: Vec<u8>,
        timeout_s: f64,
    ) -> PyResult<Py<PyBytes>> {
        let called = self.with(py, |tool| {
            Ok(tool.call(Name::from_raw(module), (interface, function), &arguments, timeout(timeout_s)))
        })?;
        answer(py, called)
    }

    /// The next value of any subscription, if one comes in time.
    fn data(&self, py: Python<'_>, timeout_s: f64) -> PyResult<Option<DataParts>> {
        let data = self.with(py, |tool| tool.data(timeout(timeout_s)))?;
        Ok(data.map(|data| {
            let value = PyBytes::new(py, &data.value).unbind();
            let head = data.head;
            (data.from.raw(), data.number, data.id, head.stamp_ns, head.sequence, head.missed, value)
        }))
    }

    /// A stream in the memory of this node.
    fn stream(&self, py: Python<'_>, module: u32, number: u16) -> PyResult<CopiedStream> {
        let stream = self.with(py, |tool| tool.stream(Name::from_raw(module), number))?;
        Ok(CopiedStream { stream: Mutex::new(Some(stream)) })
    }

    /// Gives the place back.
    fn close(&self, py: Python<'_>) {
        if is_forked() {
            return;
        }
        py.detach(|| {
            if let Some(tool) = locked(&self.place).take() {
                tool.close();
            }
        });
    }
}

impl Tool {
    /// Uses the place without the interpreter's lock: other threads may wait for it.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        part: impl FnOnce(&mut NativeTool) -> Result<T, ToolError> + Send,
    ) -> PyResult<T> {
        require_own_process(py)?;
        let done = py.detach(|| locked(&self.place).as_mut().map(part));
        done.ok_or_else(|| crate::fails::misuse(py, "this connection is closed"))?
            .map_err(|error| tool_failure(py, &error))
    }
}

impl Drop for Tool {
    fn drop(&mut self) {
        let place = self.place.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        match place {
            // It is the parent's.
            Some(tool) if is_forked() => std::mem::forget(tool),
            Some(tool) => tool.close(),
            None => {}
        }
    }
}

/// A stream that is read by copies.
#[pyclass(frozen, module = "rohrpost._node")]
pub(crate) struct CopiedStream {
    /// None once it is closed.
    stream: Mutex<Option<ToolStream>>,
}

#[pymethods]
impl CopiedStream {
    fn newest(&self, py: Python<'_>) -> PyResult<Option<RecordParts>> {
        Ok(self.with(py, ToolStream::newest)?.map(|record| parts(py, &record)))
    }

    /// The next record, if one comes in time; or how many were lost.
    fn next(&self, py: Python<'_>, timeout_s: f64) -> PyResult<(Option<RecordParts>, u64)> {
        Ok(match self.with(py, |stream| stream.next_within(timeout(timeout_s)))? {
            Next::Record(record) => (Some(parts(py, &record)), 0),
            Next::Lost(lost) => (None, lost),
            Next::Nothing => (None, 0),
        })
    }

    /// Gives its seat back.
    fn close(&self) {
        self.leave();
    }
}

impl CopiedStream {
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        part: impl FnOnce(&mut ToolStream) -> Result<T, ToolError> + Send,
    ) -> PyResult<T> {
        require_own_process(py)?;
        let done = py.detach(|| locked(&self.stream).as_mut().map(part));
        done.ok_or_else(|| crate::fails::misuse(py, "this stream is closed"))?.map_err(|error| tool_failure(py, &error))
    }

    /// Frees its seat, which in a forked process is the parent's.
    fn leave(&self) {
        let stream = locked(&self.stream).take();
        if is_forked() {
            std::mem::forget(stream);
        }
    }
}

impl Drop for CopiedStream {
    fn drop(&mut self) {
        self.leave();
    }
}

fn parts(py: Python<'_>, (info, value): &CopiedRecord) -> RecordParts {
    (info.sequence, info.incarnation, info.stamp.ns, info.stamp.epoch, PyBytes::new(py, value).unbind())
}
