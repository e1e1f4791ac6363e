//! What `docs/src/shared-memory.md` says lies where it says: read from the files by number alone. The numbers of what
//! every package touches are read from the page itself.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, HIGH, LOW, MAILBOX, label};
use rohrpost_mailbox::{
    Class, Interest, ModuleState, Name, OverflowPolicy, Participant, ROUTES_MAX, Shape, Stamp, StreamId, StreamShape,
    TimeKeeper, TimeSource, Watches, Work, local,
};
use std::os::unix::fs::{FileExt, FileTypeExt};
use std::time::Duration;

/// The page.
const PAGE: &str = include_str!("../../docs/src/shared-memory.md");
/// Where the parts of a mailbox and their fields are told.
const PARTS: &str = "## A mailbox";
const FIELDS: &str = "### Identity, owner, hot";
const VERSION: u32 = 9;

/// The offset that a section's table gives for a field: the first of the row's cells that begins with its name tells.
fn at(section: &str, field: &str) -> usize {
    let mut lines = PAGE.lines().skip_while(|line| *line != section).skip(1);
    let rows = lines.by_ref().take_while(|line| !line.starts_with('#')).filter(|line| line.starts_with('|'));
    let cells = rows.map(|row| row.trim_matches('|').split(" | ").map(str::trim).collect::<Vec<_>>());
    let found: Vec<_> = cells.filter(|cells| cells[1..].iter().any(|cell| cell.starts_with(field))).collect();
    let [row] = &found[..] else { panic!("{section}: {field} is in {} rows: {found:?}", found.len()) };
    row[0].parse().unwrap_or_else(|_| panic!("{section}: {field}: {row:?}"))
}

struct Bytes(Vec<u8>);

impl Bytes {
    fn u32(&self, at: usize) -> u32 {
        u32::from_ne_bytes(self.0[at..at + 4].try_into().unwrap())
    }

    fn u64(&self, at: usize) -> u64 {
        u64::from_ne_bytes(self.0[at..at + 8].try_into().unwrap())
    }
}

fn file(ground: &Ground, name: &str) -> Bytes {
    Bytes(std::fs::read(ground.path().join(name)).unwrap())
}

#[test]
fn a_mailbox_is_as_documented() {
    for (slots, word_bytes) in [(64, 64), (65, 8)] {
        let ground = Ground::new();
        let max_age = Some(Duration::from_secs(9));
        let shape = Shape { slots, body_bytes_max: 100, full: OverflowPolicy::Reject, max_age, claims: 3 };
        let mut receiver = ground.join().receiver(MAILBOX, shape).unwrap();
        let mut sender = ground.sender();
        sender.send(&label(LOW, 0), &[b"first"]).unwrap();
        sender.send(&label(HIGH, 0), &[b"taken"]).unwrap();
        let package = receiver.try_receive().unwrap();
        let there = file(&ground, &format!("{:08x}.mbx", MAILBOX.raw()));
        assert!(there.0.starts_with(b"rohrpost") && there.0.len().is_multiple_of(4096));
        let short = |field| there.u32(at(FIELDS, field));
        let identity = ["version", "name", "slots", "largest body", "when full", "claims"].map(short);
        assert_eq!(identity, [VERSION, MAILBOX.raw(), u32::from(slots), 100, 1, 3]);
        assert_eq!(there.u64(at(FIELDS, "max-age")), 9_000_000_000);
        let owner = ["participant", "pid", "adoptions", "most waiting"].map(short);
        assert_eq!(owner, [0, std::process::id(), 0, 2]);
        assert_eq!(there.u64(at(FIELDS, "ticket")), 2);
        let row = at(PARTS, "counters");
        assert_eq!((there.u32(row), there.u64(row + 8)), (256 + u32::from(HIGH.0), 1), "class, received");
        assert!(there.u64(row + 304) >= there.u64(row + 72), "all waits, and the longest");
        assert_eq!(there.u64(row + 312), 5, "bytes");
        let first = at(PARTS, "words");
        let words = first + (usize::from(slots) * word_bytes).next_multiple_of(64);
        let mut seen = Vec::new();
        for slot in 0..usize::from(slots) {
            let (word, at) = (there.u64(first + slot * word_bytes), words + slot * 128);
            if word != 0 {
                let (priority, redelivered, ticket) = (word >> 54 & 0xff, word >> 53 & 1, word & ((1 << 53) - 1));
                seen.push((word >> 62, priority, redelivered, ticket, there.0[at + 24..at + 29].to_vec()));
                assert_eq!((there.u32(at + 8), there.0[at + 8 + 14]), (MAILBOX.raw(), priority as u8));
            }
        }
        let expected =
            [(2, u64::from(LOW.0), 0, 0, b"first".to_vec()), (3, u64::from(HIGH.0), 0, 1, b"taken".to_vec())];
        assert_eq!(seen, expected);
        drop(package);
    }
}

