//! What comes too late in a test, and what excuses it.
//!
//! A virtual machine loses its processors to others for a tenth of a second now and then. Then slots are left out,
//! masters are replaced, packages become too old, and all of that is right. Only this excuses a test, and only for what
//! it explains: a thread of the highest priority on each processor sees when the processor stood still, and for how
//! long. Load of the tests themselves, or of other programs, excuses nothing.
//!
//! ```text
//!  what must always hold     assert!(…)                                      fails at once
//!  what takes its time       stalls.wait("…", LIMIT, || …)                   the limit counts time in which it ran
//!  what came too late        Err(Late { what, since, until, by })            excused by a stall of `by` in that time
//! ```

use nix::sched::{CpuSet, sched_getaffinity, sched_setaffinity};
use nix::unistd::Pid;
use rohrpost_mailbox::sys::{Scheduling, schedule};
use rohrpost_test_report as report;
use std::panic::Location;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The watching threads sleep for so long, again and again.
const NAP: Duration = Duration::from_millis(1);
/// A wake-up that is later than this is a stall: on a processor that runs, the highest priority wakes within 100 µs.
const STALL: Duration = Duration::from_micros(200);
/// Before all that is tested.
const PRIORITY: u8 = 99;
/// A test that is too late this often, each time with an excuse, was not tested.
const ATTEMPTS: usize = 5;
/// A condition is looked at so often.
const LOOK: Duration = Duration::from_millis(1);

/// What came too late, or did not come in time. All else that a test finds is an assertion, and fails at once.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Late {
    /// What, and how late it was.
    pub what: String,
    /// A stall counts from then on,
    pub since: Instant,
    /// until then.
    pub until: Instant,
    /// The shortest stall that explains it, all stalls of a processor in that time together.
    pub by: Duration,
}

impl Late {
    /// Something that went wrong between `since` and now, as it does if a processor stands still for `by`.
    pub fn now(what: impl Into<String>, since: Instant, by: Duration) -> Self {
        Self { what: what.into(), since, until: Instant::now(), by }
    }
}

/// Runs a test, and again if what it found late is explained by a stall; five times at most, then it says that it was
/// not tested. Each repetition is reported.
///
/// # Panics
/// Panics if the test does, and if something is late without a stall that explains it.
#[track_caller]
pub fn unless_stalled(test: impl Fn(&Stalls) -> Result<(), Late>) {
    let place = Location::caller();
    if !attempts(test, Stalls::stalled, |why| report::repeated(place, why)) {
        report::skipped_at(place, "what has to come in time, on a computer that stands still again and again");
    }
}

/// Whether it was tested at last. `repeats` is told why it begins again.
fn attempts(
    test: impl Fn(&Stalls) -> Result<(), Late>,
    stalled: impl Fn(&Stalls, Instant, Instant) -> Duration,
    repeats: impl Fn(&str),
) -> bool {
    let stalls = Stalls::watch();
    for attempt in 1..=ATTEMPTS {
        let Err(late) = test(&stalls) else { return true };
        let stood = stalled(&stalls, late.since, late.until);
        assert!(
            stood >= late.by,
            "{} (a processor stood still for {stood:?} then, {:?} would explain it)",
            late.what,
            late.by
        );
        if attempt < ATTEMPTS {
            repeats(&format!("{} (a processor stood still for {stood:?} then)", late.what));
        }
    }
    false
}

/// Watches the processors until it is dropped.
#[derive(Debug)]
pub struct Stalls {
    end: Arc<AtomicBool>,
    began: Instant,
    processors: Vec<Arc<Processor>>,
}

/// What was seen of a processor.
#[derive(Debug, Default)]
struct Processor {
    /// It ran last so long after the beginning, ns.
    ran_ns: AtomicU64,
    /// It stood still from, to: ns after the beginning.
    stalls: Mutex<Vec<(u64, u64)>>,
}

