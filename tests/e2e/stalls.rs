//! How long this computer stood still meanwhile, as a thread that only wants to wake up sees it.

use nix::sched::{CpuSet, sched_setaffinity};
use nix::unistd::Pid;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A thread on each processor sleeps for so long, again and again.
const NAP: Duration = Duration::from_millis(5);

/// Watches from its beginning on.
pub(crate) struct Stalls {
    end: Arc<AtomicBool>,
    threads: Vec<JoinHandle<Duration>>,
}

impl Stalls {
    pub(crate) fn watched() -> Self {
        let end = Arc::new(AtomicBool::new(false));
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let watch = |processor| {
            let end = end.clone();
            std::thread::spawn(move || watch(processor, &end))
        };
        let threads = (0..processors).map(watch).collect();
        Self { end, threads }
    }

    /// The longest that a processor did not come to such a thread.
    pub(crate) fn longest(mut self) -> Duration {
        self.end.store(true, Ordering::Relaxed);
        self.threads.drain(..).map(|thread| thread.join().unwrap()).max().unwrap_or_default()
    }
}

impl Drop for Stalls {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
    }
}

fn watch(processor: usize, end: &AtomicBool) -> Duration {
    let mut set = CpuSet::new();
    // Where it may not run there it watches any other.
    let _ = set.set(processor).and_then(|()| sched_setaffinity(Pid::from_raw(0), &set));
    let mut longest = Duration::ZERO;
    while !end.load(Ordering::Relaxed) {
        let began = Instant::now();
        std::thread::sleep(NAP);
        longest = longest.max(began.elapsed().saturating_sub(NAP));
    }
    longest
}
