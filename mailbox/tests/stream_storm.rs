//! The writer and eight readers of a stream killed and stopped at random moments, thousands of times: no record is torn
//! or out of order, no finished one is lost, and each reader's account is exact.
//!
//! In the full run each size of records sees 10 000 kills:
//! `ROHRPOST_STORM_KILLS=10000 cargo test -p rohrpost-mailbox --test stream_storm -- --nocapture`
//!
//! A writer writes down how many records it has written after each of them, so the record in which it is killed may be
//! finished or not. A reader writes down what it has read and lost; at rest both are all that was written since it
//! began.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::crew::{Actor, alone, master};
use common::random::Random;
use common::records::Records;
use common::stream_load::{Ledger, Reading, STREAM, Writing, records_between};
use common::{Ground, PATIENCE, tell};
use rohrpost_mailbox::{Node, StreamShape};
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::Ordering::SeqCst;
use std::time::{Duration, Instant};

const READERS: usize = 8;
/// The seat of the writer.
const WRITER: usize = READERS;
/// Kills from one look at everything to the next, and until all are killed at once.
const CALM_EVERY: u64 = 40;
const AUDIT_EVERY: u64 = 400;

/// Sizes of records: copied while the writer goes on, or plain memory. Of each two shapes, which replace each other.
const SIZES: [(&str, [StreamShape; 2]); 2] =
    [("small", [shape(4096, 16), shape(4000, 3)]), ("large", [shape(20_000, 3), shape(16_384, 8)])];

const fn shape(record_bytes: u32, keep: u32) -> StreamShape {
    StreamShape { record_bytes, keep, readers: READERS as u16, late: Duration::ZERO }
}

fn kills() -> u64 {
    std::env::var("ROHRPOST_STORM_KILLS").map_or(400, |kills| kills.parse().expect("a number of kills"))
}

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    let (_, shapes) = SIZES.into_iter().find(|(size, _)| role.ends_with(size)).unwrap();
    let longest = shapes.iter().map(|shape| shape.record_bytes).min().unwrap() as usize;
    let records = records_between(if longest > 4096 { 4096 } else { 64 }, longest);
    master(|| Storm::new(&ground, shapes, &records).rage(kills()));
    tell("done");
}

#[test]
fn kills_and_stops_tear_no_small_record_and_leave_each_account_exact() {
    alone(&Ground::in_memory(), "storm, small");
}

#[test]
fn kills_and_stops_tear_no_large_record_and_leave_each_account_exact() {
    alone(&Ground::in_memory(), "storm, large");
}

struct Storm<'a> {
    ground: &'a Ground,
    node: Arc<Node>,
    shapes: [StreamShape; 2],
    records: &'a Records,
    ledger: Ledger,
    random: Random,
    actors: Vec<Actor>,
    shape: usize,
    kills: u64,
    /// Kills of those that were inside an operation.
    in_flight: u64,
    stops: u64,
    replacements: u64,
    deadline: Instant,
}

impl<'a> Storm<'a> {
    fn new(ground: &'a Ground, shapes: [StreamShape; 2], records: &'a Records) -> Self {
        let mut storm = Self {
            ground,
            node: ground.node(),
            shapes,
            records,
            ledger: Ledger::new(READERS),
            random: Random::from_environment(),
            actors: Vec::new(),
            shape: 0,
            kills: 0,
            in_flight: 0,
            stops: 0,
            replacements: 0,
            deadline: Instant::now() + PATIENCE,
        };
        storm.start_all();
        storm
    }

    fn rage(&mut self, kills: u64) {
        let began = Instant::now();
        while self.kills < kills {
            std::thread::sleep(Duration::from_micros(self.random.below(2_000)));
            let before = self.kills;
            self.stop_one();
            self.kill_one();
            let is_time = |every: u64| self.kills / every > before / every;
            let (calm, audit) = (is_time(CALM_EVERY), is_time(AUDIT_EVERY) || self.kills >= kills);
            if calm {
                self.calm();
            }
            if audit {
                self.kill_all();
                self.audit();
                tell(format_args!("{} kills in {:.1?}", self.kills, began.elapsed()));
                self.start_all();
            }
        }
        self.calm();
        self.kill_all();
        self.audit();
        assert!(self.node.participants().is_empty());
        self.assert_was_busy(kills);
    }

    fn start_all(&mut self) {
        self.actors = (0..=READERS).map(|seat| self.start(seat)).collect();
    }

    fn start(&mut self, seat: usize) -> Actor {
        self.ledger.reset(seat);
        let path = self.ground.path();
        if seat < READERS {
            let reading = self.reading(seat);
            return Actor::new(|| reading.read_on(path));
        }
        if self.random.one_in(6) {
            self.shape ^= 1;
            self.replacements += 1;
        }
        let (shape, writing) = (self.shapes[self.shape], self.writing());
        Actor::new(|| writing.write_on(path, shape))
    }

