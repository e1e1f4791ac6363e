//! A stream's writer or reader that is stopped holds nobody up, and one that is killed leaves all as it should be:
//! stopped after each single instruction, and killed after some of them, or after each:
//! `ROHRPOST_INSTRUCTION_KILLS=1000000 cargo test -p rohrpost-mailbox --test stream_stops -- --nocapture`

#![cfg(all(target_os = "linux", target_arch = "x86_64"))]
#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::board::shared;
use common::crew::{Actor, alone, be_led, instruction_kills, master};
use common::records::Records;
use common::{Ground, MAILBOX, stay, tell, until};
use rohrpost_mailbox::{Next, RecordInfo, Stamp, StreamId, StreamReader, StreamShape, StreamWriter};
use std::sync::atomic::{AtomicU32, Ordering::SeqCst};
use std::time::Duration;

const ID: StreamId = StreamId { name: MAILBOX, number: 3 };
const KEEP: u64 = 4;
/// Copied while the writer goes on.
const RACING: StreamShape = StreamShape { record_bytes: 64, keep: KEEP as u32, readers: 4, late: Duration::ZERO };
/// Plain memory, read held.
const PLAIN: StreamShape = StreamShape { record_bytes: 4160, ..RACING };
/// Records that were written before; the next is the one that is led.
const BEFORE: u64 = 6;
/// A reader has copied its record, or holds it, before so many of its instructions.
const EARLY: u64 = 1200;
/// Looks of a reader at a record in its hand.
const LOOKS: usize = 4;
/// How it ended.
const DONE: u32 = 1;
const LOST: u32 = 2;

/// What a process does while it is led through it, instruction by instruction.
struct Operation {
    name: &'static str,
    shape: StreamShape,
    does: Does,
    /// Others go on after so many of its instructions.
    pace: u64,
    /// How it ends beside others that go on.
    ends: u32,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Does {
    /// Writes a record that is copied in.
    Write,
    /// Begins one, fills it in place and finishes it.
    Fill,
    /// Begins one and drops it.
    Abandon,
    /// Copies the newest record out.
    Copy,
    /// Holds it, looks at it again and again, and releases it.
    Hold,
    /// Opens the stream to read.
    Open,
    /// Goes on where a dead writer ended.
    Adopt,
    /// The same with records of another size.
    Replace,
}

impl Does {
    fn writes(self) -> bool {
        !matches!(self, Self::Copy | Self::Hold | Self::Open)
    }
}

const fn operation(name: &'static str, shape: StreamShape, does: Does) -> Operation {
    Operation { name, shape, does, pace: 1, ends: DONE }
}

/// Of a reader; the writer turns the ring between any two of its instructions.
const fn passed(name: &'static str, shape: StreamShape, does: Does) -> Operation {
    Operation { ends: LOST, ..operation(name, shape, does) }
}

const OPERATIONS: &[Operation] = &[
    operation("write", RACING, Does::Write),
    operation("write into plain memory", PLAIN, Does::Write),
    operation("begin, fill, finish", RACING, Does::Fill),
    operation("begin, fill in place, finish", PLAIN, Does::Fill),
    operation("begin and drop", PLAIN, Does::Abandon),
    passed("copy, passed", RACING, Does::Copy),
    passed("hold, passed", PLAIN, Does::Hold),
    Operation { pace: 150, ..operation("copy", RACING, Does::Copy) },
    Operation { pace: 150, ..operation("hold and release", RACING, Does::Hold) },
    Operation { pace: 150, ..operation("hold and release plain memory", PLAIN, Does::Hold) },
    operation("open", PLAIN, Does::Open),
    operation("adopt", RACING, Does::Adopt),
    operation("replace", RACING, Does::Replace),
];

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    assert_eq!(role, "instructions");
    let records = Records::new([16, 64, 40, 33, 57]);
    master(|| OPERATIONS.iter().for_each(|operation| operation.prove(&Scene { ground: &ground, records: &records })));
    tell("done");
}

// Other processors may have atomics of two instructions, of which the second fails when the process was stopped after
// the first.
#[test]
fn a_writer_or_reader_stopped_or_killed_after_any_instruction_harms_nobody() {
    alone(&Ground::in_memory(), "instructions");
}

#[derive(Clone, Copy)]
struct Scene<'a> {
    ground: &'a Ground,
    records: &'a Records,
}

