//! How long a package is on its way, one at a time: to a receiver that sleeps, one that spins, one on the same core.
//!
//! All echo; one way is half of the round trip. Everything is copied in and out, except where it is loaned: there 16
//! bytes are written and read at each end, whatever the size.

use super::case::Case;
use super::rivals::Rival;
use crate::harness::{Cell, Failure, Pause, Placement, Scheduling, Scratch, time_two_processes};
use crate::ours::{How, Mailboxes};
use crate::rounds::{Contender, Row, Subject, Target, Versus, compare};
use crate::settings::Settings;
use std::time::Duration;

/// Bytes that are touched of what is sent and read in place.
const TOUCHED: usize = 16;

/// Round trips of a turn, and those before them that do not count.
const MESSAGES: usize = 20_000;
const WARM_UP: usize = 2_000;

/// With a package each 0.5 ms there is time for fewer.
const MESSAGES_PACED: usize = 1_500;

/// A turn of a sleeping contender may be longer than one of a spinning contender: see [`Cell::cap`].
const CAP_ASLEEP: Duration = Duration::from_secs(2);
const CAP_AWAKE: Duration = Duration::from_millis(600);

/// A package each so often, where that is told.
const PACE: Duration = Duration::from_micros(500);

/// A case of one size.
pub(super) struct Latency {
    name: &'static str,
    bytes: usize,
    how: How,
    placement: Placement,
    scheduling: Scheduling,
    pause: Pause,
    /// Round trips of a turn.
    messages: usize,
    rivals: Vec<(Rival, Option<Target>, Option<Target>)>,
}

/// All of them.
pub(super) fn cases() -> Vec<Box<dyn Case>> {
    let groups = [blocking(), one_core(), spinning(), loaned(), normal_scheduler(), paced()];
    groups.into_iter().flatten().map(|case| Box::new(case) as Box<dyn Case>).collect()
}

/// A few, against the floors alone, which give an answer in seconds.
pub(super) fn self_test(scheduling: Scheduling) -> Vec<Box<dyn Case>> {
    let few = |mut case: Latency| {
        case.scheduling = scheduling;
        case.messages = 3_000;
        case.rivals.retain(|(rival, ..)| matches!(rival, Rival::Futex | Rival::Spin));
        Box::new(case) as Box<dyn Case>
    };
    blocking().into_iter().chain(spinning()).filter(|case| case.bytes <= 1024).map(few).collect()
}

fn at_most(bound: f64) -> Option<Target> {
    Some(Target::AtMost(bound))
}

impl Latency {
    fn new(name: &'static str, bytes: usize, how: How) -> Self {
        let (placement, scheduling, rivals) = (Placement::TwoCores, Scheduling::Fifo, Vec::new());
        Self { name, bytes, how, placement, scheduling, pause: Pause::None, messages: MESSAGES, rivals }
    }

    /// To a receiver that has gone to sleep.
    fn asleep(name: &'static str, bytes: usize) -> Self {
        Self { pause: Pause::UNTIL_ASLEEP, ..Self::new(name, bytes, How::Blocking) }
    }

    fn beside(mut self, rival: Rival, p50: Option<Target>, p99: Option<Target>) -> Self {
        self.rivals.push((rival, p50, p99));
        self
    }

    #[cfg(feature = "peers")]
    fn beside_peer(self, rival: Rival) -> Self {
        self.beside(rival, None, None)
    }
}

fn blocking() -> Vec<Latency> {
    let case = |bytes| {
        let (p50, p99) = if bytes <= 1024 { (at_most(1.10), at_most(1.15)) } else { (None, None) };
        let case = Latency::asleep("blocking", bytes).beside(Rival::Futex, p50, p99);
        let case = case.beside(Rival::PosixQueue, at_most(1.0), None);
        #[cfg(feature = "peers")]
        let case = case.beside_peer(Rival::IceoryxListener);
        case
    };
    [64, 1024, 16_384, 62_000].map(case).into()
}

