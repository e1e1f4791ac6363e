//! `rohrpost stream` and streams in `rohrpost clean`: written by one process, looked at and read by others.

use crate::completions::offered;
use crate::harness::{Place, assert_has, json_lines, probe, until};
use crate::process::Running;
use rohrpost::Name;
use rohrpost_mailbox::{Node, Participant, Stamp, StreamId, StreamShape};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};

/// As the harness' configuration has it.
const PROBE: Name = Name::new(1, 96, 0, 0);
/// Another one, so that launch sees no second process of a module of its own.
const WRITER: Name = Name::new(1, 96, 7, 0);

fn id(number: u16) -> StreamId {
    StreamId { name: PROBE, number }
}

/// Not a test: a process that writes three records and stays the writer. Run as a test it ends at once.
#[test]
fn writer() {
    let Some(path) = std::env::var_os("ROHRPOST_TEST_WRITES") else { return };
    let node = Node::open(path.as_ref()).unwrap();
    let participant = Participant::join(&node, WRITER).unwrap();
    let mut writer = participant.stream_writer(id(5), StreamShape::default()).unwrap();
    for second in 1..=3 {
        writer.write(Stamp { epoch: 1, ns: second * 1_000_000_000 }, b"written by a module").unwrap();
    }
    println!("@written");
    std::thread::sleep(crate::harness::PATIENCE);
}

fn start_writer(node: &Path) -> Running {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "streams::writer", "--nocapture"]).env("ROHRPOST_TEST_WRITES", node);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut writer = Running::start(command);
    writer.wait_for("@written");
    writer
}

#[test]
fn files_that_were_written_are_listed_and_read_back() {
    let (place, mut launch, _robot) = Place::running(&[&probe("probe.0", "", "")]);
    assert_eq!(place.say(&["stream", "list"]).ok(), "node main of test has no streams\n");
    for (file, bytes) in [("a", &b"hello"[..]), ("b", b"\x1b[2J"), ("c", b"")] {
        place.write(file, bytes);
    }
    let stamped = ["--stamp", "1000", "--delay", "0.25", "--keep", "4", "--readers", "2"];
    let said = place.say(&[&["stream", "write", "probe.0", "7", "a", "b", "c"], &stamped[..]].concat()).ok();
    assert_eq!(
        said,
        "wrote #0  1000.000000000  5 B  a\nwrote #1  1000.250000000  4 B  b\nwrote #2  1000.500000000  0 B  c\n"
    );
    let listing = place.say(&["stream", "list", "--json"]).json();
    let stream = &listing["streams"][0];
    for (key, value) in [
        ("stream", Value::from("probe.0")),
        ("number", 7.into()),
        ("record_bytes", 1024.into()),
        ("keep", 4.into()),
        ("readers", 0.into()),
        ("readers_max", 2.into()),
        ("written", 3.into()),
        ("refused", 0.into()),
    ] {
        assert_eq!(stream[key], value, "{key}: {listing:#}");
    }
    assert_eq!(stream["writer"]["alive"], false, "the tool that wrote has ended: {listing:#}");
    place.say(&["stream", "list"]).ok_with(["probe.0  -          7  4 x 1024 B   0 of 2  nobody"]);

    let read = |more: &[&str]| place.say(&[&["stream", "read", "probe.0", "7"], more].concat());
    assert_eq!(read(&[]).ok(), "#2  1000.500000000  0 B\n", "the newest");
    assert_eq!(
        read(&["--from", "0"]).ok(),
        "#0  1000.000000000  5 B  68656c6c6f\n#1  1000.250000000  4 B  1b5b324a\n#2  1000.500000000  0 B\n"
    );
    assert_eq!(
        read(&["--from", "0", "--next", "1", "--bytes", "2"]).ok(),
        "#0  1000.000000000  5 B  6865 … 3 B more\n"
    );
    assert_eq!(read(&["--from", "0", "--raw", "-"]).ok(), "hello\x1b[2J");
    read(&["--from", "0", "--raw", "copy"]).ok();
    assert_eq!(std::fs::read(place.path("copy")).unwrap(), b"hello\x1b[2J");
    let records = json_lines(&read(&["--from", "1", "--json"]).ok());
    assert_eq!((records.len(), &records[0]["hex"], &records[1]["sequence"]), (2, &"1b5b324a".into(), &2.into()));
    // Five more: of eight, four are kept.
    place.say(&["stream", "write", "probe.0", "7", "a", "a", "a", "a", "a"]).ok();
    let lines = read(&["--from", "1"]).ok();
    let missed = "(3 missed: 3 passed over: newer records took their places before they were read)";
    assert!(lines.starts_with(&format!("{missed}\n#4  ")), "{lines}");
    assert_eq!(lines.lines().count(), 5, "{lines}");
    read(&["--from", "9"]).fails_with(["probe.0 7: record #9 is not written yet; #4 to #7 are there"]);
    place.end(&mut launch);
}

