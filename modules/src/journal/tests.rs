//! Journals as a module writes them, and replays of these and of others with one thing changed.

use super::entry::{Entries, NoEntry};
use super::records::Records;
use super::*;
use rohrpost_mailbox::{Name, Next, Node, Participant, StreamId, SystemClock};
use rohrpost_schema::{DataItem, DataKind, Description, Field, Type};
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

const MODULE: Name = Name::new(1, 100, 0, 0);
const EVENTS: u64 = 6;

/// What a module does with an event: it looks at the clock twice, and publishes what it saw.
fn work(journal: &ModuleJournal, clock_ns: &mut u64, event: u64, bias: u64) {
    journal.event(&JournalEvent::Tick, || event * 1000);
    let mut ask = || {
        *clock_ns += 7;
        *clock_ns
    };
    let mut ask_time = || journal.answer(Tag::Time, Question::Plain, &mut ask);
    let (first, second) = (ask_time(), ask_time());
    let value = postcard::to_stdvec(&(first * 31 + second + bias)).unwrap();
    journal
        .output(Tag::Published, &NotedItem { endpoint: 0, number: 1, stamp_ns: first, value: NotedValue::of(&value) });
}

fn run(journal: &ModuleJournal, bias_at: Option<u64>) {
    let mut clock_ns = 1_000_000;
    for event in 0..EVENTS {
        work(journal, &mut clock_ns, event, u64::from(bias_at == Some(event)));
    }
    journal.end();
}

/// Bytes of a journal, read from the stream that it is written into.
fn written(run: impl FnOnce(&ModuleJournal)) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
    let participant = Participant::join(&node, MODULE).unwrap();
    let id = StreamId { name: MODULE, number: JOURNAL_NUMBER };
    let stream = participant.stream_writer(id, rohrpost_config::JOURNAL.shape()).unwrap();
    let mut reader = participant.stream_reader(id).unwrap();
    let journal = ModuleJournal::written(JournalWriter::new(stream, SystemClock::open(&node), 7));
    journal.begin(&Begin::new("pilot.0", ("robot.toml", "text"), None));
    run(&journal);
    drop(PRESENT.take());
    let mut bytes = Vec::new();
    while let Next::Record(record) = reader.try_next().unwrap() {
        let piece = Piece::read(record.body()).unwrap();
        assert_eq!((piece.incarnation, piece.offset), (7, bytes.len() as u64));
        bytes.extend_from_slice(piece.bytes);
    }
    bytes
}

fn replay_of(bytes: &[u8], records: Records, ends: Option<&str>) -> JournalReplay {
    JournalReplay::new(Box::new(Cursor::new(bytes.to_vec())), records, ends.map(Into::into), "".into())
}

/// What a replay of these bytes finds.
fn replayed(bytes: &[u8], ends: Option<&str>, run: impl FnOnce(&ModuleJournal)) -> ReplayReport {
    replayed_with(bytes, Records::default(), ends, run)
}

/// The same, with these records.
fn replayed_with(bytes: &[u8], records: Records, ends: Option<&str>, run: impl FnOnce(&ModuleJournal)) -> ReplayReport {
    let item = DataItem { number: 1, kind: DataKind::Data, field: Field::new("sum", Type::U64) };
    let (name, class, text) = ("Sums".into(), "pilot".into(), String::new());
    let own = Description { name, class, text, functions: Vec::new(), data: vec![item] };
    let mut replay = replay_of(bytes, records, ends);
    replay.know_own(vec![Some(own)]);
    let journal = ModuleJournal::replayed(replay);
    let run = || {
        journal.begin(&Begin::new("pilot.0", ("elsewhere.toml", "text"), None));
        run(&journal);
    };
    let told = catch_unwind(AssertUnwindSafe(run)).unwrap_err();
    *told.downcast::<ReplayReport>().unwrap()
}

/// Entries of a journal: tag and content.
fn entries(bytes: &[u8]) -> Vec<(Tag, Vec<u8>)> {
    let (mut read, mut entries) = (Entries::new(bytes), Vec::new());
    while let Ok(tag) = read.look() {
        entries.push((tag, read.content().to_vec()));
        read.pass();
    }
    assert_eq!(read.look(), Err(NoEntry::End));
    entries
}

