//! The slot core of the mailbox under [loom](https://docs.rs/loom): small programs, each run in every order of its
//! threads' steps and with every stale value that C11's memory model lets a load return.
//!
//! ```text
//!  mailbox/src/{word,slots,queue,…}.rs ─┬── unchanged ──▶ variants::real        every model holds
//!  src/models.rs ───────────────────────┤
//!  src/broken/, one edit or a few ──────┴── edited ─────▶ variants::no_fence_e  one model fails, and says how
//!                                                        variants::…
//! ```
//!
//! - `models.rs`: the programs; read these first. Each is named after what it shows.
//! - `broken`: tables of mistakes, each with the model that catches it. A proof that cannot fail proves nothing. An
//!   edit must find its text exactly once, so that a variant cannot rot: the build fails and names it. So it does with
//!   a model that no variant names.
//! - `step.rs`: the core's crash points, here places to switch threads and to die.
//! - `cell_models.rs`, `cell_broken.rs`: the same for the single-writer cells of `cell.rs`.
//! - `stream_models.rs`, `stream_broken.rs`: the same for the core of streams,
//!   `stream/{omission,ring,writing,left_out,missed,lookup}.rs`.
//! - `build.rs`: puts them together with loom's atomics. It also compares what the models had to write again (what is
//!   asked of the kernel, waiting, sending, giving up) with the lines that the mailbox has.
//!
//! Plain `cargo test -p rohrpost-proof-loom` runs all. Each model bounds how often loom takes the processor away from a
//! thread that could go on; most mistakes need one or two such preemptions. Deeper, one model at a time, over night:
//!
//! ```text
//! LOOM_MAX_PREEMPTIONS=5 cargo test -p rohrpost-proof-loom -- real::no_wake_up_is_lost_between_two
//! LOOM_LOG=trace LOOM_LOCATION=1 cargo test …    what the failing order was
//! ```
//!
//! What this does not show:
//!
//! - Loom lets a load read old values, but each read-modify-write reads the newest, and failing compare-and-swaps too.
//! - Its SeqCst fences order more than C11's: all are one lock, in the order of execution. SeqCst accesses are no more
//!   than AcqRel to it, so where the core relies on their one order (`seq_cst_accesses`), the models have a fence in
//!   the same place.
//! - It switches threads where two meet in an atomic, but remembers only the last access to each, and so overlooks
//!   orders: without the ticks of `step.rs` it passed a claim without Acquire. Between two steps it may overlook some
//!   still.
//! - Some orderings are there twice, and one alone can be dropped unseen: a taken body is handed over by word, hint and
//!   ticket counter; a ticket's Release is also in fence (E) of the package before.
//! - A displaced package may be counted twice if its displacer dies between counting it and publishing.

#![cfg(test)]

#[allow(unused, unreachable_pub)]
mod name {
    include!(concat!(env!("OUT_DIR"), "/name.rs"));
}
mod step;
mod sync {
    pub(crate) use loom::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};

    /// Loom knows the order of SeqCst fences, not that of SeqCst accesses.
    pub(crate) fn seq_cst_accesses() {
        fence(Ordering::SeqCst);
    }

    pub(crate) fn prefetch_to_read<T>(_: *const T) {}
    pub(crate) fn prefetch_to_write<T>(_: *const T) {}
}
#[allow(unused, unreachable_pub, clippy::all, clippy::unwrap_used)]
mod variants {
    include!(concat!(env!("OUT_DIR"), "/variants.rs"));
}
// Never compiled here, only beside each variant; named so that rustfmt finds it.
#[cfg(any())]
mod cell_models;
#[cfg(any())]
mod models;
#[cfg(any())]
mod stream_models;
#[cfg(any())]
mod stream_rig;

use std::cell::Cell;
use std::panic::{catch_unwind, set_hook, take_hook};
use std::sync::{Mutex, Once, PoisonError};

/// Loom maps a stack for each thread of each order. Two models at a time would wait for the kernel's lock of the memory
/// map, and each unmapping would interrupt the other processor: three times the processor time, for no less waiting.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// Runs a model; LOOM_MAX_PREEMPTIONS, if set, goes before its own bound.
fn holds(preemptions: usize, model: fn()) {
    // A model that failed leaves nothing half done.
    let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let mut loom = loom::model::Builder::new();
    loom.preemption_bound = loom.preemption_bound.or(Some(preemptions));
    loom.check(model);
}

/// Runs a model of a broken variant, which must fail, and say so in these words.
fn is_caught(says: &str, preemptions: usize, model: fn()) {
    thread_local!(static QUIET: Cell<bool> = const { Cell::new(false) });
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let loud = take_hook();
        set_hook(Box::new(move |info| {
            if !QUIET.get() {
                loud(info);
            }
        }));
    });
    QUIET.set(true);
    let outcome = catch_unwind(|| holds(preemptions, model));
    QUIET.set(false);
    let failure = outcome.expect_err("it is broken, and loom does not notice");
    let said = failure.downcast_ref::<String>().map(String::as_str).or(failure.downcast_ref::<&str>().copied());
    assert!(said.is_some_and(|said| said.contains(says)), "it should say {says:?}, not {said:?}");
}
