//! Records of another node: in order, whole, several at a time, and what is not there is told.

use super::*;
use crate::node::directory::{Node, RegistryLock};
use crate::stream::error::WriteError;
use crate::stream::missed::Missed;
use crate::stream::reader::StreamReader;
use crate::stream::record::{Around, Next};

const SHAPE: StreamShape = StreamShape { record_bytes: 64, keep: 4, readers: 2, late: std::time::Duration::ZERO };
const LARGE: StreamShape = StreamShape { record_bytes: 5000, ..SHAPE };

fn ground() -> (tempfile::TempDir, Arc<Participant>, StreamId) {
    let folder = tempfile::tempdir().unwrap();
    let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
    let name = Name::new(1, 200, 0, 0);
    let participant = Participant::join(&node, name).unwrap();
    (folder, participant, StreamId { name, number: 1 })
}

fn write(replica: &mut ReplicaWriter, sequence: u64) -> Result<(), ReplicaError> {
    write_behind(replica, sequence, 0)
}

/// The last `sampled` before it were left out on purpose.
fn write_behind(replica: &mut ReplicaWriter, sequence: u64, sampled: u64) -> Result<(), ReplicaError> {
    let bytes = sequence.to_le_bytes();
    let stamp = Stamp { epoch: 1, ns: 100 + sequence };
    replica.begin(OriginRecord { sequence, incarnation: 7, stamp, len_bytes: bytes.len() })?;
    assert!(replica.put(sequence, 4, &bytes[4..]) && replica.put(sequence, 0, &bytes[..4]));
    replica.finish(sequence, sampled)
}

/// Sequences that are read, and how many are told as lost, until there is nothing.
fn read(reader: &mut StreamReader) -> (Vec<u64>, u64) {
    let (mut all, mut lost) = (Vec::new(), 0);
    loop {
        match reader.try_next().unwrap() {
            Next::Record(record) => {
                let sequence = record.info().sequence;
                assert_eq!(record.body(), sequence.to_le_bytes());
                assert_eq!((record.info().incarnation, record.info().stamp.ns), (7, 100 + sequence));
                all.push(sequence);
            }
            Next::Lost(more) => lost += more,
            Next::Nothing => return (all, lost),
        }
    }
}

#[test]
fn each_sequence_is_read_or_told_as_lost() {
    for shape in [SHAPE, LARGE] {
        let (_folder, participant, id) = ground();
        let mut replica = participant.replica_writer(id, shape, 3).unwrap();
        let mut reader = participant.stream_reader(id).unwrap();
        for sequence in [3, 4, 6, 7] {
            write(&mut replica, sequence).unwrap();
        }
        assert_eq!(read(&mut reader), (vec![3 + 1, 6, 7], 2), "3 has lost its place to 7, 5 never came");
        let mut later = participant.stream_reader(id).unwrap();
        assert_eq!((later.position(), read(&mut later)), (8, (vec![], 0)));
        drop(later);
        for sequence in (9..11).chain((30..1000).step_by(97)) {
            write(&mut replica, sequence).unwrap();
            let (all, lost) = read(&mut reader);
            assert_eq!((all, reader.position()), (vec![sequence], sequence + 1));
            assert!(lost > 0 || sequence == 10);
        }
        let (read, lost) = reader.accounts();
        assert_eq!((read, read + lost), (3 + 2 + 10, 904 - 3));
        assert!(matches!(write(&mut replica, 32), Err(ReplicaError::Passed { next: 904, .. })));
    }
}