impl Scene<'_> {
    fn writer(&self, shape: StreamShape) -> StreamWriter {
        self.ground.join().stream_writer(ID, shape).unwrap()
    }

    fn reader(&self) -> StreamReader {
        self.ground.join().stream_reader(ID).unwrap()
    }

    fn write(&self, writer: &mut StreamWriter) {
        let (number, mut body) = (writer.written(), [0; 64]);
        self.records.fill(number, &mut body);
        assert_eq!(writer.write(stamp(number), &body[..self.records.len(number)]), Ok(number));
    }

    fn check(&self, info: &RecordInfo, body: &[u8]) {
        self.records.check(info.sequence, body);
        assert_eq!(info.stamp, stamp(info.sequence));
    }

    /// Reads all that is there; each is whole, and the next.
    fn read_on(&self, reader: &mut StreamReader) {
        loop {
            let position = reader.position();
            match reader.try_next().unwrap() {
                Next::Record(record) => {
                    assert_eq!(record.info().sequence, position);
                    self.check(&record.info(), record.body());
                }
                Next::Lost(lost) => assert!(lost > 0),
                Next::Nothing => return,
            }
        }
    }
}

fn stamp(number: u64) -> Stamp {
    Stamp { epoch: 1, ns: number + 1 }
}

/// In the process that is led: stops itself, does it, says so, and stays.
fn led(operation: &Operation, scene: Scene<'_>, done: &AtomicU32) {
    let (shape, records) = (operation.shape, scene.records);
    let me = scene.ground.join();
    let mut ended = DONE;
    match operation.does {
        Does::Write | Does::Fill | Does::Abandon => {
            let (mut writer, mut body) = (scene.writer(shape), [0; 64]);
            records.fill(BEFORE, &mut body);
            let len = records.len(BEFORE);
            be_led();
            if operation.does == Does::Write {
                writer.write(stamp(BEFORE), &body[..len]).unwrap();
            } else {
                let mut open = writer.begin(stamp(BEFORE)).unwrap();
                open.body_mut()[..len].copy_from_slice(&body[..len]);
                if operation.does == Does::Fill {
                    open.finish(len).unwrap();
                }
            }
            done.store(ended, SeqCst);
            stay();
        }
        Does::Copy | Does::Hold => {
            let (mut reader, mut copy) =
                (me.stream_reader(ID).unwrap(), Vec::with_capacity(shape.record_bytes as usize));
            reader.seek(BEFORE - 1);
            be_led();
            if operation.does == Does::Copy {
                match reader.try_next_into(&mut copy).unwrap() {
                    Next::Record(info) => scene.check(&info, &copy),
                    _ => ended = LOST,
                }
            } else {
                match reader.try_next().unwrap() {
                    Next::Record(record) => (0..LOOKS).for_each(|_| scene.check(&record.info(), record.body())),
                    _ => ended = LOST,
                }
            }
            done.store(ended, SeqCst);
            stay();
        }
        Does::Open => {
            be_led();
            let _reader = me.stream_reader(ID).unwrap();
            done.store(ended, SeqCst);
            stay();
        }
        Does::Adopt | Does::Replace => {
            be_led();
            let _writer = me.stream_writer(ID, operation.shape_after()).unwrap();
            done.store(ended, SeqCst);
            stay();
        }
    }
}

/// What the others do: the master.
struct Others<'a> {
    scene: Scene<'a>,
    /// None while the one that is led writes.
    writer: Option<StreamWriter>,
    /// Reads one after the other.
    reader: StreamReader,
    /// Looks at what there is.
    looker: StreamReader,
    newest: u64,
}

impl<'a> Others<'a> {
    fn new(scene: Scene<'a>, operation: &Operation) -> Self {
        let writer = (!operation.does.writes()).then(|| scene.writer(operation.shape));
        Self { scene, writer, reader: scene.reader(), looker: scene.reader(), newest: BEFORE - 1 }
    }

    /// While another is stopped somewhere: writes a record, reads what is there, and finds the kept ones.
    fn go_on(&mut self, operation: &Operation) {
        if let Some(writer) = &mut self.writer {
            self.scene.write(writer);
        }
        self.scene.read_on(&mut self.reader);
        let newest = self.looker.newest().unwrap().map(|record| {
            self.scene.check(&record.info(), record.body());
            record.info().sequence
        });
        let Some(newest) = newest else {
            // The new one is empty, and its readers have it to themselves.
            return assert!(operation.does == Does::Replace, "{}: there is no newest record", operation.name);
        };
        let range = if self.writer.is_some() { self.newest + 1..=self.newest + 1 } else { self.newest..=BEFORE };
        assert!(range.contains(&newest), "{}: {newest} is the newest, after {}", operation.name, self.newest);
        self.newest = newest;
        // The oldest may be about to be overwritten.
        for sequence in newest + 2 - KEEP..=newest {
            let record = self.looker.record(sequence);
            let record = record.unwrap_or_else(|| panic!("{}: record {sequence} is missing", operation.name));
            self.scene.check(&record.info(), record.body());
        }
    }
}

impl Operation {
    /// What the stream is when it was done.
    fn shape_after(&self) -> StreamShape {
        if self.does == Does::Replace { PLAIN } else { self.shape }
    }

