//! Where nothing is sealed, the check of a datagram is all that tells a part from what became of it on the wire: of
//! datagrams that were damaged by chance none is taken.

use super::*;
use crate::frame::HEAD_BYTES;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Attempts in a normal run.
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

/// How often such a test tries; `HOSTILE_DATAGRAMS` says another number than what is normal.
pub(super) fn attempts() -> usize {
    let wanted = std::env::var("HOSTILE_DATAGRAMS").ok();
    wanted.map_or(NORMALLY, |wanted| wanted.parse().expect("HOSTILE_DATAGRAMS is a number"))
}

/// Flips bits of a datagram, swaps two stretches, cuts or extends it, or puts the rest of another behind its head.
pub(super) fn alter(chance: &mut ChaCha8Rng, datagram: &mut Vec<u8>, other: &[u8]) {
    let len = datagram.len();
    match chance.random_range(0..5) {
        0 => {
            for _ in 0..=chance.random_range(0..8) {
                datagram[chance.random_range(0..len)] ^= 1 << chance.random_range(0..8);
            }
        }
        1 => {
            let bytes = if chance.random_bool(0.5) { 1 } else { chance.random_range(1..=len / 2) };
            let at = chance.random_range(0..=len - 2 * bytes);
            let behind = chance.random_range(at + bytes..=len - bytes);
            let (one, other) = datagram.split_at_mut(behind);
            one[at..at + bytes].swap_with_slice(&mut other[..bytes]);
        }
        2 => datagram.truncate(chance.random_range(0..len)),
        3 => datagram.extend((0..=chance.random_range(0..20)).map(|byte| byte as u8)),
        _ => drop(datagram.splice(HEAD_BYTES.., other[HEAD_BYTES..].iter().copied())),
    }
}

pub(super) fn one_of<'a>(chance: &mut ChaCha8Rng, all: &'a [Vec<u8>]) -> &'a Vec<u8> {
    &all[chance.random_range(0..all.len())]
}

/// All that two routers say to each other of records of many sizes.
fn said() -> Vec<Vec<u8>> {
    let Both { mut origin, mut holder, mut writer, mut now_ns, .. } = Both::new(image());
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
    let (attempts, all) = (attempts(), said());
    let kinds: std::collections::BTreeSet<u8> = all.iter().map(|datagram| datagram[3]).collect();
    assert_eq!(kinds.len(), 3, "parts of records, of descriptions, and requests: {kinds:?}");
    let stats = Stats::new(&settings(HOLDER, 3), START);
    let mut inbound = Inbound::new(&settings(HOLDER, 3), stats);
    let (mut chance, mut taken, mut as_it_was) = (ChaCha8Rng::seed_from_u64(22), Taken::default(), 0);
    for attempt in 0..attempts {
        let mut bytes = one_of(&mut chance, &all).clone();
        let other = one_of(&mut chance, &all);
        alter(&mut chance, &mut bytes, other);
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
