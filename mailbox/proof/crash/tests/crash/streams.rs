//! Deaths of a stream's writer and of its readers.

use crate::aftermath::empty;
use crate::ground::{Death, Ground, MAILBOX, each_step};
use crate::victim::die_with;
use rohrpost_mailbox_crash::{Next, OriginRecord, Stamp, StreamId, StreamReader, StreamShape, StreamWriter};
use std::time::Duration;

const ID: StreamId = StreamId { name: MAILBOX, number: 1 };
/// Copied while the writer goes on.
const RACING: StreamShape = StreamShape { record_bytes: 64, keep: 4, readers: 2, late: Duration::ZERO };
/// Plain memory.
const PLAIN: StreamShape = StreamShape { record_bytes: 8192, ..RACING };
/// Records that the scenes write: more than are kept.
const WRITTEN: u64 = 5;
/// Records that a replica leaves out before the one that it writes: less than are kept, as many, and more.
const LEFT_OUT: [u64; 4] = [2, 4, 5, 12];

/// What the victims do. Those with records of plain memory say so.
pub(crate) fn act(role: &str, ground: &Ground, arm: impl Fn()) {
    let (role, shape) = match role.strip_prefix("plain: ") {
        Some(role) => (role, PLAIN),
        None => (role, RACING),
    };
    match role {
        "make" => {
            let participant = ground.join();
            arm();
            die_with(participant.stream_writer(ID, shape).unwrap());
        }
        "write" => {
            let mut writer = writer(ground, shape);
            arm();
            write(&mut writer);
            die_with(writer);
        }
        "fill in place" => {
            let mut writer = writer(ground, shape);
            arm();
            let number = writer.written();
            let mut open = writer.begin(stamp(number)).unwrap();
            open.body_mut()[..16].copy_from_slice(&bytes(number));
            open.finish(16).unwrap();
            die_with(writer);
        }
        leaving if leaving.starts_with("leave out ") => {
            let left_out: u64 = leaving["leave out ".len()..].parse().unwrap();
            let mut replica = ground.join().replica_writer(ID, shape, WRITTEN).unwrap();
            arm();
            let sequence = WRITTEN + left_out;
            let record = OriginRecord { sequence, incarnation: 1, stamp: stamp(sequence), len_bytes: 16 };
            // An older one is begun as well, and never whole.
            let older = OriginRecord { sequence: WRITTEN, stamp: stamp(WRITTEN), ..record };
            for begun in [older, record] {
                replica.begin(begun).unwrap();
                assert!(replica.put(begun.sequence, 0, &bytes(begun.sequence)));
            }
            replica.finish(sequence, 0).unwrap();
            die_with(replica);
        }
        "read" => {
            let participant = ground.join();
            arm();
            let mut reader = participant.stream_reader(ID).unwrap();
            let newest = reader.newest().unwrap().map(|record| number(record.body()));
            assert_eq!(newest, Some(WRITTEN - 1));
            die_with(reader);
        }
        "sleep" => {
            let mut reader = ground.join().stream_reader(ID).unwrap();
            arm();
            let _ = reader.next_timeout(Duration::from_millis(1)).unwrap();
            die_with(reader);
        }
        "remove an orphan" => {
            let node = ground.node();
            arm();
            assert!(node.remove_orphan_stream(ID).unwrap());
        }
        other => panic!("there is no victim {other}"),
    }
}

fn stamp(number: u64) -> Stamp {
    Stamp { epoch: 1, ns: number + 1 }
}

/// The number and its complement, so that a torn record is seen.
fn bytes(number: u64) -> [u8; 16] {
    let mut bytes = [0; 16];
    bytes[..8].copy_from_slice(&number.to_le_bytes());
    bytes[8..].copy_from_slice(&(!number).to_le_bytes());
    bytes
}