/// What senders and the receiver tell each other with every package, as it stands in the file.
#[derive(PartialEq, Eq, Debug)]
struct Said {
    hints: Vec<u64>,
    level: u32,
    alert: u32,
    sleeping: u32,
    retired: u32,
}

impl Said {
    /// Of a mailbox's file, also of one that has no name any more.
    fn read(file: &std::fs::File) -> Self {
        let mut bytes = Bytes(vec![0; 4096]);
        file.read_exact_at(&mut bytes.0, 0).unwrap();
        let [hints, level, alert, sleeping, retired] =
            ["ready hints", "level", "alert", "sleeping", "retired"].map(|field| at(FIELDS, field));
        Self {
            hints: (0..16).map(|number| bytes.u64(hints + 8 * number)).filter(|hints| *hints != 0).collect(),
            level: bytes.u32(level),
            alert: bytes.u32(alert),
            sleeping: bytes.u32(sleeping),
            retired: bytes.u32(retired),
        }
    }
}

/// Nothing is hinted, nobody sleeps.
fn quiet(level: u8) -> Said {
    Said { hints: Vec::new(), level: level.into(), alert: 0, sleeping: 0, retired: 0 }
}

#[test]
fn senders_and_receiver_talk_where_it_is_documented() {
    let ground = Ground::new();
    let shape = Shape { slots: 1, full: OverflowPolicy::Latest, ..Shape::default() };
    let mut receiver = ground.join().receiver(MAILBOX, shape).unwrap();
    let file = std::fs::File::open(ground.path().join(format!("{:08x}.mbx", MAILBOX.raw()))).unwrap();
    let mut sender = ground.sender();
    let mut send = |priority, id| sender.send(&label(priority, id), &[]).unwrap();
    assert_eq!(Said::read(&file), quiet(0));
    send(LOW, 1);
    assert_eq!(Said::read(&file), Said { hints: vec![1], alert: 1, ..quiet(0) }, "above the level");
    assert!(receiver.try_receive().is_some());
    assert_eq!(Said::read(&file), quiet(LOW.0), "looked at, and the level told");
    send(LOW, 1);
    assert_eq!(Said::read(&file), Said { hints: vec![1], ..quiet(LOW.0) }, "not above the level");
    send(HIGH, 1);
    assert_eq!(Said::read(&file), Said { hints: vec![1], alert: 1, ..quiet(LOW.0) });
    assert!(receiver.try_receive().is_some());
    assert_eq!(Said::read(&file), quiet(HIGH.0), "raised");
    send(LOW, 1);
    send(HIGH, 1);
    let moved = Said { hints: vec![1], alert: 1, ..quiet(HIGH.0) };
    assert_eq!(Said::read(&file), moved, "at the level, in the place of a package of another priority");
    assert!(receiver.try_receive().is_some());

    std::thread::scope(|scope| {
        let sleeper = scope.spawn(|| receiver.receive().head().priority);
        common::until("it sleeps", || Said::read(&file) == Said { sleeping: 1, ..quiet(HIGH.0) });
        send(LOW, 1);
        assert_eq!(sleeper.join().unwrap(), LOW);
    });
    assert_eq!(Said::read(&file), quiet(LOW.0), "awake, and the level lowered");
    receiver.close();
    assert_eq!(Said::read(&file).retired, 1);
}

