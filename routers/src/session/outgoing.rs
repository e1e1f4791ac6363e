//! What leaves by one connection: most important first, in bounded memory, so that a connection that stands still costs
//! no other. Each sender has an equal share of memory and rate, if others want some too.
//!
//! ```text
//!  package ─┬─ nothing waits ──────────────────────▶ ready: bytes for the stream, a batch at most, in final order
//!           └─ Queue: the least important gives way ──▲ most important first, whenever the stream has taken all
//! ```
//!
//! Of data of which only the newest counts one package waits at most: a newer one takes its place.

use super::counts::Cause;
use super::frame::{Carried, HEAD_BYTES, SessionFrameKind, SessionMessage, write_head};
use super::{EndHost, WAIT_MAX_NS};
use crate::frame::{FrameKind, NodeIndex, RECORD_PART_HEAD_BYTES};
use crate::queue::{Place, Queue, QueueShare, QueuedPackage, counts_newest};
use crate::replication::LINE_PART_ROOM;
use rohrpost_mailbox::Head;
use rohrpost_network::{LEVELS, LINE_PART_HEADS_BYTES};

/// Bytes that are made ready at a time, at most: what is more important than they are waits for no more. One frame may
/// exceed it.
pub const BATCH_BYTES: usize = 16 * 1024;
/// A queue that was empty for so many looks gives its memory back.
const EMPTY_LOOKS: u8 = 50;

/// A package that is to leave.
#[derive(Clone, Copy)]
pub(super) struct Parcel<'a> {
    pub(super) head: &'a Head,
    pub(super) body: &'a [u8],
    /// By the sender's clock, ns.
    pub(super) published_ns: u64,
    pub(super) hops: u8,
    /// 0 goes first.
    pub(super) level: u8,
    /// The share of memory and rate that it counts to.
    pub(super) share: QueueShare,
}

/// Learns what becomes of packages.
pub(super) trait Fates {
    /// Handed to the stream.
    fn passed(&mut self, head: &Head);
    /// A newer one waits in its place.
    fn replaced(&mut self, head: &Head);
    /// Lost; with it the beginning of its body.
    fn lost(&mut self, head: &Head, body: &[u8], cause: Cause);
    /// What is lost, is so since too much waited of this sender.
    fn crowded(&mut self, _sender: u32) {}
}

/// What leaves by a connection, or by the next one.
#[derive(Debug, Default)]
pub(super) struct Outgoing {
    ready: Vec<u8>,
    /// Bytes of `ready` that the stream has taken.
    taken: usize,
    /// Bytes of `ready` that belong to a frame that was taken in part before.
    begun: usize,
    /// Bytes of `ready` up to the end of the last frame that was put before packages.
    hurried: usize,
    /// Bytes that the stream has taken since the connection began.
    sent: u64,
    queue: Option<Box<Queue>>,
    quota_bytes: usize,
    /// Bytes that are made ready at a time.
    batch_bytes: usize,
    /// A part of a replica left last: the packages that wait have their turn.
    is_part_last: bool,
    empty_looks: u8,
}

impl Outgoing {
    pub(super) fn new(quota_bytes: usize) -> Self {
        Self { quota_bytes, batch_bytes: BATCH_BYTES, ..Self::default() }
    }

    /// Makes this many bytes ready at a time from now on, but no more than [`BATCH_BYTES`].
    pub(super) fn set_batch(&mut self, bytes: usize) {
        self.batch_bytes = bytes.min(BATCH_BYTES);
    }

    /// Bytes for the stream.
    pub(super) fn ready(&self) -> &[u8] {
        &self.ready[self.taken..]
    }

    /// The stream has taken so many.
    pub(super) fn took(&mut self, bytes: usize) {
        self.taken += bytes;
        self.sent += bytes as u64;
        if self.taken >= self.ready.len() {
            self.ready.clear();
            (self.taken, self.begun, self.hurried) = (0, 0, 0);
            self.ready.shrink_to(BATCH_BYTES);
        }
    }

    /// Whether packages wait.
    pub(super) fn has_waiting(&self) -> bool {
        self.queue.as_ref().is_some_and(|queue| !queue.is_empty())
    }

    /// Packages that wait.
    pub(super) fn waiting(&self) -> usize {
        self.queue.as_ref().map_or(0, |queue| queue.len())
    }

    /// Bytes of memory.
    pub(super) fn bytes(&self) -> usize {
        self.ready.capacity() + self.queue.as_ref().map_or(0, |queue| queue.used_bytes() as usize)
    }

