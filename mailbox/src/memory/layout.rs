//! The shape of a mailbox's segment.
//!
//! ```text
//!     0  Identity   what this is: written once, before the segment gets its name; then only read
//!    64  Owner      the receiver: changed on adoption
//!   128  Hot        ticket, ready hints, what the receiver says, alert: 128 bytes each
//!   640  Counters   ten rows of 320 bytes
//!  4096  words      one a slot, 64 B apart up to 64 slots, 8 B above
//!     …  slots      each: published (u64 ns, monotonic), head (16 B), body; a multiple of 64 B
//! ```
//!
//! docs/src/shared-memory.md has the same for other languages.

use crate::figures::counters::{Counters, ROWS};
use crate::memory::mapping::Shared;
use crate::name::Name;
use crate::package::{BODY_BYTES_MAX, HEAD_BYTES};
use crate::slots::full::OverflowPolicy;
use crate::slots::hot::{Hot, ReceiverSays};
use crate::slots::protocol::SLOTS_MAX;
use std::mem::offset_of;
use std::sync::atomic::{AtomicU32, AtomicU64};
use std::time::Duration;

/// `rohrpost` in ASCII, little-endian.
pub(crate) const MAGIC: u64 = u64::from_le_bytes(*b"rohrpost");
/// Raised with every change of a layout in shared memory.
pub const VERSION: u32 = 9;
pub(crate) const PAGE: usize = 4096;
/// Bytes of a slot before its body: time of publishing and head.
pub(crate) const SLOT_PREFIX: usize = 8 + HEAD_BYTES;
/// Up to so many slots each word has a cache line of its own.
const SPREAD_MAX: usize = 64;

/// What a mailbox is asked to be.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shape {
    /// Slots, 1..=1024.
    pub slots: u16,
    /// Largest body, bytes.
    pub body_bytes_max: u16,
    /// What happens when all slots are in use.
    pub full: OverflowPolicy,
    /// Packages that waited longer are dropped when their turn comes.
    pub max_age: Option<Duration>,
    /// Slots that one participant may hold unpublished at a time.
    pub claims: u8,
}

impl Default for Shape {
    fn default() -> Self {
        Self { slots: 32, body_bytes_max: 1024, full: OverflowPolicy::Displace, max_age: None, claims: 1 }
    }
}

/// Why a [`Shape`] cannot be.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ShapeError {
    /// No slot, or more than there can be.
    #[error("{0} slots; a mailbox has 1 to {SLOTS_MAX}")]
    Slots(u16),
    /// Larger than a package can be.
    #[error("bodies of {0} bytes; a package holds at most {BODY_BYTES_MAX}, larger things are streams")]
    Body(u16),
    /// Nobody could send.
    #[error("0 claims a participant; at least 1 is needed to send")]
    Claims,
}

impl Shape {
    pub(crate) fn check(&self) -> Result<(), ShapeError> {
        if self.slots == 0 || usize::from(self.slots) > SLOTS_MAX {
            return Err(ShapeError::Slots(self.slots));
        }
        if usize::from(self.body_bytes_max) > BODY_BYTES_MAX {
            return Err(ShapeError::Body(self.body_bytes_max));
        }
        if self.claims == 0 {
            return Err(ShapeError::Claims);
        }
        Ok(())
    }

    /// Bytes of shared memory that such a mailbox takes.
    pub fn segment_bytes(&self) -> usize {
        let slots = usize::from(self.slots);
        (self.slots_offset() + slots * self.slot_bytes()).next_multiple_of(PAGE)
    }

    /// Words from one slot's word to the next.
    pub(crate) fn word_stride(&self) -> usize {
        if usize::from(self.slots) <= SPREAD_MAX { 8 } else { 1 }
    }

    pub(crate) fn words(&self) -> usize {
        usize::from(self.slots) * self.word_stride()
    }

    pub(crate) fn slots_offset(&self) -> usize {
        PAGE + (self.words() * 8).next_multiple_of(64)
    }

    pub(crate) fn slot_bytes(&self) -> usize {
        (SLOT_PREFIX + usize::from(self.body_bytes_max)).next_multiple_of(64)
    }

    /// As the segment will say it, to the nanosecond: else a mailbox would not know its own shape again.
    pub(crate) fn as_stored(self) -> Self {
        let max_age = self.max_age.map(|age| Duration::from_nanos(stored_ns(age)));
        Self { max_age, ..self }
    }
}

/// 0 is kept for none.
pub(crate) fn stored_ns(age: Duration) -> u64 {
    u64::try_from(age.as_nanos()).unwrap_or(u64::MAX).max(1)
}

/// The first line of a segment.
#[repr(C, align(64))]
pub(crate) struct Identity {
    pub(crate) magic: AtomicU64,
    pub(crate) version: AtomicU32,
    pub(crate) name: AtomicU32,
    slots: AtomicU32,
    body_bytes_max: AtomicU32,
    full: AtomicU32,
    claims: AtomicU32,
    /// 0: none.
    max_age_ns: AtomicU64,
}