    /// Stops it after each instruction, so that others go on; then kills it after some.
    fn prove(&self, scene: &Scene<'_>) {
        let (stops, adversely) = self.lead(*scene, u64::MAX, |others, operation| others.go_on(operation));
        let (instructions, ended) = self.lead(*scene, u64::MAX, |_, _| ());
        assert_eq!((adversely, ended, instructions > 50), (self.ends, DONE, true), "{}: {instructions}", self.name);
        let kills = instruction_kills().min(instructions);
        for kill in 0..kills {
            self.lead(*scene, 1 + kill * instructions / kills, |_, _| ());
            if kill % 200 == 199 {
                tell(format_args!("{}: {kill} of {kills}", self.name));
            }
        }
        tell(format_args!(
            "{}: stopped after {stops} instructions, others going on after each {}; killed after {kills} of \
             {instructions}",
            self.name, self.pace
        ));
        if self.ends == LOST {
            self.prove_passed(scene);
        }
    }

    /// Leads a reader up to an instruction, turns the ring, and lets it go on: it has its record whole, or is told.
    fn prove_passed(&self, scene: &Scene<'_>) {
        let (turns, mut lost) = ((20 * instruction_kills()).min(EARLY), 0);
        for turn in 0..turns {
            let (actor, mut others, done) = self.begin(*scene);
            (0..=turn * EARLY / turns).for_each(|_| actor.step(self.name));
            (0..2 * self.shape.keep + u32::from(self.shape.readers)).for_each(|_| others.go_on(self));
            actor.go_on_alone();
            until("it ends", || {
                actor.assert_alive();
                done.load(SeqCst) != 0
            });
            lost += u64::from(done.load(SeqCst) == LOST);
            self.end(actor, others, true);
        }
        tell(format_args!("{}: after {turns} of its first {EARLY} instructions, and told so {lost} times", self.name));
        assert!(0 < lost && lost < turns, "{}: never, or always", self.name);
    }

    /// Leads a process through it, for so many instructions at most, then kills it. Returns how many there were, and
    /// how it ended.
    fn lead(&self, scene: Scene<'_>, most: u64, mut meanwhile: impl FnMut(&mut Others<'_>, &Self)) -> (u64, u32) {
        let (actor, mut others, done) = self.begin(scene);
        let mut instructions = 0;
        while done.load(SeqCst) == 0 && instructions < most {
            actor.step(self.name);
            instructions += 1;
            if instructions % self.pace == 0 {
                meanwhile(&mut others, self);
            }
        }
        // Stopped in its midst, whatever it holds there.
        if done.load(SeqCst) == 0 {
            others.go_on(self);
        }
        let ended = done.load(SeqCst);
        self.end(actor, others, ended != 0);
        (instructions, ended)
    }

    /// A stream with some records, one that is about to be led, and the others.
    fn begin<'a>(&self, scene: Scene<'a>) -> (Actor, Others<'a>, &'static AtomicU32) {
        scene.ground.node().remove_orphan_stream(ID).unwrap();
        let mut writer = scene.writer(self.shape);
        (0..BEFORE).for_each(|_| scene.write(&mut writer));
        drop(writer);
        let done = shared();
        let actor = Actor::new(|| led(self, scene, done));
        actor.stopped();
        (actor, Others::new(scene, self), done)
    }

    fn end(&self, actor: Actor, others: Others<'_>, is_done: bool) {
        actor.kill();
        others.scene.ground.node().announce_death();
        self.check(others, is_done);
    }

    /// No finished record is lost and no half one is there, the accounts are exact, all frames and seats come into use
    /// again.
    fn check(&self, mut others: Others<'_>, is_done: bool) {
        let (scene, led_writes) = (others.scene, matches!(self.does, Does::Write | Does::Fill));
        let mut writer = match others.writer.take() {
            Some(writer) => writer,
            None => {
                let writer = scene.writer(self.shape_after());
                let most = BEFORE + u64::from(led_writes);
                let least = if is_done { most } else { BEFORE.max(others.newest + 1) };
                assert!((least..=most).contains(&writer.written()), "{}: {}", self.name, writer.written());
                writer
            }
        };
        for _ in 0..4 * KEEP {
            scene.write(&mut writer);
            if writer.written().is_multiple_of(3) {
                scene.read_on(&mut others.reader);
            }
        }
        scene.read_on(&mut others.reader);
        let (written, (read, lost)) = (writer.written(), others.reader.accounts());
        assert_eq!((others.reader.position(), read + lost), (written, written - BEFORE), "{}: accounts", self.name);
        let kept = (0..written).filter(|sequence| others.reader.record(*sequence).is_some());
        assert!(kept.eq(written - KEEP..written), "{}: the kept records", self.name);
        drop(others);
        // Each of them finds a seat.
        drop((0..self.shape.readers).map(|_| scene.reader()).collect::<Vec<_>>());
    }
}
