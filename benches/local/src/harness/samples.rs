//! Figures that a child process hands to its parent.

use super::{Child, Failure, Shared, Zeroable};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Most figures of one turn.
const SAMPLES_MAX: usize = 100_000;

/// Some thousand figures in shared memory, written by one process.
#[repr(C)]
pub struct Samples {
    count: AtomicU64,
    values: [AtomicU64; SAMPLES_MAX],
}

// SAFETY: atomics only.
unsafe impl Zeroable for Samples {}

impl Samples {
    /// Adds one; what is too many is left out.
    pub fn push(&self, value: f64) {
        let count = self.count.load(Ordering::Relaxed);
        if let Some(free) = self.values.get(count as usize) {
            free.store(value.to_bits(), Ordering::Relaxed);
            // ORDERING: publishes the value; pairs with `all`.
            self.count.store(count + 1, Ordering::Release);
        }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.count.load(Ordering::Acquire) as usize
    }

    /// Whether there is none yet.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All so far.
    pub fn all(&self) -> Vec<f64> {
        self.values[..self.len()].iter().map(|value| f64::from_bits(value.load(Ordering::Relaxed))).collect()
    }
}

/// Does something in a process of its own, which may place and schedule itself, and gives the figures that it took.
///
/// # Errors
/// What it fails with, or that it took too long.
pub fn sample_in_child(
    patience: Duration,
    body: impl FnOnce(&Samples) -> Result<(), Failure>,
) -> Result<Vec<f64>, Failure> {
    let samples = Shared::<Samples>::new()?;
    Child::start(|| body(&samples))?.finish(Instant::now() + patience)?;
    Ok(samples.all())
}
