//! The arena of a demo: a thread that moves the robot, and counts what it touches.

use crate::terminal::Failure;
use rohrpost_builtin::{OpenArena, Report};
use rohrpost_config::Installation;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

pub(super) struct Referee {
    is_over: Arc<AtomicBool>,
    thread: JoinHandle<io::Result<Report>>,
}

impl Referee {
    pub(super) fn begin(installation: &Installation) -> Result<Self, Failure> {
        let mut arena = OpenArena::open(installation)?;
        let is_over = Arc::new(AtomicBool::new(false));
        let over = is_over.clone();
        let run = move || arena.run(|| over.load(Ordering::Relaxed), |_| ());
        let thread = std::thread::Builder::new().name("arena".into()).spawn(run)?;
        Ok(Self { is_over, thread })
    }

    /// Ends it; what it counted.
    pub(super) fn end(self) -> Result<Report, Failure> {
        self.is_over.store(true, Ordering::Relaxed);
        let report = self.thread.join().map_err(|_| "the arena's thread has panicked")?;
        Ok(report?)
    }
}
