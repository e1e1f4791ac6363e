//! A stream as the models see it: records of one number each, and the steps of a writer and a reader. Compiled beside
//! the models.

use crate::step::reached;
use crate::stream::missed::MissedAccount;
use crate::stream::omission::LeftOut;
use crate::stream::ring::{About, IndexEntry, Line, Look, Ring, Seat, Stamp};
use crate::stream::writing::Progress;
use crate::sync::{AtomicU32, AtomicU64, Ordering};
use loom::cell::UnsafeCell;
use loom::thread::{self, JoinHandle};
use std::sync::Arc;

/// A stream with records of one number each. Each of its words follows from its sequence, and none is 0.
pub(crate) struct Stream {
    pub(crate) written: AtomicU64,
    pub(crate) entries: Vec<IndexEntry>,
    pub(crate) hints: Vec<AtomicU64>,
    pub(crate) seats: Vec<Seat>,
    /// Two words a frame, that may be copied while they are written.
    pub(crate) words: Vec<[AtomicU64; 2]>,
    /// The same as plain memory, watched by loom for races.
    pub(crate) plain: Vec<UnsafeCell<u64>>,
    /// The bell of all that sleep.
    pub(crate) rings: AtomicU32,
}

// SAFETY: the plain memory is the only part that is not Sync by itself, and loom reports every race on it.
unsafe impl Sync for Stream {}

/// How records are written, and read.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Bytes {
    Racing,
    Plain,
}

impl Stream {
    pub(crate) fn new(keep: usize, readers: usize) -> Arc<Self> {
        let frames = keep + readers + 1;
        let stream = Self {
            written: AtomicU64::new(0),
            entries: (0..keep).map(|_| IndexEntry::default()).collect(),
            hints: (0..keep).map(|_| AtomicU64::default()).collect(),
            seats: (0..readers).map(|_| Seat::default()).collect(),
            words: (0..frames).map(|_| Default::default()).collect(),
            plain: (0..frames).map(|_| UnsafeCell::new(0)).collect(),
            rings: AtomicU32::new(0),
        };
        stream.ring().format();
        Arc::new(stream)
    }

    pub(crate) fn ring(&self) -> Ring<'_> {
        Ring::new(&self.written, 0, (&self.entries, &self.hints), &self.seats)
    }

    /// Does something with it on a thread of its own.
    pub(crate) fn spawn<R: 'static>(self: &Arc<Self>, act: impl FnOnce(&Arc<Self>) -> R + 'static) -> JoinHandle<R> {
        let stream = self.clone();
        thread::spawn(move || act(&stream))
    }

    /// As `StreamWriter::write`.
    pub(crate) fn write(&self, progress: &mut Progress, stamp_ns: u64, bytes: Bytes) {
        let ring = self.ring();
        let sequence = progress.next();
        let frame = progress.claim(&ring).expect("there always is a free frame");
        match bytes {
            Bytes::Racing => {
                for word in &self.words[frame.number()] {
                    reached("words: before store");
                    word.store(sequence + 1, Ordering::Relaxed);
                }
            }
            // SAFETY: loom reports a race.
            Bytes::Plain => self.plain[frame.number()].with_mut(|plain| unsafe { *plain = sequence + 1 }),
        }
        let stamp = Stamp { epoch: 1, ns: stamp_ns };
        let left_out = LeftOut::default();
        let about = About { stamp, before_ns: 0, written_ns: 0, len_bytes: sequence + 1, incarnation: 0, left_out };
        let wake = |_: &Seat, _| {
            self.rings.fetch_add(1, Ordering::Release);
        };
        progress.publish(&ring, frame, about, |_| (), wake);
    }

    pub(crate) fn writes(&self, progress: &mut Progress, count: u64, bytes: Bytes) {
        (0..count).for_each(|_| self.write(progress, 10 * (progress.next() + 1), bytes));
    }

    /// As `StreamSegment::copy` and `HeldRecord`: whether it was there to the end.
    pub(crate) fn read(&self, seat: usize, line: &Line, bytes: Bytes) -> bool {
        let ring = self.ring();
        assert_eq!(line.about.len_bytes, line.sequence + 1, "torn: the entry is another record's");
        match bytes {
            Bytes::Racing => {
                let copy = self.words[line.frame].each_ref().map(|word| {
                    reached("words: before load");
                    word.load(Ordering::Relaxed)
                });
                let whole = ring.is_there(line);
                assert!(!whole || copy == [line.sequence + 1; 2], "torn: {copy:?} of {}", line.sequence);
                whole
            }
            Bytes::Plain => {
                let held = ring.hold(seat, line);
                if held {
                    // SAFETY: loom reports a race.
                    let plain = self.plain[line.frame].with(|plain| unsafe { *plain });
                    assert_eq!(plain, line.sequence + 1, "torn");
                    ring.release(seat);
                }
                held
            }
        }
    }
}

