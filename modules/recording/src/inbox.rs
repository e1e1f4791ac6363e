//! Between what records and the thread that writes: a bounded queue of batches, with orders between them. Putting in
//! never waits for the disk.
//!
//! A channel is given at most as many bytes as are free then. So one that floods the queue takes half of it, two take a
//! third each, and whatever comes on another channel has as much again.

use crate::batch::{Batch, Message};
use crate::format::{CHUNK_BYTES_MAX, MESSAGE_OVERHEAD_BYTES};
use crate::order::{Order, OrderError, OrderKind};
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Orders that wait.
const ORDERS_MAX: usize = 16;
/// From this part of the room on, what can be done later has to wait.
const PRESSED_PART: usize = 8;

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
    /// Of all messages in it.
    bytes: usize,
    /// Of those of each channel.
    channel_bytes: Vec<usize>,
    /// Since the last batch was taken, it had no room for a message.
    is_full: bool,
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

    /// Whether a channel may have so many more bytes here; the only message may be longer than all that should be here.
    /// An order ends a batch early: bytes say what waits, a number of batches does not.
    fn has_room(&self, channel: usize, bytes: usize, bytes_max: usize) -> bool {
        let own = self.channel_bytes.get(channel).copied().unwrap_or_default();
        self.bytes == 0 || own + bytes <= bytes_max.saturating_sub(self.bytes)
    }

    fn add(&mut self, channel: usize, bytes: usize) {
        if self.channel_bytes.len() <= channel {
            self.channel_bytes.resize(channel + 1, 0);
        }
        self.channel_bytes[channel] += bytes;
        self.bytes += bytes;
    }

    fn taken(&mut self, batch: Batch) -> Taken {
        for (channel, message) in batch.messages() {
            let bytes = bytes_of(&message);
            self.channel_bytes[channel] -= bytes;
            self.bytes -= bytes;
        }
        self.is_full = false;
        Taken::Batch(batch)
    }

    /// What is being filled waits from now on.
    fn end_open(&mut self) {
        let next = self.free.pop().unwrap_or_default();
        let full = std::mem::replace(&mut self.open, next);
        self.full.push_back(Queued::Batch(full));
    }
}

/// What a message takes.
fn bytes_of(message: &Message<'_>) -> usize {
    message.data.len() + MESSAGE_OVERHEAD_BYTES
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

    /// Puts a message in. Not if its channel has its share of the queue, or that is closed.
    pub(crate) fn put(&self, channel: usize, message: &Message<'_>) -> bool {
        let mut queue = self.lock();
        if queue.has_ended {
            return false;
        }
        let bytes = bytes_of(message);
        if !queue.has_room(channel, bytes, self.bytes_max) {
            queue.is_full = true;
            return false;
        }
        if !queue.open.has_room(message.data.len()) {
            queue.end_open();
            self.bell.notify_one();
        }
        queue.add(channel, bytes);
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
        let has_room = orders < ORDERS_MAX && (!queue.is_full || matches!(order.kind, OrderKind::Move(_)));
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
            Some(Queued::Batch(batch)) => return queue.taken(batch),
            Some(Queued::Order(order)) => return Taken::Order(order),
            None => {}
        }
        if !queue.open.is_empty() {
            let next = queue.free.pop().unwrap_or_default();
            let open = std::mem::replace(&mut queue.open, next);
            return queue.taken(open);
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

    /// Whether anything waits that the thread should have taken by now.
    pub(crate) fn is_late(&self) -> bool {
        !self.lock().full.is_empty()
    }

    /// Whether so much waits that what could be done later is to be left.
    pub(crate) fn is_pressed(&self) -> bool {
        self.lock().bytes > self.bytes_max / PRESSED_PART
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
    use std::path::PathBuf;

    const CHUNKS: usize = 4;

    fn message(data: &[u8]) -> Message<'_> {
        Message { arrival_ns: 1, stamp_ns: 1, epoch: 1, sequence: 0, data }
    }

    #[test]
    fn orders_between_messages_cost_no_room() {
        let data = [7; 1_000];
        for orders in [0, 1, ORDERS_MAX] {
            let inbox = Inbox::new(CHUNKS);
            for _ in 0..orders {
                assert!(inbox.put(0, &message(&data)));
                inbox.put_order(Order::new(OrderKind::Rotate).0).unwrap();
            }
            while inbox.put(0, &message(&data)) {}
            let (each, half) = (data.len() + MESSAGE_OVERHEAD_BYTES, CHUNKS * CHUNK_BYTES_MAX / 2);
            let bytes = inbox.waiting() as usize * each;
            assert!((half - each..=half).contains(&bytes), "{bytes} bytes beside {orders} orders");
            let told =
                [OrderKind::Rotate, OrderKind::Move(PathBuf::new())].map(|kind| inbox.put_order(Order::new(kind).0));
            let leads_away = told[1].is_ok() || orders == ORDERS_MAX;
            assert!(matches!(told[0], Err(OrderError::Full)) && leads_away, "{orders} orders: {told:?}");
        }
    }

    #[test]
    fn one_message_may_be_longer_than_the_room() {
        let long = vec![7; 2 * CHUNK_BYTES_MAX];
        let inbox = Inbox::new(1);
        let told = [&long[..], &long, &[7]].map(|data| inbox.put(0, &message(data)));
        assert_eq!((told, inbox.waiting()), ([true, false, false], 1));
    }

    /// Pictures of 230 kB, as many as there is room for, and 29 bytes of a pose after each.
    #[test]
    fn channels_that_flood_the_queue_take_no_place_from_another() {
        let (picture, pose) = (vec![7; 230_400], [7; 29]);
        for floods in [1, 2, 8] {
            let inbox = Inbox::new(CHUNKS);
            let mut pictures = vec![0; floods];
            for number in 0..1_000 {
                pictures[number % floods] += usize::from(inbox.put(1 + number % floods, &message(&picture)));
                assert!(inbox.put(0, &message(&pose)), "pose {number} beside {floods} floods");
            }
            // Equal shares, with as much left.
            let share = CHUNKS * CHUNK_BYTES_MAX / (floods + 1) / picture.len();
            assert!(pictures.iter().all(|count| (1.max(share - 1)..=share + 1).contains(count)), "{pictures:?}");
            // What is taken has room for others again.
            while let Taken::Batch(batch) = inbox.take(Duration::ZERO) {
                inbox.give_back(batch);
            }
            let queue = inbox.lock();
            assert_eq!((queue.bytes, queue.channel_bytes.iter().sum::<usize>(), queue.is_full), (0, 0, false));
        }
    }
}
