//! Tests of what has to happen in time, on computers that do not always leave the time for it.
//!
//! A virtual machine loses its processors to others for a tenth of a second now and then; then slots are left out,
//! masters are replaced, packages become too old, and all of that is right. So a test fails here if it fails on a
//! computer that ran meanwhile, or if it fails whenever it is tried. The measure is the share of time by which a thread
//! that only sleeps and wakes up is late.

use nix::sched::{CpuSet, sched_setaffinity};
use nix::unistd::Pid;
use rohrpost_mailbox::sys::{Scheduling, schedule};
use std::any::Any;
use std::io::Write;
use std::panic::{RefUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Barrier};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A thread on each processor sleeps for so long, again and again.
const NAP: Duration = Duration::from_millis(3);
/// A computer that stands still for so long leaves packages too old to be delivered, and modules without an answer.
const LONGEST_MAX: Duration = Duration::from_millis(100);
/// Where so much of the time is taken away, many slots are left out, and masters change by themselves.
const TAKEN_MAX: f64 = 0.05;
/// And here most of them: at 28 of 100 taken by the hypervisor it is 40 to 75 of 100.
const HOPELESS: f64 = 0.25;
/// A test that fails this often in a row is wrong.
const TRIES: usize = 5;
/// After the last try the detector measures for this long without the test: it tells a busy computer from a test that
/// takes the time itself.
const ALONE: Duration = Duration::from_secs(1);

/// Threads with a watched processor time.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Watched {
    /// Threads in real time: what a hypervisor takes, or others in real time.
    RealTime,
    /// All others, which wait for each other, too.
    Ordinary,
}

/// Runs a test, and again if it failed while the computer stood still; five times at most. Where a quarter of the time
/// of threads in real time is taken in each of them, and also after the last, nothing can be said, and the test says
/// so.
///
/// # Panics
/// Panics if the test does.
pub fn repeated_on_stall(watched: Watched, test: impl Fn() + RefUnwindSafe) {
    let begin = || {
        let stalls = StallDetector::watched(watched);
        move || stalls.end()
    };
    match tried(test, begin, say) {
        TestOutcome::Passed => {}
        TestOutcome::Failed(panic) => resume_unwind(panic),
        TestOutcome::Unknown => say("SKIPPED, not tested: what needs time slots, on a computer that has no time"),
    }
}

/// Result of a test.
enum TestOutcome {
    Passed,
    /// With what it panicked at last.
    Failed(Box<dyn Any + Send>),
    Unknown,
}

/// `begin` begins to watch, and gives what ends that.
fn tried<End: FnOnce() -> WakeDelay>(
    test: impl Fn() + RefUnwindSafe,
    begin: impl Fn() -> End,
    tell: impl Fn(&str),
) -> TestOutcome {
    let mut is_hopeless = true;
    for left in (0..TRIES).rev() {
        let end = begin();
        let Err(panic) = catch_unwind(&test) else { return TestOutcome::Passed };
        let seen = end();
        is_hopeless &= seen.has_no_time();
        if left == 0 && is_hopeless {
            let end = begin();
            std::thread::sleep(ALONE);
            is_hopeless = end().has_no_time();
        }
        let fails = !seen.disturbs() || (left == 0 && !is_hopeless);
        tell(&format!(
            "{:.0} of 100 of the time were taken away, at worst {:?} at once: {}: {}",
            100.0 * seen.taken,
            seen.longest,
            if fails { "no excuse" } else { "no verdict" },
            words(panic.as_ref())
        ));
        if fails {
            return TestOutcome::Failed(panic);
        }
    }
    TestOutcome::Unknown
}

/// The first words of a panic.
fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    text.unwrap_or("it panicked").chars().take(120).collect()
}

/// Past the test harness, which keeps what passing tests print to itself.
fn say(words: &str) {
    let _ = writeln!(std::io::stderr(), "{words}");
}

/// Watches from its beginning on.
struct StallDetector {
    end: Arc<AtomicBool>,
    threads: Vec<JoinHandle<WakeDelay>>,
}

/// How late a thread woke up: at worst, and of all the time.
#[derive(Clone, Copy, Default, Debug)]
struct WakeDelay {
    longest: Duration,
    taken: f64,
    /// It went before all that is not in real time.
    is_real_time: bool,
}

impl WakeDelay {
    fn disturbs(&self) -> bool {
        self.longest > LONGEST_MAX || self.taken > TAKEN_MAX
    }

    /// Nothing can be said of what is to happen in real time. Others than threads in real time wait for each other.
    fn has_no_time(&self) -> bool {
        self.is_real_time && self.taken > HOPELESS
    }

    fn worst(self, other: Self) -> Self {
        Self {
            longest: self.longest.max(other.longest),
            taken: self.taken.max(other.taken),
            is_real_time: self.is_real_time && other.is_real_time,
        }
    }
}

impl StallDetector {
    /// All threads watch when it returns.
    fn watched(watched: Watched) -> Self {
        let end = Arc::new(AtomicBool::new(false));
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let begin = Arc::new(Barrier::new(processors + 1));
        let watch = |processor| {
            let (begin, end) = (begin.clone(), end.clone());
            std::thread::spawn(move || watch(processor, watched, &begin, &end))
        };
        let threads = (0..processors).map(watch).collect();
        begin.wait();
        Self { threads, end }
    }

