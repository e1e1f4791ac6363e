//! Lost parts are asked for and come: a wire with delays, that loses and damages both ways, for many seeds.
//!
//! Whatever is lost: each record is read whole and as it was written, or told as lost; sequences do not go back; what
//! was written is what came and what is missing; and there are few requests.

use super::*;
use crate::frame::{self, Frame, FrameKind};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const US: u64 = 1000;
/// Ends are looked at this often.
const STEP_NS: u64 = 100 * US;

/// What a record contains: its sequence, and a length and bytes that follow from it.
fn body(sequence: u64, most: usize) -> Vec<u8> {
    let mix = (sequence + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let len = (most / 2 + (mix >> 40) as usize % (most / 2 + 1)).max(8);
    let mut body: Vec<u8> = (0..len).map(|at| (mix >> (at / 100 % 7 * 8)) as u8 ^ at as u8).collect();
    body[..8].copy_from_slice(&sequence.to_le_bytes());
    body
}

/// A wire one way that does harm.
struct BadWire {
    delay_ns: u64,
    loss: f64,
    rng: ChaCha8Rng,
    wire: Wire,
}

impl BadWire {
    fn new(seed: u64, loss: f64) -> Self {
        Self { delay_ns: 300 * US, loss, rng: ChaCha8Rng::seed_from_u64(seed), wire: Wire::default() }
    }

    /// Delays, and with that reorders, some; doubles and damages a few, and moves parts of records, as a sender with a
    /// mistake would.
    fn put(&mut self, now_ns: u64, mut datagram: Vec<u8>) {
        let copies = 1 + u64::from(self.rng.random_bool(self.loss / 5.0));
        for _ in 0..copies {
            if self.rng.random_bool(self.loss) {
                continue;
            }
            if self.rng.random_bool(self.loss / 10.0) {
                let [one, other] = [0, 0].map(|_| self.rng.random_range(0..datagram.len()));
                datagram.swap(one, other);
            }
            if datagram[3] == FrameKind::RecordPart as u8 && self.rng.random_bool(self.loss / 10.0) {
                let offset = u32::from_le_bytes(*datagram[52..].first_chunk().unwrap());
                let moved = offset + self.rng.random_range(1..1372);
                datagram[52..56].copy_from_slice(&moved.to_le_bytes());
                frame::write_check(&mut datagram);
            }
            let late_ns =
                if self.loss > 0.0 && self.rng.random_bool(0.05) { self.rng.random_range(0..800 * US) } else { 0 };
            self.wire.put(now_ns + self.delay_ns + late_ns, datagram.clone());
        }
    }
}

/// Two nodes with a bad wire between them.
pub(super) struct Pair {
    now_ns: u64,
    origin: Origin,
    pub(super) holder: Holder,
    pub(super) writer: StreamWriter,
    reader: StreamReader,
    there: BadWire,
    back: BadWire,
    most: usize,
    /// When each record was written, ns.
    written_ns: Vec<u64>,
    /// The longest time from writing to reading, ns, of those that were not asked for.
    slowest_ns: u64,
    last: Option<u64>,
    read: u64,
    told: u64,
    /// Sequences that were asked for, one for each request.
    asked: Vec<u64>,
    pub(super) again: u64,
}

impl Pair {
    pub(super) fn new(replica: ReplicaSettings, seed: u64, [there, back]: [f64; 2]) -> Self {
        let most = replica.shape.record_bytes as usize;
        let Both { origin, holder, writer, reader, now_ns } = Both::new(replica);
        let mut pair = Self {
            now_ns,
            origin,
            holder,
            writer,
            reader,
            there: BadWire::new(seed, 0.0),
            back: BadWire::new(seed + 1000, back),
            most,
            written_ns: Vec::new(),
            slowest_ns: 0,
            last: None,
            read: 0,
            told: 0,
            asked: Vec::new(),
            again: 0,
        };
        // Described before anything is lost.
        pair.run(10 * MS);
        pair.there.loss = there;
        pair
    }

    /// From now on either way takes so long.
    pub(super) fn slow_down(&mut self, delay_ns: u64) {
        (self.there.delay_ns, self.back.delay_ns) = (delay_ns, delay_ns);
    }

    pub(super) fn write(&mut self) {
        let sequence = self.writer.written();
        self.writer.write(at(self.now_ns), &body(sequence, self.most)).unwrap();
        self.written_ns.push(self.now_ns);
    }

    pub(super) fn run(&mut self, time_ns: u64) {
        let end_ns = self.now_ns + time_ns;
        while self.now_ns < end_ns {
            self.now_ns += STEP_NS;
            self.step();
        }
    }

    fn step(&mut self) {
        let now_ns = self.now_ns;
        while let Ok((to, datagram)) = self.origin.router.poll(now_ns) {
            assert_eq!(to, HOLDER);
            self.there.put(now_ns, datagram);
        }
        while let Some(datagram) = self.there.wire.take(now_ns) {
            self.holder.take(now_ns, &datagram);
        }
        self.holder.pass(now_ns);
        while let Ok((to, datagram)) = self.holder.router.poll(now_ns) {
            assert_eq!(to, ORIGIN);
            let Ok((head, Frame::Replica(ReplicaFrame::Request(request)))) = Frame::parse(&datagram) else {
                panic!("it only asks");
            };
            assert_eq!(head.kind, FrameKind::PartRequest);
            self.asked.push(request.read().sequence);
            self.back.put(now_ns, datagram);
        }
        while let Some(datagram) = self.back.wire.take(now_ns) {
            self.origin.router.take(now_ns, HOLDER, &datagram);
        }
        self.read();
    }

    fn read(&mut self) {
        loop {
            match self.reader.try_next().unwrap() {
                Next::Record(record) => {
                    let sequence = record.info().sequence;
                    assert!(record.body() == body(sequence, self.most), "record {sequence} is not as it was written");
                    assert!(self.last < Some(sequence), "{:?}, then {sequence}", self.last);
                    if !self.asked.contains(&sequence) {
                        let took_ns = self.now_ns - self.written_ns[sequence as usize];
                        self.slowest_ns = self.slowest_ns.max(took_ns);
                    }
                    self.last = Some(sequence);
                    self.read += 1;
                }
                Next::Lost(lost) => self.told += lost,
                Next::Nothing => return,
            }
        }
    }

    /// What was written is read or told as lost, and counted on both ends.
    pub(super) fn settle(&mut self) {
        self.there.loss = 0.0;
        self.run(1500 * MS);
        // Of three in a row one is sent at the least.
        for _ in 0..3 {
            self.write();
            self.run(20 * MS);
        }
        self.run(500 * MS);
        let (written, counts) = (self.writer.written(), self.holder.counts());
        assert!(self.last >= Some(written - 3), "the newest arrived: {:?} of {written}", self.last);
        // The first ones may have come to no ring.
        let first = written - self.read - self.told;
        assert!(first <= 12, "{first} of {written} are neither read nor told");
        assert_eq!((counts.records.get(), counts.gaps.get()), (self.read, self.told));
        let sent = self.origin.router.sender.counts()[0].clone();
        let left: u64 = [ReplicaLoss::Sampled, ReplicaLoss::Passed, ReplicaLoss::Absent]
            .map(|cause| sent.lost.of(cause))
            .iter()
            .sum();
        assert_eq!(sent.records.get() + left, written);
        assert!(self.told + first >= left);
        let never = [ReplicaLoss::Unwritable, ReplicaLoss::TooLarge, ReplicaLoss::Foreign];
        assert_eq!(never.map(|cause| self.holder.lost(cause)), [0; 3]);
        self.again = sent.again.get();
    }
}

/// Records of 60 kB: 44 parts.
pub(super) fn pictures() -> ReplicaSettings {
    ReplicaSettings { shape: StreamShape { record_bytes: 60_000, ..SHAPE }, ..image() }
}

pub(super) fn poses() -> ReplicaSettings {
    ReplicaSettings { shape: StreamShape { record_bytes: 64, keep: 64, ..SHAPE }, ..image() }
}

#[test]
fn lost_parts_are_asked_for_and_records_are_whole() {
    for (loss, least_percent, most_requests) in [(0.01, 100, 2), (0.05, 100, 4), (0.2, 98, 12)] {
        let (mut read, mut written, mut unsound) = (0, 0, 0);
        for seed in 0..8 {
            let mut pair = Pair::new(pictures(), seed, [loss, loss]);
            for _ in 0..100 {
                pair.write();
                pair.run(20 * MS);
            }
            pair.settle();
            let (records, completed) = (pair.writer.written(), pair.holder.counts().completed.get());
            assert!(pair.asked.len() as u64 <= most_requests * records, "{loss}, seed {seed}: {}", pair.asked.len());
            assert!(completed > 10 && completed <= pair.read, "{loss}, seed {seed}: {completed} completed by asking");
            // Of 44 parts about that share is lost, and some of those again.
            assert!((pair.again as f64) < 44.0 * records as f64 * (3.0 * loss + 0.05), "{loss}: {}", pair.again);
            unsound += pair.holder.lost(ReplicaLoss::Unsound);
            read += pair.read;
            written += records;
        }
        assert!(unsound > 10, "{loss}: {unsound} parts were moved");
        assert!(100 * read >= least_percent * written - 100, "{loss}: {read} of {written} are whole");
    }
}

#[test]
fn a_pose_waits_for_a_lost_one_as_long_as_an_answer_takes() {
    for seed in 0..10 {
        let mut pair = Pair::new(poses(), seed, [0.05, 0.05]);
        for count in 0..600 {
            pair.write();
            pair.run(5 * MS);
            if count == 100 {
                // By now it has measured how long an answer takes.
                pair.slowest_ns = 0;
            }
        }
        let (slowest_ns, asked) = (pair.slowest_ns, pair.asked.len() as u64);
        pair.settle();
        assert!(slowest_ns < 6 * MS, "seed {seed}: {slowest_ns} ns, a lost one is not waited for till the next one");
        assert!(100 * pair.read > 97 * pair.writer.written(), "seed {seed}: {} are read", pair.read);
        assert!(asked > 10 && asked < 120, "seed {seed}: {asked} requests for 600 poses");
    }
}

#[test]
fn what_was_left_out_on_purpose_is_not_asked_for() {
    for (sampling, seeds) in [(Sampling::Every(3), 0..6), (Sampling::Rate(80.0), 6..12)] {
        for seed in seeds {
            let mut pair = Pair::new(ReplicaSettings { sampling, ..poses() }, seed, [0.1, 0.1]);
            for _ in 0..400 {
                pair.write();
                pair.run(5 * MS);
            }
            pair.settle();
            let sent = pair.origin.router.sender.counts()[0].clone();
            assert!(sent.lost.of(ReplicaLoss::Sampled) > 200 && pair.asked.len() > 5, "{sampling}");
            assert_eq!(sent.lost.of(ReplicaLoss::NotSent), 0, "{sampling}, seed {seed}: {:?}", pair.asked);
            // Whatever is lost, and whichever of what was lost comes again: the sums are exact.
            let (missed, sampled) = (pair.reader.missed(), sent.lost.of(ReplicaLoss::Sampled));
            let ends = pair.writer.written() - pair.read - pair.told + 3;
            assert!((sampled - ends..=sampled).contains(&missed.sampled), "{sampling}: {missed:?} of {sampled}");
            let lost = sent.records.get() - pair.read;
            assert!((lost.saturating_sub(ends)..=lost).contains(&missed.lost), "{sampling}: {missed:?} of {lost}");
            if sampling == Sampling::Every(3) {
                assert!(pair.asked.iter().all(|sequence| sequence.is_multiple_of(3)), "{:?}", pair.asked);
            }
        }
    }
}

#[test]
fn a_record_behind_which_nothing_comes_is_completed() {
    for seed in 0..20 {
        let mut pair = Pair::new(pictures(), seed, [0.5, 0.2]);
        pair.write();
        pair.run(15 * MS);
        // What is missing is missing, and no newer record says so.
        pair.there.loss = 0.1;
        pair.run(400 * MS);
        assert_eq!(pair.last, Some(0), "seed {seed}: {} requests", pair.asked.len());
    }
}

#[test]
fn requests_without_an_answer_end() {
    let mut pair = Pair::new(pictures(), 1, [0.3, 1.0]);
    pair.write();
    pair.run(1000 * MS);
    let asked = pair.asked.len();
    assert!((2..12).contains(&asked), "{asked} requests for one record");
    pair.run(5000 * MS);
    assert_eq!((pair.asked.len(), pair.read), (asked, 0), "it has ended");
    // At most so many for each of two open records.
    for _ in 0..100 {
        pair.write();
        pair.run(20 * MS);
    }
    assert!(pair.asked.len() < 100 * 8, "{} requests for 100 records", pair.asked.len());
    pair.settle();
    assert_eq!(pair.again, 0);
}

#[test]
fn without_a_deadline_nothing_is_asked_for() {
    let mut pair = Pair::new(ReplicaSettings { deadline_ns: 0, ..pictures() }, 1, [0.05, 0.0]);
    for _ in 0..100 {
        pair.write();
        pair.run(20 * MS);
    }
    pair.settle();
    assert!(pair.asked.is_empty() && pair.told > 50, "{} are lost", pair.told);
}
