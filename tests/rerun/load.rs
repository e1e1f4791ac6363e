//! One processor for a robot that is measured, which is never idle.
//!
//! Where the kernel puts which process, and how deep a processor sleeps, changes latencies more than any bridge does; a
//! robot is even faster with more load from others, because it then finds processors awake. So the measured modules
//! share one processor, which also has idle-priority work all the time.

use nix::libc;
use nix::sched::{CpuSet, sched_getaffinity, sched_setaffinity};
use nix::unistd::Pid;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

const ME: Pid = Pid::from_raw(0);

/// Runs this on one processor, the first that is allowed; processes and threads that are started meanwhile stay on it.
pub(crate) fn on_one_processor<T>(work: impl FnOnce() -> T) -> T {
    let all = sched_getaffinity(ME).unwrap();
    let first = (0..CpuSet::count()).find(|processor| all.is_set(*processor).unwrap()).unwrap();
    let mut one = CpuSet::new();
    one.set(first).unwrap();
    sched_setaffinity(ME, &one).unwrap();
    let done = work();
    sched_setaffinity(ME, &all).unwrap();
    done
}

/// Work at idle priority, until it is dropped.
pub(crate) struct Load {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Load {
    pub(crate) fn start() -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let until = stop.clone();
        let thread = std::thread::spawn(move || {
            give_way();
            while !until.load(Ordering::Relaxed) {
                std::hint::spin_loop();
            }
        });
        Self { stop, thread: Some(thread) }
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// From here on this thread runs only on an otherwise idle processor.
fn give_way() {
    let parameters = libc::sched_param { sched_priority: 0 };
    // SAFETY: reads the parameters, which live here; 0 is the calling thread.
    let refused = unsafe { libc::sched_setscheduler(0, libc::SCHED_IDLE, &raw const parameters) };
    assert_eq!(refused, 0, "{}", std::io::Error::last_os_error());
}