impl Stalls {
    /// Begins to watch the processors that the calling thread may use. Where no thread may have the highest priority
    /// nothing is seen, and nothing excused.
    pub fn watch() -> Self {
        let (end, began) = (Arc::new(AtomicBool::new(false)), Instant::now());
        let begin = |number| {
            let (processor, end) = (Arc::new(Processor::default()), end.clone());
            let (is_granted, granted) = std::sync::mpsc::channel();
            std::thread::spawn({
                let processor = processor.clone();
                move || {
                    let may = may_watch(number);
                    let _ = is_granted.send(may);
                    if may {
                        processor.watch(began, &end);
                    }
                }
            });
            granted.recv().unwrap_or(false).then_some(processor)
        };
        Self { processors: processors().into_iter().filter_map(begin).collect(), end, began }
    }

    /// For how long a processor stood still between these moments, all stalls together. The longest
    /// of all processors.
    pub fn stalled(&self, since: Instant, until: Instant) -> Duration {
        let [since_ns, until_ns] = [since, until].map(|at| ns(at.saturating_duration_since(self.began)));
        let of = |processor: &Arc<Processor>| processor.stalled_ns(since_ns, until_ns);
        Duration::from_nanos(self.processors.iter().map(of).max().unwrap_or(0))
    }

    /// How long the computer has run since then: without what a processor stood still.
    pub fn ran(&self, since: Instant) -> Duration {
        let now = Instant::now();
        (now - since).saturating_sub(self.stalled(since, now))
    }

    /// Waits until something is so, for at most `limit` of the time in which the computer ran.
    ///
    /// # Panics
    /// Panics if it does not become so.
    #[track_caller]
    pub fn wait<T>(&self, what: &str, limit: Duration, mut done: impl FnMut() -> Option<T>) -> T {
        let began = Instant::now();
        loop {
            if let Some(found) = done() {
                return found;
            }
            assert!(began.elapsed() < limit || self.ran(began) < limit, "not within {limit:?}: {what}");
            std::thread::sleep(LOOK);
        }
    }
}

impl Drop for Stalls {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
    }
}

impl Processor {
    fn watch(&self, began: Instant, end: &AtomicBool) {
        let mut before_ns = ns(began.elapsed());
        while !end.load(Ordering::Relaxed) {
            std::thread::sleep(NAP);
            let now_ns = ns(began.elapsed());
            let due_ns = before_ns + ns(NAP);
            if now_ns > due_ns + ns(STALL) {
                self.stalls.lock().unwrap_or_else(PoisonError::into_inner).push((due_ns, now_ns));
            }
            // Release, with the load in `stalled_ns`: a reader of this moment finds the stalls before it.
            self.ran_ns.store(now_ns, Ordering::Release);
            before_ns = now_ns;
        }
    }

    /// Waits until it has run after `until_ns`: a stall that is not over is not written yet.
    fn stalled_ns(&self, since_ns: u64, until_ns: u64) -> u64 {
        while self.ran_ns.load(Ordering::Acquire) < until_ns {
            std::thread::sleep(NAP);
        }
        let inside = |(from_ns, to_ns): &(u64, u64)| (*to_ns.min(&until_ns)).saturating_sub(*from_ns.max(&since_ns));
        self.stalls.lock().unwrap_or_else(PoisonError::into_inner).iter().map(inside).sum()
    }
}

/// Numbers of the processors that the calling thread may use.
fn processors() -> Vec<usize> {
    let allowed = sched_getaffinity(Pid::from_raw(0)).unwrap_or_default();
    (0..CpuSet::count()).filter(|number| allowed.is_set(*number) == Ok(true)).collect()
}

/// This thread runs on this processor, before all others there.
fn may_watch(number: usize) -> bool {
    runs_on(number) && schedule(Scheduling::Fifo(PRIORITY)).is_ok()
}

/// This thread runs on this processor alone.
fn runs_on(number: usize) -> bool {
    let mut set = CpuSet::new();
    set.set(number).and_then(|()| sched_setaffinity(Pid::from_raw(0), &set)).is_ok()
}

