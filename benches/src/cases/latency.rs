//! How long a package is on its way: the cases of `rohrpost bench local` beside more floors and beside peers, in more
//! sizes and situations.

use super::rivals::{
    CROSSBEAM, ICEORYX_LISTENER, ICEORYX_LOANED, ICEORYX_SPINNING, POSIX_QUEUE, SLOT_CORE, SPIN_SMALL,
};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Pause, Placement, Scheduling};
use rohrpost_bench_local::latency::{self, FUTEX, Latency, SPIN};
use rohrpost_bench_local::ours::How;
use rohrpost_bench_local::rounds::at_most;
use std::time::Duration;

/// With a package each 0.5 ms there is time for fewer round trips.
const MESSAGES_PACED: usize = 1_500;

/// A package each so often, where that is told.
const PACE: Duration = Duration::from_micros(500);

/// All of them.
pub(super) fn cases() -> Vec<Case> {
    let groups = [blocking(), one_core(), spinning(), loaned(), normal_scheduler(), paced()];
    groups.into_iter().flatten().map(Latency::case).collect()
}

fn blocking() -> Vec<Latency> {
    let case =
        |bytes| latency::blocking(bytes).beside(POSIX_QUEUE, at_most(1.0), None).beside(ICEORYX_LISTENER, None, None);
    [64, 1024, 16_384, 62_000].map(case).into()
}

fn one_core() -> Vec<Latency> {
    let mut case = Latency::new("one-core", 64, How::Blocking);
    case.placement = Placement::OneCore;
    let case = case.beside(FUTEX, at_most(1.10), None).beside(POSIX_QUEUE, None, None);
    vec![case.beside(ICEORYX_LISTENER, None, None)]
}

fn spinning() -> Vec<Latency> {
    let case = |bytes| {
        let core = if bytes == 64 { at_most(1.3) } else { None };
        let case = latency::spinning(bytes).beside(SLOT_CORE, core, None);
        case.beside(ICEORYX_SPINNING, None, None).beside(CROSSBEAM, None, None)
    };
    [64, 1024, 16_384].map(case).into()
}

fn loaned() -> Vec<Latency> {
    let case = |bytes| {
        let case = Latency::new("loaned", bytes, How::Loaned).beside(SPIN_SMALL, at_most(1.5), None);
        case.beside(ICEORYX_LOANED, None, None)
    };
    [64, 1024, 16_384, 62_000].map(case).into()
}

fn normal_scheduler() -> Vec<Latency> {
    let blocking = Latency::asleep("blocking, default scheduler", 64);
    let blocking = blocking.beside(FUTEX, None, None).beside(POSIX_QUEUE, None, None);
    let spinning = Latency::new("spinning, default scheduler", 64, How::Spinning).beside(SPIN, None, None);
    let mut cases = vec![blocking, spinning];
    cases.iter_mut().for_each(|case| case.scheduling = Scheduling::Normal);
    cases
}

fn paced() -> Vec<Latency> {
    let blocking = Latency::new("blocking, paced", 64, How::Blocking);
    let blocking = blocking.beside(FUTEX, None, None).beside(POSIX_QUEUE, None, None);
    let spinning = Latency::new("spinning, paced", 64, How::Spinning).beside(SPIN, None, None);
    let mut cases = vec![blocking, spinning];
    for case in &mut cases {
        (case.pause, case.messages) = (Pause::Asleep(PACE), MESSAGES_PACED);
    }
    cases
}