impl Identity {
    /// As the first bytes of a file have it. Nobody changes it once the file has its name, so a copy is as good.
    pub(crate) fn from_bytes(bytes: &[u8; size_of::<Self>()]) -> Self {
        let long = |at: usize| AtomicU64::new(u64::from_ne_bytes(std::array::from_fn(|i| bytes[at + i])));
        let short = |at: usize| AtomicU32::new(u32::from_ne_bytes(std::array::from_fn(|i| bytes[at + i])));
        Self {
            magic: long(offset_of!(Self, magic)),
            version: short(offset_of!(Self, version)),
            name: short(offset_of!(Self, name)),
            slots: short(offset_of!(Self, slots)),
            body_bytes_max: short(offset_of!(Self, body_bytes_max)),
            full: short(offset_of!(Self, full)),
            claims: short(offset_of!(Self, claims)),
            max_age_ns: long(offset_of!(Self, max_age_ns)),
        }
    }

    /// Before the segment has its name, so that nobody else can see it.
    pub(crate) fn write(&self, name: Name, shape: &Shape) {
        use std::sync::atomic::Ordering::Relaxed;
        self.version.store(VERSION, Relaxed);
        self.name.store(name.raw(), Relaxed);
        self.slots.store(u32::from(shape.slots), Relaxed);
        self.body_bytes_max.store(u32::from(shape.body_bytes_max), Relaxed);
        self.full.store(shape.full as u32, Relaxed);
        self.claims.store(u32::from(shape.claims), Relaxed);
        self.max_age_ns.store(shape.max_age.map_or(0, stored_ns), Relaxed);
        self.magic.store(MAGIC, std::sync::atomic::Ordering::Release);
    }

    /// The version of the layout, if it is not ours.
    pub(crate) fn other_version(&self) -> Option<u32> {
        use std::sync::atomic::Ordering::{Acquire, Relaxed};
        let version = (self.magic.load(Acquire) == MAGIC).then(|| self.version.load(Relaxed));
        version.filter(|version| *version != VERSION)
    }

    /// What the segment claims to be; none when that cannot be. Another process wrote it, so everything is checked
    /// here, once; afterwards only the result is used.
    pub(crate) fn read(&self) -> Option<(Name, Shape)> {
        use std::sync::atomic::Ordering::{Acquire, Relaxed};
        if self.magic.load(Acquire) != MAGIC || self.version.load(Relaxed) != VERSION {
            return None;
        }
        let max_age_ns = self.max_age_ns.load(Relaxed);
        let shape = Shape {
            slots: self.slots.load(Relaxed).try_into().ok()?,
            body_bytes_max: self.body_bytes_max.load(Relaxed).try_into().ok()?,
            full: *OverflowPolicy::ALL.get(self.full.load(Relaxed) as usize)?,
            max_age: (max_age_ns != 0).then(|| Duration::from_nanos(max_age_ns)),
            claims: self.claims.load(Relaxed).try_into().ok()?,
        };
        shape.check().ok()?;
        Some((Name::from_raw(self.name.load(Relaxed)), shape))
    }
}

/// The receiver, and what it has seen.
#[repr(C, align(64))]
pub(crate) struct Owner {
    /// Participant that owns the bell which wakes the receiver.
    pub(crate) participant: AtomicU32,
    pub(crate) pid: AtomicU32,
    /// Times a new owner took over.
    pub(crate) adoptions: AtomicU32,
    /// Most packages seen waiting at once.
    pub(crate) depth_max: AtomicU32,
}

/// The first page of a segment.
#[repr(C)]
pub(crate) struct Page {
    pub(crate) identity: Identity,
    pub(crate) owner: Owner,
    pub(crate) hot: Hot,
    pub(crate) counters: Counters,
}

// SAFETY: made of atomics alone.
unsafe impl Shared for Page {}

const _: () = {
    assert!(size_of::<Identity>() == 64 && offset_of!(Identity, max_age_ns) == 32);
    assert!(size_of::<Owner>() == 64);
    assert!(size_of::<Hot>() == 512 && offset_of!(Hot, ready) == 128);
    assert!(offset_of!(Hot, receiver) == 256 && offset_of!(Hot, alert) == 384);
    assert!(offset_of!(ReceiverSays, level) == 4 && offset_of!(ReceiverSays, retired) == 8);
    assert!(offset_of!(Page, hot) == 128 && offset_of!(Page, counters) == 640);
    assert!(size_of::<Counters>() == ROWS * 320 && size_of::<Page>() <= PAGE);
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_the_slots_and_at_most_64_bytes_a_slot_and_a_page() {
        for slots in [1, 3, 64, 65, 1024] {
            for body_bytes_max in [0, 40, 1024, 65519] {
                let shape = Shape { slots, body_bytes_max, ..Shape::default() };
                let words = shape.slots_offset() - PAGE;
                assert!(words <= usize::from(slots) * 64);
                assert!(shape.segment_bytes() >= shape.slots_offset() + usize::from(slots) * shape.slot_bytes());
                assert_eq!(shape.slot_bytes() % 64, 0);
            }
        }
    }

    #[test]
    fn shapes_that_cannot_be_say_why() {
        for (shape, why) in [
            (Shape { slots: 0, ..Shape::default() }, "0 slots; a mailbox has 1 to 1024"),
            (Shape { slots: 1025, ..Shape::default() }, "1025 slots; a mailbox has 1 to 1024"),
            (
                Shape { body_bytes_max: 65520, ..Shape::default() },
                "bodies of 65520 bytes; a package holds at most 65519, larger things are streams",
            ),
            (Shape { claims: 0, ..Shape::default() }, "0 claims a participant; at least 1 is needed to send"),
        ] {
            assert_eq!(shape.check().unwrap_err().to_string(), why);
        }
    }
}