/// As `StreamReader`.
pub(crate) struct Reader {
    pub(crate) stream: Arc<Stream>,
    pub(crate) seat: usize,
    pub(crate) next: u64,
    pub(crate) read: u64,
    pub(crate) lost: u64,
    /// None: causes are not asked for. Each look that they take multiplies the interleavings.
    pub(crate) missed: Option<MissedAccount>,
}

impl Reader {
    pub(crate) fn new(stream: &Arc<Stream>, seat: usize) -> Self {
        Self { stream: stream.clone(), seat, next: 0, read: 0, lost: 0, missed: None }
    }

    /// One that tells what it missed by cause.
    pub(crate) fn telling(stream: &Arc<Stream>, seat: usize) -> Self {
        let mut missed = MissedAccount::default();
        missed.begin(&stream.ring(), 0);
        Self { missed: Some(missed), ..Self::new(stream, seat) }
    }

    /// As `StreamReader::advance`; false when there is nothing.
    pub(crate) fn advance(&mut self, bytes: Bytes) -> bool {
        reached("advance: before");
        let ring = self.stream.ring();
        match ring.look(self.next) {
            Look::There(line) if self.stream.read(self.seat, &line, bytes) => {
                assert_eq!(line.sequence, self.next);
                self.next += 1;
                self.read += 1;
                self.missed.iter_mut().for_each(|missed| missed.come_to(line.about.left_out));
            }
            Look::There(_) | Look::Gone => {
                let oldest = match &mut self.missed {
                    Some(missed) => missed.miss(&ring, self.seat, self.next),
                    None => ring.oldest_after(self.next),
                };
                assert!(oldest > self.next, "overwritten, and not told so");
                self.lost += oldest - self.next;
                self.next = oldest;
            }
            Look::NotYet => return false,
        }
        true
    }

    pub(crate) fn catch_up(&mut self, bytes: Bytes) {
        while self.advance(bytes) {}
    }

    /// Everything that was written was read or lost.
    pub(crate) fn settle(mut self, written: u64, bytes: Bytes) {
        self.catch_up(bytes);
        assert_eq!((self.read + self.lost, self.next), (written, written), "the accounts are wrong");
        let missed = self.missed.map_or(self.lost, |missed| missed.missed().all());
        assert_eq!(missed, self.lost, "some were missed without a cause");
    }
}

/// A stream with two records, and their entries: what races from here on is not the look, but what comes after it.
pub(crate) fn looked_at(readers: usize, bytes: Bytes) -> (Arc<Stream>, Progress, [Line; 2]) {
    let stream = Stream::new(2, readers);
    let mut progress = Progress::resume(&stream.ring());
    stream.writes(&mut progress, 2, bytes);
    let lines = [0, 1].map(|sequence| match stream.ring().look(sequence) {
        Look::There(line) => line,
        other => panic!("{other:?}"),
    });
    (stream, progress, lines)
}
