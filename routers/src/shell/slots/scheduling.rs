//! How the thread that sends in time slots is scheduled: as well as the system allows.

use super::super::clock::FIFO;
use crate::driver::spin_ns;
use crate::tdma::{SlotTable, Window};
use rohrpost_config::duration_decimal;
use rohrpost_mailbox::sys::{Reservation, Scheduling, reserve, schedule};
use std::time::Duration;

/// Time for a window besides sending and spinning: to wake up, and to read what came.
const AROUND_NS: u64 = 100_000;
/// Time for each millisecond: to take what waits in the mailbox.
const MILLISECOND_NS: u64 = 50_000;
/// A longer period brings nothing: the runtime would have to last for longer.
const PERIOD_NS_MAX: u64 = 10_000_000;
/// Part of a period that is reserved at most: other threads need time, and several nodes may be on one computer.
const SHARE_PERCENT_MAX: u64 = 60;
/// Slot tables repeat themselves after so many cycles at most.
const CYCLES: u64 = 64;

/// What the system has granted.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ActualScheduling {
    /// SCHED_DEADLINE: it goes before all others.
    Reserved,
    /// SCHED_FIFO above all modules; where there is too much to do the kernel stops it for 50 ms a second.
    Fifo,
    /// It is scheduled as modules are: slots are missed whenever others work.
    Ordinary,
}

impl ActualScheduling {
    /// Asks for the calling thread; what is refused is told once. Never bound to a processor: where another thread
    /// stands in the way it goes to the next.
    pub(super) fn ask(table: &SlotTable) -> Self {
        let wanted = Wanted::new(table);
        let refused = match reserve(wanted.reservation()) {
            Ok(()) => {
                if let Some(warning) = wanted.warning() {
                    tracing::warn!("{warning}");
                }
                return Self::Reserved;
            }
            Err(error) => error,
        };
        match schedule(Scheduling::Fifo(FIFO)) {
            Ok(()) => {
                tracing::info!("time slots are kept with SCHED_FIFO, which is a little less punctual: {refused}");
                Self::Fifo
            }
            Err(error) => {
                tracing::warn!(
                    "time slots are kept by an ordinary thread, and missed whenever others work: {refused}; \
                    SCHED_FIFO: {error}, \
                     which a limit `rtprio` of {FIFO} for this user (limits.conf) allows"
                );
                Self::Ordinary
            }
        }
    }

    /// One word for people and programs.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Reserved => "deadline",
            Self::Fifo => "fifo",
            Self::Ordinary => "ordinary",
        }
    }
}

/// What the thread may need of a processor, if it sends in all of its windows to their ends.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Wanted {
    period_ns: u64,
    needed_ns: u64,
}

impl Wanted {
    fn new(table: &SlotTable) -> Self {
        let period_ns = table.cycle_ns().min(PERIOD_NS_MAX);
        let naps_ns = period_ns / 1_000_000 * MILLISECOND_NS;
        Self { period_ns, needed_ns: busiest_ns(table, period_ns) + naps_ns }
    }

    fn granted_ns(self) -> u64 {
        self.needed_ns.min(self.period_ns / 100 * SHARE_PERCENT_MAX)
    }

    fn reservation(self) -> Reservation {
        Reservation { runtime_ns: self.granted_ns(), deadline_ns: self.period_ns, period_ns: self.period_ns }
    }

    /// If not all of it is asked for: what that means, and what to change.
    fn warning(self) -> Option<String> {
        let text = |ns| duration_decimal(Duration::from_nanos(ns));
        let [needed, granted, period] = [self.needed_ns, self.granted_ns(), self.period_ns].map(text);
        (self.needed_ns > self.granted_ns()).then(|| {
            format!(
                "full time slots of this node take {needed} of {period} of a processor, and {granted} are reserved, \
                so that others can work: \
                 when much is to be sent it is stopped in the middle of a slot; give its [[slot]]s a shorter \
                 `length`, or leave \
                 more time between them"
            )
        })
    }
}

