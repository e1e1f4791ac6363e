//! How long a record is on its way, one at a time, to a reader that spins or sleeps; copied, or in place.
//!
//! Each end writes a stream of its own and echoes what the other's brings; one way is half of the round trip. In place,
//! 16 bytes are written and read at each end, whatever the size.

use crate::cases::rivals::ICEORYX_LOANED;
use crate::streams::StreamLink;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Cell, Failure, Pause, Scratch, time_two_processes};
use rohrpost_bench_local::latency::{FUTEX, Rival, SPIN, TOUCHED};
use rohrpost_bench_local::ours::How;
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
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
pub(super) fn cases() -> Vec<Case> {
    let spinning = copied("spinning", How::Spinning, SPIN, [2.0, 2.0]);
    let blocking = copied("blocking", How::Blocking, FUTEX, [1.2, 1.3]);
    [spinning, blocking].into_iter().chain([64 << 10, 1 << 20, 8 << 20].map(in_place)).collect()
}

/// Records of 64 bytes, copied in and out.
fn copied(name: &str, how: How, rival: Rival, [p50, p99]: [f64; 2]) -> Case {
    Case::new(name, SMALL, "us", move |settings, subject| {
        let cell = cell(settings, how);
        let ours = Contender::sampled("rohrpost", || turn(&cell, SMALL, how));
        let rival = Contender::sampled(rival.name, || (rival.turn)(&cell));
        Ok(compare(settings, subject, &[ours, rival.beside(at_most(p50), at_most(p99))]))
    })
}

/// Records that are written and read in place, beside small ones.
fn in_place(bytes: usize) -> Case {
    Case::new("in-place", bytes, "us", move |settings, subject| {
        let cell = cell(settings, How::Loaned);
        let (rival, large) = (ICEORYX_LOANED, Cell { bytes, ..cell });
        let contenders = [
            Contender::sampled("rohrpost", || turn(&cell, bytes, How::Loaned)),
            Contender::sampled("rohrpost, 64 B", || turn(&cell, SMALL, How::Loaned)).beside(at_most(1.2), None),
            Contender::sampled(rival.name, || (rival.turn)(&large)).beside(at_most(1.0), None),
        ];
        Ok(compare(settings, subject, &contenders))
    })
}

/// A turn of records of 64 bytes.
fn cell(settings: &Settings, how: How) -> Cell {
    let (pause, cap) = match how {
        How::Blocking => (Pause::UNTIL_ASLEEP, CAP_ASLEEP),
        How::Spinning | How::Loaned => (Pause::None, CAP_AWAKE),
    };
    let warm_up = settings.count(WARM_UP);
    Cell { warm_up, pause, cap, ..Cell::hop(SMALL, settings.count(MESSAGES)) }
}

/// One turn of ours.
fn turn(cell: &Cell, bytes: usize, how: How) -> Result<Vec<f64>, Failure> {
    let scratch = Scratch::new()?;
    let node = scratch.directory().join("node");
    // What is read in place is seen, from outside, by the bytes that are touched.
    let seen = Cell { bytes: if how == How::Loaned { TOUCHED } else { bytes }, ..*cell };
    time_two_processes(&seen, |end, meetings| StreamLink::open(&node, end, bytes, how, meetings))
}
