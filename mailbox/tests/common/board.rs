//! What the processes of a test write down for each other: what was accepted and what was received, package by package.
//!
//! It lies in memory that forked processes share, and outlives each of them: a package is written down as accepted
//! after its sender was told so, and as received while its receiver has it in hand. So of a process killed at any
//! instruction, at most the one package that it was busy with is unknown.

use super::random::sum;
use nix::sys::mman::{MapFlags, ProtFlags, mmap_anonymous};
use rohrpost_mailbox::{Loss, MailboxInfo, Name, Options, OverflowPolicy, Package, Priority};
use std::ffi::c_void;
use std::num::NonZeroUsize;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::SeqCst};

/// Mailboxes that a test sends to.
pub(crate) const MAILBOXES: [Name; 2] = [super::MAILBOX, super::OTHER];
pub(crate) const PRIORITIES: [Priority; 4] = [Priority(10), Priority(20), Priority(30), Priority(40)];
/// What of one sender stays in order: its packages of a priority, or, where only the newest of a state counts, of a
/// state.
pub(crate) const KEYS: usize = 4;
/// Processes and threads at a time.
pub(crate) const SEATS: usize = 10;
/// Bytes of the smallest body: [`Mark`] and a sum.
pub(crate) const BODY_BYTES_MIN: usize = 20;

/// One process or thread, where it is now.
#[repr(C)]
pub(crate) struct Seat {
    /// Inside an operation on a mailbox: killed now, it may leave one package unaccounted for.
    busy: AtomicU32,
    /// It has done what it must at its start.
    ready: AtomicU32,
    /// The number of the hold that it keeps, or kept last.
    still: AtomicU32,
    /// Operations that ended.
    operations: AtomicU64,
}

impl Seat {
    /// Before somebody takes it.
    pub(crate) fn reset(&self) {
        [&self.busy, &self.ready, &self.still].into_iter().for_each(|word| word.store(0, SeqCst));
    }

    /// Does an operation on a mailbox.
    pub(crate) fn operate<T>(&self, operate: impl FnOnce() -> T) -> T {
        self.busy.store(1, SeqCst);
        let result = operate();
        self.busy.store(0, SeqCst);
        self.operations.fetch_add(1, SeqCst);
        result
    }

    pub(crate) fn set_ready(&self) {
        self.ready.store(1, SeqCst);
    }

    pub(crate) fn is_ready(&self) -> bool {
        self.ready.load(SeqCst) != 0
    }

    pub(crate) fn is_busy(&self) -> bool {
        self.busy.load(SeqCst) != 0
    }

    pub(crate) fn operations(&self) -> u64 {
        self.operations.load(SeqCst)
    }
}

/// One incarnation of a sender.
#[repr(C)]
struct Run {
    /// By mailbox and priority.
    accepted: [[AtomicU32; PRIORITIES.len()]; MAILBOXES.len()],
    refused: [[AtomicU32; PRIORITIES.len()]; MAILBOXES.len()],
    /// By mailbox and key: how many different ones were received, and the number of the last; in one word, so that a
    /// receiver that is killed writes both or none.
    received: [[AtomicU64; KEYS]; MAILBOXES.len()],
}

#[repr(C)]
struct Front {
    /// Odd: all senders are asked to hold still. Each time has a number of its own, so that a sender that is slow to go
    /// on after one is not taken for still in the next.
    hold: AtomicU32,
    end: AtomicU32,
    seats: [Seat; SEATS],
}

/// What a sender writes at the beginning of a body.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Mark {
    pub(crate) run: u32,
    /// Of its mailbox and key; 1 is the first.
    pub(crate) number: u32,
    pub(crate) mailbox: u8,
    pub(crate) key: u8,
    /// Index of the priority.
    pub(crate) class: u8,
}

impl Mark {
    /// A body of `len` bytes.
    pub(crate) fn write(&self, body: &mut [u8]) {
        let (content, end) = body.split_at_mut(body.len() - 8);
        content[..4].copy_from_slice(&self.run.to_le_bytes());
        content[4..8].copy_from_slice(&self.number.to_le_bytes());
        content[8..12].copy_from_slice(&[self.mailbox, self.key, self.class, 0]);
        content[12..].fill(self.number as u8);
        end.copy_from_slice(&sum(content).to_le_bytes());
    }

    /// # Panics
    /// When the body is torn.
    pub(crate) fn read(body: &[u8]) -> Self {
        let (content, end) = body.split_last_chunk::<8>().expect("torn: too short");
        assert_eq!(sum(content).to_le_bytes(), *end, "torn: {body:x?}");
        let word = |at: usize| u32::from_le_bytes(content[at..at + 4].try_into().unwrap());
        Self { run: word(0), number: word(4), mailbox: content[8], key: content[9], class: content[10] }
    }
}

/// Packages of one mailbox.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct Tally {
    pub(crate) accepted: [u64; PRIORITIES.len()],
    pub(crate) refused: [u64; PRIORITIES.len()],
    /// Different ones: a redelivered one counts once.
    pub(crate) received: u64,
}

#[derive(Clone, Copy)]
pub(crate) struct Board {
    front: &'static Front,
    runs: &'static [Run],
}

/// New memory that what this process forks from now on shares; never unmapped. All zero.
fn map(bytes: usize) -> NonNull<c_void> {
    let (protection, flags) = (ProtFlags::PROT_READ | ProtFlags::PROT_WRITE, MapFlags::MAP_SHARED);
    // SAFETY: a new mapping, at no address in particular.
    unsafe { mmap_anonymous(None, NonZeroUsize::new(bytes).unwrap(), protection, flags) }.unwrap()
}