#[test]
fn slots_have_their_hints_where_it_is_documented() {
    let ground = Ground::new();
    let _receiver = ground.join().receiver(MAILBOX, Shape { slots: 66, ..Shape::default() }).unwrap();
    let mut sender = ground.sender();
    (0..66).for_each(|id| sender.send(&label(LOW, id), &[]).unwrap());
    let there = file(&ground, &format!("{:08x}.mbx", MAILBOX.raw()));
    let hints = at(FIELDS, "ready hints");
    assert_eq!([0, 1, 2].map(|number| there.u64(hints + 8 * number)), [u64::MAX, 0b11, 0]);
}

/// The histogram as another language would read it: file, row of the class, buckets.
#[test]
fn waiting_times_by_class_are_as_documented() {
    const BYTES: usize = 320;
    let rows = at(PARTS, "counters");
    let ground = Ground::new();
    let mut receiver = ground.join().receiver(MAILBOX, Shape::default()).unwrap();
    let mut sender = ground.sender();
    for (priority, wait) in [(LOW, 0), (LOW, 3_000), (HIGH, 700), (LOW, 90)] {
        sender.send(&label(priority, 0), &[]).unwrap();
        std::thread::sleep(Duration::from_micros(wait));
        assert!(receiver.try_receive().is_some());
    }
    let there = file(&ground, &format!("{:08x}.mbx", MAILBOX.raw()));
    let seen = ground.look();
    for (class, packages) in [(LOW, 3), (HIGH, 1)] {
        let row =
            (0..10).map(|row| rows + row * BYTES).find(|row| there.u32(*row) == 256 + u32::from(class.0)).unwrap();
        let waits: Vec<u32> = (0..56).map(|bucket| there.u32(row + 80 + 4 * bucket)).collect();
        assert_eq!((there.u64(row + 8), waits.iter().sum::<u32>()), (packages, packages as u32));
        let ours = &seen.classes.iter().find(|ours| ours.class == Some(Class(class.0))).unwrap().latency;
        let longest = there.u64(row + 72);
        assert_eq!((waits.as_slice(), u128::from(longest)), (&ours.buckets[..], ours.max.as_nanos()));
        // Bucket 2 k + h begins at 2^(8+k) × (1 + h/2) ns; the longest lies in the last that is not empty.
        let start = |bucket: usize| (1u64 << (8 + bucket / 2)) * (2 + bucket as u64 % 2) / 2;
        let last = waits.iter().rposition(|count| *count > 0).unwrap();
        assert!((last == 0 || start(last) <= longest) && longest < start(last + 1), "{last}: {longest}");
    }
}

#[test]
fn a_word_tells_which_package_its_own_replaces() {
    let ground = Ground::new();
    let shape = Shape { slots: 1, body_bytes_max: 8, full: OverflowPolicy::Latest, ..Shape::default() };
    let mut receiver = ground.join().receiver(MAILBOX, shape).unwrap();
    let mut sender = ground.sender();
    (0..3).for_each(|_| sender.send(&label(LOW, 0), &[]).unwrap());
    let there = file(&ground, &format!("{:08x}.mbx", MAILBOX.raw()));
    let word = there.u64(4096);
    assert_eq!((there.u32(at(FIELDS, "when full")), there.u64(at(FIELDS, "ticket"))), (2, 3), "policy, tickets");
    assert_eq!((word >> 62, word & ((1 << 53) - 1)), (2, 0), "ready, in the place of the first");
    let row = at(PARTS, "counters");
    assert_eq!((there.u32(row), there.u64(row + 64)), (256 + u32::from(LOW.0), 2), "replaced");
    assert!(receiver.try_receive().is_some());
}

