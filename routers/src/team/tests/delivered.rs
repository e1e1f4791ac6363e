//! What is delivered, refused, counted and answered.

use super::*;
use rohrpost_mailbox::Options;

/// A router of system 1 that believes one of system 2.
fn pair() -> (End, End) {
    let (mut one, mut two) = (End::new(1, 11, None), End::new(2, 22, None));
    meet(0, &mut [&mut one, &mut two]);
    (one, two)
}

#[test]
fn what_comes_by_both_ways_is_delivered_once_and_alike_packages_by_one_way_each() {
    let (mut one, mut two) = pair();
    let by_tcp = |one: &mut End, now_ns, id, body: &[u8]| {
        // The TCP router names the one system of a package to all.
        let head = Head { id, len: body.len() as u16, ..head(2, 1, Type::data(1)) };
        one.router.by_tcp(now_ns, &head, body, &mut one.node);
    };
    for (now_ns, ways, times, why) in [
        (10 * SECOND, "team tcp", 1, "the copy comes later"),
        (20 * SECOND, "tcp team", 1, "the copy comes by the team"),
        (30 * SECOND, "team team tcp tcp", 2, "two alike, each with its copy"),
        (40 * SECOND, "tcp tcp", 2, "by one way alone"),
        (50 * SECOND, "team tcp tcp", 2, "a copy is one of one"),
    ] {
        let before = one.bodies().len();
        for way in ways.split(' ') {
            if way == "tcp" {
                by_tcp(&mut one, now_ns, 3, why.as_bytes());
            } else {
                let datagram = two.data(ALL_SYSTEMS, why.as_bytes());
                one.take(now_ns, &datagram);
            }
        }
        assert_eq!(one.bodies().len() - before, times, "{why}");
    }
    let datagram = two.data(ALL_SYSTEMS, b"body");
    one.take(60 * SECOND, &datagram);
    by_tcp(&mut one, 60 * SECOND, 4, b"body");
    by_tcp(&mut one, 60 * SECOND + COPY_MAX_NS + 1, 3, b"body");
    assert_eq!(one.bodies().iter().filter(|body| **body == b"body").count(), 3, "another number, and too late a copy");
    assert_eq!(one.router.counts().copies.get(), 5);
}

#[test]
fn a_package_for_all_goes_to_the_mailbox_of_each_system_with_the_priority_that_it_may_have() {
    let (mut one, mut two) = pair();
    let mut datagram = Vec::new();
    let urgent = Head { priority: Priority(255), ..head(2, ALL_SYSTEMS, Type::data(1)) };
    two.router.send(&urgent, b"data", &mut datagram).unwrap();
    one.take(0, &datagram);
    let (delivered, body) = &one.node.delivered[0];
    assert_eq!(
        (delivered.to, delivered.priority, body.as_slice()),
        (Name::new(1, 96, 0, 2), Priority(96), &b"data"[..])
    );
    one.node.lacks.push(delivered.to);
    let other = two.data(ALL_SYSTEMS, b"other");
    one.take(0, &other);
    let third = two.data(3, b"third");
    one.take(0, &third);
    assert_eq!((one.bodies().len(), one.router.counts().inn.class(Priority(96)).packages.get()), (1, 1));
}

#[test]
fn a_command_that_goes_no_further_is_answered_in_the_name_of_its_receiver_unless_it_was_for_all() {
    let (mut one, mut two) = pair();
    one.node.refuses = Some(NotDelivered::NoMailbox);
    let command = |to| Head { to: Name::new(to, 96, 0, 0), ..head(2, to, Type::command(16)) };
    for to in [1, ALL_SYSTEMS] {
        let mut datagram = Vec::new();
        two.router.send(&command(to), b"call", &mut datagram).unwrap();
        one.take(0, &datagram);
    }
    let (reply, body) = one.router.next_reply().expect("the first is answered");
    assert_eq!((reply.to, reply.from), (command(1).from, command(1).to));
    assert!(reply.options.has(Options::ERROR) && body == b"no-mailbox", "{reply:?}");
    assert!(one.router.next_reply().is_none());
    assert_eq!(one.router.counts().inn.class(Priority(96)).lost(Cause::NoMailbox), 2);
}

#[test]
fn a_sender_in_a_name_of_another_system_and_a_routers_own_mailbox_are_refused() {
    let (mut one, mut two) = pair();
    let mut own = settings(1, 11, None);
    own.admission.team = Some(rohrpost_mailbox::Class(65));
    let mut guarded = End::of(own);
    let forged = |from, to: Name| Head { to, ..head(from, 1, Type::data(1)) };
    let mut datagram = Vec::new();
    two.router.send(&forged(3, Name::new(1, 96, 0, 2)), b"data", &mut datagram).unwrap();
    one.take(0, &datagram);
    assert_eq!((one.bodies().len(), one.refused(TeamRefusal::Damaged)), (0, 1), "from system 3, says system 2");
    two.router.send(&forged(2, Name::new(1, 65, 0, 3)), b"data", &mut datagram).unwrap();
    guarded.take(0, &datagram);
    let counts = guarded.router.counts();
    assert_eq!((guarded.bodies().len(), counts.inn.lost_for(Cause::RoutersOwn)), (0, 1));
}

#[test]
fn what_cannot_leave_says_why() {
    let mut known = settings(1, 11, None);
    known.reached = Some(vec![2]);
    let mut one = End::of(known);
    let mut datagram = Vec::new();
    for (to, bytes, outcome) in [
        (2, 3, Ok(())),
        (3, 3, Err(Cause::NoRoute)),
        (ALL_SYSTEMS, TEAM_BODY_BYTES_MAX, Ok(())),
        (ALL_SYSTEMS, TEAM_BODY_BYTES_MAX + 1, Err(Cause::TooLarge)),
    ] {
        let head = head(1, to, Type::data(1));
        let sent = one.router.send(&head, &vec![0; bytes], &mut datagram);
        assert_eq!(sent, outcome, "{to}");
        one.router.left(&head, sent);
    }
    let class = one.router.counts().out.class(Priority(96));
    assert_eq!((class.packages.get(), class.passed.get(), class.lost_in_all()), (4, 2, 2));
}
