//! Where nothing is sealed, the check of a datagram is all that tells a part from what became of it on the wire: of
//! datagrams that were damaged by chance none is taken.

use super::*;
use crate::frame::HEAD_BYTES;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Attempts in a normal run; `HOSTILE_DATAGRAMS` says another number.
const NORMALLY: usize = 100_000;

/// Counts what is taken as a part, a description or a request.
#[derive(Default)]
struct Taken(u64);

impl Report for Taken {
    fn lost(&mut self, _: Option<NodeIndex>, _: &Head, _: &[u8], cause: crate::counts::Cause) {
        panic!("a package was lost: {cause:?}");
    }
}

impl Deliver for Taken {
    fn deliver(&mut self, _: NodeIndex, _: &Head, _: &[u8]) -> Result<(), NotDelivered> {
        panic!("a package was taken");
    }

    fn replica(&mut self, _: &FrameHead, _: &ReplicaFrame<'_>) -> bool {
        self.0 += 1;
        true
    }

    fn event(&mut self, _: RouterEvent) {}
}

/// What the wire makes of a datagram; it may be as it was.
fn damaged(chance: &mut ChaCha8Rng, all: &[Vec<u8>]) -> Vec<u8> {
    let one_of = |chance: &mut ChaCha8Rng| chance.random_range(0..all.len());
    let mut datagram = all[one_of(chance)].clone();
    let len = datagram.len();
    match chance.random_range(0..6) {
        0 => {
            for _ in 0..=chance.random_range(0..8) {
                datagram[chance.random_range(0..len)] ^= 1 << chance.random_range(0..8);
            }
        }
        1 => {
            let [one, other] = [0, 0].map(|_| chance.random_range(0..len));
            datagram.swap(one, other);
        }
        // Two stretches of it.
        2 => {
            let bytes = chance.random_range(1..=len / 2);
            let at = chance.random_range(0..=len - 2 * bytes);
            let (one, other) = datagram[at..at + 2 * bytes].split_at_mut(bytes);
            one.swap_with_slice(other);
        }
        3 => datagram.truncate(chance.random_range(0..len)),
        4 => datagram.extend((0..=chance.random_range(0..20)).map(|byte| byte as u8)),
        // The head of one, the rest of another.
        _ => {
            let rest = &all[one_of(chance)][HEAD_BYTES..];
            datagram.splice(HEAD_BYTES.., rest.iter().copied());
        }
    }
    datagram
}

/// All that two routers say to each other of records of many sizes.
fn said() -> Vec<Vec<u8>> {
    let replicas = [image()];
    let (mut origin, mut holder) = (Origin::new(&replicas), Holder::new(&replicas));
    let (mut now_ns, mut writer) = (START, origin.writer(ID, SHAPE));
    let mut all = Vec::new();
    for (step, len) in (0..).zip([0, 1, 700, 1376, 1377, 4000, 6000]) {
        let body: Vec<u8> = (0..len).map(|at| (at * 7 + step as usize) as u8).collect();
        writer.write(at(100 + step), &body).unwrap();
        let left = origin.leave(&mut now_ns);
        // The description comes; then the first part of each is lost, so requests go back.
        let lost = if step == 0 { 0 } else { left.len().min(2) - 1 };
        holder.take_all(now_ns, &left[lost..]);
        all.extend(left);
        now_ns += 20 * MS;
        holder.pass(now_ns);
        while let Ok((_, datagram)) = holder.router.poll(now_ns) {
            all.push(datagram);
        }
    }
    all
}

#[test]
fn of_what_the_wire_damages_no_part_is_taken() {
    let wanted = std::env::var("HOSTILE_DATAGRAMS").ok();
    let attempts = wanted.map_or(NORMALLY, |wanted| wanted.parse().expect("HOSTILE_DATAGRAMS is a number"));
    let all = said();
    let kinds: std::collections::BTreeSet<u8> = all.iter().map(|datagram| datagram[3]).collect();
    assert_eq!(kinds.len(), 3, "parts of records, of descriptions, and requests: {kinds:?}");
    let stats = Stats::new(&settings(HOLDER, 3), START);
    let mut inbound = Inbound::new(&settings(HOLDER, 3), stats);
    let (mut chance, mut taken, mut as_it_was) = (ChaCha8Rng::seed_from_u64(22), Taken::default(), 0);
    for attempt in 0..attempts {
        let bytes = damaged(&mut chance, &all);
        if all.contains(&bytes) {
            as_it_was += 1;
            continue;
        }
        let datagram = Datagram { source: address(ORIGIN), arrived_ns: START, bytes: &bytes };
        inbound.handle(START, &datagram, &mut taken);
        assert_eq!(taken.0, 0, "attempt {attempt}: {bytes:?} was taken");
    }
    assert!(as_it_was < attempts / 4, "{as_it_was} of {attempts} were as they had been");
    // A datagram that is as it was is taken.
    let datagram = Datagram { source: address(ORIGIN), arrived_ns: START, bytes: &all[0] };
    inbound.handle(START, &datagram, &mut taken);
    assert_eq!(taken.0, 1);
}