fn ns(duration: Duration) -> u64 {
    duration.as_nanos() as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    const BY: Duration = Duration::from_millis(5);

    /// Attempts of a test that is late so many times, on a computer that stood still for so long each time, how often
    /// it was said that it is repeated, and whether it was tested; the attempts alone if it fails.
    fn attempts_of(late: usize, stood: Duration) -> Result<(usize, usize, bool), usize> {
        let (times, repeated) = (Cell::new(0), Cell::new(0));
        let test = |_: &Stalls| {
            times.set(times.get() + 1);
            if times.get() <= late { Err(Late::now("on purpose", Instant::now(), BY)) } else { Ok(()) }
        };
        let run = || attempts(test, |_, _, _| stood, |_| repeated.set(repeated.get() + 1));
        let tested = catch_unwind(AssertUnwindSafe(run));
        tested.map(|tested| (times.get(), repeated.get(), tested)).map_err(|_| times.get())
    }

    #[test]
    fn what_is_late_without_a_stall_fails_at_once() {
        assert_eq!(attempts_of(0, Duration::ZERO), Ok((1, 0, true)));
        assert_eq!(attempts_of(1, Duration::ZERO), Err(1));
        assert_eq!(attempts_of(1, BY - Duration::from_nanos(1)), Err(1), "too short a stall");
    }

    #[test]
    fn what_a_stall_explains_is_tried_again_but_not_for_ever() {
        assert_eq!(attempts_of(2, BY), Ok((3, 2, true)));
        assert_eq!(attempts_of(ATTEMPTS - 1, BY), Ok((ATTEMPTS, ATTEMPTS - 1, true)));
        assert_eq!(attempts_of(usize::MAX, BY), Ok((ATTEMPTS, ATTEMPTS - 1, false)), "the last is not repeated");
    }

    #[test]
    fn an_assertion_fails_at_once_whatever_stood_still() {
        let times = Cell::new(0);
        let test = |_: &Stalls| -> Result<(), Late> {
            times.set(times.get() + 1);
            panic!("a package came twice")
        };
        let run = || attempts(test, |_, _, _| Duration::from_secs(1), |_| ());
        assert!(catch_unwind(AssertUnwindSafe(run)).is_err());
        assert_eq!(times.get(), 1);
    }

    #[test]
    fn only_the_part_of_a_stall_in_the_time_asked_for_counts() {
        let processor = Processor { ran_ns: AtomicU64::new(100), stalls: Mutex::new(vec![(10, 20), (40, 70)]) };
        assert_eq!(
            [(0, 100), (15, 50), (20, 40)].map(|(since, until)| processor.stalled_ns(since, until)),
            [40, 15, 0]
        );
    }

    #[test]
    fn the_processors_that_are_watched_are_those_of_the_thread() {
        for number in processors() {
            let alone = std::thread::spawn(move || (runs_on(number), processors(), Stalls::watch().processors.len()));
            let (is_alone, its, watched) = alone.join().expect("it ends");
            assert!(is_alone && its == [number] && watched <= 1, "{number}: {its:?}, {watched} watched");
        }
    }

    #[test]
    fn load_in_ordinary_scheduling_is_no_stall() {
        let (stalls, since) = (Stalls::watch(), Instant::now());
        let spins = move || while since.elapsed() < Duration::from_millis(300) {};
        let threads: Vec<_> = (0..2 * stalls.processors.len()).map(|_| std::thread::spawn(spins)).collect();
        threads.into_iter().for_each(|thread| thread.join().unwrap_or_default());
        // A hypervisor may take some.
        assert!(stalls.stalled(since, Instant::now()) < since.elapsed() / 2);
        assert!(stalls.ran(since) > since.elapsed() / 2);
    }

    #[test]
    fn a_limit_counts_the_time_in_which_the_computer_ran() {
        let stalls = Stalls::watch();
        let mut looks = 0;
        stalls.wait("the third look", Duration::from_secs(60), || {
            looks += 1;
            (looks == 3).then_some(())
        });
        let never = AssertUnwindSafe(|| stalls.wait("never", Duration::from_millis(20), || None::<()>));
        assert!(catch_unwind(never).is_err());
    }

    /// A thread of the same priority that spins keeps the processor: such a stall is seen.
    #[test]
    fn a_thread_that_spins_before_all_others_is_seen() {
        let stalls = Stalls::watch();
        let Some(last) = processors().pop().filter(|_| !stalls.processors.is_empty()) else {
            return report::skipped("a thread of the highest priority");
        };
        let since = Instant::now();
        let spins = move || {
            assert!(may_watch(last));
            let began = Instant::now();
            while began.elapsed() < 4 * BY {}
        };
        std::thread::spawn(spins).join().unwrap_or_default();
        assert!(stalls.stalled(since, Instant::now()) >= BY);
    }
}
