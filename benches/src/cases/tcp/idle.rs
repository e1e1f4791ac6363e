//! Memory of the TCP router for a client that only sends keep-alives.

use crate::tcp::crowd::{Crowd, Habits};
use crate::tcp::systems::{Security, Systems};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Failure, rest};
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;
use std::fs;
use std::time::Duration;

const GUESTS: u16 = 1_000;
const GUESTS_QUICK: u16 = 40;
/// Longer than the handshake's memory is kept, and than a status takes.
const SETTLES: Duration = Duration::from_secs(3);
const BOUND: (&str, f64) = ("64 KiB", 64.0);

/// All cases of this file.
pub(super) fn cases() -> Vec<Case> {
    [("idle client", Security::None), ("idle client, sealed", Security::Tls)]
        .map(|(name, security)| {
            Case::new(name, None, "KiB", move |settings, subject| {
                let ours = Contender::single("rohrpost", || kib_a_client(settings, security));
                let bound = Contender::fixed(BOUND.0, Summary::single(BOUND.1)).beside(at_most(1.0), None);
                Ok(compare(settings, subject, &[ours, bound]))
            })
        })
        .into()
}

fn kib_a_client(settings: &Settings, security: Security) -> Result<f64, Failure> {
    let mut systems = Systems::start(settings, security)?;
    let settles = if settings.quick { SETTLES / 10 } else { SETTLES };
    rest(settles)?;
    let before = resident_kib(systems.router_pid())?;
    let guests = if settings.quick { GUESTS_QUICK } else { GUESTS };
    let idle =
        Habits { guests, per_s: 0, bytes: 0, one_stalls: false, warm_up: Duration::ZERO, counted: Duration::ZERO };
    let mut crowd = Crowd::gather(&systems, idle)?;
    rest(settles)?;
    let after = resident_kib(systems.router_pid())?;
    systems.check()?;
    crowd.is_there()?;
    Ok((after - before) / f64::from(guests))
}

/// Resident memory of a process.
fn resident_kib(pid: i32) -> Result<f64, Failure> {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.split_whitespace().next());
    line.and_then(|kib| kib.parse().ok()).ok_or_else(|| Failure::Failed("the TCP router has no memory".into()))
}
