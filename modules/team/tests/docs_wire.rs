//! The examples of a team's messages in `docs/src/wire.md` are what the code reads and writes.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_team::coordination::{Claim, Post, Stance, TrafficMessage};
use rohrpost_team::events::{EventHead, Flow, Plan, Priority, ROOT};
use rohrpost_team::grid::Cell;
use rohrpost_team::group::{Entry, Hello, Pose, Reference};
use rohrpost_team::view::{Kept, Kind, Ledger, Named, ObjectId, Record, Records, State};
use rohrpost_team::{Position, RobotId, Version};
use siphasher::sip::SipHasher24;
use std::collections::BTreeMap;

const PAGE: &str = include_str!("../../../docs/src/wire.md");

/// The bytes of a block: each line begins with digits, two a byte, then two spaces and words.
fn block(name: &str) -> Vec<u8> {
    let text = PAGE.split(&format!("\n```hex {name}\n")).nth(1).unwrap().split("\n```").next().unwrap();
    let pairs = text.lines().flat_map(|line| line.split("  ").next().unwrap().as_bytes().chunks(2));
    pairs.map(|pair| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16).unwrap()).collect()
}

fn id(system: u8) -> RobotId {
    RobotId::new(system).unwrap()
}

fn version(incarnation: u32, counter: u32) -> Version {
    Version { incarnation, counter }
}

const POSITION: Position = Position { x_mm: 1000, y_mm: -1000 };
const MAP: u64 = 0x1122_3344_5566_7788;

#[test]
fn a_hello_has_the_documented_bytes() {
    let age_ns = 128_000_000;
    let hello = Hello {
        from: id(2),
        version: version(3, 41),
        map: MAP,
        sent_ns: 1_000_000_000,
        digests: [1, 2, 3, 4, 5, 6, 7, 8],
        tree: 0xabcd,
        agrees: true,
        pose: Some(Pose { position: POSITION, heading_mrad: 1570, speed_mm_s: 250 }),
        reference: Some(Reference { robot: id(1), incarnation: 7, offset_ns: -1_000_000, bound_ns: 5_000_000 }),
        entries: vec![Entry { robot: id(1), version: version(7, 1001), hops: 0, age_ns, agrees: true }],
    };
    assert_eq!(hello.encode(), block("team-hello"));
    assert_eq!(Hello::decode(&block("team-hello")), Ok(hello));
}

#[test]
fn an_event_has_the_documented_bytes() {
    let mut plan = Plan::new();
    let beat = plan.event("beat", Priority::Normal, 2);
    let object = plan.event("object", Priority::Normal, 8);
    let group = plan.group("communication", &[ROOT]);
    let sends = Flow { consumes: &[beat], sends: &[object], ..Flow::default() };
    plan.leaf("hello-sender", &[group], sends, move |(), text: &&str, turn| assert!(turn.send(object, text)));
    let updates = Flow { consumes: &[object], sends: &[object], cycles: &[(object, 3)], ..Flow::default() };
    plan.leaf("view-updater", &[group], updates, |(), _, _| ());
    let mut tree = plan.build().unwrap();
    assert!(tree.hard(beat, "hi") && tree.dispatch(0, &mut ()));
    let (head, text) = tree.take_sent(id(2)).unwrap();
    assert_eq!([&head.encode(), text.as_bytes()].concat(), block("team-event"));
    assert_eq!(EventHead::decode(&block("team-event")), Ok((head, &b"hi"[..])));
    let text = PAGE.split("\n```text tree\n").nth(1).unwrap().split("```").next().unwrap();
    assert_eq!(SipHasher24::new().hash(text.as_bytes()), tree.digest());
    assert!(PAGE.contains(&format!("This one's digest is `{:016x}`.", tree.digest())), "{:016x}", tree.digest());
}

#[test]
fn records_have_the_documented_bytes() {
    let named = ObjectId { observer: id(2), number: version(3, 1) };
    let record = Record {
        version: version(1, 9),
        state: State::Seen,
        kind: Kind::Intruder,
        position: POSITION,
        may_be: Some(id(4)),
        names: vec![Named { object: named, version: version(3, 2) }],
    };
    let kept = Kept { record, seen_ns: 1_500_000_000 };
    let ledger = Ledger { floor: Version::default(), records: BTreeMap::from([(version(1, 5), kept)]) };
    let ledgers = BTreeMap::from([(id(3), ledger)]);
    let records = Records { from: id(2), map: MAP, is_synchro: true, ledgers };
    assert_eq!(records.encode(), block("team-records"));
    assert_eq!(Records::decode(&block("team-records")), Ok(records));
}

#[test]
fn a_traffic_message_has_the_documented_bytes_and_others_are_refused() {
    let cell = |row| Cell { column: 3, row };
    let intruder = ObjectId { observer: id(3), number: version(1, 5) };
    let post = Some(Post { intruder, right: 0, down: -1 });
    let message = TrafficMessage {
        from: id(2),
        version: version(3, 41),
        map: MAP,
        held: vec![cell(4)],
        claim: Some(Claim { number: 7, cell: cell(5) }),
        echoes: BTreeMap::from([(id(4), 9)]),
        round: 5,
        stance: Some(Stance { cell: cell(4), goal: None, post, is_frozen: false }),
        digest: 123_456_789,
        moment: 2,
    };
    let bytes = block("team-traffic");
    assert_eq!(message.encode(), bytes);
    assert_eq!(TrafficMessage::decode(&bytes), Ok(message.clone()));
    for end in 0..bytes.len() {
        assert!(TrafficMessage::decode(&bytes[..end]).is_err(), "{end}");
    }
    for (at, value, why) in [(0, b'H', "kind"), (1, 2, "layout"), (2, 0, "robot"), (3, 32, "flag"), (4, 3, "held")] {
        let mut wrong = bytes.clone();
        wrong[at] = value;
        assert!(TrafficMessage::decode(&wrong).is_err(), "{why}");
    }
    let everything = TrafficMessage {
        stance: Some(Stance { cell: cell(4), goal: Some(cell(9)), post: None, is_frozen: true }),
        claim: None,
        ..message
    };
    assert_eq!(TrafficMessage::decode(&everything.encode()), Ok(everything));
}
