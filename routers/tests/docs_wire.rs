//! The datagrams of `docs/src/wire.md` are what the code writes, and reads.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_mailbox::{Head, Name, Priority, Type};
use rohrpost_routers::frame::{
    Alive, DescriptionPart, Fragment, Frame, FrameHead, FrameKind, HEAD_BYTES, RecordPart, Refusal, RefusalReason,
    ReplicaFrame, VERSION, write_check,
};
use rohrpost_routers::security::Port;
use rohrpost_routers::session::frame::{HOPS_MAX, SessionFrameHead, SessionMessage};
use rohrpost_routers::session::{ASK_EVERY_NS, ENTRIES_MAX, FRAME_MAX_NS, HANDSHAKE_MAX_NS};
use rohrpost_routers::session::{SILENT_AFTER_NS, SLOW_SILENT_AFTER_NS, STALLED_AFTER_NS};
use rohrpost_routers::team::{Beat, Echo, TeamHead, TeamKind};
use rohrpost_routers::time::Term;
use rohrpost_routers::time::message::{Reply, Request, Sync, TimeMessage};

const PAGE: &str = include_str!("../../docs/src/wire.md");

/// The bytes of a block: each line begins with digits, two a byte, then two spaces and words.
fn block(name: &str) -> Vec<u8> {
    let fence = format!("\n```hex {name}\n");
    let text = PAGE.split(&fence).nth(1).unwrap_or_else(|| panic!("no ```hex {name}"));
    let lines = text.split("\n```").next().unwrap().lines();
    let pairs = lines.flat_map(|line| line.split("  ").next().unwrap_or_default().as_bytes().chunks(2));
    let byte = |pair| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16);
    pairs.map(|pair| byte(pair).unwrap_or_else(|_| panic!("{name}: `{pair:?}`"))).collect()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x} ")).collect()
}

const HEAD: FrameHead = FrameHead {
    kind: FrameKind::Packages,
    system: 1,
    from: 1,
    to: 0,
    digest: 0x1122_3344_5566_7788,
    incarnation: 1_234_567_890,
    sequence: 0,
};
const PILOT: Name = Name::new(1, 140, 0, 0);
const MOTOR: Name = Name::new(1, 200, 0, 0);

/// Reads a block, and compares it with what is written.
fn check(name: &str, head: FrameHead, rest: &[u8], read: impl FnOnce(Frame<'_>)) {
    let there = block(&format!("datagram-{name}"));
    let (head_there, frame) = Frame::parse(&there).unwrap_or_else(|error| panic!("{name}: {error}"));
    assert_eq!(head_there, head, "{name}");
    read(frame);
    // The heads of packages are as a little-endian computer writes them, whatever this one is.
    if cfg!(target_endian = "little") {
        let written = [&head.to_bytes(&[rest])[..], rest].concat();
        assert_eq!(hex(&there), hex(&written), "{name}: left the page, right the code");
    }
}

fn data(len: u16) -> Head {
    let to = PILOT.with_local(2);
    Head { to, from: MOTOR, len, kind: Type::data(1), id: 5, priority: Priority(140), ..Head::default() }
}

#[test]
fn packages_have_the_documented_bytes() {
    let command = Head { to: PILOT, from: MOTOR.with_local(1), kind: Type::command(1), id: 6, ..data(0) };
    let rest = [&data(3).to_bytes()[..], &[1, 2, 3], &command.to_bytes()].concat();
    check("packages", FrameHead { sequence: 7, ..HEAD }, &rest, |frame| {
        let Frame::Packages(packages) = frame else { panic!("{frame:?}") };
        assert_eq!(packages.collect::<Vec<_>>(), [(data(3), &[1, 2, 3][..]), (command, &[])]);
    });
}

#[test]
fn a_fragment_has_the_documented_bytes() {
    let part = Fragment { first: 8, index: 1, count: 2, offset: 3, head: data(5), bytes: b"lo" };
    let rest = [&part.head_bytes()[..], part.bytes].concat();
    let head = FrameHead { kind: FrameKind::Fragment, sequence: 9, ..HEAD };
    check("fragment", head, &rest, |frame| assert_eq!(frame, Frame::Fragment(part)));
}

const STAMP_NS: u64 = 1_700_000_000_000_000_000;
const PART: RecordPart<'static> = RecordPart {
    place: 1,
    generation: 2,
    description: 0x0102_0304,
    incarnation: 77,
    len: 1376,
    offset: 1372,
    sequence: 300,
    epoch: 3,
    stamp_ns: STAMP_NS,
    written_ns: STAMP_NS + 100_000,
    error_ns: 2500,
    step: 10,
    sampled: 270,
    bytes: b"part",
};

