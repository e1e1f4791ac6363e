//! Lines that one process says in the names of others: launch passes on what its modules print.

use super::layer::cut;
use super::out::Out;
use super::print::Print;
use super::said::Said;
use super::way::{Lane, Output};
use crate::common::OutputLevel;
use rohrpost_config::Installation;
use rohrpost_mailbox::{Name, Participant};
use std::sync::{Arc, Weak};
use std::time::Instant;

/// The way to the collector, shared by all modules for which this process speaks.
pub struct Relay {
    participant: Arc<Participant>,
    /// Launch's own name, under which it sends.
    from: Name,
    out: Arc<Out>,
}

/// Speaks for one module, within the same allowance as the module has itself.
pub struct OutputProxy(Arc<Output>);

/// Speaks for one module as [`OutputProxy`] does, for a thread that nobody waits for: silent when all else has ended.
pub struct WeakOutputProxy(Weak<Output>);

impl Relay {
    /// Sends under the name `from`.
    pub fn new(participant: &Arc<Participant>, from: Name) -> Self {
        Self { participant: participant.clone(), from, out: Arc::default() }
    }

    /// Speaks for a module. None: the configuration knows no collector.
    pub fn voice(&self, installation: &Installation, module: Name) -> Option<OutputProxy> {
        let output = Output::new(&self.participant, installation, module, self.from, self.out.clone(), Print::Nothing)?;
        Some(OutputProxy(Arc::new(output)))
    }
}

impl OutputProxy {
    /// Says a line as of this system time, unless the module says too much already, or its configuration wants to hear
    /// only of more important things.
    pub fn say(&self, level: OutputLevel, time_ns: u64, text: String, errno: Option<u16>) {
        if level <= self.0.level() && self.0.allows(Lane::of(level)) {
            self.0.say(level, time_ns, Said { text: cut(text), errno });
        }
    }

    /// System time, as lines carry it.
    pub fn now_ns(&self) -> u64 {
        self.0.now_ns()
    }

    /// Sends what waits, and tells of what was suppressed when it is time.
    pub fn attend(&self) {
        self.0.attend();
    }

    /// When to attend to it again.
    pub fn retry_at(&self) -> Option<Instant> {
        self.0.retry_at()
    }

    /// For a thread that nobody waits for.
    pub fn whisper(&self) -> WeakOutputProxy {
        WeakOutputProxy(Arc::downgrade(&self.0))
    }
}

impl WeakOutputProxy {
    /// None when all else has ended.
    pub fn voice(&self) -> Option<OutputProxy> {
        self.0.upgrade().map(OutputProxy)
    }
}
