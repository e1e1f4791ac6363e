//! Streams between processes: accounts, order, deaths of writers, replacing, waiting. Checksummed records are never
//! torn.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, MAILBOX, PATIENCE, shape, tell};
use rohrpost_mailbox::{
    Around, Label, Name, Next, Participant, Source, Stamp, StreamError, StreamId, StreamReader, StreamShape, Watches,
    WriteError, wait_any,
};
use std::os::unix::fs::FileExt;
use std::time::Duration;

const ID: StreamId = StreamId { name: MAILBOX, number: 3 };
/// Copied while the writer goes on.
const SMALL: StreamShape = StreamShape { record_bytes: 256, keep: 4, readers: 4, late: Duration::ZERO };
/// Plain memory, read held.
const LARGE: StreamShape = StreamShape { record_bytes: 8192, ..SMALL };
/// Records that the full-speed writer writes.
const RECORDS: u64 = 20_000;
const WRITERS_KILLED: usize = 5;

fn at(ns: u64) -> Stamp {
    Stamp { epoch: 1, ns }
}

/// A record that tells whether it is whole: its number, and bytes that follow from it.
fn body(number: u64, len: usize) -> Vec<u8> {
    let mut body = number.to_le_bytes().to_vec();
    body.extend((8..len as u64).map(|byte| (number.wrapping_mul(31) + byte) as u8));
    body
}

fn number(bytes: &[u8]) -> u64 {
    let number = u64::from_le_bytes(bytes[..8].try_into().unwrap());
    assert!(bytes == body(number, bytes.len()), "torn: record {number}");
    number
}

fn len_of(number: u64, shape: &StreamShape) -> usize {
    8 + (number as usize * 37) % (shape.record_bytes as usize - 8)
}

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    let participant = Participant::join(&ground.node(), Name::new(1, 200, 7, 0)).unwrap();
    let shape = if role.starts_with("large") { LARGE } else { SMALL };
    let mut writer = participant.stream_writer(ID, shape).unwrap();
    tell(writer.written());
    match role.as_str() {
        "small: write for ever" | "large: write for ever" => loop {
            let number = writer.written();
            let body = body(number, len_of(number, &shape));
            if number.is_multiple_of(2) {
                writer.write(at(number + 1), &body).unwrap();
            } else {
                let mut open = writer.begin(at(number + 1)).unwrap();
                open.body_mut()[..body.len()].copy_from_slice(&body);
                open.finish(body.len()).unwrap();
            }
        },
        "small: own" => std::thread::park(),
        other => panic!("no role {other}"),
    }
}

/// Reads until `end` records were read or lost, and checks each.
fn read_on(reader: &mut StreamReader, end: u64, held: bool) {
    let mut copy = Vec::new();
    while reader.position() < end {
        let before = reader.position();
        let next = if held {
            let next = reader.next_timeout(PATIENCE).unwrap();
            next.map(|record| (record.info(), number(record.body())))
        } else {
            let next = reader.next_timeout_into(&mut copy, PATIENCE).unwrap();
            next.map(|info| (info, number(&copy)))
        };
        match next {
            Next::Record((info, number)) => {
                assert_eq!((info.sequence, info.stamp), (before, at(before + 1)));
                assert_eq!(number, before);
            }
            Next::Lost(lost) => assert_eq!(reader.position(), before + lost),
            Next::Nothing => panic!("nothing within {PATIENCE:?}"),
        }
    }
}

#[test]
fn accounts_are_exact_and_nothing_is_torn_under_a_writer_at_full_speed() {
    for shape in [SMALL, LARGE] {
        let ground = Ground::in_memory();
        let mut writer = ground.join().stream_writer(ID, shape).unwrap();
        let readers: Vec<_> = (0..4)
            .map(|which| {
                let participant = ground.join();
                let mut reader = participant.stream_reader(ID).unwrap();
                std::thread::spawn(move || {
                    read_on(&mut reader, RECORDS, which % 2 == 0);
                    (reader.position(), reader.accounts())
                })
            })
            .collect();
        for number in 0..RECORDS {
            writer.write(at(number + 1), &body(number, len_of(number, &shape))).unwrap();
        }
        for reader in readers {
            let (position, (read, lost)) = reader.join().unwrap();
            assert_eq!((position, read + lost), (RECORDS, RECORDS));
        }
    }
}