/// A journal of these entries, with sums that are right.
fn sealed(entries: &[(Tag, Vec<u8>)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let seal = |sum, (tag, content): &(Tag, Vec<u8>)| entry::append_raw(&mut bytes, sum, *tag, content).unwrap();
    entries.iter().fold(0, seal);
    bytes
}

#[test]
fn the_same_run_is_identical_whatever_its_own_clock_says() {
    let bytes = written(|journal| run(journal, None));
    let report = replayed(&bytes, None, |journal| run(journal, None));
    let expected = ReplayReport {
        verdict: ReplayVerdict::Identical { is_whole: true },
        events: EVENTS,
        outputs: EVENTS,
        first_ns: 0,
        last_ns: (EVENTS - 1) * 1000,
        not_made: None,
    };
    assert_eq!(report, expected);
    let own_clock = |journal: &ModuleJournal| {
        let mut clock_ns = 99;
        (0..EVENTS).for_each(|event| work(journal, &mut clock_ns, event, 0));
        journal.end();
    };
    assert_eq!(replayed(&bytes, None, own_clock), expected);
}

#[test]
fn what_differs_is_told_with_its_event_and_both_values() {
    let bytes = written(|journal| run(journal, None));
    for at in 0..EVENTS {
        let report = replayed(&bytes, None, |journal| run(journal, Some(at)));
        let ReplayVerdict::Differs(difference) = &report.verdict else { panic!("{report:?}") };
        assert_eq!((report.events, report.outputs, report.last_ns), (at + 1, at, at * 1000));
        assert_eq!(difference.event, "ticks");
        let first = 1_000_000 + 14 * at + 7;
        let sum = first * 31 + first + 7;
        assert_eq!(difference.recorded, format!("it publishes data: sum of {first} ns, {sum}"));
        assert_eq!(difference.replayed, format!("it publishes data: sum of {first} ns, {}", sum + 1));
    }
}

#[test]
fn each_flipped_bit_is_found_in_its_event() {
    let bytes = written(|journal| run(journal, None));
    let (mut at, mut events) = (0, 0);
    for (tag, content) in entries(&bytes) {
        let end = at + sealed(&[(tag, content)]).len();
        for bit in at * 8..end * 8 {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            let report = replayed(&flipped, None, |journal| run(journal, None));
            let damaged = ReplayVerdict::Refused("an entry of the journal is damaged or missing here".into());
            assert_eq!((&report.verdict, report.events), (&damaged, events), "bit {bit}: {report:?}");
        }
        events += u64::from(tag == Tag::Event);
        at = end;
    }
    assert_eq!(events, EVENTS);
}

#[test]
fn a_missing_entry_and_a_clock_reading_1_ns_off_are_found_in_their_event_though_all_sums_are_right() {
    let whole = entries(&written(|journal| run(journal, None)));
    assert_eq!(replayed(&sealed(&whole), None, |journal| run(journal, None)).events, EVENTS);
    let mut events = 0;
    for (at, (tag, content)) in whole.iter().enumerate().skip(1) {
        events += u64::from(*tag == Tag::Event);
        let mut less = whole.clone();
        less.remove(at);
        let report = replayed(&sealed(&less), None, |journal| run(journal, None));
        let is_end = *tag == Tag::End && report.verdict == ReplayVerdict::Identical { is_whole: false };
        assert!(is_end || matches!(report.verdict, ReplayVerdict::Differs(_)), "without entry {at}: {report:?}");
        // A missing event is missed where it should begin.
        assert_eq!(report.events, events - u64::from(*tag == Tag::Event), "without entry {at}");
        if *tag == Tag::Time {
            let mut later = whole.clone();
            let ns: u64 = postcard::from_bytes(content).unwrap();
            later[at].1 = postcard::to_stdvec(&(ns + 1)).unwrap();
            let report = replayed(&sealed(&later), None, |journal| run(journal, None));
            assert!(matches!(report.verdict, ReplayVerdict::Differs(_)), "entry {at}: {report:?}");
            assert_eq!((report.events, report.outputs), (events, events - 1), "entry {at}");
        }
    }
}

/// Asks of a stream what is next, and publishes what came.
fn look(journal: &ModuleJournal, event: u64, tag: Tag, question: Question<'_>) {
    journal.event(&JournalEvent::Tick, || event * 1000);
    let next: Option<u64> = journal.answer(tag, question, || Some(event));
    let value = postcard::to_stdvec(&next.unwrap_or_default()).unwrap();
    journal.output(Tag::Published, &NotedItem { endpoint: 0, number: 1, stamp_ns: 0, value: NotedValue::of(&value) });
}

#[test]
fn another_question_is_told_in_its_event_with_both_though_the_answer_would_do() {
    let [hook, lamp] = [1, 2].map(|number| StreamId { name: MODULE, number }.into());
    let run = |tag: Tag, question: Question<'static>| {
        move |journal: &ModuleJournal| {
            (0..3).for_each(|event| look(journal, event, Tag::Record, Question::Sequence(hook, event)));
            look(journal, 3, tag, question);
            journal.end();
        }
    };
    let bytes = written(run(Tag::Record, Question::Sequence(hook, 3)));
    let same = replayed(&bytes, None, run(Tag::Record, Question::Sequence(hook, 3)));
    assert_eq!(same.to_string(), "identical: 4 events, 4 outputs");
    for (tag, question, told) in [
        (Tag::Record, Question::Sequence(hook, 4), "it reads a record of a stream: stream 1 of 1.100.0.0, sequence 4"),
        (Tag::Record, Question::Sequence(lamp, 3), "it reads a record of a stream: stream 2 of 1.100.0.0, sequence 3"),
        (Tag::Newest, Question::Of(hook), "it reads the newest record of a stream: stream 1 of 1.100.0.0"),
        (
            Tag::Around,
            Question::Time(hook, 2, 5),
            "it looks for a time in a stream: stream 1 of 1.100.0.0, 5 ns of epoch 2",
        ),
    ] {
        let report = replayed(&bytes, None, run(tag, question));
        let ReplayVerdict::Differs(difference) = &report.verdict else { panic!("{report:?}") };
        assert_eq!((report.events, report.outputs, report.last_ns), (4, 3, 3000), "{report:?}");
        assert_eq!(difference.recorded, "it reads a record of a stream: stream 1 of 1.100.0.0, sequence 3");
        assert_eq!(difference.replayed, told);
    }
}

