//! Handover from the thread that reads the router's mailbox to the one that sends what is not real time: a few batches
//! of packages in a ring.
//!
//! ```text
//!  mailbox ─▶ tx_thread: Giver ── full ──▶ rest: Taker ─▶ Outbound
//!                         ▲                   │
//!                         └────── empty ◀─────┘      none empty: what is not real time stays in the mailbox
//! ```
//!
//! Neither thread waits for the other, and nothing is taken from the heap. Without an empty batch the reader continues
//! with real-time packages.

use super::threads::Shared;
use crate::driver::Handover;
use rohrpost_mailbox::{BODY_BYTES_MAX, HEAD_BYTES, Head};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

/// Enough to keep one thread busy while the other fills.
const BATCHES: usize = 3;
/// A batch is full from here on: copying this much takes a few microseconds, in a thread above all modules.
const BATCH_BYTES: usize = 16 * 1024;
/// Before each body: the package's head, and when it was published.
const RECORD_HEAD_BYTES: usize = HEAD_BYTES + 8;

/// Packages, one behind the other.
type Batch = Vec<u8>;

/// State that both ends share.
struct Room {
    /// Batches on their way back.
    empty: AtomicUsize,
    /// The giver waits for an empty one.
    wanted: AtomicBool,
}

/// The end that reads the mailbox.
pub(super) struct BatchSender {
    full: SyncSender<Batch>,
    empty: Receiver<Batch>,
    filling: Option<Batch>,
    room: Arc<Room>,
}

/// The end that sends.
pub(super) struct BatchReceiver {
    full: Receiver<Batch>,
    empty: SyncSender<Batch>,
    /// The batch in use, and the offset in it.
    reading: Option<(Batch, usize)>,
    room: Arc<Room>,
    shared: Arc<Shared>,
}

/// Both ends.
pub(super) fn handover(shared: &Arc<Shared>) -> (BatchSender, BatchReceiver) {
    let ((full, filled), (empty, emptied)) = (sync_channel(BATCHES), sync_channel(BATCHES));
    let room = Arc::new(Room { empty: AtomicUsize::new(BATCHES), wanted: AtomicBool::new(false) });
    for _ in 0..BATCHES {
        // There is room for all.
        let _ = empty.try_send(Batch::with_capacity(BATCH_BYTES + RECORD_HEAD_BYTES + BODY_BYTES_MAX));
    }
    let giver = BatchSender { full, empty: emptied, filling: None, room: room.clone() };
    (giver, BatchReceiver { full: filled, empty, reading: None, room, shared: shared.clone() })
}

impl Handover for BatchSender {
    fn takes(&mut self) -> bool {
        if self.filling.is_none()
            && let Ok(batch) = self.empty.try_recv()
        {
            self.room.empty.fetch_sub(1, Ordering::SeqCst);
            self.filling = Some(batch);
        }
        self.filling.is_some()
    }

    fn give(&mut self, head: &Head, published_ns: u64, body: &[u8]) {
        let Some(batch) = &mut self.filling else { return };
        batch.extend_from_slice(&head.to_bytes());
        batch.extend_from_slice(&published_ns.to_le_bytes());
        batch.extend_from_slice(body);
        if batch.len() >= BATCH_BYTES {
            self.finish();
        }
    }

    fn finish(&mut self) {
        if let Some(batch) = self.filling.take_if(|batch| !batch.is_empty()) {
            // There is room for all; a missing taker is noticed by the thread watch.
            let _ = self.full.try_send(batch);
        }
    }

    fn wants_room(&self) {
        // ORDERING: SeqCst, before the load of `empty`. At least one side sees the other: this one, or the one that
        // returns a batch.
        self.room.wanted.store(true, Ordering::SeqCst);
    }

    fn has_room(&self) -> bool {
        self.filling.is_some() || self.room.empty.load(Ordering::SeqCst) > 0
    }
}

/// How waiting for packages ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Waited {
    /// Some came, or time passed.
    Enough,
    /// The giver is gone.
    Ended,
}

