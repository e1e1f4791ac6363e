//! How far a slave's system time is off the master's, while both computers work and the network is full.
//!
//! The far node follows the near one, by real routers. Both computers of this network have one clock, so both pages can be read for
//! the same moment, and what they differ by is the slave's error. Its own bound must contain it.

use super::Ground;
use crate::cases::Case;
use crate::harness::{Child, End, Failure, Link, Placement, Scheduling, interrupted, sample_in_child, settle};
use crate::lan::Wire;
use crate::lan::nodes::{Network, Nodes};
use crate::lan::rtnet;
use crate::lan::udp::Datagrams;
use crate::rounds::{Contender, Row, Subject, Target, Versus, compare};
use crate::settings::Settings;
use crate::statistics::Summary;
use rohrpost_mailbox::{Node, NodeError, SystemClock, TimeSource, monotonic_ns};
use std::time::{Duration, Instant};

/// How often the pages are read, and how many times in a turn.
const EACH: Duration = Duration::from_millis(1);
const SAMPLES: usize = 2_000;
/// RTnet's have 5 ms each.
const SYNCHRONISATIONS: usize = 400;
const PATIENCE: Duration = Duration::from_secs(20);
/// A slave that has the time within this, which is where it no longer steps, may take that long to have it exactly.
const SETTLED: Duration = Duration::from_micros(200);
const SETTLES_WITHIN: Duration = Duration::from_secs(60);
/// After that the filter is full.
const SETTLING: Duration = Duration::from_secs(10);
/// The load: datagrams of an ordinary network, about 40 000 a second.
const LOAD_BYTES: usize = 1_400;
const LOAD_BURST: usize = 40;
const LOAD_EACH: Duration = Duration::from_millis(1);

/// What must be reached, and what may be hoped for: µs, as p50, p99, p99.9 (none given) and maximum.
const MUST: (&str, Summary) = ("2, 5, 15 us", Summary { p50: 2.0, p99: Some(5.0), p999: None, max: Some(15.0) });
const HOPED: (&str, Summary) = ("0.5, 1.5, 3 us", Summary { p50: 0.5, p99: Some(1.5), p999: None, max: Some(3.0) });
const RTNET: &str = "RTnet's formula";

/// All of them.
pub(super) fn cases() -> Vec<Box<dyn Case>> {
    vec![Box::new(Clock)]
}

struct Clock;

impl Case for Clock {
    fn name(&self) -> String {
        "clock".into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let ground = Ground::new(settings, &Network { mtu: 1_500, rate: "100 MiB", quota: "256 KiB" });
        let settled = ground.turn().and_then(|(nodes, _)| await_time(nodes, settings));
        let fixed = |(name, bounds)| Contender { name, turn: Box::new(move || Ok(bounds)) };
        let contenders = [
            Contender::sampled("rohrpost", || {
                settled.clone()?;
                let (nodes, _) = ground.turn()?;
                let _load = Load::start(ground.wire()?)?;
                sample_in_child(PATIENCE, |samples| {
                    let clocks = Clocks::open(nodes)?;
                    for _ in 0..settings.count(SAMPLES) {
                        std::thread::sleep(EACH);
                        samples.push(clocks.error_us()?);
                    }
                    Ok(())
                })
            }),
            Contender::sampled(RTNET, || {
                let wire = ground.wire()?;
                let _load = Load::start(wire)?;
                rtnet::errors_us(wire, settings.count(SYNCHRONISATIONS))
            }),
            fixed(MUST),
            fixed(HOPED),
        ];
        let bounded = |bound| Some(Target::AtMost(bound));
        let versus = [
            Versus { name: RTNET, p50: bounded(0.2), p99: None },
            Versus { name: MUST.0, p50: bounded(1.0), p99: bounded(1.0) },
            Versus { name: HOPED.0, p50: None, p99: None },
        ];
        let subject = Subject { case: self.name(), bytes: None, unit: "us" };
        Ok(compare(settings, &subject, &contenders, &versus))
    }
}

/// Both nodes' pages.
struct Clocks {
    near: SystemClock,
    far: SystemClock,
}

impl Clocks {
    fn open(nodes: &Nodes) -> Result<Self, Failure> {
        let clock = |end| Ok(SystemClock::open(&*Node::open(&nodes.directory(end))?));
        let both = || Ok::<_, NodeError>(Self { near: clock(End::Ping)?, far: clock(End::Pong)? });
        both().map_err(|error| Failure::of("time page", error))
    }

    /// Whether both have the time, and the slave knows it well.
    fn are_settled(&self) -> bool {
        let follows = |clock: &SystemClock| clock.record().is_some_and(|record| record.source == TimeSource::Master);
        follows(&self.near) && follows(&self.far) && self.far.now().error < SETTLED && self.near.now().error < SETTLED
    }

    /// How far the slave is off the master at this moment. It must know.
    fn error_us(&self) -> Result<f64, Failure> {
        let now_ns = monotonic_ns();
        let (near, far) = (self.near.at(now_ns), self.far.at(now_ns));
        if near.epoch != far.epoch {
            return Err(Failure::Failed(format!("epoch {} at the master, {} at the slave", near.epoch, far.epoch)));
        }
        let error = Duration::from_nanos(near.ns.abs_diff(far.ns));
        let bound = near.error + far.error;
        if error > bound {
            return Err(Failure::Failed(format!("off by {error:?}, where at most {bound:?} was promised")));
        }
        Ok(error.as_nanos() as f64 / 1000.0)
    }
}

/// Until the slave has the master's time.
fn await_time(nodes: &Nodes, settings: &Settings) -> Result<(), Failure> {
    let clocks = Clocks::open(nodes)?;
    let give_up = Instant::now() + SETTLES_WITHIN;
    while !clocks.are_settled() {
        if interrupted() || Instant::now() > give_up {
            let [near, far] = [&clocks.near, &clocks.far].map(|clock| clock.record().map(|record| record.source));
            let error = clocks.far.now().error;
            return Err(Failure::Failed(format!(
                "after {SETTLES_WITHIN:?} the slave knows the time within {error:?}; sources: {near:?}, {far:?}"
            )));
        }
        std::thread::sleep(EACH);
    }
    let settled = Instant::now() + SETTLING;
    while !settings.quick && !interrupted() && Instant::now() < settled {
        std::thread::sleep(EACH);
    }
    Ok(())
}

/// Work on both processors, and datagrams from node to node, until it is dropped.
struct Load {
    _children: [Child; 4],
}

impl Load {
    fn start(wire: &Wire) -> Result<Self, Failure> {
        let work = || {
            Child::start(|| {
                loop {
                    std::hint::black_box(monotonic_ns());
                }
            })
        };
        let swamp = Child::start(|| {
            let mut datagrams = Datagrams::open(wire, End::Pong)?;
            let mut message = vec![0; LOAD_BYTES];
            loop {
                datagrams.receive(&mut message)?;
            }
        })?;
        let flooder = Child::start(|| {
            let mut datagrams = Datagrams::open(wire, End::Ping)?;
            settle(End::Ping, Placement::TwoCores, Scheduling::Normal)?;
            let message = vec![7; LOAD_BYTES];
            loop {
                for _ in 0..LOAD_BURST {
                    // Refused until the swamp is there.
                    let _ = datagrams.send(&message);
                }
                std::thread::sleep(LOAD_EACH);
            }
        })?;
        Ok(Self { _children: [work()?, work()?, swamp, flooder] })
    }
}
