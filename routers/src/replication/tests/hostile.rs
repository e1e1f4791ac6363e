//! Parts that nobody should send: refused and counted, and what is right still arrives.

use super::*;
use crate::frame::{DescriptionPart, FrameKind, RecordPart};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn head(from: NodeIndex) -> FrameHead {
    FrameHead { kind: FrameKind::RecordPart, system: 1, from, to: HOLDER, digest: 7, incarnation: 100, sequence: 0 }
}

pub(super) fn part(bytes: &[u8]) -> RecordPart<'_> {
    RecordPart {
        description: crc32fast::hash(&words(1)),
        incarnation: 3,
        len: bytes.len() as u32,
        sequence: 5,
        epoch: 1,
        stamp_ns: 100,
        bytes,
        ..RecordPart::default()
    }
}

fn take(holder: &mut Holder, from: NodeIndex, part: RecordPart<'_>) -> bool {
    holder.router.receiver.take(START, || time(START), &head(from), &ReplicaFrame::Record(part))
}

/// Of this incarnation of the origin's router.
pub(super) fn take_of(holder: &mut Holder, now_ns: u64, incarnation: u64, part: RecordPart<'_>) -> bool {
    let head = FrameHead { incarnation, ..head(ORIGIN) };
    holder.router.receiver.take(now_ns, || time(now_ns), &head, &ReplicaFrame::Record(part))
}

/// A description comes, in one part.
pub(super) fn describe(holder: &mut Holder, generation: u16, incarnation: u64, words: &[u8]) {
    let (check, len) = (crc32fast::hash(words), words.len() as u32);
    let part = DescriptionPart { place: 0, generation, check, len, offset: 0, written: 0, bytes: words };
    let head = FrameHead { incarnation, ..head(ORIGIN) };
    assert!(holder.router.receiver.take(START, || time(START), &head, &ReplicaFrame::Description(part)));
}

/// A replica's node that knows the description.
pub(super) fn described() -> Holder {
    described_by(image())
}

pub(super) fn described_by(replica: ReplicaSettings) -> Holder {
    let mut both = Both::new(replica);
    both.carry();
    assert_eq!(both.holder.ground.node.about(CAMERA), Some(words(1)));
    both.holder
}