#[test]
fn parts_of_sessions_have_the_documented_bytes() {
    let description =
        DescriptionPart { place: 1, generation: 2, check: 0x0102_0304, len: 2, offset: 0, written: 301, bytes: b"hi" };
    for (name, message) in [
        ("session-record-part", SessionMessage::Record(RecordPart { len: 4, offset: 0, ..PART })),
        ("session-description", SessionMessage::Description(description)),
    ] {
        let (there, mut written) = (block(name), Vec::new());
        message.write(&mut written);
        assert_eq!(hex(&there), hex(&written), "{name}: left the page, right the code");
        let (head, rest) = there.split_first_chunk().unwrap();
        let head = SessionFrameHead::parse(head, rest.len()).unwrap();
        assert_eq!(SessionMessage::parse(head, rest), Ok(message), "{name}");
    }
}

#[test]
fn a_record_part_has_the_documented_bytes() {
    let part = PART;
    let rest = [&part.head_bytes()[..], part.bytes].concat();
    let sequence = Port::Replicas.first_sequence() + 12;
    let head = FrameHead { kind: FrameKind::RecordPart, sequence, ..HEAD };
    check("record-part", head, &rest, |frame| assert_eq!(frame, Frame::Replica(ReplicaFrame::Record(part))));
}

#[test]
fn what_carries_no_package_has_the_documented_bytes() {
    let alive = Alive { heard_incarnation: 987_654_321, heard_next: 41, heard_lost: 2 };
    let head = FrameHead { kind: FrameKind::Alive, sequence: 10, ..HEAD };
    check("alive", head, &alive.to_bytes(), |frame| assert_eq!(frame, Frame::Alive(alive)));
    let refusal = Refusal { version: VERSION, reason: RefusalReason::Digest, digest: HEAD.digest };
    let head = FrameHead { kind: FrameKind::Refusal, ..HEAD };
    check("refusal", head, &refusal.to_bytes(), |frame| assert_eq!(frame, Frame::Refusal(refusal)));
}

/// Reads a block of a team, and compares it with what is written.
fn check_team(name: &str, head: TeamHead, rest: &[u8]) {
    let there = block(name);
    assert_eq!(TeamHead::read(&there), Ok((head, 0)), "{name}");
    let mut written = vec![0; HEAD_BYTES];
    head.write(&mut written);
    written.extend(rest);
    write_check(&mut written);
    if cfg!(target_endian = "little") {
        assert_eq!(hex(&there), hex(&written), "{name}: left the page, right the code");
    }
}

#[test]
fn datagrams_between_systems_have_the_documented_bytes() {
    let (common, incarnation) = (HEAD.digest, HEAD.incarnation);
    let head = TeamHead { kind: TeamKind::Package, system: 1, node: 0, to: 255, common, incarnation, sequence: 7 };
    let to = Name::new(255, 200, 0, 2);
    let package = Head { to, from: PILOT, ..data(3) };
    check_team("team-package", head, &[&package.to_bytes()[..], &[1, 2, 3]].concat());
    let mut beat = Vec::new();
    let echo = Echo { system: 2, node: 0, challenge: 0x0102_0304_0506_0708 };
    Beat::write(HEAD.digest, 2, [echo].into_iter(), &mut beat);
    check_team("team-beat", TeamHead { kind: TeamKind::Beat, sequence: 8, ..head }, &beat);
    let there = block("team-beat");
    let read = Beat::parse(&there[HEAD_BYTES..]).unwrap();
    assert_eq!((read.challenge, read.sent, read.echoes().collect::<Vec<_>>()), (HEAD.digest, 2, vec![echo]));
}

