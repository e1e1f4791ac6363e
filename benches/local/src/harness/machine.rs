//! What the computer did meanwhile that no router can help: time that the hypervisor kept, and time spent waiting for a
//! processor.

use std::fs;

/// Counts so far.
#[derive(Clone, Copy, Default, Debug)]
pub struct Machine {
    stolen: u64,
    all: u64,
    waited_ns: u64,
}

impl Machine {
    /// Looks, for the threads of these processes that have this name.
    pub fn look(pids: &[i32], thread: &str) -> Self {
        let stat = fs::read_to_string("/proc/stat").unwrap_or_default();
        let line = stat.lines().next().unwrap_or_default();
        // User, nice, system, idle, waiting, two kinds of interrupts, stolen; what follows is in the first two already.
        let ticks: Vec<u64> = line.split_whitespace().skip(1).take(8).filter_map(|ticks| ticks.parse().ok()).collect();
        Self {
            stolen: ticks.get(7).copied().unwrap_or_default(),
            all: ticks.iter().sum(),
            waited_ns: pids.iter().map(|pid| waited_ns(*pid, thread)).sum(),
        }
    }

    /// Of the processors' time since `before`, so much was the hypervisor's, percent.
    pub fn steal_percent(&self, before: &Self) -> f64 {
        self.stolen.saturating_sub(before.stolen) as f64 * 100.0 / self.all.saturating_sub(before.all).max(1) as f64
    }

    /// So long these threads have waited for a processor since then, all together, ms.
    pub fn waited_ms(&self, before: &Self) -> f64 {
        self.waited_ns.saturating_sub(before.waited_ns) as f64 / 1e6
    }
}

/// `run_delay` of the threads with this name.
fn waited_ns(pid: i32, name: &str) -> u64 {
    let threads = fs::read_dir(format!("/proc/{pid}/task")).into_iter().flatten().flatten();
    let read = |thread: &fs::DirEntry, file| fs::read_to_string(thread.path().join(file)).unwrap_or_default();
    let named = threads.filter(|thread| read(thread, "comm").trim() == name);
    let waited = named.filter_map(|thread| read(&thread, "schedstat").split_whitespace().nth(1)?.parse::<u64>().ok());
    waited.sum()
}
