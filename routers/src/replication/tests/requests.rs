//! Requests that nobody should send: refused and counted, and what is right is still answered.

use super::super::requests::OutgoingRequest;
use super::*;
use crate::frame::{Frame, FrameKind, PART_REQUEST_BYTES_MAX, PartRequest, PartRequestBytes};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// For these parts of a record of this sequence.
pub(super) fn request(sequence: u64, indices: &[usize]) -> PartRequest {
    let mut parts = [0; 16];
    indices.iter().for_each(|index| parts[index / 64] |= 1 << (index % 64));
    PartRequest { place: 0, generation: 0, first: 0, router: 100, sequence, parts }
}

/// Hands a request over; whether it was not refused.
pub(super) fn ask(origin: &mut Origin, from: NodeIndex, request: PartRequest) -> bool {
    let kind = FrameKind::PartRequest;
    let head = FrameHead { kind, system: 1, from, to: ORIGIN, digest: 7, incarnation: 101, sequence: 0 };
    let mut bytes = [0; PART_REQUEST_BYTES_MAX];
    let len = request.write(&mut bytes);
    let request = PartRequestBytes::parse(&bytes[..len]).unwrap();
    origin.router.receiver.take(START, || time(START), &head, &ReplicaFrame::Request(request))
}

fn again(origin: &Origin) -> u64 {
    origin.router.sender.counts().iter().map(|counts| counts.again.get()).sum()
}

/// A node that has sent so many records of five parts.
fn sent(replica: ReplicaSettings, count: u64) -> (Origin, StreamWriter, u64) {
    let mut origin = Origin::new(&[replica]);
    let (mut writer, mut now_ns) = (origin.writer(ID, SHAPE), START);
    for step in 0..count {
        writer.write(at(100 + step), &[step as u8; 6000]).unwrap();
        origin.leave(&mut now_ns);
    }
    (origin, writer, now_ns)
}

#[test]
fn parts_that_are_asked_for_leave_before_new_ones() {
    let (mut origin, mut writer, mut now_ns) = sent(image(), 2);
    writer.write(at(200), &[9; 6000]).unwrap();
    assert!(ask(&mut origin, HOLDER, request(1, &[4])) && ask(&mut origin, HOLDER, request(0, &[1, 3])));
    let sequence = |datagram: &[u8]| (datagram[56], u32::from_le_bytes(*datagram[52..].first_chunk().unwrap()) / 1372);
    let step = |datagram: &[u8]| match Frame::parse(datagram) {
        Ok((_, Frame::Replica(ReplicaFrame::Record(part)))) => part.step,
        _ => panic!("it is a part of a record"),
    };
    let all = origin.leave(&mut now_ns);
    let left: Vec<(u8, u32)> = all.iter().map(|datagram| sequence(datagram)).collect();
    assert_eq!(left, [(0, 1), (0, 3), (1, 4), (2, 0), (2, 1), (2, 2), (2, 3), (2, 4)]);
    let steps: Vec<u32> = all.iter().map(|datagram| step(datagram)).collect();
    assert_eq!(steps, [0, 0, 0, 1, 1, 1, 1, 1], "those say nothing of what was sent before");
    assert_eq!(again(&origin), 3);
}

