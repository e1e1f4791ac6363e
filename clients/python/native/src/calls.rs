//! Calls of other modules.

use crate::fails::{call_failure, failure};
use crate::lent::with;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rohrpost_native::{CallError, Fault, NativeContext, Peer};
use std::rc::Rc;
use std::time::Duration;

/// What a thread does without the interpreter's lock.
struct Apart<T>(T);

// SAFETY: `Python::detach` runs its closure in the calling thread, and has this bound only so that nothing of Python's
// gets in; nothing of Python's is in what is wrapped here.
unsafe impl<T> Send for Apart<T> {}

impl<T> Apart<T> {
    /// As a method, so that a closure takes all of it.
    fn into_inner(self) -> T {
        self.0
    }
}

/// Runs `part`, which waits, without the interpreter's lock.
pub(crate) fn apart<A, T>(py: Python<'_>, argument: A, part: impl FnOnce(A) -> T) -> T {
    let inside = Apart((argument, part));
    let result = py.detach(move || {
        let (argument, part) = inside.into_inner();
        Apart(part(argument))
    });
    result.into_inner()
}

pub(crate) fn timeout(timeout_s: f64) -> Duration {
    Duration::try_from_secs_f64(timeout_s.max(0.0)).unwrap_or(Duration::MAX)
}

fn found(py: Python<'_>, context: &mut NativeContext<'_>, module: &str, timeout_s: f64) -> PyResult<Rc<Peer>> {
    let found = apart(py, context, |context| context.peer(module, timeout(timeout_s)));
    found.map_err(|error| failure(py, error))
}

/// A module's name as a number, and the bytes of its description.
#[pyfunction]
pub(crate) fn peer(py: Python<'_>, module: &str, timeout_s: f64) -> PyResult<(u32, Py<PyBytes>)> {
    with(py, |context| {
        let peer = found(py, context, module, timeout_s)?;
        Ok((peer.name.raw(), PyBytes::new(py, &peer.description.to_bytes()).unbind()))
    })
}

/// A module is asked anew what it offers.
#[pyfunction]
pub(crate) fn forget(py: Python<'_>, module: &str) -> PyResult<()> {
    with(py, |context| {
        context.forget(module);
        Ok(())
    })
}

/// A module that still has the interface by which Python has written the arguments: others may have met a newer one
/// since.
fn known(
    py: Python<'_>,
    context: &mut NativeContext<'_>,
    module: &str,
    interface: u32,
    timeout_s: f64,
) -> PyResult<Rc<Peer>> {
    let peer = found(py, context, module, timeout_s)?;
    if peer.hash == interface {
        return Ok(peer);
    }
    let differs = Fault::InterfaceDiffers { server: peer.hash };
    Err(call_failure(py, &CallError::Fault(peer.name, differs)))
}

/// Runs a function of another module, by the hash of its interface; its result in postcard.
#[pyfunction]
pub(crate) fn call(
    py: Python<'_>,
    module: &str,
    interface: u32,
    function: u16,
    arguments: &[u8],
    timeout_s: f64,
) -> PyResult<Py<PyBytes>> {
    with(py, |context| {
        let peer = known(py, context, module, interface, timeout_s)?;
        let called = apart(py, context, |context| context.call(&peer, function, arguments, timeout(timeout_s)));
        answer(py, called)
    })
}

/// Another module's newest data: postcard of the time, then of the value.
#[pyfunction]
pub(crate) fn get(py: Python<'_>, module: &str, interface: u32, number: u16, timeout_s: f64) -> PyResult<Py<PyBytes>> {
    with(py, |context| {
        let peer = known(py, context, module, interface, timeout_s)?;
        let called = apart(py, context, |context| context.get(&peer, number, timeout(timeout_s)));
        answer(py, called)
    })
}

pub(crate) fn answer(py: Python<'_>, called: Result<Vec<u8>, CallError>) -> PyResult<Py<PyBytes>> {
    match called {
        Ok(bytes) => Ok(PyBytes::new(py, &bytes).unbind()),
        Err(error) => Err(call_failure(py, &error)),
    }
}
