//! Rohrpost's mailboxes, one way.

use super::{Sink, Source};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{OrFail, Scratch, copy_whole};
use rohrpost_bench_local::ours::join;
use rohrpost_mailbox::{Label, Name, OverflowPolicy, Priority, Receiver, SendError, Sender, Shape, Type, Waiting};
use std::path::PathBuf;
use std::time::Duration;

const MAILBOX: Name = Name::new(1, 200, 0, 0);
/// Spinning is always spinning for a while, then sleeping.
const SPIN: Duration = Duration::from_millis(100);

/// A node of its own in shared memory; gone when this is dropped.
pub struct OwnNode {
    scratch: Scratch,
    shape: Shape,
}

impl OwnNode {
    /// Makes the directory; the processes of a turn make the rest. The mailbox will have `slots` for `bytes` each.
    ///
    /// # Errors
    /// When there is no room.
    pub fn new(slots: usize, bytes: usize, full: OverflowPolicy) -> Result<Self, Failure> {
        let shape = Shape { slots: slots as u16, body_bytes_max: bytes as u16, full, ..Shape::default() };
        Ok(Self { scratch: Scratch::new()?, shape })
    }

    /// Where the node lies.
    pub fn path(&self) -> PathBuf {
        self.scratch.directory().join("node")
    }

    /// Makes the mailbox.
    ///
    /// # Errors
    /// When there is no memory for it.
    pub fn source(&self, spins: bool) -> Result<OurSource, Failure> {
        let receiver = join(&self.path(), MAILBOX)?.receiver(MAILBOX, self.shape).or_fail("receiver")?;
        let spin = if spins { SPIN } else { Duration::ZERO };
        Ok(OurSource { receiver, waiting: Waiting { spin, deadline: None } })
    }

    /// Opens the mailbox, which must be there.
    ///
    /// # Errors
    /// When it is not.
    pub fn sink(&self, priority: u8, retry: Retry) -> Result<OurSink, Failure> {
        let sender = join(&self.path(), Name::NONE)?.sender(MAILBOX).or_fail("sender")?;
        let label = Label { kind: Type::data(0), priority: Priority(priority), ..Label::default() };
        Ok(OurSink { sender, label, ids: 1, retry })
    }
}

/// What a sender does that finds the mailbox full.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Retry {
    /// Tries again after so many turns of an empty loop.
    Spin(u32),
    /// Lets others have the processor, then tries again.
    Yield,
    /// Sleeps for a while, then tries again.
    Sleep(Duration),
    /// Fails: it must not be refused.
    Never,
}

/// A sender.
pub struct OurSink {
    sender: Sender,
    label: Label,
    ids: u16,
    retry: Retry,
}

impl OurSink {
    /// Sends commands, each with an id of its own, so that nothing newer replaces it.
    #[must_use]
    pub fn with_commands(mut self) -> Self {
        self.label.kind = Type::command(16);
        self.with_states(u16::MAX)
    }

    /// Sends packages of so many different states in turn, for mailboxes that keep the latest of each.
    #[must_use]
    pub fn with_states(self, ids: u16) -> Self {
        Self { ids, ..self }
    }
}

impl Sink for OurSink {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.label.id = if self.ids > 1 { self.label.id.wrapping_add(1) % self.ids } else { 0 };
        loop {
            match self.sender.send(&self.label, &[message]) {
                Ok(()) => return Ok(()),
                Err(SendError::Full(_)) if self.retry != Retry::Never => self.pause(),
                Err(error) => return Err(Failure::of("send", error)),
            }
        }
    }
}

impl OurSink {
    #[cold]
    fn pause(&self) {
        match self.retry {
            Retry::Spin(turns) => (0..turns).for_each(|_| std::hint::spin_loop()),
            Retry::Yield => std::thread::yield_now(),
            Retry::Sleep(time) => std::thread::sleep(time),
            Retry::Never => {}
        }
    }
}

/// The receiver.
pub struct OurSource {
    receiver: Receiver,
    waiting: Waiting,
}

impl Source for OurSource {
    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        loop {
            if let Some(package) = self.receiver.receive_timeout(self.waiting) {
                return copy_whole(package.body(), message);
            }
        }
    }
}
