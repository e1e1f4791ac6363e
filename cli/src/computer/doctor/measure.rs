//! How late a thread wakes up: for one second it sleeps until each full millisecond.

use super::finding::{Check, Finding};
use crate::terminal::table::time;
use rohrpost_mailbox::sys::{self, Scheduling};
use std::time::{Duration, Instant};

const PERIOD: Duration = Duration::from_millis(1);
const WAKES: u32 = 1000;
/// More than this is late for a robot that drives.
const LATE: Duration = Duration::from_millis(5);

const CHECK: Check = Check("wake-up", "a module that sleeps until a time wakes up this late, under the present load");

/// Measures with the scheduling that the most urgent module would get.
pub(super) fn wake_up(priority: u8) -> Finding {
    match std::thread::spawn(move || measure(priority)).join() {
        Ok((latenesses, fifo)) => validate(&latenesses, fifo.then_some(priority)),
        Err(_) => CHECK.warn("the measuring thread has panicked", "try again"),
    }
}

/// Validates sorted latenesses, measured with a real-time priority or under the normal scheduler.
pub(super) fn validate(latenesses: &[Duration], fifo: Option<u8>) -> Finding {
    let at = |part: f64| time(latenesses[((latenesses.len() - 1) as f64 * part) as usize]);
    let how = fifo.map_or_else(|| "the normal scheduler".into(), |priority| format!("SCHED_FIFO {priority}"));
    let wakes = latenesses.len();
    let is = format!("half by {}, 99 % by {}, all by {} late, of {wakes} under {how}", at(0.5), at(0.99), at(1.0));
    if latenesses.last().is_some_and(|most| *most > LATE) {
        let fix = "fix the warnings above; then look for other busy threads (`top -H`)";
        return CHECK.warn(is, fix);
    }
    CHECK.ok(is)
}

/// Sorted latenesses, and whether the thread was real time.
fn measure(priority: u8) -> (Vec<Duration>, bool) {
    let fifo = priority > 0 && sys::schedule(Scheduling::Fifo(priority)).is_ok();
    let begin = Instant::now();
    let mut latenesses: Vec<Duration> = (1..=WAKES)
        .map(|wake| {
            let due = begin + PERIOD * wake;
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            due.elapsed()
        })
        .collect();
    latenesses.sort_unstable();
    (latenesses, fifo)
}
