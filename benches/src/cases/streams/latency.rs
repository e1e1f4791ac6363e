//! How long a record is on its way, one at a time, to a reader that spins or sleeps; copied, or in place.
//!
//! Each end writes a stream of its own and echoes what the other's brings; one way is half of the round trip. In place,
//! 16 bytes are written and read at each end, whatever the size.

use crate::cases::rivals::ICEORYX_LOANED;
use crate::streams::StreamLink;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Cell, Failure, Pause, Placement, Scheduling, Scratch, time_two_processes};
use rohrpost_bench_local::latency::{FUTEX, Rival, SPIN, TOUCHED};
use rohrpost_bench_local::ours::How;
use rohrpost_bench_local::rounds::{Contender, Row, Subject, Target, Versus, compare};
use rohrpost_bench_local::settings::Settings;
use std::time::Duration;

const SMALL: usize = 64;

/// Round trips of a turn, and those before them that do not count.
const MESSAGES: usize = 20_000;
const WARM_UP: usize = 2_000;

/// A turn with readers that sleep may be longer than one with readers that spin: see [`Cell::cap`].
const CAP_ASLEEP: Duration = Duration::from_secs(2);
const CAP_AWAKE: Duration = Duration::from_millis(600);

/// All cases of this file.
pub(super) fn cases() -> Vec<Box<dyn Case>> {
    let at_most = |bound| Some(Target::AtMost(bound));
    let copied = |name, how, rival: Rival, p50, p99| -> Box<dyn Case> {
        let versus = Versus { name: rival.name, p50: at_most(p50), p99: at_most(p99) };
        Box::new(CopiedLatency { name, how, rival, versus })
    };
    let mut cases =
        vec![copied("spinning", How::Spinning, SPIN, 2.0, 2.0), copied("blocking", How::Blocking, FUTEX, 1.2, 1.3)];
    cases.extend([64 << 10, 1 << 20, 8 << 20].map(|bytes| -> Box<dyn Case> { Box::new(InPlaceLatency { bytes }) }));
    cases
}

/// Records of 64 bytes, copied in and out.
struct CopiedLatency {
    name: &'static str,
    how: How,
    rival: Rival,
    versus: Versus,
}

impl Case for CopiedLatency {
    fn name(&self) -> String {
        self.name.into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let cell = cell(settings, self.how);
        let ours = Contender::sampled("rohrpost", || turn(&cell, SMALL, self.how));
        let rival = Contender::sampled(self.versus.name, || (self.rival.turn)(&cell));
        let subject = Subject { case: self.name(), bytes: Some(SMALL), unit: "us" };
        Ok(compare(settings, &subject, &[ours, rival], &[self.versus]))
    }
}

/// Records that are written and read in place, beside small ones.
struct InPlaceLatency {
    bytes: usize,
}

impl Case for InPlaceLatency {
    fn name(&self) -> String {
        "in-place".into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let cell = cell(settings, How::Loaned);
        let small = Contender::sampled("rohrpost, 64 B", || turn(&cell, SMALL, How::Loaned));
        let (rival, large) = (ICEORYX_LOANED, Cell { bytes: self.bytes, ..cell });
        let versus = [(small.name, 1.2), (rival.name, 1.0)];
        let versus = versus.map(|(name, bound)| Versus { name, p50: Some(Target::AtMost(bound)), p99: None });
        let ours = Contender::sampled("rohrpost", || turn(&cell, self.bytes, How::Loaned));
        let contenders = [ours, small, Contender::sampled(rival.name, || (rival.turn)(&large))];
        let subject = Subject { case: self.name(), bytes: Some(self.bytes), unit: "us" };
        Ok(compare(settings, &subject, &contenders, &versus))
    }
}

/// A turn of records of 64 bytes.
fn cell(settings: &Settings, how: How) -> Cell {
    Cell {
        bytes: SMALL,
        messages: settings.count(MESSAGES),
        warm_up: settings.count(WARM_UP).min(MESSAGES / 10),
        placement: Placement::TwoCores,
        scheduling: Scheduling::Fifo,
        pause: if how == How::Blocking { Pause::UNTIL_ASLEEP } else { Pause::None },
        cap: if how == How::Blocking { CAP_ASLEEP } else { CAP_AWAKE },
    }
}

/// One turn of ours.
fn turn(cell: &Cell, bytes: usize, how: How) -> Result<Vec<f64>, Failure> {
    let scratch = Scratch::new()?;
    let node = scratch.directory().join("node");
    // What is read in place is seen, from outside, by the bytes that are touched.
    let seen = Cell { bytes: if how == How::Loaned { TOUCHED } else { bytes }, ..*cell };
    time_two_processes(&seen, |end, meetings| StreamLink::open(&node, end, bytes, how, meetings))
}
