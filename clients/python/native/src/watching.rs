//! Descriptors that a module waits for.

use crate::fails::misuse;
use crate::lent::with;
use pyo3::prelude::*;
use rohrpost_native::{Interest, Watch};
use std::os::fd::{BorrowedFd, RawFd};

/// Waits for a descriptor, too: to be read, to be written, or both; the number of this watch.
#[pyfunction]
pub(crate) fn watch(py: Python<'_>, descriptor: RawFd, read: bool, write: bool) -> PyResult<u32> {
    if descriptor < 0 {
        return Err(misuse(py, &format!("{descriptor} is no open descriptor")));
    }
    let interest = match (read, write) {
        (true, true) => Interest::Both,
        (false, true) => Interest::Write,
        _ => Interest::Read,
    };
    with(py, |context| {
        // SAFETY: used during this call alone, which duplicates it; if nothing is open under this number, the kernel
        // says so.
        let borrowed = unsafe { BorrowedFd::borrow_raw(descriptor) };
        Ok(context.watch(&borrowed, interest)?.number())
    })
}

/// Waits for it no longer; false when it was not waited for.
#[pyfunction]
pub(crate) fn unwatch(py: Python<'_>, watch: u32) -> PyResult<bool> {
    with(py, |context| Ok(context.unwatch(Watch::from_number(watch))))
}