#[test]
fn a_killed_writer_loses_no_finished_record_and_its_successor_continues() {
    for role in ["small: write for ever", "large: write for ever"] {
        let ground = Ground::in_memory();
        let mut reader = None;
        let mut end = 0;
        for _ in 0..WRITERS_KILLED {
            let writer = ground.start(role);
            let written: u64 = writer.hear().parse().unwrap();
            assert!(written >= end, "{written} records were written, and {end} were read");
            let reader = reader.get_or_insert_with(|| ground.join().stream_reader(ID).unwrap());
            end = reader.position() + 500;
            read_on(reader, end, true);
            end = reader.position();
            writer.kill();
        }
        let shape = if role.starts_with("large") { LARGE } else { SMALL };
        let writer = ground.join().stream_writer(ID, shape).unwrap();
        let mut reader = reader.unwrap();
        read_on(&mut reader, writer.written(), false);
        assert_eq!(reader.position(), writer.written());
        assert!(matches!(reader.try_next().unwrap(), Next::Nothing));
        let mut newest = Vec::new();
        assert_eq!(reader.newest_into(&mut newest).unwrap().unwrap().sequence, writer.written() - 1);
        assert_eq!(number(&newest), writer.written() - 1);
    }
}

#[test]
fn a_second_writer_is_refused_with_the_first_ones_name_and_process() {
    let ground = Ground::new();
    let first = ground.start("small: own");
    first.hear();
    for shape in [SMALL, LARGE] {
        let Err(StreamError::Owned { id, module, pid }) = ground.join().stream_writer(ID, shape) else {
            panic!("it has a writer");
        };
        assert_eq!((id, module, pid), (ID, Name::new(1, 200, 7, 0), first.id()));
    }
    first.kill();
    ground.join().stream_writer(ID, SMALL).unwrap();
}

#[test]
fn an_unfinished_record_is_nothing() {
    for shape in [SMALL, LARGE] {
        let (_ground, participant) = Ground::joined();
        let mut writer = participant.stream_writer(ID, shape).unwrap();
        let mut reader = participant.stream_reader(ID).unwrap();
        for _ in 0..100 {
            writer.begin(at(7)).unwrap().body_mut().fill(7);
        }
        assert!(!reader.has_next());
        let open = writer.begin(at(7)).unwrap();
        let error = open.finish(shape.record_bytes as usize + 1).unwrap_err();
        assert!(matches!(error, WriteError::TooLarge { .. }), "{error}");
        assert_eq!(writer.written(), 0);
        writer.write(at(5), b"first").unwrap();
        assert!(matches!(reader.try_next().unwrap(), Next::Record(record) if record.body() == b"first"));
    }
}

/// As many records are held as there are readers, and the writer turns the ring many times: each is still whole, and
/// none of the kept ones is missing.
#[test]
fn the_writer_goes_round_what_is_held() {
    for shape in [SMALL, LARGE] {
        let (_ground, participant) = Ground::joined();
        let mut writer = participant.stream_writer(ID, shape).unwrap();
        let mut readers: Vec<_> = (0..shape.readers).map(|_| participant.stream_reader(ID).unwrap()).collect();
        let mut held = Vec::new();
        for (reader, sequence) in readers.iter_mut().zip(0..) {
            writer.write(at(sequence + 1), &body(sequence, 100)).unwrap();
            held.push(reader.record(sequence).unwrap());
        }
        for sequence in writer.written()..100 {
            writer.write(at(sequence + 1), &body(sequence, 100)).unwrap();
            for (record, expected) in held.iter().zip(0..) {
                assert_eq!((number(record.body()), record.info().sequence), (expected, expected));
            }
        }
        drop(held);
        let kept = (0..100).filter(|sequence| readers[0].record(*sequence).is_some());
        assert!(kept.eq(96..100));
    }
}

#[test]
fn seats_are_counted_and_those_of_the_gone_are_free() {
    let (_ground, participant) = Ground::joined();
    let _writer = participant.stream_writer(ID, SMALL).unwrap();
    let mut readers: Vec<_> = (0..4).map(|_| participant.stream_reader(ID).unwrap()).collect();
    let error = participant.stream_reader(ID).err().unwrap();
    assert_eq!(error.to_string(), format!("stream {ID} has 4 readers already; end one, or raise its `readers`"));
    readers.pop();
    participant.stream_reader(ID).unwrap();
}