/// Whatever is left out, for which cause and in how large a ring: a reader knows exactly how many there were of each,
/// at whatever time it reads, and which records it was too slow for.
#[test]
fn each_that_is_not_read_is_told_with_its_cause() {
    for seed in 0..200_u64 {
        let mut random = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        let mut below = |most: u64| {
            // As xorshift does.
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            random % most
        };
        let (_folder, participant, id) = ground();
        let shape = StreamShape { keep: [2, 4, 16][seed as usize % 3], ..SHAPE };
        let first = below(50);
        let mut replica = participant.replica_writer(id, shape, first).unwrap();
        let mut reader = participant.stream_reader(id).unwrap();
        let (mut left_out, mut written, mut since) = (Missed::default(), 0, 0);
        for _ in 0..60 {
            let [lost, sampled] = [below(3) * below(6), below(3) * below(6)];
            let sequence = replica.next() + lost + sampled;
            write_behind(&mut replica, sequence, sampled).unwrap();
            (left_out.lost, left_out.sampled, written) =
                (left_out.lost + lost, left_out.sampled + sampled, written + 1);
            let info = participant.node().inspect_stream(id).unwrap().unwrap();
            assert_eq!(Missed { passed_over: 0, ..info.missed }, left_out, "seed {seed}: the ring says so");
            if below(3) > 0 {
                continue;
            }
            let before = reader.missed();
            let (all, told) = read(&mut reader);
            assert_eq!(reader.missed().since(&before).all(), told, "seed {seed}: what is told has a cause at once");
            since += all.len() as u64;
            let passed_over = written - since;
            assert_eq!(reader.missed(), Missed { passed_over, ..left_out }, "seed {seed}");
            let info = participant.node().inspect_stream(id).unwrap().unwrap();
            assert_eq!(info.missed.passed_over, passed_over, "seed {seed}: its seat says so");
            if below(8) == 0 {
                // Its next life goes on with the counts.
                drop(replica);
                replica = participant.replica_writer(id, shape, sequence + 1).unwrap();
            }
        }
        let mut later = participant.stream_reader(id).unwrap();
        let next = replica.next() + 40;
        write_behind(&mut replica, next, 30).unwrap();
        assert_eq!(
            (read(&mut later), later.missed()),
            ((vec![next], 40), Missed { lost: 10, sampled: 30, passed_over: 0 })
        );
        later.seek(first);
        let (there, told) = read(&mut later);
        assert_eq!(there.len() as u64 + told, next + 1 - first, "seed {seed}");
        let left_out = Missed { lost: left_out.lost + 10, sampled: left_out.sampled + 30, passed_over: 0 };
        let again = later.missed().since(&Missed { lost: 10, sampled: 30, passed_over: 0 });
        assert_eq!(Missed { passed_over: 0, ..again }, left_out, "seed {seed}: from the first one on all is known");
    }
}

/// More is claimed to be left out on purpose than is left out at all.
#[test]
fn a_gap_has_no_more_than_its_length_of_either_cause() {
    let (_folder, participant, id) = ground();
    let mut replica = participant.replica_writer(id, SHAPE, 0).unwrap();
    let mut reader = participant.stream_reader(id).unwrap();
    for (sequence, claimed) in [(0, u64::MAX), (3, u64::MAX), (4, 9), (40, 1 << 40)] {
        write_behind(&mut replica, sequence, claimed).unwrap();
    }
    let (all, told) = read(&mut reader);
    let passed_over = 4 - all.len() as u64;
    assert_eq!((told, reader.missed()), (37 + passed_over, Missed { lost: 0, sampled: 37, passed_over }));
}

fn begin(replica: &mut ReplicaWriter, sequence: u64, ns: u64) -> Result<(), ReplicaError> {
    replica.begin(OriginRecord { sequence, incarnation: 7, stamp: Stamp { epoch: 1, ns }, len_bytes: 8 })
}

#[test]
fn records_are_filled_at_once_and_finished_in_order() {
    for shape in [SHAPE, LARGE] {
        let (_folder, participant, id) = ground();
        let mut replica = participant.replica_writer(id, shape, 0).unwrap();
        let mut reader = participant.stream_reader(id).unwrap();
        for older in (0..60).step_by(3) {
            let newer = older + 1;
            for sequence in [older, newer] {
                begin(&mut replica, sequence, 100 + sequence).unwrap();
            }
            let others = newer + 1..older + shape.begun_max() as u64;
            others.clone().for_each(|other| begin(&mut replica, other, 900).unwrap());
            assert!(matches!(begin(&mut replica, others.end, 900), Err(ReplicaError::Begun(_))), "one too many");
            others.for_each(|other| replica.give_up(other));
            for half in [0, 4] {
                for sequence in [newer, older] {
                    assert!(replica.put(sequence, half, &sequence.to_le_bytes()[half..half + 4]));
                }
            }
            assert!(matches!(reader.try_next().unwrap(), Next::Nothing), "nobody sees what is not finished");
            if older % 2 == 0 {
                replica.finish(older, 0).unwrap();
            }
            replica.finish(newer, 0).unwrap();
            assert!(replica.begun(older).is_none() && replica.finish(older, 0).is_err(), "a sequence does not go back");
            let (all, lost) = read(&mut reader);
            let before = u64::from(older > 0);
            let expected = if older % 2 == 0 { (vec![older, newer], before) } else { (vec![newer], before + 1) };
            assert_eq!((all, lost), expected);
        }
    }
}

