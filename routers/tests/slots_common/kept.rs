//! Whether frames that crossed the bridge were in their senders' slots.
//!
//! ```text
//!   a node's window                                        guard           another's
//!  ├──────────────────────── looks at the clock: it fits ──┼───────────────┼──────────
//!                                └──── stands still ────────────── frame ──▶ the call comes back: it overran
//! ```
//! A thread looks at the clock before each frame, and may lose its processor between that and the system call. It knows
//! that itself when the call is back. So a frame outside is right if, and only if, its sender counted that very window,
//! and it is the only one of that window. The call itself takes microseconds: if the window is full, it comes back in
//! the guard, which is there for that. A router that is slow itself overruns the guard in window after window, and
//! counts that as well; so no node may overrun half of the guard more than a few times.

use super::own_log::{EVERY, OwnLog, OwnWindow};
use super::{Crossed, MASTERS, NODES, Segment, table};
use rohrpost_routers::frame::FrameKind;
use rohrpost_routers::tdma::SlotTable;
use std::time::{Duration, Instant};

/// A node that is alive tells what it did within this time.
const TELLS: Duration = Duration::from_secs(2);

/// Windows that a node may overrun by more than half of the guard: these, and one in so many of those that it used. A
/// processor that stands still in the middle of a call meets one window of each node at most.
const OVERRUN: usize = 3;
const USED_FOR_AN_OVERRUN: usize = 40;

/// A frame in the slot of another, or in nobody's.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outside {
    pub(crate) from: u8,
    #[allow(unused, reason = "to be shown")]
    pub(crate) kind: FrameKind,
    pub(crate) at_ns: u64,
    /// The same in system time.
    pub(crate) system_ns: u64,
}

/// The nodes with these frames' slots, by the time of a master.
#[derive(Default, Debug)]
pub(crate) struct SlotReport {
    pub(crate) frames: usize,
    /// Of these, in a window of another, or in nobody's.
    pub(crate) outside: Vec<Outside>,
}

pub(crate) fn slot_table(own: u8) -> SlotTable {
    SlotTable::new(&table(), &MASTERS, own, NODES, 28)
}

/// A frame is its sender's if it starts in a window of it or in the guard behind, or so little before that the guard of
/// the slot before still holds: half of it, which is what a node's clock may be off. `time`: system time at a moment.
pub(crate) fn validate(crossed: &[Crossed], time: impl Fn(u64) -> u64) -> SlotReport {
    let table = slot_table(0);
    let mut kept = SlotReport { frames: crossed.len(), ..SlotReport::default() };
    for frame in crossed {
        let system_ns = time(frame.at_ns);
        let moments = [system_ns, system_ns + table.allowance_ns()];
        let owner = moments.into_iter().filter_map(|ns| table.owner(ns)).find(|owner| owner.node == frame.from);
        if owner.is_none() {
            kept.outside.push(Outside { from: frame.from, kind: frame.kind, at_ns: frame.at_ns, system_ns });
        }
    }
    kept
}

/// These frames were in their senders' slots, by the time that node `witness` knew when they crossed.
pub(crate) fn assert_kept(what: &str, segment: &Segment, witness: u8, crossed: &[Crossed]) {
    assert_kept_by(what, segment, crossed, segment.time_of(witness));
}

/// The same by this time.
pub(crate) fn assert_kept_by(what: &str, segment: &Segment, crossed: &[Crossed], time: impl Fn(u64) -> u64) {
    let kept = validate(crossed, time);
    assert!(kept.frames > 100, "{kept:?}");
    assert_inside(what, segment, &kept);
}

/// Each frame was where it belongs, or its sender says that it stood still with it.
pub(crate) fn assert_inside(what: &str, segment: &Segment, kept: &SlotReport) {
    let slack_ns = slot_table(0).allowance_ns();
    for node in 0..NODES {
        let log = segment.own_log(node);
        let decided_late = log.windows().find(|window| window.spare_ns < 0);
        assert!(decided_late.is_none(), "{what}: node {node} sent what did not fit: {decided_late:?}");
        let (used, overrun) = (log.windows().count(), log.windows().filter(|window| window.over_ns > slack_ns).count());
        let most = OVERRUN + used / USED_FOR_AN_OVERRUN;
        assert!(overrun <= most, "{what}: node {node} overran {overrun} of {used} windows, {most} at most");
    }
    let mut overran: Vec<(u8, OwnWindow)> = Vec::new();
    for outside in &kept.outside {
        let log = told(segment, outside.from, outside.at_ns);
        let met = log.windows().find(|window| {
            let is_in_call = (window.end_ns..=window.end_ns + window.over_ns + slack_ns).contains(&outside.system_ns);
            window.over_ns > 0 && is_in_call && !overran.contains(&(outside.from, *window))
        });
        match met {
            Some(window) => overran.push((outside.from, window)),
            None if segment.has_died(outside.from, outside.at_ns) => {}
            None => panic!(
                "{what}: its sender does not say that it overran: {outside:?}; {:?}",
                log.near(outside.system_ns)
            ),
        }
    }
}

/// What a node says, once it has told of this moment.
pub(crate) fn told(segment: &Segment, node: u8, at_ns: u64) -> OwnLog {
    let began = Instant::now();
    loop {
        let log = segment.own_log(node);
        if log.told_ns() > at_ns + 2 * EVERY.as_nanos() as u64 || began.elapsed() > TELLS {
            return log;
        }
        std::thread::sleep(EVERY);
    }
}