/// Longest time that the windows within one period take together.
fn busiest_ns(table: &SlotTable, period_ns: u64) -> u64 {
    let end_ns = CYCLES * table.cycle_ns() + period_ns;
    let next = |from_ns| table.next_window(from_ns).filter(|window| window.begin_ns < end_ns);
    let windows = std::iter::successors(next(0), |window| next(window.begin_ns + 1));
    let takes =
        |window: Window| (window.begin_ns, window.end_ns - window.begin_ns + spin_ns(table.cycle_ns()) + AROUND_NS);
    let windows: Vec<_> = windows.map(takes).collect();
    let in_period = |first: usize| {
        let until_ns = windows[first].0 + period_ns;
        windows[first..].iter().take_while(|(begin_ns, _)| *begin_ns < until_ns).map(|(_, takes_ns)| takes_ns).sum()
    };
    (0..windows.len()).map(in_period).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harness::{settings, slot, tdma};
    use rohrpost_network::TimeSlot;

    const US: u64 = 1_000;
    const MS: u64 = 1_000_000;

    /// Slots of node 0, each with its length in µs and its period; guards of 100 µs, and a window of 300 µs for the
    /// master's synchronisation.
    fn wanted(cycle_us: u64, slots: &[(u64, u32)]) -> Wanted {
        let mut offset_us = 300;
        let slots = slots.iter().map(|(length_us, period)| {
            let slot = TimeSlot { period: *period, ..slot(0, offset_us, *length_us) };
            offset_us += length_us;
            slot
        });
        let tdma = tdma([cycle_us, 300, 100], slots.collect());
        Wanted::new(&SlotTable::new(&tdma, &[0], 0, 3, settings(0, 3).overhead_bytes()))
    }

    #[test]
    fn a_reservation_has_room_for_each_window_and_leaves_room_for_others() {
        // Of each window what it sends, 100 µs around it, and of the cycle a twentieth for spinning, at most 150 µs; 50
        // µs for each millisecond.
        let synchronisation_ns = (200 + 100 + 150) * US;
        for (cycle_us, slots, needed_ns, period_ns, why) in [
            (5000, &[(250, 1)][..], synchronisation_ns + 400 * US + 250 * US, 5 * MS, "as short as slots are"),
            (5000, &[(1600, 1)], synchronisation_ns + 1750 * US + 250 * US, 5 * MS, "a long one is sent in to its end"),
            (5000, &[(250, 1); 10], synchronisation_ns + 4000 * US + 250 * US, 5 * MS, "more than others can spare"),
            (5000, &[(250, 4), (850, 2)], synchronisation_ns + 1400 * US + 250 * US, 5 * MS, "both in one cycle"),
            (1000, &[(250, 1)], (350 + 300 + 50) * US, MS, "a short cycle has less to spin"),
            (100_000, &[(9000, 1)], synchronisation_ns + 9150 * US + 500 * US, 10 * MS, "all in one period"),
            (
                20_000,
                &[(250, 1); 60],
                450 * US + 39 * 400 * US + 500 * US,
                10 * MS,
                "in one period as many as begin in it",
            ),
        ] {
            let wanted = wanted(cycle_us, slots);
            assert_eq!(wanted, Wanted { period_ns, needed_ns }, "{why}");
            let Reservation { runtime_ns, deadline_ns, .. } = wanted.reservation();
            assert_eq!((runtime_ns, deadline_ns), (needed_ns.min(period_ns * 6 / 10), period_ns), "{why}");
            assert_eq!(wanted.warning().is_some(), runtime_ns < needed_ns, "{why}");
        }
    }

    #[test]
    fn a_short_reservation_is_reported_with_what_to_change() {
        let warning = wanted(5000, &[(3000, 1)]).warning().unwrap();
        assert_eq!(
            warning,
            "full time slots of this node take 3.85 ms of 5 ms of a processor, and 3 ms are reserved, so that others \
            can work: when much is \
             to be sent it is stopped in the middle of a slot; give its [[slot]]s a shorter `length`, or leave more \
             time between them"
        );
    }
}
