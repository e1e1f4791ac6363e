//! What tests of simulated networks share.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicU64, Ordering};

/// What the environment asks for.
pub(crate) fn number(variable: &str) -> Option<u64> {
    std::env::var(variable).ok()?.parse().ok()
}

/// Runs something for all seeds, on all processors; what came of each, in their order.
pub(crate) fn for_all<R: Send>(seeds: u64, run: impl Fn(u64) -> R + Sync) -> Vec<R> {
    let next = AtomicU64::new(0);
    let work = || {
        let own = std::iter::repeat_with(|| next.fetch_add(1, Ordering::Relaxed)).take_while(|seed| *seed < seeds);
        own.map(|seed| (seed, run(seed))).collect::<Vec<(u64, R)>>()
    };
    let mut all: Vec<_> = std::thread::scope(|scope| {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap_or_else(|panic| resume_unwind(panic))).collect()
    });
    all.sort_unstable_by_key(|(seed, _)| *seed);
    all.into_iter().map(|(_, made)| made).collect()
}