#[test]
fn readers_follow_to_a_stream_of_another_shape() {
    let (_ground, participant) = Ground::joined();
    let mut reader = participant.stream_reader(ID).unwrap();
    let mut newest_only = participant.stream_reader(ID).unwrap();
    assert!(matches!(reader.try_next().unwrap(), Next::Nothing), "there is no stream yet");
    for (round, shape) in [SMALL, LARGE, SMALL].into_iter().enumerate() {
        let first = round as u64 * 3;
        let mut writer = participant.stream_writer(ID, shape).unwrap();
        assert_eq!(writer.written(), first);
        for sequence in first..first + 3 {
            writer.write(at(sequence + 1), &body(sequence, 50)).unwrap();
        }
        assert_eq!(newest_only.newest().unwrap().map(|record| number(record.body())), Some(first + 2));
        // What the old stream held is read before the new one is entered.
        match round {
            0 => read_on(&mut reader, 1, false),
            1 => read_on(&mut reader, 5, true),
            _ => {}
        }
    }
    read_on(&mut reader, 9, false);
    assert_eq!(reader.accounts(), (9, 0));
    assert_eq!(reader.shape(), Some(&SMALL));
}

/// All seats are taken, and a stream that was given up is still the one of its name.
#[test]
fn readers_of_a_stream_without_a_free_seat_wait_for_what_replaces_it() {
    let (ground, participant) = Ground::joined();
    drop(participant.stream_writer(ID, SMALL).unwrap());
    let mut readers: Vec<_> = (0..SMALL.readers).map(|_| participant.stream_reader(ID).unwrap()).collect();
    // As a successor leaves it that dies before the new one has its name.
    let file = std::fs::File::options().write(true).open(ground.path().join(format!("{:08x}.3.ring", MAILBOX.raw())));
    file.unwrap().write_all_at(&1_u32.to_ne_bytes(), 80).unwrap();
    // The registry changes.
    drop(participant.stream_writer(StreamId { number: 4, ..ID }, SMALL).unwrap());
    for reader in &mut readers {
        assert!(matches!(reader.try_next().unwrap(), Next::Nothing));
    }
    let mut writer = participant.stream_writer(ID, LARGE).unwrap();
    writer.write(at(1), b"new").unwrap();
    for reader in &mut readers {
        assert!(matches!(reader.try_next().unwrap(), Next::Record(record) if record.body() == b"new"));
    }
}

#[test]
fn a_removed_stream_begins_anew() {
    let (ground, participant) = Ground::joined();
    let node = ground.node();
    let mut writer = participant.stream_writer(ID, SMALL).unwrap();
    writer.write(at(1), b"old").unwrap();
    let mut reader = participant.stream_reader(ID).unwrap();
    assert_eq!(node.streams().unwrap(), [ID]);
    assert!(!node.remove_orphan_stream(ID).unwrap(), "it has a writer");
    drop(writer);
    assert!(node.remove_orphan_stream(ID).unwrap());
    assert_eq!(node.streams().unwrap(), []);
    assert!(matches!(reader.try_next().unwrap(), Next::Nothing));
    let mut writer = participant.stream_writer(ID, SMALL).unwrap();
    writer.write(at(1), b"new").unwrap();
    assert!(matches!(reader.try_next().unwrap(), Next::Record(record) if record.body() == b"new"));
}

#[test]
fn stamps_behind_are_refused_and_counted_and_a_new_epoch_begins_anew() {
    let ground = Ground::new();
    let late = StreamShape { late: Duration::from_nanos(10), ..SMALL };
    let participant = ground.join();
    let mut writer = participant.stream_writer(ID, late).unwrap();
    writer.write(at(100), b"").unwrap();
    writer.write(at(90), b"").unwrap();
    assert_eq!(writer.write(at(89), b""), Err(WriteError::Late { id: ID, behind_ns: 11, late_ns: 10 }));
    assert_eq!(writer.write(at(0), b""), Err(WriteError::Unstamped(ID)));
    writer.write(Stamp { epoch: 2, ns: 5 }, b"").unwrap();
    assert_eq!(writer.write(at(100), b""), Err(WriteError::OldEpoch { id: ID, epoch: 1, newest: 2 }));
    assert_eq!(writer.refused(), 2);
    drop(writer);
    // What the successor knows of the newest stamp lies in the ring.
    let mut writer = participant.stream_writer(ID, late).unwrap();
    assert!(writer.write(at(100), b"").is_err());
    writer.write(Stamp { epoch: 2, ns: 1 }, b"").unwrap();
    assert_eq!((writer.written(), writer.refused()), (4, 3));
}

