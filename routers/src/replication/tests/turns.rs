//! When parts leave, and in which turn: what the wire takes, the more important first, and each has its turn.

use super::*;
use crate::frame::FrameKind;

const POSE: Name = Name::new(1, 240, 0, 0);
const POSES: StreamId = StreamId { name: POSE, number: NUMBER };

/// An origin that has described another stream as well, and from which all descriptions have left.
fn described(replicas: &[ReplicaSettings], rate_bytes_s: u64) -> (Origin, u64) {
    let ground = Ground::new();
    for (from, of) in [(CAMERA, 1), (POSE, 3)] {
        ground.join().describe_replicas(from, &words(of)).unwrap();
    }
    let mut settings = settings(ORIGIN, 3);
    settings.network.rate_bytes_s = rate_bytes_s;
    let mut origin = Origin { participant: ground.join(), router: Router::new(&ground, &settings, replicas), ground };
    origin.look();
    let mut now_ns = START;
    origin.leave(&mut now_ns);
    (origin, now_ns + 100 * MS)
}

/// Places of what leaves at this moment, until the wire has no room.
fn at_once(origin: &mut Origin, now_ns: u64) -> Vec<u8> {
    std::iter::from_fn(|| origin.router.poll(now_ns).ok()).map(|(_, datagram)| datagram[36]).collect()
}

#[test]
fn parts_wait_for_the_wire_and_what_is_more_important_for_one_datagram_alone() {
    let pose = ReplicaSettings { level: 2, from: POSE, ..image() };
    let (mut origin, now_ns) = described(&[image(), pose], 1 << 20);
    let (mut pictures, mut poses) = (origin.writer(ID, SHAPE), origin.writer(POSES, SHAPE));
    pictures.write(at(100), &[1; 6000]).unwrap();
    assert_eq!(at_once(&mut origin, now_ns), [0], "a part takes longer than a burst does");
    poses.write(at(100), &[2; 64]).unwrap();
    assert_eq!(at_once(&mut origin, now_ns), [1], "it does not wait for the rate as well");
    poses.write(at(101), &[2; 64]).unwrap();
    assert_eq!(at_once(&mut origin, now_ns), [0; 0]);
}

/// Of what leaves until nothing waits: place and receiver of each part of a record.
fn sent(origin: &mut Origin, now_ns: &mut u64) -> Vec<(u8, NodeIndex)> {
    let mut all = Vec::new();
    loop {
        match origin.router.poll(*now_ns) {
            Ok((to, datagram)) if datagram[3] == FrameKind::RecordPart as u8 => all.push((datagram[36], to)),
            Ok(_) => {}
            Err(ReplicaStep::Wait { .. }) => *now_ns += MS,
            Err(_) => return all,
        }
    }
}

#[test]
fn streams_of_one_level_and_nodes_of_one_stream_have_turns() {
    let both = 1 << HOLDER | 1 << 2;
    let replicas = [ReplicaSettings { to: both, ..image() }, ReplicaSettings { from: POSE, ..image() }];
    let ((mut origin, mut now_ns), mut left) = (described(&replicas, 100 << 20), Vec::new());
    let mut writers = [ID, POSES].map(|id| origin.writer(id, SHAPE));
    // The first ones have left: then each that is written goes.
    for records in [1, 4] {
        for writer in &mut writers {
            (0..records).for_each(|_| assert!(writer.write(at(100), &[7; 2000]).is_ok()));
        }
        left = sent(&mut origin, &mut now_ns);
    }
    // Of so many records of two parts each; the second stream is done at half of them.
    assert_eq!(left.len(), 24, "{left:?}");
    let count = |sent: &[(u8, NodeIndex)], of: (u8, NodeIndex)| sent.iter().filter(|sent| **sent == of).count();
    for (of, least) in [((0, HOLDER), 2), ((0, 2), 2), ((1, HOLDER), 4)] {
        assert!(count(&left[..12], of) >= least, "{of:?}: {left:?}");
    }
}

/// What is waited on is what is not looked at yet: else the thread would never sleep, or not wake.
#[test]
fn the_sender_sleeps_until_there_is_a_newer_record() {
    let (mut origin, mut now_ns) = described(&[image()], 100 << 20);
    let mut writer = origin.writer(ID, SHAPE);
    for step in 0..3 {
        writer.write(at(100 + step), b"picture").unwrap();
        let has_next = |origin: &mut Origin| {
            let (readers, _) = origin.router.sender.waits_on();
            readers.iter().map(|reader| reader.has_next()).collect::<Vec<_>>()
        };
        assert_eq!(has_next(&mut origin), [true]);
        assert_eq!(origin.leave(&mut now_ns).len(), 1);
        assert_eq!(has_next(&mut origin), [false]);
    }
}
