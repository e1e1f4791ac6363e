//! Two routers and a wire that loses, duplicates and reorders.

use super::*;
use crate::counts::Cause;
use crate::harness::Log;
use crate::report::NotDelivered;
use rohrpost_mailbox::Name;
use std::collections::HashMap;

/// What the wire does with the datagram that leaves next.
#[derive(Clone, Copy, Debug)]
enum WireFate {
    Passes,
    Loses,
    Copies,
    /// This many others overtake it.
    Holds(usize),
}

fn wire() -> impl Strategy<Value = WireFate> {
    prop_oneof![
        6 => Just(WireFate::Passes),
        1 => Just(WireFate::Loses),
        1 => Just(WireFate::Copies),
        2 => (1usize..100).prop_map(WireFate::Holds),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]
    #[test]
    fn every_package_is_delivered_once_and_in_order_or_counted(
        packages in prop::collection::vec((0u8..4, 0u8..3, 0usize..4000, 0u64..3), 1..300),
        wire in prop::collection::vec(wire(), 64),
    ) {
        let (mut base, mut arm) = (End::new(0, |_| {}), End::new(1, |_| {}));
        let (mut now_ns, mut busy_ns) = (START, START);
        let (mut on_wire, mut left, mut lost_on_wire) = (Vec::new(), 0usize, 0u64);
        let mut bodies = HashMap::new();
        let mut steps = packages.into_iter();
        loop {
            let step = steps.next();
            if let Some((sender, priority, len, ms)) = step {
                now_ns += ms * MS;
                let head = head(module(50, 0), module(100 + sender, 1), 100 + priority * 20);
                let body: Vec<u8> = (0..len).map(|at| (at + left) as u8).collect();
                let before = bodies.len() as u16;
                bodies.insert(before, body.clone());
                arm.hears(0, now_ns);
                let direct = arm.send(now_ns, head, &body, left % 3 == 0);
                on_wire.extend(direct.map(|(_, datagram)| (left, datagram)));
            } else {
                now_ns += 50 * MS;
            }
            for (to, datagram) in arm.leave(now_ns) {
                left += 1;
                if to != 0 {
                    continue;
                }
                match if step.is_some() { wire[left % wire.len()] } else { WireFate::Passes } {
                    WireFate::Passes => on_wire.push((left, datagram)),
                    WireFate::Loses => lost_on_wire += 1,
                    WireFate::Copies => on_wire.extend([(left, datagram.clone()), (left + 7, datagram)]),
                    WireFate::Holds(by) => on_wire.push((left + by, datagram)),
                }
            }
            on_wire.sort_by_key(|(at, _)| *at);
            while on_wire.first().is_some_and(|(at, _)| *at <= left) {
                base.take(now_ns, 1, &on_wire.remove(0).1);
            }
            base.refusals(now_ns);
            if step.is_some() || !on_wire.is_empty() {
                busy_ns = now_ns;
            }
            // Long after the last, so that all that is missing was given up, and every fragment.
            if now_ns > busy_ns + 3 * S {
                break;
            }
        }
        arm.assert_balanced();
        base.assert_balanced();
        prop_assert_eq!((arm.stats.waiting_in_all(), base.inbound.partial()), (0, 0));
        prop_assert_eq!(arm.log.lost.len(), 0);
        // No peer took the very first one.
        let received = &base.stats.peer(1).received;
        prop_assert_eq!(received.missing(), lost_on_wire + 1);
        prop_assert_eq!(received.datagrams.get() + received.missing(), arm.stats.peer(0).sent.datagrams.get());
        assert_in_order(&base.log, &bodies);
    }
}

fn assert_in_order(log: &Log, bodies: &HashMap<u16, Vec<u8>>) {
    let mut last: HashMap<(Name, Name, u8), u16> = HashMap::new();
    for (_, head, body) in &log.delivered {
        assert_eq!(*body, bodies[&head.id], "as it was sent");
        let before = last.insert((head.to, head.from, head.priority.0), head.id);
        assert!(before < Some(head.id), "in order, and once");
    }
}

#[test]
fn what_no_mailbox_takes_is_counted_with_its_cause() {
    let (mut base, mut arm) = (End::new(0, |_| {}), End::new(1, |_| {}));
    for (why, cause) in [
        (NotDelivered::NoMailbox, Cause::NoMailbox),
        (NotDelivered::MailboxFull, Cause::MailboxFull),
        (NotDelivered::TooLarge, Cause::TooLarge),
    ] {
        base.log.closed = Some(why);
        let (_, datagram) = arm.send(START, head(module(50, 0), module(200, 1), 90), b"the call", true).unwrap();
        base.take(START, 1, &datagram);
        let (head, body, told) = base.log.lost.last().unwrap();
        assert_eq!((head.from, &body[..], *told), (module(200, 1), &b"the call"[..], cause));
    }
    base.assert_balanced();
}
