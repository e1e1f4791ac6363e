//! Whether this computer leaves real-time threads the time for slots, as threads that only want to wake up see it.

use nix::sched::{CpuSet, sched_setaffinity};
use nix::unistd::Pid;
use rohrpost_mailbox::sys::{Scheduling, schedule};
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A thread on each processor sleeps for so long, again and again.
const NAP: Duration = Duration::from_millis(3);
/// One that stands still for so long leaves packages too old to be delivered.
const STANDS_STILL: Duration = Duration::from_millis(250);
/// Where so much of the time is taken away, most slots are left out, and masters change by themselves.
const TAKEN_MAX: f64 = 0.05;

/// Watches from its beginning on.
pub(crate) struct Stalls {
    end: Arc<AtomicBool>,
    threads: Vec<JoinHandle<Seen>>,
}

/// How late a thread woke up: at worst, and of all the time.
struct Seen {
    longest: Duration,
    taken: f64,
}

impl Stalls {
    pub(crate) fn watched() -> Self {
        let end = Arc::new(AtomicBool::new(false));
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let watch = |processor| {
            let end = end.clone();
            std::thread::spawn(move || watch(processor, &end))
        };
        Self { threads: (0..processors).map(watch).collect(), end }
    }

    /// Whether this computer was too busy for time slots; says so, since what went wrong meanwhile was not the routers' doing.
    pub(crate) fn starved(mut self) -> bool {
        self.end.store(true, Ordering::Relaxed);
        let seen: Vec<Seen> = self.threads.drain(..).map(|thread| thread.join().unwrap()).collect();
        let longest = seen.iter().map(|seen| seen.longest).max().unwrap_or_default();
        let taken = seen.iter().map(|seen| seen.taken).fold(0.0, f64::max);
        let is_starved = longest > STANDS_STILL || taken > TAKEN_MAX;
        let _ = writeln!(
            std::io::stderr(),
            "{:.1} of 100 of a processor's time were taken away, at worst {longest:?} at once: {}",
            100.0 * taken,
            if is_starved { "too much for time slots" } else { "no excuse" }
        );
        is_starved
    }
}

impl Drop for Stalls {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
    }
}

fn watch(processor: usize, end: &AtomicBool) -> Seen {
    let mut set = CpuSet::new();
    // Where it may not run there it watches any other; without real time it sees ordinary load, too.
    let _ = set.set(processor).and_then(|()| sched_setaffinity(Pid::from_raw(0), &set));
    let _ = schedule(Scheduling::Fifo(1));
    let (began, mut longest, mut late) = (Instant::now(), Duration::ZERO, Duration::ZERO);
    while !end.load(Ordering::Relaxed) {
        let nap = Instant::now();
        std::thread::sleep(NAP);
        let over = nap.elapsed().saturating_sub(NAP);
        longest = longest.max(over);
        // Less is what waking up takes.
        late += if over > NAP / 3 { over } else { Duration::ZERO };
    }
    Seen { longest, taken: late.as_secs_f64() / began.elapsed().as_secs_f64().max(1e-3) }
}
