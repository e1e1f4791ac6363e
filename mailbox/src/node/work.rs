//! What a module has in hand: one word that it writes at each turn and anyone may read, so that a handler which does
//! not come back is seen from outside. Writing it is one store, without system call, lock or thread.
//!
//! ```text
//!  63      56 55          40 39                                    0
//!  |  what   |    number    |  since, in 2^20 ns of the clock       |      all 0: nothing in hand
//! ```

use crate::clock::monotonic_ns;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

const WHAT_SHIFT: u32 = 56;
const NUMBER_SHIFT: u32 = 40;
const SINCE_MASK: u64 = (1 << NUMBER_SHIFT) - 1;
/// The clock's unit here is 2^20 ns, about a millisecond: 40 bits of it are 36 years.
const UNIT_SHIFT: u32 = 20;
const _: () = assert!(NUMBER_SHIFT + u16::BITS == WHAT_SHIFT && WHAT_SHIFT + u8::BITS == u64::BITS);

/// Which part of a module's own code runs.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Work {
    /// It is being made.
    New,
    /// It is being switched on.
    On,
    /// It goes to its safe state.
    Off,
    /// Its periodic work.
    Tick,
    /// It takes data that it subscribed to, of this number.
    Received(u16),
    /// It takes what a descriptor brings.
    Ready,
    /// It runs a function of its interface, of this number.
    Function(u16),
    /// Its parameters were changed.
    Parameters,
}

impl Work {
    const fn code(self) -> (u8, u16) {
        match self {
            Self::New => (1, 0),
            Self::On => (2, 0),
            Self::Off => (3, 0),
            Self::Tick => (4, 0),
            Self::Received(number) => (5, number),
            Self::Ready => (6, 0),
            Self::Function(number) => (7, number),
            Self::Parameters => (8, 0),
        }
    }

    const fn from_code(what: u8, number: u16) -> Option<Self> {
        Some(match what {
            1 => Self::New,
            2 => Self::On,
            3 => Self::Off,
            4 => Self::Tick,
            5 => Self::Received(number),
            6 => Self::Ready,
            7 => Self::Function(number),
            8 => Self::Parameters,
            _ => return None,
        })
    }
}

/// What a module has in hand, and since when.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct InHand {
    /// What runs.
    pub work: Work,
    /// When it began, ns of the monotonic clock, to within two milliseconds.
    pub since_ns: u64,
}

impl InHand {
    /// For how long, at this moment of the same clock.
    pub fn lasts(&self, now_ns: u64) -> Duration {
        Duration::from_nanos(now_ns.saturating_sub(self.since_ns))
    }
}

/// The word in shared memory. Only the thread that runs the module writes it.
#[repr(transparent)]
pub(crate) struct Mark(AtomicU64);

impl Mark {
    pub(crate) fn begin(&self, work: Work) {
        let (what, number) = work.code();
        let since = monotonic_ns() >> UNIT_SHIFT & SINCE_MASK;
        let word = u64::from(what) << WHAT_SHIFT | u64::from(number) << NUMBER_SHIFT | since;
        // ORDERING: Relaxed; the word says all there is to say, and nobody concludes anything else from it.
        self.0.store(word, Ordering::Relaxed);
    }

    /// For how long it was in hand.
    pub(crate) fn end(&self) -> Duration {
        let lasted = self.read().map_or(Duration::ZERO, |in_hand| in_hand.lasts(monotonic_ns()));
        self.clear();
        lasted
    }

    pub(crate) fn clear(&self) {
        self.0.store(0, Ordering::Relaxed);
    }

    /// None when nothing is in hand, or the word is none of ours.
    pub(crate) fn read(&self) -> Option<InHand> {
        let word = self.0.load(Ordering::Relaxed);
        let work = Work::from_code((word >> WHAT_SHIFT) as u8, (word >> NUMBER_SHIFT) as u16)?;
        Some(InHand { work, since_ns: (word & SINCE_MASK) << UNIT_SHIFT })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_in_hand_is_read_as_it_was_written() {
        let mark = Mark(AtomicU64::new(0));
        assert_eq!(mark.read(), None);
        for work in [
            Work::New,
            Work::On,
            Work::Off,
            Work::Tick,
            Work::Received(u16::MAX),
            Work::Ready,
            Work::Function(16),
            Work::Parameters,
        ] {
            mark.begin(work);
            let read = mark.read().unwrap();
            assert_eq!(read.work, work);
            assert!(read.since_ns <= monotonic_ns(), "it began before now");
            mark.end();
            assert_eq!(mark.read(), None);
        }
        mark.0.store(u64::MAX, Ordering::Relaxed);
        assert_eq!(mark.read(), None, "what nobody of us writes is nothing");
    }

    #[test]
    fn it_lasts_as_long_as_it_does() {
        let (mark, unit) = (Mark(AtomicU64::new(0)), Duration::from_nanos(1 << UNIT_SHIFT));
        let (before, asleep) = (std::time::Instant::now(), Duration::from_millis(30));
        mark.begin(Work::Tick);
        std::thread::sleep(asleep);
        let (lasted, most) = (mark.end(), before.elapsed() + unit);
        assert!(lasted >= asleep && lasted <= most, "{lasted:?} of {most:?}");
    }
}