    /// What was seen on the processor that had least.
    fn end(mut self) -> WakeDelay {
        self.end.store(true, Ordering::Relaxed);
        // One that could not watch has seen nothing.
        self.threads.drain(..).filter_map(|thread| thread.join().ok()).reduce(WakeDelay::worst).unwrap_or_default()
    }
}

impl Drop for StallDetector {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
    }
}

fn watch(processor: usize, watched: Watched, begin: &Barrier, end: &AtomicBool) -> WakeDelay {
    let mut set = CpuSet::new();
    // Where it may not run there it watches any other; without real time it sees ordinary load, too.
    let _ = set.set(processor).and_then(|()| sched_setaffinity(Pid::from_raw(0), &set));
    let is_real_time = watched == Watched::RealTime && schedule(Scheduling::Fifo(1)).is_ok();
    begin.wait();
    let (began, mut longest, mut late) = (Instant::now(), Duration::ZERO, Duration::ZERO);
    while !end.load(Ordering::Relaxed) {
        let nap = Instant::now();
        std::thread::sleep(NAP);
        let over = nap.elapsed().saturating_sub(NAP);
        longest = longest.max(over);
        // Less is what waking up takes.
        late += if over > NAP / 3 { over } else { Duration::ZERO };
    }
    WakeDelay { longest, taken: late.as_secs_f64() / began.elapsed().as_secs_f64().max(1e-3), is_real_time }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "these are tests")]

    use super::*;
    use std::sync::atomic::AtomicUsize;

    const CALM: WakeDelay = WakeDelay { longest: Duration::from_millis(5), taken: 0.01, is_real_time: true };
    const DISTURBED: WakeDelay = WakeDelay { longest: Duration::from_millis(300), taken: 0.02, is_real_time: true };
    const NO_TIME: WakeDelay = WakeDelay { longest: Duration::from_millis(300), taken: 0.4, is_real_time: true };

    /// What comes of a test that fails so many times, on a computer of which this is seen, and this once the test is
    /// over; and how often it ran.
    fn outcome(fails: usize, seen: WakeDelay, alone: WakeDelay) -> (Option<Result<(), String>>, usize) {
        let (times, begun) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let test = || assert!(times.fetch_add(1, Ordering::Relaxed) >= fails, "on purpose");
        let begin = || {
            let is_test = begun.fetch_add(1, Ordering::Relaxed) < TRIES;
            move || if is_test { seen } else { alone }
        };
        let outcome = match tried(test, begin, |_| {}) {
            TestOutcome::Passed => Some(Ok(())),
            TestOutcome::Failed(panic) => Some(Err(words(panic.as_ref()))),
            TestOutcome::Unknown => None,
        };
        (outcome, times.load(Ordering::Relaxed))
    }

    fn failed() -> Option<Result<(), String>> {
        Some(Err("on purpose".to_owned()))
    }

    #[test]
    fn a_test_that_fails_undisturbed_fails_at_once() {
        assert_eq!(outcome(1, CALM, CALM), (failed(), 1));
        assert_eq!(outcome(0, NO_TIME, NO_TIME), (Some(Ok(())), 1));
    }

    #[test]
    fn a_test_that_fails_in_a_stall_is_tried_again_but_not_for_ever() {
        assert_eq!(outcome(TRIES - 1, DISTURBED, DISTURBED), (Some(Ok(())), TRIES));
        assert_eq!(outcome(usize::MAX, DISTURBED, DISTURBED), (failed(), TRIES));
    }

    #[test]
    fn where_most_of_the_time_is_taken_nothing_is_said_of_real_time() {
        assert_eq!(outcome(usize::MAX, NO_TIME, NO_TIME), (None, TRIES));
        assert_eq!(outcome(usize::MAX, NO_TIME, CALM), (failed(), TRIES), "the test itself took it");
        // Others have done that, which are part of the test.
        let ordinary = WakeDelay { is_real_time: false, ..NO_TIME };
        assert_eq!(outcome(usize::MAX, ordinary, ordinary), (failed(), TRIES));
    }

    #[test]
    fn a_thread_that_spins_in_real_time_is_seen() {
        let spins = || {
            let is_granted = schedule(Scheduling::Fifo(2)).is_ok();
            let began = Instant::now();
            while is_granted && began.elapsed() < 3 * LONGEST_MAX {}
            is_granted
        };
        let stalls = StallDetector::watched(Watched::RealTime);
        // One for each processor, so that the watching thread does not come to it.
        let processors = std::thread::available_parallelism().unwrap().get();
        let threads: Vec<_> = (0..processors).map(|_| std::thread::spawn(spins)).collect();
        if !threads.into_iter().all(|thread| thread.join().unwrap()) {
            return say("SKIPPED, not tested: threads in real time");
        }
        let seen = stalls.end();
        assert!(seen.disturbs(), "{seen:?}");
    }
}