#[test]
fn a_poller_says_that_it_sleeps_as_documented() {
    let (ground, me) = Ground::joined();
    let mut receiver = me.receiver(MAILBOX, Shape::default()).unwrap();
    let mut watches = Watches::new(&me).unwrap();
    let (_far, near) = std::os::unix::net::UnixStream::pair().unwrap();
    watches.add(&near, Interest::Read).unwrap();
    assert!(std::fs::metadata(ground.path().join("bell.0")).unwrap().file_type().is_fifo());
    let sleeper = std::thread::spawn(move || watches.wait_any(&mut [&mut receiver], None, || false));
    common::until("it polls", || file(&ground, "node").u32(64 + 32) == 1);
    // As a ringer of another language does it.
    let bell = std::fs::OpenOptions::new().read(true).write(true).open(ground.path().join("bell.0"));
    std::io::Write::write_all(&mut bell.unwrap(), &[1]).unwrap();
    sleeper.join().unwrap();
    assert_eq!(file(&ground, "node").u32(64 + 32), 0);
}

#[test]
fn a_filling_word_names_its_participant() {
    let ground = Ground::new();
    let shape = Shape { slots: 1, body_bytes_max: 8, ..Shape::default() };
    let _receiver = ground.join().receiver(MAILBOX, shape).unwrap();
    let filler = ground.join();
    let (mut first, mut second) = (ground.sender(), filler.sender(MAILBOX).unwrap());
    first.send(&label(LOW, 0), &[b"lost"]).unwrap();
    let _loan = second.loan(HIGH).unwrap();
    let word = file(&ground, &format!("{:08x}.mbx", MAILBOX.raw())).u64(4096);
    assert_eq!(
        (word >> 62, word >> 61 & 1, word >> 53 & 0xff, word >> 48 & 0x1f),
        (1, 1, u64::from(LOW.0), 0),
        "displaced"
    );
    let entry = 64 + 64 * (word >> 32 & 0xffff) as usize;
    assert_eq!(word as u32, filler.incarnation());
    assert_eq!(file(&ground, "node").u32(entry), filler.incarnation());
}

#[test]
fn the_node_and_its_time_are_as_documented() {
    let (ground, node) = Ground::made();
    let me = Participant::join(&node, Name::new(1, 200, 0, 0)).unwrap();
    me.set_state(ModuleState::Error);
    me.set_state(ModuleState::On);
    me.set_restarts(7);
    me.begin_work(Work::Function(16));
    let _receiver = me.receiver(MAILBOX, Shape::default()).unwrap();
    me.ring();
    node.announce_death();
    let there = file(&ground, "node");
    assert!(there.0.starts_with(b"rohrpost") && there.0.len() == 16448);
    assert_eq!([8, 12, 16, 20].map(|at| there.u32(at)), [VERSION, 1, 1, me.incarnation()]);
    let entry = [0, 4, 8, 12, 16, 20].map(|at| there.u32(64 + at));
    assert_eq!(entry, [me.incarnation(), std::process::id(), 2, 0x01c8_0000, 3, 7]);
    assert!(there.u64(64 + 24) > 0);
    assert_eq!(there.u32(64 + 36), 1, "errors");
    let (mark, now_ns) = (there.u64(64 + 40), rohrpost_mailbox::monotonic_ns());
    assert_eq!((mark >> 56, mark >> 40 & 0xffff), (7, 16));
    let since_ns = (mark & ((1 << 40) - 1)) << 20;
    assert!((now_ns.saturating_sub(60_000_000_000)..=now_ns).contains(&since_ns), "{since_ns} of {now_ns}");
    me.end_work();
    assert_eq!(file(&ground, "node").u64(64 + 40), 0);

    let _keeper = TimeKeeper::begin(&node, TimeSource::Log, 1_000, 2.0).unwrap();
    let there = file(&ground, "time");
    assert_eq!((there.0.len(), there.u64(0), there.u32(8)), (192, 1, std::process::id()));
    let record = 64 + 64 * (there.u64(0) % 2) as usize;
    let fields = [0, 8, 24, 32, 40, 48].map(|at| there.u64(record + at));
    assert_eq!(fields, [1, 3, 1_000, 2_000_000_000, 0, 0]);
}

