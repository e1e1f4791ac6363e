//! Memory of the TCP router for a client that only sends keep-alives.

use crate::tcp::crowd::{Crowd, Habits};
use crate::tcp::systems::{Security, Systems};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Failure, rest};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, Target, Versus, compare};
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
pub(super) fn cases() -> Vec<Box<dyn Case>> {
    [("idle client", Security::None), ("idle client, sealed", Security::Tls)]
        .map(|(name, security)| Box::new(Idle { name, security }) as Box<dyn Case>)
        .into()
}

struct Idle {
    name: &'static str,
    security: Security,
}

impl Case for Idle {
    fn name(&self) -> String {
        self.name.into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let ours = || self.kib_a_client(settings).map(Summary::single);
        let contenders = [
            Contender { name: "rohrpost", turn: Box::new(ours) },
            Contender { name: BOUND.0, turn: Box::new(|| Ok(Summary::single(BOUND.1))) },
        ];
        let versus = [Versus { name: BOUND.0, p50: Some(Target::AtMost(1.0)), p99: None }];
        let subject = Subject { case: self.name(), bytes: None, unit: "KiB" };
        Ok(compare(settings, &subject, &contenders, &versus))
    }
}

impl Idle {
    fn kib_a_client(&self, settings: &Settings) -> Result<f64, Failure> {
        let mut systems = Systems::start(settings, self.security)?;
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
}

/// Resident memory of a process.
fn resident_kib(pid: i32) -> Result<f64, Failure> {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.split_whitespace().next());
    line.and_then(|kib| kib.parse().ok()).ok_or_else(|| Failure::Failed("the TCP router has no memory".into()))
}