#[test]
fn the_two_around_a_time_or_exactly_why_not() {
    let (_ground, participant) = Ground::joined();
    let shape = StreamShape { keep: 16, late: Duration::from_nanos(20), ..SMALL };
    let mut reader = participant.stream_reader(ID).unwrap();
    assert_eq!(reader.around(at(1)).unwrap(), Around::Empty);
    let mut writer = participant.stream_writer(ID, shape).unwrap();
    assert_eq!(reader.around(at(1)).unwrap(), Around::Empty);
    for ns in [10, 30, 20, 40, 35, 60, 50, 44, 70] {
        writer.write(at(ns), &ns.to_le_bytes()).unwrap();
    }
    let around = |reader: &mut StreamReader, ns| match reader.around(at(ns)).unwrap() {
        Around::Records { before, after } => Ok((before.stamp.ns, after.stamp.ns)),
        other => Err(other),
    };
    assert_eq!(around(&mut reader, 45), Ok((44, 50)));
    assert_eq!(around(&mut reader, 42), Ok((40, 44)));
    assert_eq!(around(&mut reader, 35), Ok((35, 35)));
    assert_eq!(around(&mut reader, 9), Err(Around::BeforeOldest { by_ns: 1 }));
    assert_eq!(around(&mut reader, 55), Err(Around::NotYet { by_ns: 10 }), "one of 56 may come");
    assert_eq!(around(&mut reader, 71), Err(Around::NotYet { by_ns: 21 }));
    writer.write(at(80), b"").unwrap();
    assert_eq!(around(&mut reader, 55), Ok((50, 60)));
    writer.write(Stamp { epoch: 2, ns: 1 }, b"").unwrap();
    assert_eq!(around(&mut reader, 75), Ok((70, 80)), "no more of this epoch will come");
    assert_eq!(around(&mut reader, 81), Err(Around::OtherEpoch { newest: 2 }));
    let later = Stamp { epoch: 3, ns: 1 };
    assert_eq!(reader.around(later).unwrap(), Around::OtherEpoch { newest: 2 });
}

fn waits<S: Source + ?Sized>(sources: &mut [&mut S]) {
    wait_any(sources, PATIENCE, || false);
}

#[test]
fn one_bell_wakes_for_mailboxes_and_streams_and_watched_descriptors() {
    let (ground, participant) = Ground::joined();
    let mut receiver = participant.receiver(MAILBOX, shape(4)).unwrap();
    let mut reader = participant.stream_reader(ID).unwrap();
    let mut watches = Watches::new(&participant).unwrap();
    let (_far, near) = std::os::unix::net::UnixStream::pair().unwrap();
    watches.add(&near, rohrpost_mailbox::Interest::Read).unwrap();
    let others = ground.join();
    let (asked, ask) = std::sync::mpsc::channel::<u64>();
    let other = std::thread::spawn(move || {
        let mut sender = others.sender(MAILBOX).unwrap();
        let mut writer = None;
        for number in ask {
            if number % 2 == 0 {
                let writer = writer.get_or_insert_with(|| others.stream_writer(ID, SMALL).unwrap());
                writer.write(at(number + 1), b"a record").unwrap();
            } else {
                sender.send(&Label::default(), &[b"a package"]).unwrap();
            }
        }
    });
    for number in 0..400 {
        asked.send(number).unwrap();
        let arrived = loop {
            if number % 4 < 2 {
                waits::<dyn Source>(&mut [&mut receiver, &mut reader]);
            } else {
                watches.wait_any::<dyn Source>(&mut [&mut receiver, &mut reader], PATIENCE, || false);
            }
            if receiver.try_receive().is_some() {
                break 1;
            }
            if matches!(reader.try_next().unwrap(), Next::Record(_)) {
                break 0;
            }
        };
        assert_eq!(arrived, number % 2);
    }
    drop(asked);
    other.join().unwrap();
}