#[test]
fn a_table_of_traffic_is_as_documented() {
    let ground = Ground::new();
    let _receiver =
        ground.join().receiver(MAILBOX, Shape { slots: 2, body_bytes_max: 100, ..Shape::default() }).unwrap();
    let me = Participant::join(&ground.node(), Name::new(1, 201, 0, 0)).unwrap();
    let mut sender = me.sender(MAILBOX).unwrap();
    let (from, kind) = (Name::new(1, 201, 0, 1), rohrpost_mailbox::Type::reply(16));
    let label = rohrpost_mailbox::Label { from, kind, ..label(LOW, 0) };
    for body in ["four", "five!"] {
        sender.send(&label, &[body.as_bytes()]).unwrap();
    }
    sender.send(&label, &[b"full"]).unwrap_err();
    let mut publications = rohrpost_mailbox::Publications::new(&me);
    publications.published(me.module(), rohrpost_mailbox::Type::data(7), 3, Duration::from_nanos(11));

    let there = file(&ground, "traffic.1");
    assert!(there.0.starts_with(b"rohrpost") && there.0.len() == 32832);
    assert_eq!([8, 12, 16, 20].map(|at| there.u32(at)), [VERSION, 1, me.incarnation(), 128]);
    let row = 64;
    assert_eq!([8, 12, 16].map(|at| there.u32(row + at)), [MAILBOX.raw(), from.raw(), 0xfff0]);
    assert_eq!(there.u32(row + 4) % 2, 0, "nobody is inside");
    assert_eq!([24, 32, 40].map(|at| there.u64(row + at)), [2, 9, 1]);
    let (first, last) = (there.u64(row + 48), there.u64(row + 56));
    let slots = file(&ground, &format!("{:08x}.mbx", MAILBOX.raw()));
    let published = [0, 1].map(|slot| slots.u64(4096 + 128 + slot * 128));
    assert_eq!([first, last], [published[0].min(published[1]), published[0].max(published[1])]);
    assert_eq!((there.u64(row + 64), there.u64(row + 72)), ((last - first).pow(2), 0));
    let second = row + 128 + 32 * (last / 1_000_000_000 % 4) as usize;
    assert_eq!([0, 8, 16].map(|at| there.u64(second + at)), [last / 1_000_000_000, last - first, last - first]);
    assert!(there.u32(second + 24) >= 4 && there.u32(second + 28) == 5, "the first may lie in the second before");

    let row = 64 + 256;
    assert_eq!([8, 12, 16].map(|at| there.u32(row + at)), [0, me.module().raw(), 0xbff9]);
    assert_eq!([24, 32, 80].map(|at| there.u64(row + at)), [1, 3, 11]);
    drop((sender, publications, me));
    assert!(!ground.path().join("traffic.1").exists());
}

#[test]
fn the_page_tells_one_version_of_all_files() {
    let told: Vec<_> = PAGE.lines().filter_map(|line| line.strip_prefix("| 8 | 4 | version")).collect();
    assert_eq!((told.len(), rohrpost_mailbox::LAYOUT_VERSION), (5, VERSION));
    assert!(told.iter().all(|told| told.contains(&format!(" {VERSION} |"))), "{told:?}");
}

