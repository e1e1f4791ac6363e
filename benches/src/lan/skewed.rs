//! Nodes of one computer with clocks that are wrong on purpose, so that the true error of each is known.

use rohrpost_bench_local::Failure;
use rohrpost_mailbox::{TimeRecord, monotonic_ns};
use rohrpost_routers::shell::clock::Skew;
use std::time::Duration;

/// A clock of a slave: a known offset, 30 ppm, and a varying half ppm.
pub const SKEW: Skew = Skew { offset_ns: 1_234_000_000, rate_ppb: 30_000, wander_ppb: 500.0, begin_ns: 0 };

/// What a node shows as system time, and the error of the clock by which it does.
#[derive(Clone, Copy, Debug)]
pub struct Shown {
    /// As in its time page.
    pub record: TimeRecord,
    /// Of its clock.
    pub skew: Skew,
}

/// Error of the slave's time now, µs. The slave must be synchronised.
///
/// # Errors
/// When the error exceeds the slave's own bound, or the epoch differs.
pub fn error_us(master: &Shown, slave: &Shown) -> Result<f64, Failure> {
    let now_ns = monotonic_ns();
    let [master, slave] = [master, slave].map(|shown| shown.record.at(shown.skew.local_ns(now_ns)));
    if master.epoch != slave.epoch {
        return Err(Failure::Failed(format!("epoch {} at the master, {} at the slave", master.epoch, slave.epoch)));
    }
    let (error, bound) = (Duration::from_nanos(master.ns.abs_diff(slave.ns)), slave.error);
    if error > bound {
        return Err(Failure::Failed(format!("off by {error:?}, where at most {bound:?} was promised")));
    }
    Ok(error.as_nanos() as f64 / 1000.0)
}
