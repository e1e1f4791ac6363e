//! The module's context, as functions of Python reach it: lent to the thread for one call of the module's code.

use crate::fails::misuse;
use crate::owned::drop_left;
use pyo3::prelude::*;
use rohrpost_native::NativeContext;
use std::cell::Cell;
use std::io::Write;
use std::path::PathBuf;
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

/// Python tells it of each child process. Below which directory the files lie that the child has no part in.
#[pyfunction]
pub(crate) fn forked() -> PathBuf {
    // ORDERING: Relaxed; it is of one thread.
    IS_FORKED.store(true, Ordering::Relaxed);
    rohrpost_native::base_directory()
}

/// Whether this process was forked from one with a module.
pub(crate) fn is_forked() -> bool {
    // ORDERING: Relaxed; as above.
    IS_FORKED.load(Ordering::Relaxed)
}

/// Lends the context while `part` runs.
pub(crate) fn lend<T>(context: &mut NativeContext<'_>, part: impl FnOnce() -> T) -> T {
    drop_left();
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

/// For what is its module's alone.
pub(crate) fn require_own_process(py: Python<'_>) -> PyResult<()> {
    match is_forked() {
        true => Err(misuse(py, "this process was forked from a module's, and has no part in it")),
        false => Ok(()),
    }
}

/// Uses the context. What `part` runs cannot use it again.
pub(crate) fn with<T>(py: Python<'_>, part: impl FnOnce(&mut NativeContext<'_>) -> PyResult<T>) -> PyResult<T> {
    require_own_process(py)?;
    let Some(mut lent) = LENT.take() else {
        let why = "this is for a module's own functions, in its own thread, while it runs (`rohrpost.run`)";
        return Err(misuse(py, why));
    };
    let _then = Then(Some(lent));
    // SAFETY: `lend` put it there from a borrow that lasts until `part` of it returns, and removes it then; it was
    // taken out just now, so this is the only use of it. Its lifetime does not get out: `part` takes any.
    part(unsafe { lent.as_mut() })
}