#[test]
fn time_has_the_documented_bytes() {
    const NOMINAL_NS: u64 = 1_700_000_000_000_000_000;
    let (term, epoch) = (Term::new(1, 0), 1);
    let sync = TimeMessage::Sync(Sync {
        id: 99,
        cycle: 1_700_000_000,
        nominal_ns: NOMINAL_NS,
        sent_ns: NOMINAL_NS + 1500,
        error_ns: 0,
        epoch,
        term,
        began: term,
        followed: true,
        replacement: false,
    });
    let request = TimeMessage::Request(Request {
        id: 99,
        sent_ns: 0,
        error_ns: 20_000,
        epoch,
        term,
        eager: false,
        far: false,
        timed: true,
    });
    let reply = TimeMessage::Reply(Reply {
        id: 99,
        sync_ns: NOMINAL_NS + 9_000,
        request_ns: NOMINAL_NS + 250_000,
        sent_ns: NOMINAL_NS + 300_000,
        error_ns: 0,
        epoch,
        term,
        began: term,
        doubt_ns: 700,
        sync_by_kernel: true,
        request_by_kernel: true,
    });
    let replacement = TimeMessage::Sync(Sync {
        id: 99,
        cycle: 340_000_000_000,
        nominal_ns: NOMINAL_NS + 300_000,
        sent_ns: NOMINAL_NS + 301_500,
        error_ns: 20_000,
        epoch,
        term,
        began: term,
        followed: false,
        replacement: true,
    });
    for (name, from, sequence, message) in
        [("sync", 0, 3, sync), ("request", 1, 4, request), ("reply", 0, 4, reply), ("replacement", 2, 5, replacement)]
    {
        let kind = message.kind();
        let head = FrameHead { kind, from, to: if from == 1 { 0 } else { 1 }, sequence, ..HEAD };
        check(name, head, &message.to_bytes(), |frame| {
            let Frame::Time(rest) = frame else { panic!("{frame:?}") };
            assert_eq!(TimeMessage::parse(kind, rest), Ok(message), "{name}");
        });
    }
}

#[test]
fn sessions_close_after_the_documented_times() {
    let seconds = |ns: u64| format!("{} s", ns as f64 / 1e9);
    for (ns, words) in [
        (HANDSHAKE_MAX_NS, "from its beginning to the welcome"),
        (SILENT_AFTER_NS, "in which nothing came; in the middle of a frame 8 s"),
        (SILENT_AFTER_NS, "if also the oldest question of the client that was not answered left 2.5 s ago"),
        (STALLED_AFTER_NS, "in which the stream took nothing of what was ready"),
        (FRAME_MAX_NS, "from the first byte of a frame to its last"),
    ] {
        let line = PAGE.lines().find(|line| line.contains(words)).unwrap_or_else(|| panic!("nothing of `{words}`"));
        assert!(line.starts_with(&format!("| {} |", seconds(ns))), "{}: {line}", seconds(ns));
    }
    let (slow, before) = (SLOW_SILENT_AFTER_NS, ASK_EVERY_NS);
    assert_eq!([SILENT_AFTER_NS - before, slow, slow - before].map(seconds), ["2.5 s", "8 s", "7 s"]);
    assert!(PAGE.contains(&format!("has {HOPS_MAX} hops already")));
    let spaced = format!("{} {:03} ranges in all", ENTRIES_MAX / 1000, ENTRIES_MAX % 1000);
    assert!(PAGE.contains(&spaced) && PAGE.contains(&format!("or {} of one certificate", ENTRIES_MAX / 8)));
}
