//! A stream from outside: its writer, its readers, and the ends of what it keeps. Looking takes no seat.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, MAILBOX, stay, tell};
use rohrpost_mailbox::{
    Name, Next, Participant, RecordInfo, Stamp, StreamError, StreamId, StreamInfo, StreamShape, WriteError,
};
use std::fs;
use std::time::Duration;

const ID: StreamId = StreamId { name: MAILBOX, number: 3 };
const MODULE: Name = Name::new(1, 60, 3, 0);
const SHAPE: StreamShape = StreamShape { record_bytes: 256, keep: 4, readers: 2, late: Duration::ZERO };

fn at(ns: u64) -> Stamp {
    Stamp { epoch: 1, ns }
}

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    assert_eq!(role, "write six");
    let participant = Participant::join(&ground.node(), MODULE).unwrap();
    let mut writer = participant.stream_writer(ID, SHAPE).unwrap();
    for number in 0..6 {
        writer.write(at(10 + number), &[7; 5]).unwrap();
    }
    tell("there");
    stay();
}

fn inspect(ground: &Ground) -> StreamInfo {
    ground.node().inspect_stream(ID).unwrap().unwrap()
}

/// Sequence, stamp and length.
fn said(record: Option<RecordInfo>) -> (u64, Stamp, usize) {
    record.map(|record| (record.sequence, record.stamp, record.len_bytes)).unwrap()
}

#[test]
fn a_stream_names_its_writer_and_whether_that_lives() {
    let ground = Ground::new();
    assert!(ground.node().inspect_stream(ID).unwrap().is_none());
    let child = ground.start("write six");
    assert_eq!(child.hear(), "there");
    let info = inspect(&ground);
    assert_eq!((info.id, info.shape, info.written, info.refused, info.adoptions), (ID, SHAPE, 6, 0, 0));
    assert_eq!((said(info.oldest), said(info.newest)), ((2, at(12), 5), (5, at(15), 5)));
    let (pid, writer) = (child.id(), info.writer.unwrap());
    assert_eq!((writer.pid, writer.module, writer.is_alive), (Some(pid), MODULE, true));
    child.kill();
    let writer = inspect(&ground).writer.unwrap();
    assert_eq!((writer.pid, writer.module, writer.is_alive), (Some(pid), MODULE, false));

    let mut writer = ground.join().stream_writer(ID, SHAPE).unwrap();
    assert!(matches!(writer.write(at(14), &[]), Err(WriteError::Late { .. })));
    let info = inspect(&ground);
    let now = info.writer.unwrap();
    assert_eq!((info.adoptions, info.refused, now.pid, now.module), (1, 1, Some(std::process::id()), Name::NONE));
}

#[test]
fn seats_in_use_are_counted_and_looking_takes_none() {
    let ground = Ground::new();
    let mut writer = ground.join().stream_writer(ID, SHAPE).unwrap();
    let empty = inspect(&ground);
    assert_eq!((empty.written, empty.oldest, empty.newest, empty.readers), (0, None, None, 0));
    let (mut first, second) = (ground.join().stream_reader(ID).unwrap(), ground.join().stream_reader(ID).unwrap());
    writer.write(at(1), b"a record").unwrap();
    let Next::Record(held) = first.try_next().unwrap() else { panic!("it was written") };
    let info = inspect(&ground);
    assert_eq!((info.readers, info.holding, info.sleeping), (2, 1, 0));
    drop((held, second));
    let info = inspect(&ground);
    assert_eq!((info.readers, info.holding), (1, 0));
}

#[test]
fn a_file_that_is_no_stream_is_told() {
    let ground = Ground::new();
    drop(ground.join().stream_writer(ID, SHAPE).unwrap());
    let node = ground.node();
    let file = fs::read_dir(node.path()).unwrap().map(|entry| entry.unwrap().path());
    let file = file.into_iter().find(|path| path.extension().is_some_and(|end| end == "ring")).unwrap();
    fs::write(file, b"a letter").unwrap();
    assert!(matches!(node.inspect_stream(ID), Err(StreamError::Bad(ID, _))));
}
