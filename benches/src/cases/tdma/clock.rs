//! How far a slave's system time is off the master's in time slots, under load; and how far a second after the last
//! master fell silent.
//!
//! The routers are threads of one process. Their clocks are wrong by a known offset, 30 ppm, and a varying half ppm; so
//! the true error of each reading is known, and the reading's own bound must contain it.

use super::goals::{Goal, figure};
use super::plans::LOADED;
use crate::cases::lan::clock::{HOPED, MUST, RTNET};
use crate::lan::load::Load;
use crate::lan::skewed::error_us;
use crate::lan::udp::Datagrams;
use crate::lan::{Wire, rtnet};
use crate::tdma::shells::Shells;
use crate::tdma::stage::{NODES, Stage};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{End, Failure, Scratch, sample_in_child};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_most, compare};
use rohrpost_bench_local::settings::Settings;
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

const MOST: [Goal; 2] = [Goal { name: "must 15 us", most: 15.0 }, Goal { name: "hoped 3 us", most: 3.0 }];
const AFTER_A_SECOND: [Goal; 2] = [Goal { name: "must 5 us", most: 5.0 }, Goal { name: "hoped 2 us", most: 2.0 }];

pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("clock", None, "us", slot_clock), Case::new("holdover", None, "us", holdover)]
}

fn slot_clock(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let (stage, wire) = (Stage::new(), Wire::new(MTU));
    let most_us = RefCell::new(Vec::new());
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
        })
        // Five times better; twenty times in the middle and thirty at the end.
        .beside(at_most(0.2), at_most(0.2))
        .beside(at_most(0.05), at_most(0.033)),
        Contender::fixed(MUST.0, MUST.1).beside(at_most(1.0), at_most(1.0)),
        Contender::fixed(HOPED.0, HOPED.1).beside(at_most(1.0), at_most(1.0)),
    ];
    let mut rows = compare(settings, subject, &contenders);
    let most = Subject { case: "clock, max".into(), ..subject.clone() };
    rows.extend(figure(&most, "rohrpost", &most_us.borrow(), &MOST));
    Ok(rows)
}

fn holdover(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let stage = Stage::new();
    let most_us = RefCell::new(Vec::new());
    let contenders = [Contender::sampled("after 1 s", || {
        let stage = stage.as_ref().map_err(Clone::clone)?;
        let samples = off_after_silence_us(stage, settings)?;
        most_us.borrow_mut().extend(samples.iter().copied().reduce(f64::max));
        Ok(samples)
    })];
    let mut rows = compare(settings, subject, &contenders);
    let most = Subject { case: "holdover, max".into(), ..subject.clone() };
    rows.extend(figure(&most, "after 1 s", &most_us.borrow(), &AFTER_A_SECOND));
    Ok(rows)
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