#[test]
fn finishing_a_record_gives_up_all_older_ones() {
    for shape in [SHAPE, LARGE] {
        let (_folder, participant, id) = ground();
        let mut replica = participant.replica_writer(id, shape, 0).unwrap();
        let newest = shape.begun_max() as u64 - 1;
        for _ in 0..2 {
            let first = replica.next();
            (first..=first + newest).for_each(|sequence| begin(&mut replica, sequence, 100 + sequence).unwrap());
            replica.finish(first + newest, 0).unwrap();
            assert!((first..=first + newest).all(|sequence| replica.begun(sequence).is_none()));
        }
    }
}

#[test]
fn a_stamp_behind_what_was_finished_meanwhile_is_refused() {
    for shape in [SHAPE, LARGE] {
        let (_folder, participant, id) = ground();
        let mut replica = participant.replica_writer(id, shape, 0).unwrap();
        begin(&mut replica, 0, 100).unwrap();
        begin(&mut replica, 1, 99).unwrap();
        replica.finish(0, 0).unwrap();
        assert!(matches!(replica.finish(1, 0), Err(ReplicaError::Write(WriteError::Late { .. }))));
        assert_eq!((replica.next(), replica.begun(1)), (1, None));
    }
}

#[test]
fn a_frame_that_no_reader_holds_is_there_for_one_record_always() {
    let (_folder, participant, id) = ground();
    let mut replica = participant.replica_writer(id, LARGE, 0).unwrap();
    let mut readers = [participant.stream_reader(id).unwrap(), participant.stream_reader(id).unwrap()];
    write(&mut replica, 0).unwrap();
    write(&mut replica, 1).unwrap();
    let [one, two] = &mut readers;
    let _ = two.try_next().unwrap();
    let held = [one, two].map(|reader| reader.try_next().unwrap());
    (2..9).for_each(|sequence| write(&mut replica, sequence).unwrap());
    begin(&mut replica, 9, 109).unwrap();
    assert!(matches!(begin(&mut replica, 10, 110), Err(ReplicaError::Begun(_))), "readers hold all others");
    replica.give_up(9);
    begin(&mut replica, 10, 110).unwrap();
    drop(held);
    begin(&mut replica, 11, 111).unwrap();
    for sequence in [10, 11_u64] {
        assert!(replica.put(sequence, 0, &sequence.to_le_bytes()));
        replica.finish(sequence, 0).unwrap();
    }
}

#[test]
fn a_held_record_stays_whole_when_many_are_left_out() {
    let (_folder, participant, id) = ground();
    let mut replica = participant.replica_writer(id, LARGE, 0).unwrap();
    let mut reader = participant.stream_reader(id).unwrap();
    write(&mut replica, 0).unwrap();
    let Next::Record(held) = reader.try_next().unwrap() else { panic!("it is there") };
    for sequence in (10..200).step_by(7) {
        write(&mut replica, sequence).unwrap();
        assert_eq!(held.body(), 0_u64.to_le_bytes());
    }
}