#[test]
fn requests_that_cannot_be_answered_are_refused_and_counted() {
    let (mut origin, mut writer, mut now_ns) = sent(ReplicaSettings { sampling: Sampling::Every(2), ..image() }, 4);
    assert!(!ask(&mut origin, 2, request(0, &[0])), "it has no replica");
    assert!(!ask(&mut origin, HOLDER, PartRequest { place: 1, ..request(0, &[0]) }), "there is no such replica");
    for (request, cause) in [
        (request(2, &[0, 5]), ReplicaLoss::OutOfRange),
        (PartRequest { first: u32::MAX - 2000, ..request(2, &[0]) }, ReplicaLoss::OutOfRange),
        (request(1, &[0]), ReplicaLoss::NotSent),
        (request(4, &[0]), ReplicaLoss::NotSent),
        (request(u64::MAX, &[0]), ReplicaLoss::NotSent),
        (PartRequest { router: 99, ..request(2, &[0]) }, ReplicaLoss::NotSent),
        (PartRequest { generation: 1, ..request(2, &[0]) }, ReplicaLoss::NotSent),
    ] {
        let before = origin.lost(cause);
        assert!(ask(&mut origin, HOLDER, request));
        assert!(origin.leave(&mut now_ns).is_empty(), "{request:?}");
        assert_eq!(origin.lost(cause), before + 1, "{request:?}");
    }
    assert!(origin.router.receiver.must_ring(), "the thread that sends looks at each");
    // The ring keeps 16 records, and the last 32 that were sent may be asked for.
    for step in 4..30 {
        writer.write(at(100 + step), &[9; 6000]).unwrap();
        origin.leave(&mut now_ns);
    }
    assert!(ask(&mut origin, HOLDER, request(2, &[0])) && origin.leave(&mut now_ns).is_empty());
    assert_eq!(origin.lost(ReplicaLoss::Overwritten), 1);
    assert!(ask(&mut origin, HOLDER, request(28, &[0])));
    assert_eq!((origin.leave(&mut now_ns).len(), again(&origin)), (1, 1), "what is right is answered");
}

#[test]
fn a_record_leaves_twice_and_some_parts_at_most_however_often_it_is_asked_for() {
    let (mut origin, mut writer, mut now_ns) = sent(image(), 3);
    for round in 0..300 {
        for sequence in [0, 1, 2] {
            assert!(ask(&mut origin, HOLDER, request(sequence, &[round % 5, 4])));
        }
        origin.leave(&mut now_ns);
    }
    // Of two records, the newer ones at that time; the third one is held to be over.
    assert!((2 * (5 + 8)..=3 * (5 + 8)).contains(&again(&origin)), "{}", again(&origin));
    assert!(origin.lost(ReplicaLoss::Exhausted) > 500, "{}", origin.lost(ReplicaLoss::Exhausted));
    // A flood of requests finds its queue full, and delays nothing.
    assert!((0..1000).all(|_| ask(&mut origin, HOLDER, request(2, &[0]))), "none is refused");
    assert_eq!(origin.lost(ReplicaLoss::Crowded), 1000 - 32);
    writer.write(at(200), &[9; 6000]).unwrap();
    assert_eq!(origin.leave(&mut now_ns).len(), 5);
}

/// What this node asks for of a less important stream waits for its own records; what it asks for of a more important
/// one does not wait behind that.
#[test]
fn a_request_that_waits_holds_up_no_other() {
    const POSE: Name = Name::new(1, 240, 0, 0);
    const OWN: Name = Name::new(1, 241, 0, 0);
    let of = |from, level, node, to| ReplicaSettings { from, level, node, to: 1_u64 << to, ..image() };
    // Two come from another node, and one goes there.
    let replicas = [of(CAMERA, 20, HOLDER, ORIGIN), of(POSE, 1, HOLDER, ORIGIN), of(OWN, 10, ORIGIN, HOLDER)];
    let mut origin = Origin::new(&replicas);
    origin.ground.join().describe_replicas(OWN, &words(3)).unwrap();
    origin.look();
    let own = StreamId { name: OWN, number: NUMBER };
    let (mut writer, mut now_ns) = (origin.writer(own, SHAPE), START);
    origin.leave(&mut now_ns);
    let mut rings = origin.router.sender.requests();
    let mut ask = |place: u16| {
        let asked = OutgoingRequest { to: HOLDER, request: PartRequest { place, ..request(0, &[0]) } };
        rings.outgoing[usize::from(place)].as_mut().unwrap().push(asked).is_ok()
    };
    // More than its ring has room for.
    assert!((0..100).filter(|_| ask(0)).count() < 100);
    assert!(ask(1), "there is room for those of another stream");
    for sequence in 0..20 {
        writer.write(at(100 + sequence), &[7; 6000]).unwrap();
    }
    let left: Vec<_> = origin.leave(&mut now_ns).iter().map(|datagram| (datagram[3], datagram[36])).collect();
    let [part, request] = [FrameKind::RecordPart, FrameKind::PartRequest].map(|kind| kind as u8);
    assert_eq!(left[0], (request, 1), "the most important of all");
    let last_part = left.iter().rposition(|sent| *sent == (part, 2)).unwrap();
    let first_bulk = left.iter().position(|sent| *sent == (request, 0)).unwrap();
    assert!(last_part < first_bulk, "{left:?}");
}

