//! Incompatible nodes: one with another configuration, and one with another version of the wire format.

use super::flow::{PLAIN, Sink, Source, carried, lost};
use super::{Field, lines};
use crate::harness::{PATIENCE, until, wait};
use rohrpost::Fault;
use rohrpost::interfaces::LinkState;
use rohrpost_config::Installation;
use rohrpost_routers::frame::{Frame, FrameHead, FrameKind, HEAD_BYTES, RefusalReason, VERSION};
use std::net::UdpSocket;
use std::time::{Duration, Instant};

#[test]
fn nodes_with_different_configurations_refuse_each_other_and_both_say_why() {
    let Some(mut field) = Field::new(2, "") else { return };
    let (config, other) = (field.config.clone(), field.collects_on_arm(""));
    field.launch_deaf(&["base"]);
    field.network.launch_from(&other, &["arm"]);

    let digests = [&config, &other].map(|file| format!("{:016x}", Installation::load(file).unwrap().digest().lan()));
    assert_ne!(digests[0], digests[1]);
    let [ours, theirs] = &digests;
    for (log, router, peer, its, own) in
        [("robot.log", "router.0", "node arm", theirs, ours), ("arm.log", "router.1", "node base", ours, theirs)]
    {
        let its = format!("its configuration has the digest {its}, this node's {own}");
        for start in [format!("takes nothing from {peer} (10.78"), format!("{peer} (10.78.0.")] {
            let log = field.place.path(log);
            let words = [start.as_str(), its.as_str(), "launch all nodes from the same file"];
            until(format!("{router} says {words:?}"), || !lines(&log, router, &words).is_empty());
        }
    }
    // Neither commands nor data pass, in neither direction.
    let mut sink = Sink::new(field.robot("arm"), "arm");
    let mut source = Source::new(field.robot("base"), "base", "arm", PLAIN);
    for (node, peer, module) in [("base", "arm", "probe.1"), ("arm", "base", "probe.0")] {
        field.wait_for_state(node, peer, LinkState::Refused);
        let why = field.peer(node, peer).why;
        assert!(digests.iter().all(|digest| why.contains(digest)), "{why}");
        let fault = field.fault(node, module);
        assert!(matches!(&fault, Fault::NodeRefuses { node, .. } if node == peer), "{fault:?}");
        assert!(digests.iter().all(|digest| fault.to_string().contains(digest)), "{fault}");
    }
    while source.sent < 20 {
        assert!(source.send());
        sink.take(Duration::from_millis(5));
    }
    let refused = wait("all are counted as refused", || {
        let carried = carried(&field.links("base"), PLAIN);
        (lost(&carried) == 20).then_some(carried)
    });
    assert_eq!((refused.taken, refused.sent, refused.lost[0].cause.as_str()), (20, 0, "refused"));
    assert!(sink.came.is_empty() && field.place.counted().is_empty(), "{:?}", sink.came);

    drop((source, sink));
    field.network.halt("arm");
    field.launch(&["arm"]);
    field.wait_counted("base", "probe.1", 1);
    field.wait_counted("arm", "probe.0", 2);
    field.stop();
}

/// The CRC-32 of zlib, as docs/wire.md has it.
fn crc32(bytes: impl Iterator<Item = u8>) -> u32 {
    let divide = |rest: u32| rest >> 1 ^ if rest & 1 == 1 { 0xedb8_8320 } else { 0 };
    !bytes.fold(!0, |rest, byte| (0..8).fold(rest ^ u32::from(byte), |rest, _| divide(rest)))
}

/// A datagram as a router of version 1 sent it, of which later ones know the first four bytes and the check.
pub(super) fn of_earlier_version(head: &FrameHead) -> Vec<u8> {
    let body = b"what comes in version 1";
    let mut datagram = [&head.to_bytes(&[body]), &body[..]].concat();
    datagram[2] = 1;
    let check = crc32(datagram[..HEAD_BYTES - 4].iter().chain(&datagram[HEAD_BYTES..]).copied());
    datagram[HEAD_BYTES - 4..HEAD_BYTES].copy_from_slice(&check.to_le_bytes());
    datagram
}

#[test]
fn a_node_with_another_version_is_refused_by_both_versions_and_told_so_once_a_second() {
    let Some(mut field) = Field::new(3, "") else { return };
    field.launch_deaf(&["base"]);
    // The test is the router of the desk.
    let desk = field.inside("desk", || UdpSocket::bind(("10.78.0.3", 21117)).unwrap());
    let head = FrameHead {
        kind: FrameKind::Packages,
        system: 1,
        from: 2,
        to: 0,
        digest: field.digest(),
        incarnation: 9,
        sequence: 0,
    };
    desk.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
    let (begun, mut refusals, mut sent) = (Instant::now(), 0, 0);
    let mut bytes = [0; 1500];
    // Until three refusals have arrived: at most one a second, and with the right reason.
    while refusals < 3 {
        assert!(begun.elapsed() < PATIENCE, "told {refusals} times");
        desk.send_to(&of_earlier_version(&head), ("10.78.0.1", 21117)).unwrap();
        sent += 1;
        let Ok((length, _)) = desk.recv_from(&mut bytes) else { continue };
        // Besides refusals it learns that the base is there.
        if let Ok((_, Frame::Refusal(refusal))) = Frame::parse(&bytes[..length]) {
            assert_eq!((refusal.version, refusal.reason), (VERSION, RefusalReason::Version));
            assert_eq!(refusal.digest, field.digest());
            refusals += 1;
        }
    }
    assert!(begun.elapsed() > Duration::from_secs(2), "three refusals of {sent} datagrams in {:?}", begun.elapsed());

    let differ = format!("it speaks wire format 1, this one {VERSION}");
    let words = ["takes nothing from node desk (10.78.0.3)", differ.as_str(), "rohrpost version"];
    field.wait_told("router.0", &words, 1);
    let fault = field.fault("base", "probe.2");
    assert!(matches!(&fault, Fault::NodeRefuses { node, .. } if node == "desk"), "{fault:?}");
    assert!(fault.to_string().contains(&differ), "{fault}");
    let peer = field.peer("base", "desk");
    assert_eq!((peer.received.datagrams, peer.received.packages), (0, 0), "nothing of it was taken");
    assert_eq!(field.lines("router.0", &words).len(), 1, "told once");
    field.stop();
}