#[test]
fn times_are_found_beside_what_was_left_out() {
    let (_folder, participant, id) = ground();
    let shape = StreamShape { keep: 64, ..SHAPE };
    let mut replica = participant.replica_writer(id, shape, 0).unwrap();
    let mut reader = participant.stream_reader(id).unwrap();
    let written: Vec<u64> = (0..40_u64).filter(|sequence| sequence % 7 != 3 && !(20..31).contains(sequence)).collect();
    for sequence in &written {
        write(&mut replica, *sequence).unwrap();
        for asked in 0..=*sequence {
            let around = reader.around(Stamp { epoch: 1, ns: 100 + asked }).unwrap();
            let before = written.iter().rfind(|there| **there <= asked);
            let after = written.iter().find(|there| **there >= asked);
            let Around::Records { before: found, after: next } = around else { panic!("{asked}: {around:?}") };
            assert_eq!((Some(&found.sequence), Some(&next.sequence)), (before, after), "of {asked}");
        }
    }
    assert_eq!(participant.node().inspect_stream(id).unwrap().unwrap().oldest.map(|oldest| oldest.sequence), Some(0));
}

#[test]
fn the_next_writer_goes_on_and_an_origin_made_anew_begins_anew() {
    let (_folder, participant, id) = ground();
    let mut replica = participant.replica_writer(id, SHAPE, 0).unwrap();
    let mut reader = participant.stream_reader(id).unwrap();
    write(&mut replica, 0).unwrap();
    write(&mut replica, 5).unwrap();
    drop(replica);
    let mut replica = participant.replica_writer(id, SHAPE, 6).unwrap();
    assert_eq!((replica.next(), replica.newest().map(|info| info.sequence)), (6, Some(5)));
    write(&mut replica, 6).unwrap();
    assert_eq!(read(&mut reader).0.last(), Some(&6));
    drop(replica);
    let mut replica = participant.replica_writer(id, SHAPE, 2).unwrap();
    assert_eq!((replica.next(), replica.newest()), (2, None));
    write(&mut replica, 2).unwrap();
    assert_eq!(read(&mut reader), (vec![2], 0));
}

#[test]
fn what_does_not_fit_is_not_written() {
    let (_folder, participant, id) = ground();
    let mut replica = participant.replica_writer(id, SHAPE, 0).unwrap();
    let stamp = Stamp { epoch: 1, ns: 1 };
    let record = OriginRecord { sequence: 0, incarnation: 1, stamp, len_bytes: 65 };
    assert!(matches!(replica.begin(record), Err(ReplicaError::Write(WriteError::TooLarge { .. }))));
    assert!(!replica.put(0, 0, b"a") && replica.finish(0, 0).is_err());
    replica.begin(OriginRecord { len_bytes: 8, ..record }).unwrap();
    for (offset, bytes) in [(8, &b"a"[..]), (1, b"12345678"), (usize::MAX, b"ab")] {
        assert!(!replica.put(0, offset, bytes), "{offset}");
    }
    assert!(!replica.put(1, 0, b"a"), "another record");
    assert!(matches!(replica.begin(OriginRecord { len_bytes: 8, ..record }), Err(ReplicaError::Passed { .. })));
    replica.give_up(0);
    assert!(replica.begun(0).is_none());
    let unstamped = OriginRecord { stamp: Stamp { epoch: 1, ns: 0 }, len_bytes: 8, ..record };
    assert!(matches!(replica.begin(unstamped), Err(ReplicaError::Write(WriteError::Unstamped(_)))));
    let past = OriginRecord { sequence: SEQUENCE_MAX + 1, len_bytes: 8, ..record };
    assert!(matches!(replica.begin(past), Err(ReplicaError::Passed { .. })));
}

#[test]
fn what_has_no_time_does_not_wait_for_a_process_that_has_the_registry() {
    let (_folder, participant, id) = ground();
    let first = |patience| participant.replica_writer_within(id, SHAPE, 3, patience).map(|replica| replica.next());
    let registry = RegistryLock::take(participant.node().directory()).unwrap();
    let busy = first(Duration::ZERO);
    assert!(matches!(busy, Err(StreamError::Node(NodeError::Busy(_)))), "{busy:?}");
    let removed = participant.node().remove_orphan_stream_within(id, Duration::ZERO);
    assert!(matches!(removed, Err(NodeError::Busy(_))), "{removed:?}");
    drop(registry);
    assert_eq!(first(Duration::ZERO).unwrap(), 3);
}