fn number(bytes: &[u8]) -> u64 {
    let halves = [0, 8].map(|at| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()));
    assert!(bytes.len() == 16 && halves[0] == !halves[1], "torn: {bytes:?}");
    halves[0]
}

fn writer(ground: &Ground, shape: StreamShape) -> StreamWriter {
    ground.join().stream_writer(ID, shape).unwrap()
}

fn write(writer: &mut StreamWriter) {
    let number = writer.written();
    writer.write(stamp(number), &bytes(number)).unwrap();
}

/// A stream without writer, and a reader that stands at its next record.
fn orphan(ground: &Ground, shape: StreamShape) -> StreamReader {
    let mut writer = writer(ground, shape);
    (0..WRITTEN).for_each(|_| write(&mut writer));
    ground.join().stream_reader(ID).unwrap()
}

/// Reads what is there; each record has the number that it should have.
fn read_on(reader: &mut StreamReader) {
    loop {
        let position = reader.position();
        match reader.try_next().unwrap() {
            Next::Record(record) => assert_eq!((record.info().sequence, number(record.body())), (position, position)),
            Next::Lost(lost) => assert!(lost > 0),
            Next::Nothing => return,
        }
    }
}

/// The reader's accounts are exact, all frames are used without a torn record, all seats are free, and all goes away.
fn all_usable(ground: &Ground, mut writer: StreamWriter, mut reader: StreamReader, began: u64) {
    read_on(&mut reader);
    let keep = u64::from(writer.shape().keep);
    for _ in 0..4 * keep {
        write(&mut writer);
        if writer.written().is_multiple_of(3) {
            read_on(&mut reader);
        }
    }
    read_on(&mut reader);
    let (read, lost) = reader.accounts();
    assert_eq!((reader.position(), read + lost), (writer.written(), writer.written() - began), "the accounts");
    let kept = (0..writer.written()).filter(|sequence| reader.record(*sequence).is_some());
    assert!(kept.eq(writer.written() - keep..writer.written()), "the kept records");
    drop(reader);
    let seats: Vec<_> = (0..writer.shape().readers).map(|_| ground.join().stream_reader(ID).unwrap()).collect();
    drop((seats, writer));
    empty(ground);
}

/// Steps at which the record is finished.
fn is_finished(death: Option<&Death>) -> bool {
    let after = ["entry: published", "publish: counted", "publish: before wake", "wake: rung"];
    let begins = ["bell: ", "ring: "];
    death.is_none_or(|death| {
        after.contains(&death.step.as_str()) || begins.iter().any(|begin| death.step.starts_with(begin))
    })
}

fn a_successor_goes_on(ground: &Ground, reader: StreamReader, shape: StreamShape, death: Option<&Death>) {
    let writer = writer(ground, shape);
    let written = WRITTEN + u64::from(is_finished(death));
    assert_eq!(writer.written(), written, "a finished record is lost, or an unfinished one is none: {death:?}");
    all_usable(ground, writer, reader, WRITTEN);
}

#[test]
fn a_writer_dies_writing() {
    for (role, shape) in [
        ("stream: write", RACING),
        ("stream: plain: write", PLAIN),
        ("stream: fill in place", RACING),
        ("stream: plain: fill in place", PLAIN),
    ] {
        each_step(
            role,
            4,
            |ground| orphan(ground, shape),
            |ground, reader, death| {
                a_successor_goes_on(ground, reader, shape, death);
            },
        );
    }
}

