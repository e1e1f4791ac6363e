//! A small stream around the real core of streams, its writers and its readers, as threads; and the runs of them.
//!
//! Records are plain memory and read held, so that ThreadSanitizer checks every access to them. All else is atomics.
//! ThreadSanitizer knows no fences, and needs none here: what they settle is whether a reader holds a frame. One that
//! does has its bytes by the entry's word, and gives them back by its seat.

use crate::rounds;
use crate::step::{dice, reached, shake};
use crate::stream::omission::LeftOut;
use crate::stream::ring::{About, IndexEntry, Line, Look, Ring, Seat, Stamp};
use crate::stream::writing::Progress;
use crate::sync::{AtomicU32, AtomicU64, Ordering};
use std::cell::UnsafeCell;
use std::thread;

/// All, with what each is called.
pub(crate) const ALL: &[(&str, fn())] = &[("holding", holding), ("succeeding", succeeding)];

/// Four words of which each is the record's number; torn, they are not.
type Record = [u64; 4];

struct Stream {
    written: AtomicU64,
    entries: Vec<IndexEntry>,
    hints: Vec<AtomicU64>,
    seats: Vec<Seat>,
    frames: Vec<UnsafeCell<Record>>,
    /// Not 0: nothing more is written.
    ended: AtomicU32,
    /// Looks that found another record than they held. They end nothing at once: the first may find a whole record, in
    /// order, and a reader that stops there would keep ThreadSanitizer from the race that is looked for.
    torn: AtomicU32,
}

// SAFETY: the records are the only part that is not Sync by itself. Whether the core of streams keeps writer and
// readers from one record is what is tested here, and ThreadSanitizer is the test.
unsafe impl Sync for Stream {}

impl Stream {
    /// Lives as long as the process: threads need no counting of references, which would order them.
    fn new(keep: usize, readers: usize) -> &'static Self {
        let stream = Box::leak(Box::new(Self {
            written: AtomicU64::new(0),
            entries: (0..keep).map(|_| IndexEntry::default()).collect(),
            hints: (0..keep).map(|_| AtomicU64::default()).collect(),
            seats: (0..readers).map(|_| Seat::default()).collect(),
            frames: (0..keep + readers + 1).map(|_| UnsafeCell::default()).collect(),
            ended: AtomicU32::new(0),
            torn: AtomicU32::new(0),
        }));
        stream.ring().format();
        stream
    }

    fn ring(&self) -> Ring<'_> {
        Ring::new(&self.written, 0, (&self.entries, &self.hints), &self.seats)
    }

    /// Fills a frame, and makes it a record if `is_finished`.
    fn write(&self, progress: &mut Progress, is_finished: bool) {
        let (ring, number) = (self.ring(), progress.next());
        let frame = progress.claim(&ring).expect("there always is a free frame");
        let halves = self.frames[frame.number()].get().cast::<[u64; 2]>();
        // SAFETY: the frame is ours; if that were wrong, ThreadSanitizer would tell.
        unsafe { halves.write([number; 2]) };
        reached("fill: half");
        // SAFETY: as above; a record is two halves.
        unsafe { halves.add(1).write([number; 2]) };
        if !is_finished {
            return progress.give_back(frame);
        }
        let stamp = Stamp { epoch: 1, ns: number + 1 };
        let about =
            About { stamp, before_ns: 0, written_ns: 0, len_bytes: 32, incarnation: 1, left_out: LeftOut::default() };
        progress.publish(&ring, frame, about, |_| (), |_, _| ());
    }

    /// Begins where the one before ended, and writes a record for each number; some are begun and dropped.
    fn write_on(&self, records: impl Iterator<Item = u64>) {
        let mut progress = Progress::resume(&self.ring());
        for _ in records {
            self.write(&mut progress, !dice().is_multiple_of(8));
            if dice().is_multiple_of(4) {
                thread::yield_now();
            }
        }
    }

    /// A reader that holds a record looks at it more than once.
    fn look(&self, line: &Line) {
        for _ in 0..3 {
            // SAFETY: held by us; if that were wrong, ThreadSanitizer would tell.
            let record = unsafe { *self.frames[line.frame].get() };
            if record != [line.sequence; 4] {
                self.torn.fetch_add(1, Ordering::Relaxed);
            }
            reached("hold: looked");
        }
    }

    fn assert_whole(&self) {
        assert_eq!(self.torn.load(Ordering::Relaxed), 0, "looks at records that changed while they were held");
    }
}

