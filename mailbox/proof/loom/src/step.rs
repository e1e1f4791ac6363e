//! Deaths: the named steps of the slot core, at which a model lets a sender or receiver die.

use crate::sync::{AtomicU32, Ordering};
use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// A step of an operation on shared memory.
macro_rules! step {
    ($what:literal) => {
        $crate::step::reached($what)
    };
}
pub(crate) use step;

loom::thread_local! {
    static FATAL: Cell<Option<&'static str>> = Cell::new(None);
}

loom::lazy_static! {
    static ref TICK: AtomicU32 = AtomicU32::new(0);
}

struct Died;

pub(crate) fn reached(what: &'static str) {
    // Makes every step a place where loom tries the other threads. By itself it does so only where two threads meet in
    // an atomic, and of those it remembers just the last access: a load of one's own, and the other's is forgotten.
    // Nobody loads the tick, so it orders nothing.
    TICK.store(0, Ordering::Relaxed);
    if FATAL.with(Cell::get) == Some(what) {
        resume_unwind(Box::new(Died));
    }
}

/// Does `incarnation` up to the step `fatal`, as SIGKILL would cut it: nothing after the step happens, and the slot
/// core has no destructors that would tidy up. Says whether the step was reached.
pub(crate) fn dies_at(fatal: &'static str, life: impl FnOnce()) -> bool {
    FATAL.with(|step| step.set(Some(fatal)));
    let end: Result<(), Box<dyn Any + Send>> = catch_unwind(AssertUnwindSafe(life));
    FATAL.with(|step| step.set(None));
    match end {
        Ok(()) => false,
        Err(death) if death.is::<Died>() => true,
        Err(other) => resume_unwind(other),
    }
}
