//! The module's context, as functions of Python reach it: lent to the thread for one call of the module's code.

use crate::fails::misuse;
use pyo3::prelude::*;
use rohrpost_native::NativeContext;
use std::cell::Cell;
use std::io::Write;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicBool, Ordering};

thread_local! {
    /// The context that is lent to this thread, and not in use.
    static LENT: Cell<Option<NonNull<NativeContext<'static>>>> = const { Cell::new(None) };
}

/// This process was forked from one with a module. Set before any other code of it runs, in its only thread.
static IS_FORKED: AtomicBool = AtomicBool::new(false);

/// Gives back what was lent, or puts back what is not in use any more, also after a panic.
struct Then(Option<NonNull<NativeContext<'static>>>);

impl Drop for Then {
    fn drop(&mut self) {
        LENT.set(self.0);
    }
}

/// Python tells it of each child process.
#[pyfunction]
pub(crate) fn forked() {
    // ORDERING: Relaxed; it is of one thread.
    IS_FORKED.store(true, Ordering::Relaxed);
}

/// Whether this process was forked from one with a module.
fn is_forked() -> bool {
    // ORDERING: Relaxed; as above.
    IS_FORKED.load(Ordering::Relaxed)
}

/// Lends the context while `part` runs.
pub(crate) fn lend<T>(context: &mut NativeContext<'_>, part: impl FnOnce() -> T) -> T {
    let _then = Then(LENT.take());
    LENT.set(Some(NonNull::from(context).cast()));
    let result = part();
    if is_forked() {
        let why = "a forked process came back to the loop of its parent's module, and ends; let it end by os._exit";
        // Where nobody can hear it, it ends all the same.
        let _ = writeln!(std::io::stderr(), "{why}");
        std::process::exit(70);
    }
    result
}

/// Uses the context. What `part` runs cannot use it again.
pub(crate) fn with<T>(py: Python<'_>, part: impl FnOnce(&mut NativeContext<'_>) -> PyResult<T>) -> PyResult<T> {
    if is_forked() {
        return Err(misuse(py, "this process was forked from a module's, and has no part in it"));
    }
    let Some(mut lent) = LENT.take() else {
        let why = "this is for a module's own functions, in its own thread, while it runs (`rohrpost.run`)";
        return Err(misuse(py, why));
    };
    let _then = Then(Some(lent));
    // SAFETY: `lend` put it there from a borrow that lasts until `part` of it returns, and removes it then; it was
    // taken out just now, so this is the only use of it. Its lifetime does not get out: `part` takes any.
    part(unsafe { lent.as_mut() })
}