#[test]
fn what_does_not_belong_here_is_refused_and_counted() {
    let mut holder = described();
    assert!(!take(&mut holder, ORIGIN, RecordPart { place: 1, ..part(b"picture") }), "there is no such replica");
    let large = [0; 1372];
    let cases: [(NodeIndex, RecordPart<'_>, ReplicaLoss); 8] = [
        (2, part(b"picture"), ReplicaLoss::Foreign),
        (ORIGIN, RecordPart { description: 1, ..part(b"picture") }, ReplicaLoss::Undescribed),
        (ORIGIN, RecordPart { len: 6001, ..part(&large) }, ReplicaLoss::TooLarge),
        (ORIGIN, RecordPart { len: u32::MAX, offset: u32::MAX - 7, ..part(b"picture") }, ReplicaLoss::TooLarge),
        (ORIGIN, RecordPart { len: 3000, offset: 1, ..part(&large) }, ReplicaLoss::Unsound),
        (ORIGIN, RecordPart { len: 3000, ..part(&large[1..]) }, ReplicaLoss::Unsound),
        (ORIGIN, RecordPart { stamp_ns: 0, ..part(b"picture") }, ReplicaLoss::Unsound),
        (ORIGIN, RecordPart { sequence: u64::MAX, ..part(b"picture") }, ReplicaLoss::Unsound),
    ];
    for (from, part, cause) in cases {
        let before = holder.lost(cause);
        assert!(take(&mut holder, from, part));
        assert_eq!(holder.lost(cause), before + 1, "{}: {part:?}", cause.word());
    }
    assert_eq!(holder.records(), 0);
    assert!(take(&mut holder, ORIGIN, part(b"picture")));
    assert_eq!(holder.records(), 1, "what is right arrives");
    let before = holder.lost(ReplicaLoss::Late);
    assert!(take(&mut holder, ORIGIN, RecordPart { sequence: 4, ..part(b"picture") }));
    assert_eq!(holder.lost(ReplicaLoss::Late), before + 1);
}

#[test]
fn a_record_of_which_a_part_never_comes_is_left_out() {
    let mut holder = described_by(ReplicaSettings { deadline_ns: 0, ..image() });
    let mut reader = holder.reader();
    let bytes = [4; 1372];
    let first = |sequence| RecordPart { len: 2000, sequence, ..part(&bytes) };
    assert!(take(&mut holder, ORIGIN, RecordPart { sequence: 4, ..part(b"whole") }));
    assert!(take(&mut holder, ORIGIN, first(5)));
    assert!(take(&mut holder, ORIGIN, first(5)), "the same once more");
    assert!(take(&mut holder, ORIGIN, RecordPart { sequence: 6, ..part(b"newer") }));
    assert_eq!(read(&mut reader), (vec![(4, 5), (6, 5)], 1));
    let lost = [ReplicaLoss::Incomplete, ReplicaLoss::Duplicate].map(|cause| holder.lost(cause));
    assert_eq!((lost, holder.counts().gaps.get()), ([1, 1], 1));
    // However many of them there are in a row.
    (7..50).for_each(|sequence| assert!(take(&mut holder, ORIGIN, first(sequence))));
    assert!(take(&mut holder, ORIGIN, RecordPart { sequence: 50, ..part(b"newer") }));
    assert_eq!(read(&mut reader), (vec![(50, 5)], 43));
    assert_eq!((holder.lost(ReplicaLoss::Incomplete), holder.counts().gaps.get()), (44, 44));
}

#[test]
fn no_part_does_harm() {
    let mut holder = described();
    let mut reader = holder.reader();
    let mut rng = ChaCha8Rng::seed_from_u64(22);
    let bytes = [9; 1372];
    for _ in 0..5000 {
        let one_of = |rng: &mut ChaCha8Rng, all: &[u32]| all[rng.random_range(0..all.len())];
        let len = one_of(&mut rng, &[0, 1, 1372, 1373, 3000, 6000, 6001, u32::MAX]);
        let offset = one_of(&mut rng, &[0, 0, 1, 1372, 2744, 5488, u32::MAX]);
        let room = if rng.random_bool(0.9) { len.saturating_sub(offset).min(1372) } else { one_of(&mut rng, &[0, 7]) };
        let part = RecordPart {
            place: rng.random_range(0..2),
            generation: one_of(&mut rng, &[0, 0, 0, 1, 0x8000]) as u16,
            incarnation: one_of(&mut rng, &[3, 3, 4]),
            len,
            offset,
            sequence: if rng.random_bool(0.98) { rng.random_range(0..400) } else { u64::MAX >> rng.random_range(0..9) },
            stamp_ns: if rng.random_bool(0.9) { 100 } else { rng.random_range(0..200) },
            epoch: one_of(&mut rng, &[1, 1, 1, 2]).into(),
            step: one_of(&mut rng, &[0, 1, 1, 3, u32::MAX]),
            sampled: one_of(&mut rng, &[0, 0, 1, 7, u32::MAX]),
            bytes: &bytes[..room as usize],
            ..part(b"")
        };
        let incarnation = 100 + u64::from(one_of(&mut rng, &[0, 0, 0, 0, 1]));
        let from = one_of(&mut rng, &[0, 0, 0, 2]) as NodeIndex;
        let _ = holder.router.receiver.take(
            START,
            || time(START),
            &FrameHead { incarnation, ..head(from) },
            &ReplicaFrame::Record(part),
        );
        let (all, _) = read(&mut reader);
        assert!(all.iter().all(|(sequence, len)| *len <= 6000 && *sequence < 1 << 57));
    }
    assert!(holder.records() > 20, "{}", holder.records());
    let seen = |cause| holder.lost(cause) > 0;
    assert!([ReplicaLoss::Foreign, ReplicaLoss::TooLarge, ReplicaLoss::Unsound].into_iter().all(seen));
}

#[test]
fn a_record_later_than_both_clocks_may_be_off_is_counted() {
    let mut holder = described();
    let ago = |us: u64| START - us * 1000;
    // The alarm is after 5 ms, this node's clock is off by 10 µs at most, the other's by 100 µs.
    for (sequence, (written_ns, epoch, delayed)) in
        (5..).zip([(ago(5111), 1, 1), (ago(5109), 1, 1), (0, 1, 1), (ago(8000), 1, 2), (ago(9000), 2, 2)])
    {
        let late = RecordPart { sequence, written_ns, epoch, error_ns: 100_000, ..part(b"picture") };
        assert!(take(&mut holder, ORIGIN, late));
        assert_eq!(holder.counts().delayed.get(), delayed, "record {sequence}");
    }
    let delay = holder.counts().delay.get();
    assert_eq!((holder.records(), delay.count(), delay.max), (5, 3, Duration::from_millis(8)));
}

#[test]
fn a_description_in_pieces_of_two_is_none() {
    let replicas = [image()];
    let mut holder = Holder::new(&replicas);
    let (one, two) = (words(1), words(2));
    let piece = |of: &[u8], offset: usize| (crc32fast::hash(of), offset);
    for (of, (check, offset)) in [(&one, piece(&one, 0)), (&two, piece(&two, 2000)), (&two, piece(&one, 2000))] {
        let bytes = &of[offset..offset + 2000];
        let (len, offset) = (of.len() as u32, offset as u32);
        let part = DescriptionPart { place: 0, generation: 0, check, len, offset, written: 0, bytes };
        assert!(holder.router.receiver.take(START, || time(START), &head(ORIGIN), &ReplicaFrame::Description(part)));
    }
    assert_eq!(holder.ground.node.about(CAMERA), None);
}
