//! How the thread that sends in time slots is scheduled: as well as the system allows.

use super::super::clock::FIFO;
use crate::tdma::Table;
use rohrpost_mailbox::sys::{Reservation, Scheduling, reserve, schedule};

/// For a window: to spin before it, to send in it, and to read what came.
const WINDOW_NS: u64 = 300_000;
/// For each millisecond: to take what waits in the mailbox.
const MILLISECOND_NS: u64 = 50_000;
/// A longer period brings nothing: the runtime would have to last for longer.
const PERIOD_NS_MAX: u64 = 10_000_000;
/// Of a period, the most that is reserved: others have to live as well, and several nodes may be on one computer.
const SHARE_PERCENT_MAX: u64 = 40;

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
                    "time slots are kept by an ordinary thread, and missed whenever others work: {refused}; SCHED_FIFO: {error}, which a                      limit `rtprio` of {FIFO} for this user (limits.conf) allows"
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
    let needed_ns = table.own_windows_of_cycle() * WINDOW_NS + period_ns / 1_000_000 * MILLISECOND_NS;
    let runtime_ns = needed_ns.min(period_ns / 100 * SHARE_PERCENT_MAX);
    Reservation { runtime_ns, deadline_ns: period_ns, period_ns }
}
