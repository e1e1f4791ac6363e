//! Bytes that nobody of the team sent.

use super::*;
use proptest::prelude::*;

#[test]
fn a_damaged_foreign_or_other_datagram_is_counted_for_what_it_is() {
    let (mut one, mut two) = (End::new(1, 11, None), End::new(2, 22, None));
    let whole = two.data(1, b"data");
    for at in 0..whole.len() {
        let mut damaged = whole.clone();
        damaged[at] ^= 1;
        one.take(0, &damaged);
        one.take(0, &whole[..at]);
    }
    assert!(one.bodies().is_empty() && one.router.teammates().is_empty());
    let counted: u64 = TeamRefusal::ALL.into_iter().map(|why| one.refused(why)).sum();
    assert_eq!(counted, 2 * whole.len() as u64);
    let checked = |at: usize, byte: u8| {
        let mut changed = whole.clone();
        changed[at] = byte;
        lan::write_check(&mut changed);
        changed
    };
    for (at, byte, why) in [
        (2, 9, TeamRefusal::Version),
        (3, 9, TeamRefusal::Damaged),
        (4, 0, TeamRefusal::Damaged),
        (4, 255, TeamRefusal::Damaged),
        (5, 64, TeamRefusal::Damaged),
        (6, 0, TeamRefusal::Damaged),
        (7, 1, TeamRefusal::Sealed),
        (8, 9, TeamRefusal::Classes),
        (4, 3, TeamRefusal::Damaged),
    ] {
        let before = one.refused(why);
        one.take(0, &checked(at, byte));
        assert_eq!(one.refused(why) - before, 1, "byte {at} is {byte}: {why:?}");
    }
    let mut twin = End::new(1, 12, None);
    let own = twin.data(ALL_SYSTEMS, b"own");
    one.take(0, &own);
    assert_eq!(one.refused(TeamRefusal::OwnName), 1);
    assert!(one.bodies().is_empty());
}

#[test]
fn more_than_are_remembered_are_crowded_out_until_others_are_silent() {
    let mut one = End::new(1, 11, None);
    let mut from = |now_ns, system: u8, node: u8, incarnation| {
        let mut other = settings(system, incarnation, None);
        other.node = node;
        let data = End::of(other).data(1, b"data");
        one.take(now_ns, &data);
        (one.router.teammates().len(), one.bodies().len(), one.refused(TeamRefusal::Crowded))
    };
    for place in 0..MEMBERS_MAX as u64 {
        from(0, 2 + (place / 64) as u8, (place % 64) as u8, 1 + place);
    }
    assert_eq!(from(SECOND, 9, 0, 1000), (MEMBERS_MAX, MEMBERS_MAX, 1));
    assert_eq!(from(TEAM_SILENT_NS + SECOND, 9, 0, 1000), (MEMBERS_MAX, MEMBERS_MAX + 1, 1));
}

#[test]
fn recorded_beats_make_nobody_talk_for_ever() {
    let mut one = End::new(1, 11, Some(1));
    let recorded = End::new(2, 22, Some(1)).beat(0).unwrap();
    let mut beats = 0;
    for step in 0..1000 {
        one.take(step * 50 * MS, &recorded);
        beats += u32::from(one.beat(step * 50 * MS).is_some());
    }
    assert!(beats <= 50 / 2 * 2 + 20, "{beats} in 50 s");
}

proptest! {
    #[test]
    fn whatever_comes_is_read_without_harm(mut bytes: Vec<u8>, is_sealed: bool, text: Vec<u8>) {
        let mut one = End::new(1, 11, is_sealed.then_some(1));
        one.router.handle(0, source(), &mut bytes, &mut one.node);
        for kind in [TeamKind::Package, TeamKind::Beat] {
            let head = TeamHead { kind, system: 2, node: 0, to: 1, common: 0, incarnation: 5, sequence: 1 };
            let mut datagram = vec![0; lan::HEAD_BYTES];
            head.write(&mut datagram);
            datagram.extend(&text);
            lan::write_check(&mut datagram);
            one.router.handle(0, source(), &mut datagram, &mut one.node);
        }
        prop_assert!(one.router.teammates().len() <= 1);
    }
}
