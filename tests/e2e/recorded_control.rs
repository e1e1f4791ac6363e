//! Log control on a running node: by `rohrpost record`, and by TCP, also with connections that misbehave.

use crate::harness::{PATIENCE, until, wait};
use crate::recorded::{Frame, RECORD, feed, feed_until_recorded, launched, numbers, wait_for_all};
use crate::recordings::messages;
use rohrpost::wire::from_bytes;
use rohrpost_recording::info;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// A connection of a test.
pub(crate) struct ControlConnection {
    lines: BufReader<TcpStream>,
}

impl ControlConnection {
    /// As soon as the recorder listens.
    pub(crate) fn open(address: SocketAddr) -> Self {
        let socket = wait(format!("{address} listens"), || TcpStream::connect(address).ok());
        socket.set_read_timeout(Some(PATIENCE)).unwrap();
        Self { lines: BufReader::new(socket) }
    }

    /// To one that may be gone: then it hears nothing.
    pub(crate) fn say(&mut self, bytes: &[u8]) {
        let _ = self.lines.get_mut().write_all(bytes);
    }

    /// The next answer; empty at the end.
    pub(crate) fn hear(&mut self) -> String {
        let mut line = String::new();
        let _ = self.lines.read_line(&mut line);
        line.trim_end().to_owned()
    }

    pub(crate) fn ask(&mut self, line: &str) -> String {
        self.say(format!("{line}\n").as_bytes());
        self.hear()
    }
}

/// An address of this process alone, on this computer; tests of one process have ports of their own.
pub(crate) fn own_address(port: u16) -> SocketAddr {
    let [_, a, b, c] = std::process::id().to_be_bytes();
    SocketAddr::from(([127, a | 0x80, b, c], port))
}

/// What `[record]` says, with log control at an address.
pub(crate) fn controlled(record: &str, address: SocketAddr) -> String {
    format!("{record}control = \"{address}\"\n")
}

/// What an answer says of a key: without quotes, as no path of a test has any inside.
pub(crate) fn told(answer: &str, key: &str) -> Option<String> {
    let rest = answer.split_once(&format!(" {key}=")).map(|(_, rest)| rest)?;
    let value = match rest.strip_prefix('"') {
        Some(text) => text.split('"').next(),
        None => rest.split(' ').next(),
    };
    value.map(str::to_owned)
}

/// Numbers of a feeder's frames in files, one behind the other.
fn frames(files: &[&Path]) -> Vec<u64> {
    files.iter().flat_map(|file| numbers(file, "feeder.0/frame")).collect()
}

/// The number of the frame that a file repeats of the time before it.
fn repeated_frame(file: &Path) -> Option<u64> {
    let repeated = messages(file, |channel, message| {
        let is_it = channel.topic == "feeder.0/frame" && channel.is_repeated();
        is_it.then(|| from_bytes::<Frame>(message.data).unwrap().number)
    });
    repeated.first().copied()
}

