//! Sealing and opening take nothing from the heap: neither what is taken, nor what is rejected, nor a hello that brings
//! about nothing new.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "../../benches/src/counting.rs"]
pub mod counting;

use counting::{CountingHeap, heap_uses};
use rohrpost_routers::frame::{FrameHead, FrameKind, HEAD_BYTES, NodeIndex};
use rohrpost_routers::security::{
    HELLO_DATAGRAM_BYTES, Handshake, InstallationKey, KeyId, KeyRing, Opened, Opening, PeerSessions, Port, Rejection,
    RouterIdentity, Sealing, TAG_BYTES, Tally,
};
use std::num::NonZeroU8;
use std::sync::Arc;
use std::time::{Duration, Instant};

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

const PACKAGES: u64 = 10_000;

struct Router {
    own: NodeIndex,
    all: Arc<PeerSessions>,
    handshake: Handshake,
    sealing: Sealing,
    opening: Opening,
}

impl Router {
    fn new(own: NodeIndex) -> Self {
        let router = RouterIdentity { system: 1, own, nodes: 2, digest: 7, incarnation: 100 + u64::from(own) };
        let all = PeerSessions::new(router, KeyRing::new(InstallationKey::new(KeyId(NonZeroU8::MIN), &[3; 32]), None));
        Self {
            own,
            handshake: Handshake::new(&all, [own; 32]),
            sealing: Sealing::new(&all, Port::Packages),
            opening: Opening::new(&all, Port::Packages),
            all,
        }
    }

    /// Takes a hello; what it answers takes its place.
    fn greet(&mut self, now_ns: u64, hello: &mut [u8; HELLO_DATAGRAM_BYTES]) -> bool {
        let mut reply = [0; HELLO_DATAGRAM_BYTES];
        let Opened::Hello(head, asked) = self.opening.open(hello).unwrap() else { panic!("no hello") };
        let replied = self.handshake.receive(now_ns, &head, &asked, &mut reply).reply_bytes.is_some();
        self.handshake.begin();
        *hello = reply;
        replied
    }
}

fn acquaint(now_ns: u64, a: &mut Router, b: &mut Router) {
    let mut hello = [0; HELLO_DATAGRAM_BYTES];
    a.sealing.ask(b.own, &mut hello).unwrap();
    assert!(b.greet(now_ns, &mut hello) && a.greet(now_ns, &mut hello) && !b.greet(now_ns, &mut hello));
}

#[test]
fn sealing_and_opening_take_nothing_from_the_heap() {
    let (mut a, mut b) = (Router::new(0), Router::new(1));
    acquaint(0, &mut a, &mut b);
    let mut tally = Tally::new(b.all.rejections(Port::Packages));
    let mut sequence = 0;
    for bytes in [64, 1400] {
        let mut room = [0; HEAD_BYTES + 1400 + TAG_BYTES];
        let datagram = &mut room[..HEAD_BYTES + bytes + TAG_BYTES];
        let (mut before, mut took) = (heap_uses(), Duration::ZERO);
        for number in 0..=PACKAGES {
            let begun = Instant::now();
            let head = FrameHead {
                kind: FrameKind::Packages,
                system: 1,
                from: 0,
                to: 1,
                digest: 7,
                incarnation: 100,
                sequence,
            };
            a.sealing.seal(&head, datagram).unwrap();
            let mut altered = [0; HEAD_BYTES + 1400 + TAG_BYTES];
            let altered = &mut altered[..datagram.len()];
            altered.copy_from_slice(datagram);
            altered[datagram.len() - 1] ^= 1;
            let opened = matches!(b.opening.open(datagram), Ok(Opened::Frame(..)));
            took += begun.elapsed();
            assert!(opened);
            assert!(b.opening.open(altered).is_err());
            tally.note(number, Some(0), Rejection::Forged);
            sequence += 1;
            if number == 0 {
                // An incarnation had begun, so keys were derived.
                (before, took) = (heap_uses(), Duration::ZERO);
            }
        }
        assert_eq!(heap_uses() - before, 0);
        println!("{bytes} B sealed and opened: {} ns", took.as_nanos() / u128::from(PACKAGES));
    }
    let before = heap_uses();
    (1..100).for_each(|round| acquaint(round * 1_000_000_000, &mut a, &mut b));
    assert_eq!(heap_uses() - before, 0, "they know each other");
}
