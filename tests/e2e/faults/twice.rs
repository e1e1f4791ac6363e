//! Two routers claim to be one node.

use super::flow::{ALONE_BYTES, PLAIN, Sink, Source};
use super::{Field, mailbox_on};
use crate::harness::until;
use rohrpost::Fault;
use rohrpost::interfaces::LinkState;
use rohrpost_mailbox::{Head, Type};
use rohrpost_routers::frame::{FrameHead, FrameKind};
use std::net::UdpSocket;
use std::time::Duration;

/// Where the numbers of the second begin.
const SECOND: u64 = 1 << 32;

/// A second router of the arm, at the same address: its datagrams are those of a router with the right configuration.
struct Second {
    socket: UdpSocket,
    head: FrameHead,
}

impl Second {
    fn new(field: &Field) -> Self {
        let socket = field.inside("arm", || UdpSocket::bind(("10.78.0.2", 0)).unwrap());
        let digest = field.digest();
        let head =
            FrameHead { kind: FrameKind::Packages, system: 1, from: 1, to: 0, digest, incarnation: 4711, sequence: 0 };
        Self { socket, head }
    }

    /// A package for the sink at the base, as the first one's, with the datagram's number above [`SECOND`].
    fn send(&mut self) {
        let body = [&(SECOND + self.head.sequence).to_le_bytes()[..], &[0; ALONE_BYTES - 8]].concat();
        let package = Head {
            to: mailbox_on("base"),
            from: mailbox_on("arm"),
            len: body.len() as u16,
            kind: Type::data(1),
            priority: PLAIN.priority(),
            ..Head::default()
        };
        let rest = [&package.to_bytes()[..], &body].concat();
        let datagram = [&self.head.to_bytes(&[&rest])[..], &rest].concat();
        self.socket.send_to(&datagram, ("10.78.0.1", 21117)).unwrap();
        self.head.sequence += 1;
    }
}

#[test]
fn of_two_routers_that_claim_one_node_the_newer_is_taken_and_both_are_told_of() {
    let Some(field) = Field::launched() else { return };
    field.wait_counted("base", "probe.1", 1);
    let mut sink = Sink::new(field.robot("base"), "base");
    let mut first = Source::new(field.robot("arm"), "arm", "base", PLAIN);
    let mut second = Second::new(&field);
    let words = ["two routers send as node arm", "address is used twice"];
    until("base tells of two", || {
        first.send();
        second.send();
        sink.take(Duration::from_millis(1));
        !field.lines("router.0", &words).is_empty()
    });
    field.wait_told("router.0", &["the router of node arm", "was started anew"], 1);
    // Delivered packages: the first router's until the second is heard, the second's alone from there on.
    until("all of the second came", || {
        sink.take(Duration::from_millis(1));
        sink.numbers(PLAIN).last() == Some(&(SECOND + second.head.sequence - 1))
    });
    let numbers = sink.numbers(PLAIN);
    // The first datagram of another incarnation is lost: it only counts once a second one confirms it.
    let turn = numbers.iter().position(|number| *number >= SECOND).unwrap();
    assert!(turn <= 2, "{turn} of the first came before");
    assert!(
        (SECOND + 1..SECOND + second.head.sequence).eq(numbers[turn..].iter().copied()),
        "all of the second from then on, and nothing else"
    );
    // Only its own router knows how many there were: a busy computer cannot send a whole burst.
    until("those of the first are counted", || field.peer("base", "arm").counters.refused > 0);
    // The first notices that its peer accepts another router.
    until("arm is not heard", || {
        second.send();
        field.peer("arm", "base").state == LinkState::Unheard
    });
    assert_eq!(field.fault("arm", "probe.0"), Fault::NodeDeaf { node: "base".into() });

    // The second ends: after a second of its silence the first is heard again.
    sink.came.clear();
    until("the first is heard again", || {
        first.send();
        sink.take(Duration::from_millis(1));
        sink.numbers(PLAIN).iter().filter(|number| **number < SECOND).count() > 10
    });
    let numbers = sink.numbers(PLAIN);
    let first_again = numbers.iter().position(|number| *number < SECOND).unwrap();
    assert!(numbers[first_again..].is_sorted_by(|one, next| one < next), "in order, none twice, none of the second");
    field.wait_counted("base", "probe.1", 2);
    field.wait_counted("arm", "probe.0", 3);
    until("to the second, and back", || field.peer("base", "arm").counters.restarts == 2);
    assert_eq!(field.lines("router.0", &words).len(), 1, "told once");
    drop((first, sink));
    field.stop();
}