#[test]
fn the_recorder_obeys_the_command_line() {
    let (place, mut launch, _robot) = launched(RECORD);
    let record = |words: &[&str]| place.say(&[&["record"], words, &["--timeout", "60"]].concat());
    let path = |name: &str| std::fs::canonicalize(place.path("recordings")).unwrap().join(name);
    feed_until_recorded(&place, "feeder.0");
    let status = record(&["status"]).ok();
    assert!(status.starts_with("recording=on directory=\"") && status.contains(" lost=0 "), "{status}");

    let first = feed(&place, "feeder.0", 50);
    wait_for_all(&place, &place.path("recordings/main-0001.mcap"), "feeder.0/frame", first, 1);
    record(&["mark", "door", "open"]).ok_with(["main-0001.mcap\" time="]);
    record(&["rotate"]).ok_with(["closed=\"", "main-0002.mcap"]);
    for (path, words) in [("..", "is not below"), ("/tmp", "is not below"), ("a/b", "is no folder")] {
        record(&["directory", path]).fails_with([words]);
    }
    let moved = record(&["directory", "run 7"]).ok();
    let folder = path("run 7");
    assert!(moved.contains(&format!("directory=\"{}\"", folder.display())), "{moved}");
    let last = feed(&place, "feeder.0", 50);
    wait_for_all(&place, &folder.join("main-0001.mcap"), "feeder.0/frame", last, 1);

    record(&["off"]).ok_with([" lost=0 files="]);
    assert!(record(&["status"]).ok().starts_with("recording=off"));
    until("status says that nothing is recorded", || {
        let said = place.say(&["status", "logd.0", "--json"]).json();
        said[0]["error"] == "records nothing: log control has switched it off"
    });
    for words in [&["mark", "late"][..], &["rotate"]] {
        assert!(record(words).fails().contains("nothing is recorded; say `on` first"));
    }
    feed(&place, "feeder.0", 50);
    let begun = record(&["on"]).ok();
    assert!(begun.contains("run 7/main-0002.mcap"), "{begun}");
    assert_eq!(record(&["on"]).ok(), begun, "it is on");
    wait("a line is recorded", || told(&record(&["status"]).ok(), "written").filter(|written| written != "0"));
    feed_until_recorded(&place, "feeder.0");
    launch.stop();

    let told = info(&path("main-0001.mcap")).unwrap();
    assert_eq!(told.marks.iter().map(|mark| mark.text.as_str()).collect::<Vec<_>>(), ["door open"]);
    // Lines of output may come behind it.
    let frame = told.channels.iter().find(|channel| channel.topic == "feeder.0/frame").unwrap();
    assert!(frame.last_ns.unwrap() <= told.marks[0].time_ns);
    let said = place.say(&["record", "info", path("main-0001.mcap").to_str().unwrap()]).ok();
    assert!(said.lines().any(|line| line.starts_with("mark at ") && line.ends_with(": door open")), "{said}");
    let all = frames(&[&path("main-0001.mcap"), &path("main-0002.mcap"), &folder.join("main-0001.mcap")]);
    assert_eq!(all, (all[0]..=last).collect::<Vec<u64>>(), "each is in one file");
    assert_eq!(repeated_frame(&folder.join("main-0002.mcap")), Some(last + 50), "it begins with the newest");
    let later = frames(&[&folder.join("main-0002.mcap")]);
    assert!(later[0] > last + 50, "what came while it was off is in no file: {later:?}");
    assert_eq!(info(&folder.join("main-0002.mcap")).unwrap().lost, 0, "nor is it lost");
}

