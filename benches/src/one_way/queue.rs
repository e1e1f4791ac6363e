//! A POSIX queue, one way. Its sender sleeps in the kernel while it is full, the receiver while it is empty.

use super::{Sink, Source};
use crate::Failure;
use crate::floors::queue;
use nix::mqueue::{MqdT, mq_receive, mq_send};

/// A queue; make it before the processes that use it.
pub struct Queue(MqdT);

impl Queue {
    /// One of its own.
    ///
    /// # Errors
    /// As [`queue`].
    pub fn new(depth: usize, bytes: usize) -> Result<Self, Failure> {
        Ok(Self(queue(depth, bytes)?))
    }

    /// A sender of this priority.
    pub fn sink(&self, priority: u32) -> QueueSink<'_> {
        QueueSink { queue: &self.0, priority }
    }

    /// The receiver.
    pub fn source(&self) -> QueueSource<'_> {
        QueueSource { queue: &self.0 }
    }
}

/// Sends with one priority.
pub struct QueueSink<'a> {
    queue: &'a MqdT,
    priority: u32,
}

impl Sink for QueueSink<'_> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        mq_send(self.queue, message, self.priority).map_err(|error| Failure::of("mq_send", error))
    }
}

/// Receives the most urgent.
pub struct QueueSource<'a> {
    queue: &'a MqdT,
}

impl Source for QueueSource<'_> {
    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        let mut priority = 0;
        match mq_receive(self.queue, message, &mut priority) {
            Ok(bytes) if bytes == message.len() => Ok(()),
            Ok(bytes) => Err(Failure::Failed(format!("{bytes} bytes came, not {}", message.len()))),
            Err(error) => Err(Failure::of("mq_receive", error)),
        }
    }
}