#[test]
fn the_two_records_around_a_time_are_read_or_it_is_said_why_not() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let mut writer = start_writer(robot.node.path());
    let at =
        |stamp: &str, more: &[&str]| place.say(&[&["stream", "read", "probe.0", "5", "--at", stamp], more].concat());
    let text = at("1.5", &["--bytes", "3"]).ok();
    assert_eq!(
        text,
        "before  #0  1.000000000  19 B  777269 … 16 B more\nafter   #1  2.000000000  19 B  777269 … 16 B more\n"
    );
    let exact = json_lines(&at("2", &["--json"]).ok());
    assert_eq!((&exact[0]["sequence"], &exact[1]["sequence"]), (&1.into(), &1.into()));
    assert_eq!((&exact[0]["side"], &exact[1]["side"]), (&"before".into(), &"after".into()));
    for (stamp, more, words) in [
        ("0.5", &[][..], "probe.0 5: the record before that time is not there"),
        ("3.5", &[], "probe.0 5: not yet: nearer records may come until stamps are at most 0.500000000 s further"),
        ("1", &["--epoch", "2"], "no two records of epoch 2 are around that time"),
    ] {
        at(stamp, more).fails_with([words]);
    }
    let said = at("3.5", &["--json"]);
    let refusal: Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!((said.code, &refusal["answer"], &refusal["by_ns"]), (Some(1), &"not yet".into(), &500_000_000.into()));
    writer.kill();
    launch.stop();
}

#[test]
fn a_second_writer_is_refused_and_a_reader_waits_for_the_next_record() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let mut writer = start_writer(robot.node.path());
    place.write("a", b"hello");
    let told = place.say(&["stream", "write", "probe.0", "5", "a"]).fails();
    let words = format!("stream probe.0 5 is written by probe.7, process {}; a stream has one writer", writer.pid());
    assert!(told.contains(&words), "{told}");
    let info = place.say(&["stream", "info", "probe.0", "5"]).ok();
    assert_has(
        &info,
        [
            "stream probe.0 5, node main\n",
            &format!("writer      probe.7, process {}\n", writer.pid()),
            "readers     0 of 8 seats in use; 0 hold a record, 0 sleep\n",
            "newest      #2, stamp 3.000000000 of epoch 1, 19 B, written ",
        ],
    );
    for (arguments, words) in [
        (&["stream", "info", "probe.0", "6"][..], "probe.0 has no stream 6; it has 5"),
        (&["stream", "read", "probe.1", "5"], "node main has no stream of probe.1; `rohrpost stream list` lists all"),
        (&["stream", "write", "probe.0", "6", "."], "is no file; each record is written from one"),
        (&["stream", "read", "probe.0", "5", "--next", "1", "--timeout", "0.05"], "no record within 50ms"),
    ] {
        place.say(arguments).fails_with([words]);
    }
    assert_eq!(offered(&place, &["rohrpost", "stream", "read", ""]), ["probe.0"]);
    assert_eq!(offered(&place, &["rohrpost", "stream", "info", "probe.0", ""]), ["5"]);

    writer.kill();
    let reader = place.start(&["stream", "read", "probe.0", "5", "--next", "2"]);
    let readers = || robot.node.inspect_stream(id(5)).unwrap().map(|info| info.readers);
    until("the reader has its seat", || readers() == Some(1));
    let info = place.say(&["stream", "info", "probe.0", "5", "--json"]).json();
    assert_eq!((&info["writer"]["alive"], &info["readers"]), (&false.into(), &1.into()));
    // Now nobody writes: the next writer goes on.
    place.say(&["stream", "write", "probe.0", "5", "a", "a"]).ok();
    let read = reader.said().ok();
    let sequences: Vec<&str> = read.lines().filter_map(|line| line.split(' ').next()).collect();
    assert_eq!(sequences, ["#3", "#4"], "{read}");
    launch.stop();
}

#[test]
fn clean_removes_a_stream_without_writer_and_none_that_is_written() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "", "")]);
    let config = config.to_str().unwrap();
    let node = Node::create(&place.memory().join("test.main"), 0o700).unwrap();
    let mut writer = start_writer(node.path());
    place.write("a", b"hello");
    place.say(&["stream", "write", "probe.0", "9", "a", "--config", config]).ok();
    assert_eq!(node.streams().unwrap(), [id(5), id(9)]);
    place.say(&["clean"]).ok_with(["is in use; removed 0 mailboxes without owner, 1 stream without writer"]);
    assert_eq!(node.streams().unwrap(), [id(5)]);
    let cleaned = place.say(&["clean", "--json"]).json();
    assert_eq!(cleaned["nodes"][0]["streams_removed"], 0, "{cleaned:#}");
    let read = place.say(&["stream", "read", "probe.0", "5", "--config", config]).ok();
    assert!(read.starts_with("#2  3.000000000  19 B  "), "{read}");
    writer.kill();
    drop(node);
    place.say(&["clean"]).ok();
    place.assert_empty();
}