/// As `StreamReader`.
struct Reader {
    stream: &'static Stream,
    seat: usize,
    began: u64,
    next: u64,
    read: u64,
    lost: u64,
}

impl Reader {
    /// Takes the seat of a reader that is gone.
    fn new(stream: &'static Stream, seat: usize) -> Self {
        let ring = stream.ring();
        ring.sit_down(seat, 0);
        Self { stream, seat, began: ring.written(), next: ring.written(), read: 0, lost: 0 }
    }

    /// False when there is nothing.
    fn advance(&mut self) -> bool {
        let ring = self.stream.ring();
        match ring.look(self.next) {
            Look::There(line) if self.hold(&line) => {
                self.stream.look(&line);
                ring.release(self.seat);
                self.next += 1;
                self.read += 1;
            }
            Look::There(_) | Look::Gone => {
                let oldest = ring.oldest_after(self.next);
                self.lost += oldest - self.next;
                self.next = oldest;
            }
            Look::NotYet => return false,
        }
        true
    }

    /// Now and then the writer turns the ring between the look and the hold.
    fn hold(&self, line: &Line) -> bool {
        if dice().is_multiple_of(32) {
            let end = self.stream.ring().written() + self.stream.entries.len() as u64 + 1;
            while self.stream.ring().written() < end && self.stream.ended.load(Ordering::Relaxed) == 0 {
                thread::yield_now();
            }
        }
        self.stream.ring().hold(self.seat, line)
    }

    /// Until the writer has ended and nothing is left. All that was written was read or lost.
    fn read_to_the_end(mut self) -> u64 {
        loop {
            let is_last = self.stream.ended.load(Ordering::Acquire) != 0;
            while self.advance() {}
            if is_last {
                break;
            }
            thread::yield_now();
        }
        let written = self.stream.ring().written();
        assert_eq!((self.next, self.read + self.lost), (written, written - self.began), "the account");
        self.read
    }

    /// Reads some, holds one more, and dies with it in hand.
    fn read_and_die(mut self) {
        (0..20).for_each(|_| _ = self.advance());
        let ring = self.stream.ring();
        if let Some(line) = ring.newest().filter(|line| self.hold(line)) {
            self.stream.look(&line);
        }
    }
}

fn reader(stream: &'static Stream, seat: usize) -> thread::JoinHandle<u64> {
    thread::spawn(move || {
        shake(seat as u64 + 1);
        Reader::new(stream, seat).read_to_the_end()
    })
}

fn join<T>(thread: thread::JoinHandle<T>) -> T {
    thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// Two records are kept, and two readers hold one after the other while the writer turns the ring.
pub(crate) fn holding() {
    let stream = Stream::new(2, 2);
    let readers = [0, 1].map(|seat| reader(stream, seat));
    let writer = thread::spawn(move || {
        shake(100);
        stream.write_on(rounds(60_000));
        stream.ended.store(1, Ordering::Release);
    });
    join(writer);
    assert!(readers.map(join).iter().all(|read| *read > 0), "a reader has read nothing");
    stream.assert_whole();
}

/// Writers end with a frame half filled, readers die with a record in hand; others go on in their places.
pub(crate) fn succeeding() {
    let stream = Stream::new(3, 3);
    let readers = [0, 1].map(|seat| reader(stream, seat));
    let dying = thread::spawn(move || {
        for life in rounds(200) {
            let reader = thread::spawn(move || {
                shake(life + 200);
                Reader::new(stream, 2).read_and_die();
            });
            join(reader);
        }
    });
    for life in rounds(200) {
        let writer = thread::spawn(move || {
            shake(life + 300);
            stream.write_on(0..50);
            stream.write(&mut Progress::resume(&stream.ring()), false);
        });
        join(writer);
    }
    join(dying);
    stream.ended.store(1, Ordering::Release);
    readers.map(join);
    stream.assert_whole();
}