#[test]
fn a_long_record_that_is_recorded_anyhow_stands_there_by_its_sum() {
    let picture: Vec<u8> = (0..70_000_u32).map(|at| (at / 7) as u8).collect();
    let id = StreamId { name: MODULE, number: 2 };
    // As a reader of streams does it.
    let read = |journal: &ModuleJournal, is_recorded: bool| {
        journal.event(&JournalEvent::Tick, || 5);
        let bytes = match journal.given(Tag::Newest, Question::Of(id.into())) {
            Some(given) => journal.bytes(given.read()).into_owned(),
            None => {
                let noted = journal.record(id, 7, is_recorded, &picture);
                journal.note(Tag::Newest, Question::Of(id.into()), &noted);
                picture.clone()
            }
        };
        journal.output(Tag::Replied, &NotedReply { is_fault: false, result: NotedValue::of(&bytes) });
        journal.end();
    };
    let [whole, short] = [false, true].map(|is_recorded| written(|journal| read(journal, is_recorded)));
    assert!(whole.len() > 70_000 && short.len() < 300, "{} B, {} B", whole.len(), short.len());
    let found = replayed(&whole, None, |journal| read(journal, false));
    assert_eq!(found.to_string(), "identical: 1 events, 1 outputs");

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("records");
    let records = |bytes: &[u8]| {
        let mut writer = RecordWriter::create(&path).unwrap();
        writer.add(RecordSum::of(bytes), bytes).unwrap();
        writer.finish().unwrap();
        Records::open(&path).unwrap()
    };
    let found = replayed_with(&short, records(&picture), None, |journal| read(journal, true));
    assert_eq!(found.to_string(), "identical: 1 events, 1 outputs");
    let mut other = picture.clone();
    other[40_000] ^= 1;
    for records in [records(&other), Records::default()] {
        let found = replayed_with(&short, records, None, |journal| read(journal, true));
        assert_eq!((found.events, found.outputs), (1, 0));
        let ReplayVerdict::Refused(why) = &found.verdict else { panic!("{found:?}") };
        assert!(why.starts_with("record 7 of stream 2 of 1.100.0.0, 70000 bytes of sum "), "{why}");
    }
}

#[test]
fn a_journal_ends_where_something_is_that_it_does_not_see() {
    let with_hole = |journal: &ModuleJournal| {
        let mut clock_ns = 0;
        work(journal, &mut clock_ns, 0, 0);
        journal.event(&JournalEvent::Tick, || 1000);
        journal.hole("it looks out of the window");
        work(journal, &mut clock_ns, 2, 0);
    };
    let bytes = written(with_hole);
    assert_eq!(entries(&bytes).last().map(|(tag, _)| *tag), Some(Tag::Hole));
    let report = replayed(&bytes, None, with_hole);
    assert_eq!(report.to_string(), "refused from event 2 on, at 1000 ns: it looks out of the window");
}

