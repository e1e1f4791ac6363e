//! How the thread that sends in time slots is scheduled: as well as the system allows.

use super::super::clock::FIFO;
use super::spin_ns;
use crate::tdma::Table;
use rohrpost_mailbox::sys::{Reservation, Scheduling, reserve, schedule};

/// For a window, besides the spinning before it: to send in it, and to read what came.
const WINDOW_NS: u64 = 250_000;
/// For each millisecond: to take what waits in the mailbox.
const MILLISECOND_NS: u64 = 50_000;
/// A longer period brings nothing: the runtime would have to last for longer.
const PERIOD_NS_MAX: u64 = 10_000_000;
/// Of a period, the most that is reserved: others have to live as well, and several nodes may be on one computer.
const SHARE_PERCENT_MAX: u64 = 60;

/// What the system has granted.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Granted {
    /// SCHED_DEADLINE: it goes before all others.
    Reserved,
    /// SCHED_FIFO above all modules; where there is too much to do the kernel stops it for 50 ms a second.
    Fifo,
    /// It is scheduled as modules are: slots are missed whenever others work.
    Ordinary,
}

impl Granted {
    /// Asks for the calling thread; what is refused is told once. Never bound to a processor: where another thread stands in the way it goes
    /// to the next.
    pub(super) fn ask(table: &Table) -> Self {
        let refused = match reserve(reservation(table)) {
            Ok(()) => return Self::Reserved,
            Err(error) => error,
        };
        match schedule(Scheduling::Fifo(FIFO)) {
            Ok(()) => {
                tracing::info!("time slots are kept with SCHED_FIFO, which is a little less punctual: {refused}");
                Self::Fifo
            }
            Err(error) => {
                tracing::warn!(
                    "time slots are kept by an ordinary thread, and missed whenever others work: {refused}; SCHED_FIFO: {error}, \
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

/// All windows of a cycle may lie in one period.
fn reservation(table: &Table) -> Reservation {
    let period_ns = table.cycle_ns().min(PERIOD_NS_MAX);
    let window_ns = WINDOW_NS + spin_ns(table.cycle_ns());
    let needed_ns = table.own_windows_of_cycle() * window_ns + period_ns / 1_000_000 * MILLISECOND_NS;
    let runtime_ns = needed_ns.min(period_ns / 100 * SHARE_PERCENT_MAX);
    Reservation { runtime_ns, deadline_ns: period_ns, period_ns }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harness::settings;
    use rohrpost_config::{Tdma, TimeSlot};
    use std::time::Duration;

    fn table(cycle: Duration, slots: u64) -> Table {
        let slot = |index: u64| TimeSlot {
            node: 0,
            offset: Duration::from_micros(400 + 300 * index),
            length: Duration::from_micros(250),
            period: 1,
            phase: 0,
            line: 0,
        };
        let tdma = Tdma {
            cycle,
            synchronisation: Duration::from_micros(300),
            guard: Duration::from_micros(100),
            link_bytes_s: 125_000_000,
            slots: (0..slots).map(slot).collect(),
            tunnel: None,
            line: 0,
        };
        Table::new(&tdma, &[0], 0, 3, settings(0, 3).overhead_bytes())
    }

    #[test]
    fn a_reservation_has_room_for_each_window_and_leaves_room_for_others() {
        let ms = Duration::from_millis;
        for (cycle, slots, runtime_ns, period_ns) in [
            // Two windows: 250 µs each, and 50 to 150 µs of spinning; 50 µs for each millisecond.
            (ms(1), 1, 600_000, 1_000_000),
            (ms(5), 1, 800_000 + 250_000, 5_000_000),
            (ms(5), 20, 3_000_000, 5_000_000),
            (ms(1000), 1, 800_000 + 500_000, 10_000_000),
        ] {
            let asked = reservation(&table(cycle, slots));
            let expected = Reservation { runtime_ns, deadline_ns: period_ns, period_ns };
            assert_eq!(asked, expected, "{cycle:?}, {slots} slots");
        }
    }
}
