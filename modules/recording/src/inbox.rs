//! Between what records and the thread that writes: a bounded queue of batches, with orders between them. Putting in
//! never waits for the disk.

use crate::batch::{Batch, Message};
use crate::format::CHUNK_BYTES_MAX;
use crate::order::{Order, OrderError, OrderKind};
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Orders that wait.
const ORDERS_MAX: usize = 16;

/// The queue.
pub(crate) struct Inbox {
    queue: Mutex<Queue>,
    bell: Condvar,
    bytes_max: usize,
}

#[derive(Default)]
struct Queue {
    /// Being filled.
    open: Batch,
    /// Waiting for the thread, oldest first.
    full: VecDeque<Queued>,
    /// Written, to be filled again.
    free: Vec<Batch>,
    has_ended: bool,
}

/// One of the queue.
enum Queued {
    Batch(Batch),
    Order(Order),
}

impl Queue {
    fn batches(&self) -> impl Iterator<Item = &Batch> {
        self.full.iter().filter_map(|queued| match queued {
            Queued::Batch(batch) => Some(batch),
            Queued::Order(_) => None,
        })
    }

    /// Whether what is being filled may wait with the others, of which one may be longer than all that should be there.
    /// An order ends a batch early: bytes say what waits, a number of batches does not.
    fn has_room(&self, bytes_max: usize) -> bool {
        let bytes: usize = self.batches().map(Batch::bytes).sum();
        self.open.is_empty() || bytes == 0 || bytes + self.open.bytes() <= bytes_max
    }

    /// What is being filled waits from now on.
    fn end_open(&mut self) {
        let next = self.free.pop().unwrap_or_default();
        let full = std::mem::replace(&mut self.open, next);
        self.full.push_back(Queued::Batch(full));
    }
}

/// What the thread finds.
pub(crate) enum Taken {
    /// The oldest messages.
    Batch(Batch),
    /// What is asked for behind the messages before it.
    Order(Order),
    /// None for so long.
    Nothing,
    /// None, and none will come.
    End,
}

impl Inbox {
    /// For so many whole chunks.
    pub(crate) fn new(chunks_max: usize) -> Self {
        Self { queue: Mutex::default(), bell: Condvar::new(), bytes_max: chunks_max.saturating_mul(CHUNK_BYTES_MAX) }
    }

    /// Puts a message in. Not if the queue is full or closed.
    pub(crate) fn put(&self, channel: usize, message: &Message<'_>) -> bool {
        let mut queue = self.lock();
        if queue.has_ended {
            return false;
        }
        if !queue.open.has_room(message.data.len()) {
            if !queue.has_room(self.bytes_max) {
                return false;
            }
            queue.end_open();
            self.bell.notify_one();
        }
        queue.open.push(channel, message);
        true
    }

    /// Puts an order in, behind all messages so far.
    pub(crate) fn put_order(&self, order: Order) -> Result<(), OrderError> {
        let mut queue = self.lock();
        if queue.has_ended {
            return Err(OrderError::Ended);
        }
        let orders = queue.full.len() - queue.batches().count();
        // One that leads to another disk needs no room: it is what helps.
        let has_room =
            orders < ORDERS_MAX && (queue.has_room(self.bytes_max) || matches!(order.kind, OrderKind::Move(_)));
        if !has_room {
            return Err(OrderError::Full);
        }
        if !queue.open.is_empty() {
            queue.end_open();
        }
        queue.full.push_back(Queued::Order(order));
        self.bell.notify_one();
        Ok(())
    }

    /// Takes what is full; after a while also what is not.
    pub(crate) fn take(&self, patience: Duration) -> Taken {
        let waits = |queue: &mut Queue| queue.full.is_empty() && !queue.has_ended;
        let told = self.bell.wait_timeout_while(self.lock(), patience, waits);
        let (mut queue, _) = told.unwrap_or_else(PoisonError::into_inner);
        match queue.full.pop_front() {
            Some(Queued::Batch(batch)) => return Taken::Batch(batch),
            Some(Queued::Order(order)) => return Taken::Order(order),
            None => {}
        }
        if !queue.open.is_empty() {
            let next = queue.free.pop().unwrap_or_default();
            return Taken::Batch(std::mem::replace(&mut queue.open, next));
        }
        if queue.has_ended { Taken::End } else { Taken::Nothing }
    }

    /// Waits for the end, or for an order that leads to another disk, and takes nothing else.
    pub(crate) fn wait_while_failing(&self, patience: Duration) -> Taken {
        let leads_away =
            |queued: &Queued| matches!(queued, Queued::Order(order) if matches!(order.kind, OrderKind::Move(_)));
        let waits = |queue: &mut Queue| !queue.has_ended && !queue.full.iter().any(leads_away);
        let told = self.bell.wait_timeout_while(self.lock(), patience, waits);
        let (mut queue, _) = told.unwrap_or_else(PoisonError::into_inner);
        if queue.has_ended {
            return Taken::End;
        }
        let at = queue.full.iter().position(leads_away);
        match at.and_then(|at| queue.full.remove(at)) {
            Some(Queued::Order(order)) => Taken::Order(order),
            _ => Taken::Nothing,
        }
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
        (queue.open.len() + queue.batches().map(Batch::len).sum::<usize>()) as u64
    }

    /// Nothing panics while it is locked; if something did, the queue is whole between any two lines.
    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::MESSAGE_OVERHEAD_BYTES;
    use std::path::PathBuf;

    const CHUNKS: usize = 4;

    #[test]
    fn orders_between_messages_cost_no_room() {
        let data = [7; 1_000];
        let message = Message { arrival_ns: 1, stamp_ns: 1, epoch: 1, sequence: 0, data: &data };
        for orders in [0, 1, ORDERS_MAX] {
            let inbox = Inbox::new(CHUNKS);
            for _ in 0..orders {
                assert!(inbox.put(0, &message));
                inbox.put_order(Order::new(OrderKind::Rotate).0).unwrap();
            }
            while inbox.put(0, &message) {}
            let bytes = inbox.waiting() as usize * (data.len() + MESSAGE_OVERHEAD_BYTES);
            let bounds = CHUNKS * CHUNK_BYTES_MAX..=(CHUNKS + 1) * CHUNK_BYTES_MAX;
            assert!(bounds.contains(&bytes), "{bytes} bytes beside {orders} orders");
            let told =
                [OrderKind::Rotate, OrderKind::Move(PathBuf::new())].map(|kind| inbox.put_order(Order::new(kind).0));
            let leads_away = told[1].is_ok() || orders == ORDERS_MAX;
            assert!(matches!(told[0], Err(OrderError::Full)) && leads_away, "{orders} orders: {told:?}");
        }
    }

    #[test]
    fn one_message_may_be_longer_than_the_room() {
        let long = vec![7; 2 * CHUNK_BYTES_MAX];
        let message = |data| Message { arrival_ns: 1, stamp_ns: 1, epoch: 1, sequence: 0, data };
        let inbox = Inbox::new(1);
        let told = [&long[..], &long, &long, &[7]].map(|data| inbox.put(0, &message(data)));
        assert_eq!((told, inbox.waiting()), ([true, true, false, false], 2));
    }
}