#[test]
fn a_module_that_is_not_made_is_repeated_with_its_reason() {
    for (tag, told) in [(Tag::Failed, "it fails: \"no port\""), (Tag::Panicked, "it panics: \"no port\"")] {
        let run = |why: &'static str| {
            move |journal: &ModuleJournal| {
                journal.event(&JournalEvent::New, || 5);
                end_unmade(tag, why);
            }
        };
        let bytes = written(run("no port"));
        let report = replayed(&bytes, None, run("no port"));
        assert_eq!(report.to_string(), format!("identical: 1 events, 1 outputs; the module was not made: {told}"));
        let report = replayed(&bytes, None, run("no money"));
        assert!(matches!(report.verdict, ReplayVerdict::Differs(_)), "{report:?}");
        let report = replayed(&bytes, None, |_| end_unstarted("no node"));
        assert_eq!(report.verdict, ReplayVerdict::Refused("the module cannot be started here: no node".into()));
    }
    let bytes = written(|_| end_unstarted("no node"));
    let report = replayed(&bytes, None, |journal| journal.event(&JournalEvent::New, || 5));
    assert_eq!(report.verdict, ReplayVerdict::Refused("the module could not be started: no node".into()));
}

#[test]
fn a_panic_while_something_is_taken_in_is_a_hole() {
    let taking = |journal: &ModuleJournal| {
        journal.event(&JournalEvent::Tick, || 5);
        let taken = catch_unwind(AssertUnwindSafe(|| journal.apart(|| panic!("no device"))));
        assert!(taken.is_err());
        end_unmade(Tag::Panicked, "no device");
    };
    let bytes = written(taking);
    let report = replayed(&bytes, None, |journal| {
        journal.event(&JournalEvent::Tick, || 5);
        journal.asked(Tag::TakenIn, Question::Plain);
    });
    assert!(report.to_string().contains("refused from event 1 on, at 5 ns: the module panicked within"), "{report}");
}

#[test]
fn a_journal_that_is_cut_off_says_why() {
    let bytes = written(|journal| run(journal, None));
    let half = &bytes[..bytes.len() / 2];
    let report = replayed(half, None, |journal| run(journal, None));
    assert_eq!(report.verdict, ReplayVerdict::Identical { is_whole: false });
    assert!((1..EVENTS).contains(&report.events), "{report:?}");
    let told = replayed(half, Some("5 bytes are lost"), |journal| run(journal, None));
    assert_eq!(told, ReplayReport { verdict: ReplayVerdict::Refused("5 bytes are lost".into()), ..report });
}

#[test]
fn another_module_or_other_settings_are_refused() {
    let bytes = written(|journal| run(journal, None));
    for (module, text) in [("pilot.1", "text"), ("pilot.0", "texT")] {
        let told = catch_unwind(AssertUnwindSafe(|| {
            let journal = ModuleJournal::replayed(replay_of(&bytes, Records::default(), None));
            journal.begin(&Begin::new(module, ("robot.toml", text), None));
        }));
        let report = told.unwrap_err().downcast::<ReplayReport>().unwrap();
        assert!(matches!(report.verdict, ReplayVerdict::Refused(_)), "{report:?}");
    }
}

#[test]
fn entries_larger_than_a_record_of_the_stream_come_whole() {
    let values: Vec<Vec<u8>> = [0, 1, 4000, 4096, 4097, 60_000].map(|len| vec![0xa5; len]).into();
    let told = |journal: &ModuleJournal| {
        for value in &values {
            let event = JournalEvent::Function { endpoint: 0, number: 16, arguments: Blob(value) };
            journal.event(&event, || 5);
            journal.output(Tag::Replied, &NotedReply { is_fault: false, result: NotedValue::of(value) });
        }
        journal.end();
    };
    let bytes = written(told);
    let report = replayed(&bytes, None, told);
    assert_eq!(report.to_string(), "identical: 6 events, 6 outputs");
    let mut events = entries(&bytes).into_iter().filter(|(tag, _)| *tag == Tag::Event);
    assert!(values.iter().all(|value| events.next().is_some_and(|(_, content)| content.len() > value.len())));
}