#[test]
fn routes_are_as_documented() {
    let ground = Ground::new();
    let name = |local| Name::new(1, 200, 0, local);
    let router = Name::new(1, 250, 2, local::TRANSIT);
    ground
        .node()
        .set_routes(router, &[(name(0), name(255)), (Name::new(1, 201, 0, 0), Name::new(1, 201, 0, 9))])
        .unwrap();
    let there = file(&ground, "routes");
    assert!(there.0.starts_with(b"rohrpost") && there.0.len() == 24 + 2 * 8);
    let fields = ["version", "via", "count"].map(|field| there.u32(at("## `routes`", field)));
    assert_eq!(fields, [VERSION, 0x01fa_0203, 2]);
    assert_eq!([20, 24, 28, 32, 36].map(|at| there.u32(at)), [0, 0x01c8_0000, 0x01c8_00ff, 0x01c9_0000, 0x01c9_0009]);
    assert!(PAGE.contains("`router.I`, local id 3") && PAGE.contains("at most 65 536") && ROUTES_MAX == 65_536);
}

#[test]
fn a_stream_is_as_documented() {
    const STREAM: &str = "## A stream";
    const STREAM_FIELDS: &str = "### Fields of a stream";
    const ENTRY: &str = "### An entry of the index";
    const SEAT: &str = "### A seat";
    let ground = Ground::new();
    let participant = Participant::join(&ground.node(), Name::new(1, 200, 7, 0)).unwrap();
    let id = StreamId { name: MAILBOX, number: 5 };
    let late = Duration::from_millis(3);
    let shape = StreamShape { record_bytes: 100, keep: 70, readers: 33, late };
    let mut writer = participant.stream_writer(id, shape).unwrap();
    let mut reader = participant.stream_reader(id).unwrap();
    for number in 0..75_u64 {
        writer.write(Stamp { epoch: 9, ns: 1_000_000 + number }, &number.to_ne_bytes()).unwrap();
    }
    assert!(writer.write(Stamp { epoch: 8, ns: 1 }, b"refused").is_err());
    let held = reader.record(74).unwrap();
    let there = file(&ground, &format!("{:08x}.5.ring", MAILBOX.raw()));
    assert!(there.0.starts_with(b"rohrring"));
    let short = |field| there.u32(at(STREAM_FIELDS, field));
    let long = |field| there.u64(at(STREAM_FIELDS, field));
    let identity = ["version", "name", "number", "largest record", "keep", "readers"].map(short);
    assert_eq!(identity, [VERSION, MAILBOX.raw(), 5, 100, 70, 33]);
    let writer_says = ["its pid", "module", "adoptions", "retired"].map(short);
    assert_eq!(writer_says, [std::process::id(), Name::new(1, 200, 7, 0).raw(), 0, 0]);
    assert_eq!(["late", "first", "refused"].map(long), [3_000_000, 0, 1]);
    assert_eq!(there.u64(at(STREAM, "written")), 75);
    let seats = at(STREAM, "seats");
    let index = seats + (33 * 128_usize).next_multiple_of(4096);
    let hints = index + 70 * 64;
    let frames = index + (70 * (64 + 8_usize)).next_multiple_of(4096);
    let entry = index + 74 % 70 * 64;
    let word = there.u64(entry + at(ENTRY, "word"));
    assert_eq!(word >> 20, 74);
    let frame = (word & 0xf_ffff) - 1;
    assert_eq!(there.u64(frames + frame as usize * 128), 74, "the bytes of the record");
    let fields = ["stamp", "the greatest", "epoch", "written", "lost", "sampled"];
    let fields = fields.map(|field| there.u64(entry + at(ENTRY, field)));
    let info = held.info();
    assert_eq!(fields, [1_000_074, 1_000_073, 9, info.written_ns, 0, 0]);
    assert_eq!(["length", "incarnation"].map(|field| there.u32(entry + at(ENTRY, field))), [8, info.incarnation]);
    assert_eq!(there.u64(hints + 74 % 70 * 8), 1_000_074, "the hint");
    assert_eq!(u64::from(there.u32(seats + at(SEAT, "hold"))), frame + 1);
    assert_eq!(there.u32(seats + at(SEAT, "name of the module")), Name::new(1, 200, 7, 0).raw());
    assert_eq!(["sleeper", "passed over"].map(|field| there.u64(seats + at(SEAT, field))), [0, 0]);
    assert_eq!(there.0.len(), shape.segment_bytes());
}
