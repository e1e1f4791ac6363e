//! What the hot paths ask of the kernel, counted by tracing: nothing, but for one call to sleep and one to wake.
//!
//! Where it cannot be counted the test says so: a promise that nobody looked at is not kept.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[path = "../common/mod.rs"]
mod common;
#[cfg(all(target_os = "linux", target_env = "gnu"))]
mod trace;

#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[test]
fn role() {
    let Some((_, ground)) = common::role() else { return };
    trace::trace_all(&ground);
}

#[test]
fn hot_paths_ask_the_kernel_for_nothing_but_sleep_and_wake() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    common::crew::alone(&common::Ground::in_memory(), "trace");
    #[cfg(not(all(target_os = "linux", target_env = "gnu")))]
    rohrpost_test_report::skipped("system calls of the hot paths; they can be traced on Linux with glibc only");
}