/// A word in such memory.
pub(crate) fn shared() -> &'static AtomicU32 {
    // SAFETY: page-aligned, zero, which is a valid atomic, and never unmapped.
    unsafe { map(size_of::<AtomicU32>()).cast().as_ref() }
}

/// So many of them; all 0.
pub(crate) fn shared_words(count: usize) -> &'static [AtomicU64] {
    // SAFETY: page-aligned, zero, which is a valid atomic, large enough, and never unmapped.
    unsafe { std::slice::from_raw_parts(map(count * size_of::<AtomicU64>()).cast().as_ptr(), count) }
}

impl Board {
    /// In memory that what this process forks from now on shares. It stays until the process ends.
    pub(crate) fn new(runs: usize) -> Self {
        let base = map(size_of::<Front>() + runs * size_of::<Run>());
        const { assert!(size_of::<Front>().is_multiple_of(align_of::<Run>())) };
        // SAFETY: the mapping is page-aligned, large enough, zero, which is a valid atomic, and never unmapped.
        unsafe {
            let after = base.cast::<Front>().add(1).cast::<Run>();
            Self { front: base.cast::<Front>().as_ref(), runs: std::slice::from_raw_parts(after.as_ptr(), runs) }
        }
    }

    pub(crate) fn seat(&self, seat: usize) -> &'static Seat {
        &self.front.seats[seat]
    }

    /// Asks all senders to hold still, or to go on.
    pub(crate) fn hold(&self, hold: bool) {
        let before = self.front.hold.fetch_add(1, SeqCst);
        assert_eq!(before.is_multiple_of(2), hold, "asked twice");
    }

    /// Whether the process of this seat holds still, and stays so until it is asked to go on.
    pub(crate) fn is_still(&self, seat: usize) -> bool {
        let hold = self.front.hold.load(SeqCst);
        hold % 2 == 1 && self.seat(seat).still.load(SeqCst) == hold
    }

    /// Asks all to end.
    pub(crate) fn end(&self) {
        self.front.end.store(1, SeqCst);
    }

    pub(crate) fn is_ended(&self) -> bool {
        self.front.end.load(SeqCst) != 0
    }

    /// A sender, between two operations: holds still if it should.
    pub(crate) fn hold_if_asked(&self, seat: &Seat) {
        loop {
            let hold = self.front.hold.load(SeqCst);
            if hold.is_multiple_of(2) || self.is_ended() {
                break;
            }
            seat.still.store(hold, SeqCst);
            std::thread::sleep(std::time::Duration::from_micros(100));
        }
    }

    pub(crate) fn accepted(&self, mark: &Mark) {
        self.runs[mark.run as usize].accepted[usize::from(mark.mailbox)][usize::from(mark.class)].fetch_add(1, SeqCst);
    }

    pub(crate) fn refused(&self, mark: &Mark) {
        self.runs[mark.run as usize].refused[usize::from(mark.mailbox)][usize::from(mark.class)].fetch_add(1, SeqCst);
    }

    /// Looks at a package in hand, and writes down that it was received.
    ///
    /// # Panics
    /// When it is torn, not what its head says, or out of order.
    pub(crate) fn received(&self, package: &Package<'_>) {
        let (mark, head) = (Mark::read(package.body()), package.head());
        assert_eq!(
            (head.to, head.priority),
            (MAILBOXES[usize::from(mark.mailbox)], PRIORITIES[usize::from(mark.class)]),
            "head and body are of different packages: {mark:?}"
        );
        let word = &self.runs[mark.run as usize].received[usize::from(mark.mailbox)][usize::from(mark.key)];
        let (count, last) = (word.load(SeqCst) >> 32, word.load(SeqCst) as u32);
        if mark.number > last {
            word.store((count + 1) << 32 | u64::from(mark.number), SeqCst);
        } else {
            // An earlier receiver wrote it down and was killed with it in hand.
            let again = mark.number == last && head.options.has(Options::REDELIVERED);
            assert!(again, "out of order: {mark:?} ({:?}) after {last}", head.options);
        }
    }

    /// What one sender had accepted.
    pub(crate) fn accepted_of(&self, run: usize, mailbox: usize) -> u64 {
        self.runs[run].accepted[mailbox].iter().map(|count| u64::from(count.load(SeqCst))).sum()
    }

    /// What of one sender and key was received.
    pub(crate) fn received_of(&self, run: usize, mailbox: usize, key: usize) -> u64 {
        self.runs[run].received[mailbox][key].load(SeqCst) >> 32
    }

    /// What all senders and receivers have written down about a mailbox.
    pub(crate) fn tally(&self, mailbox: usize) -> Tally {
        let mut tally = Tally::default();
        for run in self.runs {
            for class in 0..PRIORITIES.len() {
                tally.accepted[class] += u64::from(run.accepted[mailbox][class].load(SeqCst));
                tally.refused[class] += u64::from(run.refused[mailbox][class].load(SeqCst));
            }
            tally.received += run.received[mailbox].iter().map(|word| word.load(SeqCst) >> 32).sum::<u64>();
        }
        tally
    }
}

/// Lost after being accepted, as the mailbox has counted.
pub(crate) fn missing(info: &MailboxInfo) -> u64 {
    Loss::ALL.into_iter().filter(|cause| cause.was_accepted()).map(|cause| super::lost(info, cause)).sum()
}

/// What stays in order: with `latest`, where a newer package takes the place of an older one of its state, only those.
pub(crate) fn key(full: OverflowPolicy, class: u8, state: u8) -> u8 {
    if full == OverflowPolicy::Latest { state } else { class }
}