impl BatchReceiver {
    /// The next package: its head, when it was published, its body; and whether it is the last for now.
    pub(super) fn next(&mut self) -> Option<(Head, u64, &[u8], bool)> {
        if self.reading.as_ref().is_some_and(|(batch, at)| *at >= batch.len()) {
            self.give_back();
        }
        if self.reading.is_none() {
            self.reading = Some((self.full.try_recv().ok()?, 0));
        }
        let (batch, at) = self.reading.as_mut()?;
        let (head, rest) = batch[*at..].split_first_chunk::<RECORD_HEAD_BYTES>()?;
        let (package, published) = head.split_first_chunk::<HEAD_BYTES>()?;
        let package = Head::from_bytes(package).ok()?;
        let body = rest.get(..package.len.into())?;
        *at += RECORD_HEAD_BYTES + body.len();
        Some((package, u64::from_le_bytes(*published.first_chunk()?), body, *at >= batch.len()))
    }

    /// Whether the batch in use has more.
    pub(super) fn has_next(&self) -> bool {
        self.reading.as_ref().is_some_and(|(batch, at)| *at < batch.len())
    }

    /// Waits until there is a batch, or for this long.
    pub(super) fn wait(&mut self, time: Duration) -> Waited {
        if self.has_next() {
            return Waited::Enough;
        }
        self.give_back();
        match self.full.recv_timeout(time) {
            Ok(batch) => {
                self.reading = Some((batch, 0));
                Waited::Enough
            }
            Err(RecvTimeoutError::Timeout) => Waited::Enough,
            Err(RecvTimeoutError::Disconnected) => Waited::Ended,
        }
    }

    fn give_back(&mut self) {
        let Some((mut batch, _)) = self.reading.take() else { return };
        batch.clear();
        let _ = self.empty.try_send(batch);
        // ORDERING: SeqCst, before the look at `wanted`: see there.
        self.room.empty.fetch_add(1, Ordering::SeqCst);
        if self.room.wanted.swap(false, Ordering::SeqCst) {
            self.shared.ring();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harness::TestNode;
    use rohrpost_mailbox::{Name, Priority, Type};

    fn ends() -> (TestNode, BatchSender, BatchReceiver) {
        let node = TestNode::new();
        let (giver, taker) = handover(&Arc::new(Shared::new(&node.join())));
        (node, giver, taker)
    }

    fn head(id: u16, len: usize) -> Head {
        let (to, from) = (Name::new(1, 9, 0, 0), Name::new(1, 7, 0, 1));
        Head { to, from, id, len: len as u16, kind: Type::data(3), priority: Priority(20), ..Head::default() }
    }

    #[test]
    fn packages_of_all_sizes_come_out_as_they_went_in() {
        let (_node, mut giver, mut taker) = ends();
        let sizes = [0, 1, 1400, BODY_BYTES_MAX, 3, BATCH_BYTES, 0];
        let (mut given, mut taken) = (0, 0);
        for round in 0..20_u16 {
            for size in sizes {
                if !giver.takes() {
                    break;
                }
                giver.give(&head(given, size), u64::from(given), &vec![given as u8; size]);
                given += 1;
            }
            giver.finish();
            while let Some((package, published_ns, body, _)) = taker.next() {
                assert_eq!((package.id, published_ns), (taken, u64::from(taken)), "in order, round {round}");
                assert_eq!(package, head(taken, body.len()));
                assert!(body.iter().all(|byte| *byte == taken as u8));
                taken += 1;
            }
        }
        assert_eq!(given, taken);
        assert!(given > 100, "{given}");
    }

    #[test]
    fn a_full_handover_takes_no_more() {
        let (_node, mut giver, mut taker) = ends();
        let mut given = 0;
        while giver.takes() {
            giver.give(&head(given, 1400), 0, &[0; 1400]);
            given += 1;
            assert!(usize::from(given) * 1400 < 2 * BATCHES * BATCH_BYTES, "it never ends");
        }
        assert!(!giver.has_room());
        giver.wants_room();
        assert!(taker.next().is_some());
        while taker.has_next() {
            let _ = taker.next();
        }
        assert!(!giver.has_room(), "the batch is still in hand");
        assert_eq!(taker.wait(Duration::ZERO), Waited::Enough);
        assert!(giver.has_room() && giver.takes(), "it was given back");
        drop(giver);
        while taker.next().is_some() {}
        assert_eq!(taker.wait(Duration::from_secs(10)), Waited::Ended);
    }
}