#[test]
fn connections_are_answered_line_by_line_and_none_holds_the_recorder_up() {
    let address = own_address(21_121);
    let (place, mut launch, _robot) = launched(&controlled(RECORD, address));
    feed_until_recorded(&place, "feeder.0");
    let before = feed(&place, "feeder.0", 10);

    // All at once, and each line in two parts.
    let mut one = ControlConnection::open(address);
    one.say("status\r\n\nmark T\u{fc}r offen\nrotate\ndirec".as_bytes());
    let answers: Vec<String> = (0..3).map(|_| one.hear()).collect();
    assert_eq!(told(&answers[0], "recording").as_deref(), Some("on"), "{answers:?}");
    assert!(told(&answers[1], "file").unwrap().ends_with("main-0001.mcap"), "{answers:?}");
    assert!(told(&answers[2], "closed").unwrap().ends_with("main-0001.mcap"), "{answers:?}");
    one.say(b"tory there\n");
    assert!(told(&one.hear(), "directory").unwrap().ends_with("recordings/there"));
    std::os::unix::fs::symlink("/tmp", place.path("recordings/out")).unwrap();
    assert!(one.ask("directory out").contains("is not below"));
    assert!(one.ask("directory out/new").contains("is not below"));

    // What is no command ends the connection, with all that is behind it: what comes may be in another protocol, that
    // somebody has made to carry commands.
    let page = format!("POST / HTTP/1.1\r\nHost: {address}\r\nAccept: */*\r\n\r\n");
    for (said, words) in [
        (&b"ROTATE\n"[..], "ERR no command `ROTATE`; there are on, off, "),
        (b"\xff\xfb\x01\n", "ERR the line is not in UTF-8"),
        (&[b'x'; 100_000], "ERR the line is too long"),
        (page.as_bytes(), "ERR no command `POST`"),
        (b"EHLO robot\r\n", "ERR no command `EHLO`"),
        (b"\x16\x03\x01\x00\xf4\x01\n", "ERR the line is not in UTF-8"),
        (b"\x16\x03\x01\x00\x74\x01\n", "ERR the line has control characters"),
    ] {
        let mut other = ControlConnection::open(address);
        other.say(&[said, b"off\n"].concat());
        let answer = other.hear();
        assert!(answer.starts_with(words), "{answer}");
        assert_eq!(other.hear(), "", "and the connection ends");
    }
    assert!(ControlConnection::open(address).ask("status").starts_with("OK recording=on "));
    // One that asks and asks, and never takes an answer.
    let mut deaf = TcpStream::connect(address).unwrap();
    deaf.set_write_timeout(Some(Duration::from_millis(100))).unwrap();
    while deaf.write_all(&b"status\n".repeat(1_000)).is_ok() {}
    // More than there is room for: the last one is told so.
    let mut silent: Vec<TcpStream> = (0..8).map(|_| TcpStream::connect(address).unwrap()).collect();
    let mut refused = String::new();
    silent[7].set_read_timeout(Some(PATIENCE)).unwrap();
    silent[7].read_to_string(&mut refused).unwrap();
    assert!(refused.starts_with("ERR 8 connections are open already"), "{refused}");

    // Nothing of it disturbs.
    assert!(one.ask("status").contains(" lost=0 "));
    let last = feed(&place, "feeder.0", 200);
    let file = place.path("recordings/there/main-0001.mcap");
    wait_for_all(&place, &file, "feeder.0/frame", last, 1);
    silent.clear();
    wait("there is room again", || {
        let mut later = ControlConnection::open(address);
        later.say(b"status\n");
        later.lines.get_mut().shutdown(Shutdown::Write).ok()?;
        // It has said all, and is answered all the same.
        let answers = (later.hear(), later.hear());
        let is_answered = answers.0.starts_with("OK recording=on ") && answers.0.contains(" lost=0 ");
        (is_answered && answers.1.is_empty()).then_some(())
    });
    let mut one = ControlConnection::open(address);
    assert!(told(&one.ask("off"), "written").is_some());
    launch.stop();
    assert_eq!(one.hear(), "", "the connection ends with the recorder");
    let files =
        ["main-0001", "main-0002", "there/main-0001"].map(|name| place.path(&format!("recordings/{name}.mcap")));
    let all: Vec<u64> = files.iter().flat_map(|file| numbers(file, "feeder.0/frame")).collect();
    assert_eq!(all, (all[0]..=last).collect::<Vec<u64>>(), "each is in one file");
    assert!(all[0] <= before);
}

/// Both come at the same time, and the command line fetches its answers.
#[test]
fn a_connection_that_chatters_takes_no_answers_from_the_command_line() {
    let address = own_address(21_123);
    let (place, mut launch, _robot) = launched(&controlled(RECORD, address));
    feed_until_recorded(&place, "feeder.0");
    let ends = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let chatter = scope.spawn(|| {
            let (mut connection, mut answers) = (ControlConnection::open(address), 0);
            while !ends.load(Ordering::Relaxed) {
                connection.say(&b"status\nmark here\n".repeat(20));
                answers += (0..40).filter(|_| !connection.hear().is_empty()).count();
            }
            answers
        });
        let told: Vec<_> = (0..8).map(|_| place.say(&["record", "rotate", "--timeout", "60"])).collect();
        ends.store(true, Ordering::Relaxed);
        assert!(chatter.join().unwrap() >= 40, "or nothing was tried");
        told.into_iter().for_each(|told| drop(told.ok()));
    });
    launch.stop();
}

/// Recording does not depend on it.
#[test]
fn a_port_that_is_taken_is_told_and_used_once_it_is_free() {
    let address = own_address(21_122);
    let taken = std::net::TcpListener::bind(address).unwrap();
    let (place, mut launch, _robot) = launched(&controlled(RECORD, address));
    feed_until_recorded(&place, "feeder.0");
    let errors = || place.say(&["log", "--timeout", "60", "--module", "logd.0", "--level", "error"]).out;
    let error = wait("an error", || Some(errors()).filter(|lines| lines.contains("log control: cannot listen at")));
    assert!(error.contains(&address.to_string()) && error.contains("records all the same"), "{error}");
    drop(taken);
    assert!(ControlConnection::open(address).ask("status").starts_with("OK recording=on "));
    launch.stop();
}
