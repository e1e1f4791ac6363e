//! Looks survive their way, and bytes that are none are refused.

use super::*;
use crate::launcher::Phase;
use proptest::prelude::*;
use rohrpost_mailbox::{Class, ClassTraffic, FlowInfo, FlowSecond, Latency, Type};

/// A look with something in each of its parts.
fn seen() -> Snapshot {
    let waited = Latency { max: Duration::from_micros(3), ..Latency::default() };
    let class = ClassTraffic {
        class: Some(Class(140)),
        received: 7,
        body_bytes: 70,
        losses: [1; Loss::ALL.len()],
        latency: waited.clone(),
    };
    let name = Name::new(1, 140, 0, 0);
    let process = ParticipantInfo {
        module: name,
        pid: 4711,
        incarnation: 9,
        state: Some(ModuleState::Error),
        complains: true,
        errors: 1,
        restarts: 2,
        joined_ns: 5,
        in_hand: None,
    };
    let module = ModuleSurvey {
        node: "base".into(),
        at_ns: Some(9),
        name,
        aliases: vec![Name::new(1, 141, 0, 0)],
        process: Some(process),
        usage: Some(Usage { cpu: Duration::from_millis(30), memory_bytes: 1 << 20 }),
        scheduling: Some(Scheduling::Normal(-3)),
        received: 7,
        bytes_in: 70,
        lost: 1,
        losses: [1; Loss::ALL.len()],
        waited,
        sent: 3,
        bytes_out: 30,
        depth: 1,
        in_turn: Some(Duration::from_millis(4200)),
        working: Some(Working { part: "`tick`".into(), lasts: Duration::from_millis(4200) }),
        child: Some(ChildState {
            module: "laser.0".into(),
            phase: Phase::Waiting,
            pid: None,
            lives: 3,
            restarts: 2,
            attempt: 2,
            attempts_max: 5,
            starts_in_ms: Some(100),
            last_end: "ended with 1".into(),
            error: "no port".into(),
            printed: String::new(),
        }),
        error: None,
    };
    let second = FlowSecond { second: 8, interval_ns: Some((1, 2)), bytes: (3, 4) };
    let flow = FlowInfo {
        pid: 4711,
        module: name,
        incarnation: 9,
        from: name,
        to: Name::new(1, 200, 0, 0),
        kind: Type::command(16),
        packages: 3,
        bytes: 30,
        refused: 0,
        first_ns: 1,
        last_ns: 2,
        interval_squares_ns2: u128::MAX,
        age_sum_ns: 0,
        seconds: vec![second],
    };
    let mailbox = MailboxInfo {
        name,
        shape: Shape { max_age: Some(Duration::from_secs(2)), full: OverflowPolicy::Latest, ..Shape::default() },
        owner: Some(4711),
        adoptions: 1,
        depth: 1,
        depth_max: 2,
        sent: 8,
        classes: vec![class.clone()],
    };
    let stamp = Stamp { epoch: 3, ns: 17 };
    let record = RecordInfo { sequence: 5, stamp, written_ns: 6, len_bytes: 100, incarnation: 9 };
    let info = StreamInfo {
        id: StreamId { name, number: 1 },
        shape: StreamShape { late: Duration::from_millis(50), ..StreamShape::default() },
        writer: Some(Party { participant: 3, pid: Some(4711), module: name, is_alive: true }),
        adoptions: 1,
        written: 6,
        refused: 2,
        oldest: Some(record),
        newest: Some(RecordInfo { sequence: 6, ..record }),
        readers: 4,
        reader_modules: vec![name],
        holding: 1,
        sleeping: 3,
        missed: Missed { lost: 7, sampled: 8, passed_over: 9 },
    };
    Snapshot::Survey(Box::new(Survey {
        node: "base".into(),
        at_ns: 9,
        modules: vec![module],
        mailboxes: vec![mailbox],
        streams: vec![StreamSurvey { node: "base".into(), at_ns: 9, info }],
        classes: vec![class],
        flows: vec![flow],
    }))
}

#[test]
fn what_travels_arrives_field_by_field() {
    let there = seen();
    let here = Snapshot::from_bytes(&there.to_bytes()).unwrap();
    assert_eq!(format!("{there:?}"), format!("{here:?}"));
}

proptest! {
    #[test]
    fn whatever_the_bytes_are_they_are_a_look_or_an_error(
        bytes in prop::collection::vec(any::<u8>(), 0..400), at in any::<prop::sample::Index>(), with in any::<u8>(),
    ) {
        let mut changed = seen().to_bytes();
        let at = at.index(changed.len());
        changed[at] = with;
        for bytes in [bytes, changed] {
            if let Ok(seen) = Snapshot::from_bytes(&bytes) {
                // What was read is written as it is read: a second way through changes nothing.
                let again = Snapshot::from_bytes(&seen.to_bytes()).unwrap();
                if let Snapshot::Survey(survey) = &seen {
                    survey.streams.iter().for_each(|stream| _ = stream.info.shape.segment_bytes());
                }
                prop_assert_eq!(format!("{seen:?}"), format!("{again:?}"));
            }
        }
    }
}
