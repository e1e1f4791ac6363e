//! Between what records and the thread that writes: a bounded queue of batches. Putting in never waits for the disk.

use crate::batch::{Batch, Message};
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// The queue.
pub(crate) struct Inbox {
    queue: Mutex<Queue>,
    bell: Condvar,
    chunks_max: usize,
}

#[derive(Default)]
struct Queue {
    /// Being filled.
    open: Batch,
    /// Waiting for the thread, oldest first.
    full: VecDeque<Batch>,
    /// Written, to be filled again.
    free: Vec<Batch>,
    has_ended: bool,
}

/// What the thread finds.
pub(crate) enum Taken {
    /// The oldest messages.
    Batch(Batch),
    /// None for so long.
    Nothing,
    /// None, and none will come.
    End,
}

impl Inbox {
    /// For so many chunks.
    pub(crate) fn new(chunks_max: usize) -> Self {
        Self { queue: Mutex::default(), bell: Condvar::new(), chunks_max }
    }

    /// Puts a message in. Not if the queue is full or closed.
    pub(crate) fn put(&self, channel: usize, message: &Message<'_>) -> bool {
        let mut queue = self.lock();
        if queue.has_ended {
            return false;
        }
        if !queue.open.has_room(message.data.len()) {
            if queue.full.len() >= self.chunks_max {
                return false;
            }
            let next = queue.free.pop().unwrap_or_default();
            let full = std::mem::replace(&mut queue.open, next);
            queue.full.push_back(full);
            self.bell.notify_one();
        }
        queue.open.push(channel, message);
        true
    }

    /// Takes what is full; after a while also what is not.
    pub(crate) fn take(&self, patience: Duration) -> Taken {
        let waits = |queue: &mut Queue| queue.full.is_empty() && !queue.has_ended;
        let told = self.bell.wait_timeout_while(self.lock(), patience, waits);
        let (mut queue, _) = told.unwrap_or_else(PoisonError::into_inner);
        if let Some(batch) = queue.full.pop_front() {
            return Taken::Batch(batch);
        }
        if !queue.open.is_empty() {
            let next = queue.free.pop().unwrap_or_default();
            return Taken::Batch(std::mem::replace(&mut queue.open, next));
        }
        if queue.has_ended { Taken::End } else { Taken::Nothing }
    }

    /// Waits without taking; whether the end has come.
    pub(crate) fn wait_for_end(&self, patience: Duration) -> bool {
        let told = self.bell.wait_timeout_while(self.lock(), patience, |queue| !queue.has_ended);
        told.unwrap_or_else(PoisonError::into_inner).0.has_ended
    }

    /// Takes back what was written.
    pub(crate) fn give_back(&self, mut batch: Batch) {
        batch.clear();
        self.lock().free.push(batch);
    }

    /// No more is put in.
    pub(crate) fn end(&self) {
        self.lock().has_ended = true;
        self.bell.notify_one();
    }

    /// Messages that wait.
    pub(crate) fn waiting(&self) -> u64 {
        let queue = self.lock();
        (queue.open.len() + queue.full.iter().map(Batch::len).sum::<usize>()) as u64
    }

    /// Nothing panics while it is locked; if something did, the queue is whole between any two lines.
    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