    /// The connection is over: what was made ready for it goes with it.
    pub(super) fn cut(&mut self) {
        self.ready.clear();
        (self.taken, self.begun, self.hurried, self.sent) = (0, 0, 0, 0);
        self.batch_bytes = BATCH_BYTES;
    }

    /// Appends a frame that is no package. The caller bounds how many.
    pub(super) fn say(&mut self, message: &SessionMessage<'_>) {
        message.write(&mut self.ready);
    }

    /// The same, before all packages that have not begun to leave. What has left when [`sent`](Self::sent) has come so
    /// far.
    pub(super) fn hurry(&mut self, message: &SessionMessage<'_>) -> u64 {
        let frame = message.to_bytes();
        let at = self.next_frame().max(self.hurried);
        self.hurried = at + frame.len();
        self.ready.splice(at..at, frame);
        self.sent + (self.hurried - self.taken) as u64
    }

    /// Bytes that the stream has taken since the connection began.
    pub(super) fn sent(&self) -> u64 {
        self.sent
    }

    /// A package is to leave. `shift_ns` goes from our clock to the session's; none as long as nothing may leave.
    pub(super) fn accept(&mut self, shift_ns: Option<i64>, parcel: &Parcel<'_>, fates: &mut impl Fates) {
        if let Some(shift_ns) = shift_ns.filter(|_| !self.has_waiting() && self.ready().len() < self.batch_bytes) {
            return self.make_ready(shift_ns, parcel, fates);
        }
        let Parcel { head, body, published_ns, hops, level, share } = *parcel;
        let quota_bytes = self.quota_bytes;
        let queue = self.queue.get_or_insert_with(|| Box::new(Queue::shared(quota_bytes)));
        let sender = queue.sender_of(share);
        let waiting =
            QueuedPackage { head: *head, published_ns, hops, level, sender, share, ..QueuedPackage::default() };
        let is_taken = match queue.older(&waiting) {
            Some(older) => replace(queue, older, waiting, body, fates),
            None => queue.push(waiting, body, gives_way(sender, fates)),
        };
        if !is_taken {
            let others_wait = queue.others_wait(sender);
            lose(&waiting, body, others_wait, fates);
        }
    }

    /// Fills the batch with what waits.
    pub(super) fn refill(&mut self, now_ns: u64, shift_ns: i64, fates: &mut impl Fates) {
        let Some(mut queue) = self.queue.take() else { return };
        while self.ready().len() < self.batch_bytes
            && let Some(place) = queue.first_shared(self.batch_bytes as u64)
        {
            let QueuedPackage { head, published_ns, hops, share, .. } = *queue.at(place);
            if is_stale(now_ns, published_ns) {
                let (waiting, beginning) = queue.remove(place);
                fates.lost(&waiting.head, beginning, Cause::Stale);
                continue;
            }
            self.forget_taken();
            let start = self.ready.len();
            self.make_ready(shift_ns, &Parcel { head: &head, body: &[], published_ns, hops, level: 0, share }, fates);
            let body = self.ready.len();
            self.ready.resize(body + usize::from(head.len), 0);
            queue.read(place, &mut self.ready[body..]);
            let length = (self.ready.len() - start - HEAD_BYTES) as u32;
            self.ready[start..start + 4].copy_from_slice(&length.to_le_bytes());
            queue.serve(place);
        }
        self.queue = Some(queue);
    }

    /// Makes a part of a replica ready, if nothing else is. While packages wait, a batch of them and a part have turns:
    /// a part of what is more important than they are, or any beside those of another `party` than its own. `write`
    /// puts what follows the head of the frame into the room that it gets, of a level before the one that it gets, and
    /// says how long it is; none: there is none. Whether one was made.
    pub(super) fn add_part(
        &mut self,
        (room, party): (usize, u32),
        write: impl FnOnce(u8, &mut [u8]) -> Option<(SessionFrameKind, usize)>,
    ) -> bool {
        let first = self.queue.as_ref().and_then(|queue| Some(queue.at(queue.first_shared(self.batch_bytes as u64)?)));
        if !self.ready().is_empty() || (first.is_some() && self.is_part_last) {
            return false;
        }
        let before = first.filter(|first| first.share.party == party).map_or(LEVELS as u8, |first| first.level);
        self.forget_taken();
        self.ready.resize(HEAD_BYTES + room, 0);
        let made = write(before, &mut self.ready[HEAD_BYTES..]);
        self.ready.truncate(made.map_or(0, |(_, length)| HEAD_BYTES + length));
        let Some((kind, length)) = made else { return false };
        write_head(kind, length, &mut self.ready);
        self.is_part_last = true;
        true
    }

