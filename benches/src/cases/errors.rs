//! How a turn that does several kinds of work fails.

use rohrpost_bench_local::harness::Failure;

/// Errors in a turn that does several kinds of work.
pub(super) type Done<T> = Result<T, Box<dyn std::error::Error + Send + Sync>>;

/// The error as a turn reports it. What was skipped stays skipped.
pub(super) fn as_failure(what: &str) -> impl Fn(Box<dyn std::error::Error + Send + Sync>) -> Failure {
    move |error| match error.downcast::<Failure>() {
        Ok(failure) => *failure,
        Err(error) => Failure::of(what, error),
    }
}