fn one_core() -> Vec<Latency> {
    let case = Latency { placement: Placement::OneCore, ..Latency::new("one-core", 64, How::Blocking) };
    let case = case.beside(Rival::Futex, at_most(1.10), None).beside(Rival::PosixQueue, None, None);
    #[cfg(feature = "peers")]
    let case = case.beside_peer(Rival::IceoryxListener);
    vec![case]
}

fn spinning() -> Vec<Latency> {
    let case = |(bytes, bound)| {
        let core = if bytes == 64 { at_most(1.3) } else { None };
        let case = Latency::new("spinning", bytes, How::Spinning).beside(Rival::Spin, at_most(bound), None);
        let case = case.beside(Rival::SlotCore, core, None);
        #[cfg(feature = "peers")]
        let case = case.beside_peer(Rival::IceoryxSpinning).beside_peer(Rival::Crossbeam);
        case
    };
    [(64, 1.4), (1024, 1.15), (16_384, 1.0)].map(case).into()
}

fn loaned() -> Vec<Latency> {
    let case = |bytes| {
        let case = Latency::new("loaned", bytes, How::Loaned).beside(Rival::SpinSmall, at_most(1.5), None);
        #[cfg(feature = "peers")]
        let case = case.beside_peer(Rival::IceoryxLoaned);
        case
    };
    [64, 1024, 16_384, 62_000].map(case).into()
}

fn normal_scheduler() -> Vec<Latency> {
    let case = |case| Latency { scheduling: Scheduling::Normal, ..case };
    let blocking = case(Latency::asleep("blocking, default scheduler", 64));
    let blocking = blocking.beside(Rival::Futex, None, None).beside(Rival::PosixQueue, None, None);
    let spinning = case(Latency::new("spinning, default scheduler", 64, How::Spinning));
    vec![blocking, spinning.beside(Rival::Spin, None, None)]
}

fn paced() -> Vec<Latency> {
    let case =
        |name, how| Latency { pause: Pause::Asleep(PACE), messages: MESSAGES_PACED, ..Latency::new(name, 64, how) };
    let blocking = case("blocking, paced", How::Blocking);
    let blocking = blocking.beside(Rival::Futex, None, None).beside(Rival::PosixQueue, None, None);
    let spinning = case("spinning, paced", How::Spinning).beside(Rival::Spin, None, None);
    vec![blocking, spinning]
}

impl Latency {
    fn cell(&self, settings: &Settings) -> Cell {
        Cell {
            bytes: self.bytes,
            messages: settings.count(self.messages),
            warm_up: settings.count(WARM_UP).min(self.messages / 10),
            placement: self.placement,
            scheduling: self.scheduling,
            pause: self.pause,
            cap: if self.how == How::Blocking { CAP_ASLEEP } else { CAP_AWAKE },
        }
    }
}

/// One turn of ours.
pub(super) fn ours(cell: &Cell, how: How) -> Result<Vec<f64>, Failure> {
    let scratch = Scratch::new()?;
    let node = scratch.directory().join("node");
    // What is loaned is seen, from outside, by the bytes that are touched.
    let seen = Cell { bytes: if how == How::Loaned { TOUCHED } else { cell.bytes }, ..*cell };
    time_two_processes(&seen, |end, meetings| Mailboxes::open(&node, end, cell.bytes, how, meetings))
}

impl Case for Latency {
    fn name(&self) -> String {
        self.name.into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let cell = self.cell(settings);
        let mut contenders = vec![Contender::sampled("rohrpost", || ours(&cell, self.how))];
        for (rival, ..) in &self.rivals {
            contenders.push(Contender::sampled(rival.name(), || rival.turn(&cell, TOUCHED)));
        }
        let versus: Vec<Versus> =
            self.rivals.iter().map(|&(rival, p50, p99)| Versus { name: rival.name(), p50, p99 }).collect();
        let subject = Subject { case: self.name(), bytes: Some(self.bytes), unit: "us" };
        Ok(compare(settings, &subject, &contenders, &versus))
    }
}