    /// Gives up what waited too long. `cause`: why it did.
    pub(super) fn look(&mut self, now_ns: u64, cause: Cause, fates: &mut impl Fates) {
        let Some(queue) = &mut self.queue else { return };
        for level in 0..LEVELS as u8 {
            let mut next = queue.first_of(0, level);
            while let Some(place) = next {
                next = queue.behind(place);
                let QueuedPackage { head, published_ns, .. } = queue.at(place);
                if is_stale(now_ns, *published_ns) {
                    let (waiting, beginning) = queue.remove(place);
                    fates.lost(&waiting.head, beginning, cause);
                } else if !counts_newest(head) {
                    // They came one after the other, but for those that stand in the place of an older one.
                    break;
                }
            }
        }
        self.empty_looks = if queue.is_empty() { self.empty_looks + 1 } else { 0 };
        if self.empty_looks == EMPTY_LOOKS {
            self.queue = None;
            self.empty_looks = 0;
        }
    }

    /// Gives up all that waits.
    pub(super) fn give_up(&mut self, cause: Cause, fates: &mut impl Fates) {
        let Some(mut queue) = self.queue.take() else { return };
        while let Some(place) = queue.first() {
            let (waiting, beginning) = queue.remove(place);
            fates.lost(&waiting.head, beginning, cause);
        }
    }

    /// Offset in `ready` of the first frame of which nothing was taken.
    fn next_frame(&self) -> usize {
        let mut at = self.begun;
        while let Some(length) = self.ready[at..].first_chunk().filter(|_| at < self.taken) {
            at += HEAD_BYTES + u32::from_le_bytes(*length) as usize;
        }
        at
    }

    fn forget_taken(&mut self) {
        if self.taken > 0 {
            self.begun = self.next_frame() - self.taken;
            self.hurried = self.hurried.saturating_sub(self.taken);
            self.ready.drain(..self.taken);
            self.taken = 0;
        }
    }

    fn make_ready(&mut self, shift_ns: i64, parcel: &Parcel<'_>, fates: &mut impl Fates) {
        self.forget_taken();
        self.is_part_last = false;
        let Parcel { head, body, published_ns, hops, .. } = *parcel;
        // 0 says that nobody knows.
        let published_ns = published_ns.saturating_add_signed(shift_ns).max(1);
        self.say(&SessionMessage::Package(Carried { hops, published_ns, head: *head, body }));
        fates.passed(head);
    }
}

/// Lets a package wait in the place of an older one; whether it is taken.
fn replace(queue: &mut Queue, older: Place, newer: QueuedPackage, body: &[u8], fates: &mut impl Fates) -> bool {
    let head = queue.at(older).head;
    let is_taken = queue.replace(older, newer, body, gives_way(newer.sender, fates));
    if is_taken {
        fates.replaced(&head);
    }
    is_taken
}

/// Accounts for packages that give way to one of this sender.
fn gives_way(sender: u16, fates: &mut impl Fates) -> impl FnMut(&QueuedPackage, &[u8]) {
    move |gone, beginning| lose(gone, beginning, gone.sender != sender, fates)
}

/// Lost for lack of room. `for_others`: since it would be more than its sender's part of it.
fn lose(waiting: &QueuedPackage, body: &[u8], for_others: bool, fates: &mut impl Fates) {
    fates.crowded(waiting.share.sender);
    fates.lost(&waiting.head, body, if for_others { Cause::Share } else { Cause::Full });
}

pub(super) fn is_stale(now_ns: u64, published_ns: u64) -> bool {
    now_ns.saturating_sub(published_ns) > WAIT_MAX_NS
}

const _: () = assert!(LINE_PART_HEADS_BYTES == HEAD_BYTES + RECORD_PART_HEAD_BYTES, "what `check` reckons with");

/// Makes the next part for a node ready, if the line has room and there is one, and no packages go first: those of its
/// own party that are as important, and a batch of any after each part. Whether one was made, and whether more wait
/// behind it: what measures how fast the line is must know.
pub(super) fn add_part(
    outgoing: &mut Outgoing,
    now_ns: u64,
    (node, party): (NodeIndex, u32),
    end: &mut impl EndHost,
) -> (bool, bool) {
    let Some(replicas) = end.replicas() else { return (false, false) };
    let is_made = outgoing.add_part((LINE_PART_ROOM, party), |level, content| {
        let (kind, length) = replicas.next_before(now_ns, (node, level), content)?;
        let is_record = kind == FrameKind::RecordPart;
        Some((if is_record { SessionFrameKind::RecordPart } else { SessionFrameKind::Description }, length))
    });
    (is_made, replicas.waits_for(now_ns, node))
}
