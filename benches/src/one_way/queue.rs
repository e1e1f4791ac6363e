//! A POSIX queue, one way. Its sender sleeps in the kernel while it is full, the receiver while it is empty.

use super::{Sink, Source};
use crate::floors::Queue;
use rohrpost_bench_local::Failure;

/// Sends into a queue with one priority.
pub struct QueueSink<'a> {
    queue: &'a Queue,
    priority: u32,
}

impl<'a> QueueSink<'a> {
    /// A sender of this priority.
    pub fn new(queue: &'a Queue, priority: u32) -> Self {
        Self { queue, priority }
    }
}

impl Sink for QueueSink<'_> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.queue.send(message, self.priority)
    }
}

impl Source for &Queue {
    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        Queue::receive(self, message).map(drop)
    }
}
