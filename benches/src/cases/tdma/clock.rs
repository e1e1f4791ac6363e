//! How far a slave's system time is off the master's in time slots, under load; and how far a second after the last
//! master fell silent.
//!
//! The routers are threads of one process. Their clocks are wrong by a known offset, 30 ppm, and a varying half ppm; so
//! the true error of each reading is known, and the reading's own bound must contain it.

use super::goals::{Goal, figure};
use super::plans::LOADED;
use crate::lan::load::Load;
use crate::lan::skewed::error_us;
use crate::lan::udp::Datagrams;
use crate::lan::{Wire, rtnet};
use crate::tdma::shells::Shells;
use crate::tdma::stage::{NODES, Stage};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{End, Failure, Scratch, sample_in_child};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, Target, Versus, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;
use std::cell::RefCell;
use std::time::Duration;

/// How often clocks are read, and how many times in a turn.
const EACH: Duration = Duration::from_millis(1);
const SAMPLES: usize = 5_000;
/// One in each cycle of RTnet's.
const SYNCHRONISATIONS: usize = 1_000;
const MTU: u16 = 1_500;
const PATIENCE: Duration = Duration::from_secs(180);
/// The masters of the plan, which all fall silent.
const MASTERS: std::ops::Range<u8> = 0..2;
/// The slaves.
const SLAVE: u8 = 2;
const SILENT_FOR: Duration = Duration::from_secs(1);
const SILENCES: usize = 5;
/// Clocks measure for so long before; this is what they know of their rate.
const MEASURES: Duration = Duration::from_secs(10);
const MEASURES_QUICK: Duration = Duration::from_millis(500);

const MUST: (&str, Summary) = ("2, 5, 15 us", Summary { p50: 2.0, p99: Some(5.0), p999: None, max: Some(15.0) });
const HOPED: (&str, Summary) = ("0.5, 1.5, 3 us", Summary { p50: 0.5, p99: Some(1.5), p999: None, max: Some(3.0) });
const RTNET: &str = "RTnet's formula";
const MOST: [Goal; 2] = [Goal { name: "must 15 us", most: 15.0 }, Goal { name: "hoped 3 us", most: 3.0 }];
const AFTER_A_SECOND: [Goal; 2] = [Goal { name: "must 5 us", most: 5.0 }, Goal { name: "hoped 2 us", most: 2.0 }];

pub(super) fn cases() -> Vec<Box<dyn Case>> {
    vec![Box::new(SlotClockCase), Box::new(Holdover)]
}

struct SlotClockCase;

impl Case for SlotClockCase {
    fn name(&self) -> String {
        "clock".into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let (stage, wire) = (Stage::new(), Wire::new(MTU));
        let most_us = RefCell::new(Vec::new());
        let fixed = |(name, bounds)| Contender { name, turn: Box::new(move || Ok(bounds)) };
        let contenders = [
            Contender::sampled("rohrpost", || {
                let samples = errors_us(stage.as_ref().map_err(Clone::clone)?, settings)?;
                most_us.borrow_mut().extend(samples.iter().copied().reduce(f64::max));
                Ok(samples)
            }),
            Contender::sampled(RTNET, || {
                let wire = wire.as_ref().map_err(Clone::clone)?;
                let _load = Load::start(|| Datagrams::open(wire, End::Ping), || Datagrams::open(wire, End::Pong))?;
                rtnet::errors_us(wire, settings.count(SYNCHRONISATIONS))
            }),
            fixed(MUST),
            fixed(HOPED),
        ];
        let versus =
            |name, p50: f64, p99: f64| Versus { name, p50: Some(Target::AtMost(p50)), p99: Some(Target::AtMost(p99)) };
        // Five times better; twenty times in the middle and thirty at the end.
        let (better, much_better) = (versus(RTNET, 0.2, 0.2), versus(RTNET, 0.05, 0.033));
        let all = [better, much_better, versus(MUST.0, 1.0, 1.0), versus(HOPED.0, 1.0, 1.0)];
        let mut rows = compare(settings, &subject("clock"), &contenders, &all);
        rows.extend(figure(&subject("clock, max"), "rohrpost", &most_us.borrow(), &MOST));
        Ok(rows)
    }
}

struct Holdover;

impl Case for Holdover {
    fn name(&self) -> String {
        "holdover".into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let stage = Stage::new();
        let most_us = RefCell::new(Vec::new());
        let contenders = [Contender::sampled("after 1 s", || {
            let stage = stage.as_ref().map_err(Clone::clone)?;
            let samples = off_after_silence_us(stage, settings)?;
            most_us.borrow_mut().extend(samples.iter().copied().reduce(f64::max));
            Ok(samples)
        })];
        let mut rows = compare(settings, &subject("holdover"), &contenders, &[]);
        rows.extend(figure(&subject("holdover, max"), "after 1 s", &most_us.borrow(), &AFTER_A_SECOND));
        Ok(rows)
    }
}

fn subject(case: &str) -> Subject {
    Subject { case: case.into(), bytes: None, unit: "us" }
}

fn measures(settings: &Settings) -> Duration {
    if settings.quick { MEASURES_QUICK } else { MEASURES }
}

/// Errors of the slaves' time.
fn errors_us(stage: &Stage, settings: &Settings) -> Result<Vec<f64>, Failure> {
    let scratch = Scratch::new()?;
    let _load = stage.load()?;
    sample_in_child(PATIENCE, |samples| {
        let shells = Shells::start(stage, &LOADED, &scratch)?;
        let mut master = shells.await_settled()?;
        std::thread::sleep(measures(settings));
        for _ in 0..settings.count(SAMPLES) {
            std::thread::sleep(EACH);
            // After a change of the master only slaves that have measured the new one are right.
            if shells.master() != Some(master) {
                master = shells.await_settled()?;
            }
            for slave in (0..NODES).filter(|node| *node != master) {
                samples.push(error_us(&shells.shown(master)?, &shells.shown(slave)?)?);
            }
        }
        Ok(())
    })
}

/// Error of a slave's time a second after all masters fell silent, several times.
fn off_after_silence_us(stage: &Stage, settings: &Settings) -> Result<Vec<f64>, Failure> {
    let silences = if settings.quick { 1 } else { SILENCES };
    let scratches = (0..silences).map(|_| Scratch::new()).collect::<Result<Vec<_>, Failure>>()?;
    sample_in_child(PATIENCE, |samples| {
        for scratch in &scratches {
            let mut shells = Shells::start(stage, &LOADED, scratch)?;
            shells.await_settled()?;
            std::thread::sleep(measures(settings));
            let master = shells.shown(shells.await_settled()?)?;
            shells.end(MASTERS);
            std::thread::sleep(SILENT_FOR);
            samples.push(error_us(&master, &shells.shown(SLAVE)?)?);
        }
        Ok(())
    })
}