/// Its successor goes on behind what it had left out by then, or behind the record; a reader that holds what the dead
/// one left keeps it, whatever is written.
#[test]
fn a_writer_of_a_replica_dies_leaving_records_out() {
    for (bytes, shape) in [("", RACING), ("plain: ", PLAIN)] {
        for left_out in LEFT_OUT {
            each_step(
                &format!("stream: {bytes}leave out {left_out}"),
                6,
                |ground| orphan(ground, shape),
                |ground, mut reader, death| {
                    let mut holder = ground.join().stream_reader(ID).unwrap();
                    let mut writer = writer(ground, shape);
                    let (written, finished) = (writer.written(), WRITTEN + left_out + 1);
                    // Entries of what is left out are published as well.
                    let may_be = death.is_some_and(|death| death.step == "entry: published");
                    assert!((WRITTEN..=finished).contains(&written), "{written}: {death:?}");
                    assert!(may_be || is_finished(death) == (written == finished), "{written}: {death:?}");
                    read_on(&mut reader);
                    assert_eq!(reader.position(), written, "a reader waits for what was left out: {death:?}");
                    let last = (0..written).rev().find(|sequence| holder.record(*sequence).is_some());
                    let held = last.and_then(|last| holder.record(last));
                    assert!(held.is_some() || left_out >= u64::from(shape.keep), "{death:?}");
                    for _ in 0..3 * shape.keep {
                        write(&mut writer);
                        assert_eq!(held.as_ref().map(|held| number(held.body())), last, "{death:?}");
                    }
                    drop(held);
                    drop(holder);
                    all_usable(ground, writer, reader, WRITTEN);
                },
            );
        }
    }
}

/// The reader that sleeps is dead as well: the writer rings for nobody.
#[test]
fn a_writer_dies_waking() {
    let scene = |ground: &Ground| {
        let reader = orphan(ground, RACING);
        let asleep = (1..).find(|step| ground.run("stream: sleep", *step).unwrap().step == "wait: drowsy");
        assert!(asleep.is_some());
        reader
    };
    each_step("stream: write", 6, scene, |ground, reader, death| {
        a_successor_goes_on(ground, reader, RACING, death);
    });
}

/// The one before died when its record was finished, and not counted yet.
#[test]
fn a_successor_dies_as_well() {
    let scene = |ground: &Ground| {
        let reader = orphan(ground, RACING);
        let finished = (1..).find(|step| ground.run("stream: write", *step).unwrap().step == "entry: published");
        assert!(finished.is_some());
        reader
    };
    each_step("stream: make", 3, scene, |ground, reader, _| a_successor_goes_on(ground, reader, RACING, None));
}

#[test]
fn a_writer_dies_making_a_stream() {
    let scene = |ground: &Ground| ground.join().stream_reader(ID).unwrap();
    each_step("stream: make", 6, scene, |ground, reader, _| {
        all_usable(ground, writer(ground, RACING), reader, 0);
    });
}

#[test]
fn a_writer_dies_replacing_a_stream_of_another_shape() {
    each_step(
        "stream: plain: make",
        8,
        |ground| orphan(ground, RACING),
        |ground, reader, death| {
            let writer = writer(ground, PLAIN);
            assert_eq!(writer.written(), WRITTEN, "the sequence goes on: {death:?}");
            all_usable(ground, writer, reader, WRITTEN);
        },
    );
}

#[test]
fn a_reader_dies_reading() {
    let scene = |ground: &Ground| {
        let reader = orphan(ground, PLAIN);
        (writer(ground, PLAIN), reader)
    };
    each_step("stream: plain: read", 5, scene, |ground, (writer, reader), _| {
        all_usable(ground, writer, reader, WRITTEN);
    });
}

#[test]
fn a_remover_of_an_orphan_stream_dies() {
    each_step(
        "stream: remove an orphan",
        3,
        |ground| orphan(ground, RACING),
        |ground, reader, death| {
            drop(reader);
            let writer = writer(ground, RACING);
            let is_there = death.is_some_and(|death| death.step == "retire: before ring");
            let is_replaced = death.is_some_and(|death| death.step == "retire: ring");
            assert_eq!(writer.written(), if is_there || is_replaced { WRITTEN } else { 0 }, "{death:?}");
            let reader = ground.join().stream_reader(ID).unwrap();
            let began = writer.written();
            all_usable(ground, writer, reader, began);
        },
    );
}
