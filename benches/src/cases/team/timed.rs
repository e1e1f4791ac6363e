//! Times of small work, one after the other.

use rohrpost_bench_local::harness::{End, Failure, Placement, Scheduling, sample_in_child, settle};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(60);
/// Turns before those that count.
pub(super) const WARM_UP: usize = 20;

/// How long work takes each time, ns; what it works on is made beforehand.
pub(super) fn timed<I, O>(
    count: usize,
    mut make: impl FnMut() -> I,
    mut work: impl FnMut(I) -> O,
) -> Result<Vec<f64>, Failure> {
    sample_in_child(PATIENCE, |samples| {
        settle(End::Ping, Placement::OneCore, Scheduling::Fifo)?;
        for at in 0..WARM_UP + count {
            let input = std::hint::black_box(make());
            let began = Instant::now();
            let output = std::hint::black_box(work(input));
            let took_ns = began.elapsed().as_nanos() as f64;
            drop(output);
            if at >= WARM_UP {
                samples.push(took_ns);
            }
        }
        Ok(())
    })
}
