//! How far a slave's system time is off the master's, while both processors work and the network is full.
//!
//! The clock services are those of routers. The clocks that they read are this computer's, the slave's made wrong by a
//! known offset, 30 ppm, and half a ppm that comes and goes; so the true error of each reading is known, and its own
//! bound must contain it.

use crate::lan::Wire;
use crate::lan::load::Load;
use crate::lan::rtnet;
use crate::lan::skewed::{SKEW, Shown, error_us};
use crate::lan::udp::Datagrams;
use crate::lan::wire::address;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{End, Failure, OrFail, look_for, sample_in_child};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;
use rohrpost_mailbox::monotonic_ns;
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::shell::clock::{ClockParts, ClockService, Skew};
use rohrpost_routers::time::{Role, TimeSettings};
use std::time::Duration;

/// How often the clocks are read, and how many times in a turn.
const EACH: Duration = Duration::from_millis(1);
const SAMPLES: usize = 2_000;
/// RTnet's have 5 ms each.
const SYNCHRONISATIONS: usize = 400;
/// Of ours.
const INTERVAL: Duration = Duration::from_millis(100);
/// Exchanges until the slave's filter has what it needs.
const SETTLED: u64 = 50;
const PATIENCE: Duration = Duration::from_secs(60);
const PORT: u16 = 20_140;
const MTU: u16 = 1_500;

/// What must be reached, and what may be hoped for: µs, as p50, p99, p99.9 (none given) and maximum.
pub(in crate::cases) const MUST: (&str, Summary) =
    ("2, 5, 15 us", Summary { p50: 2.0, p99: Some(5.0), p999: None, max: Some(15.0) });
pub(in crate::cases) const HOPED: (&str, Summary) =
    ("0.5, 1.5, 3 us", Summary { p50: 0.5, p99: Some(1.5), p999: None, max: Some(3.0) });
pub(in crate::cases) const RTNET: &str = "RTnet's formula";

/// All of them.
pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("clock", None, "us", lan_clock_case)]
}

fn lan_clock_case(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let wire = Wire::new(MTU);
    let wire = || wire.as_ref().map_err(Clone::clone);
    let contenders = [
        Contender::sampled("rohrpost", || errors_us(wire()?, settings)),
        Contender::sampled(RTNET, || {
            let _load = load(wire()?)?;
            rtnet::errors_us(wire()?, settings.count(SYNCHRONISATIONS))
        })
        .beside(at_most(0.2), None),
        Contender::fixed(MUST.0, MUST.1).beside(at_most(1.0), at_most(1.0)),
        Contender::fixed(HOPED.0, HOPED.1).beside(None, None),
    ];
    Ok(compare(settings, subject, &contenders))
}

fn load(wire: &Wire) -> Result<Load, Failure> {
    Load::start(|| Datagrams::open(wire, End::Ping), || Datagrams::open(wire, End::Pong))
}

/// How far off the slave was at any moment, µs.
fn errors_us(wire: &Wire, settings: &Settings) -> Result<Vec<f64>, Failure> {
    let _load = load(wire)?;
    sample_in_child(PATIENCE, |samples| {
        let master = Timed::start(wire, End::Ping)?;
        let slave = Timed::start(wire, End::Pong)?;
        let seen = || slave.service.state().snapshot();
        let settled = look_for(PATIENCE, EACH, || Ok(slave.is_settled().then_some(())))?;
        settled.ok_or_else(|| Failure::Failed(format!("the slave has no time: {:?}", seen())))?;
        for _ in 0..settings.count(SAMPLES) {
            std::thread::sleep(EACH);
            samples.push(error_us(&master.shown(), &slave.shown())?);
        }
        Ok(())
    })
}

/// A node that keeps time, by a clock of its own.
struct Timed {
    service: ClockService,
    skew: Skew,
}

impl Timed {
    /// The near one is the master.
    fn start(wire: &Wire, end: End) -> Result<Self, Failure> {
        wire.enter(end)?;
        let own = NodeIndex::from(end == End::Pong);
        let skew = if end == End::Ping { Skew::default() } else { Skew { begin_ns: monotonic_ns(), ..SKEW } };
        let settings = TimeSettings {
            system: 1,
            own,
            nodes: 2,
            masters: vec![0],
            interval: INTERVAL,
            digest: 1,
            incarnation: monotonic_ns(),
        };
        let nodes = [End::Ping, End::Pong].map(|end| (address(end), PORT).into()).into();
        let parts = ClockParts { skew: Some(skew), ..ClockParts::at(nodes, settings) };
        let service = ClockService::start(parts).or_fail("clock service")?;
        Ok(Self { service, skew })
    }

    fn shown(&self) -> Shown {
        Shown { record: self.service.state().snapshot().record, skew: self.skew }
    }

    fn is_settled(&self) -> bool {
        let seen = self.service.state().snapshot();
        seen.synchronised && seen.role == Role::Slave && seen.exchanges >= SETTLED
    }
}
