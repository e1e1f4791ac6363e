//! A computer that has much to do.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Keeps all processors busy until it is dropped.
pub(crate) struct Load(Arc<AtomicBool>, Vec<std::thread::JoinHandle<()>>);

impl Load {
    pub(crate) fn begin() -> Self {
        let ends = Arc::new(AtomicBool::new(false));
        let threads = std::thread::available_parallelism().map_or(2, usize::from);
        let work = |ends: Arc<AtomicBool>| std::thread::spawn(move || while !ends.load(Ordering::Relaxed) {});
        Self(ends.clone(), (0..threads).map(|_| work(ends.clone())).collect())
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
        self.1.drain(..).for_each(|thread| drop(thread.join()));
    }
}