    fn reading(&mut self, seat: usize) -> Reading<'a> {
        let random = Random::new(self.random.below(1 << 40));
        Reading { ledger: self.ledger, records: self.records, random, rests: true, seat, copy: Vec::new() }
    }

    fn writing(&mut self) -> Writing<'a> {
        let random = Random::new(self.random.below(1 << 40));
        let body = vec![0; self.shapes[self.shape].record_bytes as usize];
        Writing { ledger: self.ledger, records: self.records, random, rests: true, body }
    }

    /// A reader that is stopped costs the others nothing, and a stopped writer harms none; stopped they may be killed.
    fn stop_one(&mut self) {
        let seat = self.random.below(self.actors.len() as u64) as usize;
        self.deadline = Instant::now() + PATIENCE;
        self.actors[seat].stop();
        self.stops += 1;
        if seat == WRITER {
            std::thread::sleep(Duration::from_micros(self.random.below(1_000)));
        } else {
            let operations = |storm: &Self| storm.ledger.board.seat(WRITER).operations();
            let before = operations(self);
            self.wait("the writer goes on beside a stopped reader", |storm| operations(storm) >= before + 20);
        }
        if self.random.one_in(4) {
            return self.replace(seat);
        }
        self.actors[seat].go_on();
    }

    /// One of them, wherever it is; another takes its seat.
    fn kill_one(&mut self) {
        let seat = if self.random.one_in(3) { WRITER } else { self.random.below(READERS as u64) as usize };
        self.deadline = Instant::now() + PATIENCE;
        // Some while they start; most at work, however busy the computer is.
        if !self.random.one_in(4) {
            self.wait("the process to be killed works", |storm| storm.ledger.board.seat(seat).is_ready());
            std::thread::sleep(Duration::from_micros(self.random.below(500)));
        }
        self.replace(seat);
    }

    fn replace(&mut self, seat: usize) {
        let actor = self.actors.swap_remove(seat);
        self.kill(actor, seat);
        let instead = self.start(seat);
        self.actors.push(instead);
        let last = self.actors.len() - 1;
        self.actors.swap(seat, last);
    }

    fn kill_all(&mut self) {
        for (seat, actor) in std::mem::take(&mut self.actors).into_iter().enumerate() {
            self.kill(actor, seat);
        }
    }

    fn kill(&mut self, actor: Actor, seat: usize) {
        actor.kill();
        self.kills += 1;
        self.in_flight += u64::from(self.ledger.board.seat(seat).is_busy());
        self.node.announce_death();
    }

    /// Nobody writes: a reader that sleeps beside a record now has missed its wake-up. Each account is exact.
    fn calm(&mut self) {
        self.deadline = Instant::now() + PATIENCE;
        self.ledger.board.hold(true);
        self.wait("the writer holds still", |storm| storm.ledger.board.is_still(WRITER));
        self.wait("each reader accounts for all", |storm| (0..READERS).all(|seat| storm.ledger.is_at_rest(seat)));
        // A reader that has read all of a stream goes over to the one that replaced it.
        let info = |storm: &Self| storm.node.inspect_stream(STREAM).unwrap().unwrap();
        self.wait("each reader has a seat", |storm| usize::from(info(storm).readers) == READERS);
        let (info, written) = (info(self), self.ledger.written().load(SeqCst));
        let newest = info.newest.map_or(written, |newest| newest.sequence + 1);
        assert_eq!((info.written, newest), (written, written), "{self}");
        self.ledger.board.hold(false);
    }

    fn wait(&self, what: &str, done: impl Fn(&Self) -> bool) {
        while !done(self) {
            self.actors.iter().for_each(Actor::assert_alive);
            assert!(
                Instant::now() < self.deadline,
                "{self}: waited too long until {what}: {:#?}",
                self.node.inspect_stream(STREAM)
            );
            std::thread::sleep(Duration::from_micros(100));
        }
    }

    /// Goes on from what processes left that were all killed at once; each frame and each seat is used again.
    fn audit(&mut self) {
        let me = self.ground.join();
        let shape = self.shapes[self.shape];
        let mut writer = me.stream_writer(STREAM, shape).unwrap();
        self.ledger.succeed(&writer);
        let mut readers: Vec<_> = (0..READERS).map(|_| me.stream_reader(STREAM).unwrap()).collect();
        let began = writer.written();
        let (mut writing, mut reading) = (self.writing(), self.reading(0));
        for _ in 0..3 * (u64::from(shape.keep) + READERS as u64) {
            writing.write(&mut writer);
            for (seat, reader) in readers.iter_mut().enumerate() {
                reading.seat = 2 * (seat % 2);
                reading.read(reader);
            }
        }
        for reader in &mut readers {
            while reader.has_next() {
                reading.read(reader);
            }
            let (read, lost) = reader.accounts();
            assert_eq!(read + lost, writer.written() - began, "{self}");
        }
        self.ledger.written().store(writer.written(), SeqCst);
    }

    /// A storm in which little happens would prove little.
    fn assert_was_busy(&self, kills: u64) {
        let [written, read, lost] =
            [self.ledger.written(), self.ledger.all_read(), self.ledger.all_lost()].map(|word| word.load(SeqCst));
        tell(format_args!("{self}: {written} written, {read} read, {lost} lost"));
        assert!(written > kills && read > kills && lost > kills && self.in_flight > kills / 10, "too quiet: {self}");
        assert!(self.replacements > 0, "never replaced: {self}");
    }
}

impl fmt::Display for Storm<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kills, in_flight, stops, replacements, .. } = self;
        write!(f, "{kills} kills, {in_flight} in flight, {stops} stops, {replacements} replacements")
    }
}
