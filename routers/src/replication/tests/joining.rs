//! Nodes that come late, and nodes that are not there.

use super::*;

#[test]
fn a_node_that_comes_late_has_the_newest_at_once() {
    let replicas = [image()];
    let (mut origin, mut holder) = (Origin::new(&replicas), Holder::new(&replicas));
    let (mut now_ns, mut writer) = (START, origin.writer(ID, SHAPE));
    for step in 0..5 {
        writer.write(at(100 + step), b"a map").unwrap();
        origin.leave(&mut now_ns);
    }
    // Its router is heard for the first time.
    origin.router.stats.peer(HOLDER).link.incarnation.set(5);
    holder.take_all(now_ns, &origin.leave(&mut now_ns));
    assert_eq!(holder.ground.node.inspect_stream(ID).unwrap().unwrap().newest.map(|newest| newest.sequence), Some(4));
    // And again: what it has already is no gap, and not a second record.
    origin.router.stats.peer(HOLDER).link.incarnation.set(6);
    holder.take_all(now_ns, &origin.leave(&mut now_ns));
    assert_eq!((holder.records(), holder.lost(ReplicaLoss::Duplicate)), (1, 1));
}

#[test]
fn an_absent_node_is_not_waited_for() {
    let replicas = [image()];
    let mut origin = Origin::new(&replicas);
    let (mut now_ns, mut writer) = (START, origin.writer(ID, SHAPE));
    writer.write(at(100), b"picture").unwrap();
    origin.leave(&mut now_ns);
    let silent_ns = now_ns + 2000 * MS;
    let mut datagram = vec![0; 1472];
    for step in 0..40 {
        writer.write(at(200 + step), b"picture").unwrap();
        let Router { sender, outbound, .. } = &mut origin.router;
        let waits = sender.poll(silent_ns + step, time, outbound, &mut datagram);
        assert!(matches!(waits, ReplicaStep::Idle { .. }), "{waits:?}");
    }
    assert_eq!(origin.lost(ReplicaLoss::Absent), 39, "the newest is for when it is there again");
}