#[test]
fn what_has_not_left_yet_is_not_sent_twice() {
    let (mut origin, mut writer, mut now_ns) = sent(image(), 1);
    writer.write(at(200), &[9; 6000]).unwrap();
    now_ns += MS;
    for _ in 0..2 {
        origin.router.poll(now_ns).unwrap();
    }
    assert!(ask(&mut origin, HOLDER, request(1, &[0, 1, 2, 3, 4])));
    assert_eq!((origin.leave(&mut now_ns).len(), again(&origin)), (3 + 2, 2));
}

#[test]
fn no_request_does_harm() {
    let mut both = Both::new(image());
    let mut rng = ChaCha8Rng::seed_from_u64(22);
    for step in 0..2000_u64 {
        for _ in 0..rng.random_range(0..6) {
            let nearly = |rng: &mut ChaCha8Rng, right: u64| {
                if rng.random_bool(0.9) { right } else { right.wrapping_add(rng.random_range(0..3)).wrapping_sub(1) }
            };
            let sequence =
                if rng.random_bool(0.9) { step.saturating_sub(rng.random_range(0..5)) } else { rng.random() };
            let mut parts = [0; 16];
            parts[0] = rng.random_range(1..40);
            parts[rng.random_range(0..16)] |= u64::from(rng.random_bool(0.1));
            let request = PartRequest {
                place: nearly(&mut rng, 0) as u16,
                generation: nearly(&mut rng, 0) as u16,
                first: nearly(&mut rng, 0) as u32 & 0xffff,
                router: nearly(&mut rng, 100),
                sequence,
                parts,
            };
            let from = rng.random_range(1..3);
            let _ = ask(&mut both.origin, from, request);
        }
        both.send(100 + step, &[step as u8; 6000]);
        assert_eq!(both.read(), (vec![(step, 6000)], 0), "each record comes at once");
    }
    let origin = both.origin;
    assert!(again(&origin) < 2000 * (5 + 8), "{}", again(&origin));
    let causes = [ReplicaLoss::NotSent, ReplicaLoss::OutOfRange];
    assert!(causes.iter().all(|cause| origin.lost(*cause) > 50), "{:?}", causes.map(|cause| origin.lost(cause)));
}

/// The module was started anew with larger records than the router's configuration has.
#[test]
fn of_a_record_larger_than_its_replica_no_part_is_sent_again_for_which_there_is_no_room() {
    let shape = StreamShape { record_bytes: 200_000, ..SHAPE };
    let mut origin = Origin::new(&[image()]);
    let (mut writer, mut now_ns) = (origin.writer(ID, shape), START);
    writer.write(at(100), &[7; 200_000]).unwrap();
    assert!(origin.leave(&mut now_ns).len() >= 200_000_usize.div_ceil(1372), "the description, and all parts");
    assert!(ask(&mut origin, HOLDER, request(0, &[1, 100])));
    assert!(origin.leave(&mut now_ns).is_empty());
    assert_eq!((origin.lost(ReplicaLoss::OutOfRange), again(&origin)), (1, 0));
    assert!(ask(&mut origin, HOLDER, request(0, &[1])) && origin.leave(&mut now_ns).len() == 1);
}

/// Each node asks for what it has.
#[test]
fn a_node_with_another_replica_may_not_ask_for_this_one() {
    const POSE: Name = Name::new(1, 240, 0, 0);
    let mut origin = Origin::new(&[image(), ReplicaSettings { from: POSE, to: 1 << 2, ..image() }]);
    let asked = [(2, 0), (HOLDER, 1), (ORIGIN, 0), (HOLDER, 0), (2, 1)];
    let taken = asked.map(|(from, place)| {
        let taken = ask(&mut origin, from, PartRequest { place, ..request(0, &[0]) });
        (taken, origin.router.receiver.must_ring())
    });
    assert_eq!(taken, [(false, false), (false, false), (false, false), (true, true), (true, true)]);
}
