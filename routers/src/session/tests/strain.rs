//! What one client must not do to the others, by hand.

use super::ground::{Ground, frames, package};
use super::plan::{client_settings, module, ranges, system_of};
use super::world::{MS, S};
use crate::session::client;
use crate::session::frame::{HEAD_BYTES, RANGES_MAX, Range, SessionFrameKind, SessionMessage};
use crate::session::server::Rights;
use crate::session::{Cause, LOOK_EVERY_NS};
use rohrpost_mailbox::{Head, Name};

/// As many ranges as a client may host.
pub(super) fn many(client: usize, first_class: u8) -> Vec<Range> {
    let system = system_of(client);
    let name = |index: usize| Name::new(system, first_class + (index >> 8) as u8, index as u8, 0);
    (0..RANGES_MAX).map(|index| Range::module(name(index))).collect()
}

#[test]
fn of_many_registrations_of_one_client_the_first_and_the_last_are_looked_at() {
    let mut ground = Ground::clients(3);
    ground.pass(S);
    let (place, ranges) = (ground.ends[1].1.unwrap(), many(1, 100));
    let before_bytes = ground.server.bytes_of(place);
    for number in 0..500 {
        ground.register(1, number, &ranges[number as usize..]);
    }
    assert_eq!(ground.server.superseded(), 498, "the first is looked at, the last waits");
    let hosted = |ground: &Ground| {
        let mut all = ground.server.snapshots(0);
        all.find(|(index, _)| *index == place).unwrap().1.ranges as usize
    };
    assert_eq!(hosted(&ground), RANGES_MAX);
    assert!(ground.server.bytes_of(place) < before_bytes + 2 * RANGES_MAX * size_of::<Range>());
    // What another sends meanwhile is handed on.
    ground.send(0, module(2), 0);
    assert_eq!(ground.delivered(2), [module(2)]);
    ground.pass(LOOK_EVERY_NS);
    assert_eq!((hosted(&ground), ground.server.superseded()), (RANGES_MAX - 499, 498), "the last counts");
}

#[test]
fn clients_that_register_much_take_turns_and_each_has_its_own() {
    let clients = 60;
    let settings = |client: usize| (client_settings(client, 100 + client as u64), Vec::new());
    let mut ground = Ground::with_room((clients as u16, clients as u16), (0..clients).map(settings));
    // They registered nothing so far; then those of one system register different names.
    ground.pass(S);
    for client in 0..clients {
        let ranges: Vec<Range> = many(client, 0).into_iter().map(|range| own(client, range)).collect();
        for number in 0..3 {
            ground.register(client, number, &ranges[..1090]);
        }
    }
    let hosts = |ground: &Ground| ground.server.snapshots(0).filter(|(_, it)| it.ranges == 1090).count();
    let at_once = hosts(&ground);
    assert!((1..clients).contains(&at_once), "{at_once} of {clients} had their turn at once");
    let mut looks = 0;
    while hosts(&ground) < clients {
        ground.pass(100 * MS);
        looks += 1;
        assert!(looks < 100, "{} of {clients} had their turn", hosts(&ground));
    }
}

/// A registration that waits, with one of these names, and a package of that name right behind it.
fn send_behind_a_registration(from: Name, more: &[Range], may_host: Option<Vec<Range>>) -> Ground {
    let mut ground = Ground::clients(2);
    let place = ground.ends[0].1.unwrap();
    let rights = may_host.map_or_else(Rights::any, |ranges| Rights::only(ranges.into_iter().collect()));
    ground.server.certify(place, system_of(0), "client 0", rights);
    // The first of these is looked at, so the second waits.
    ground.register(0, 7, &ranges(0));
    let ranges: Vec<Range> = ranges(0).into_iter().chain(more.iter().copied()).collect();
    ground.register(0, 8, &ranges);
    ground.receives(0, &package(Head { to: module(1), from, ..Head::default() }, &[]));
    assert_eq!(ground.server.table().client_of(from).filter(|client| *client == place), None, "it waits");
    ground.settle();
    ground
}

#[test]
fn a_package_behind_a_registration_that_waits_for_its_turn_is_not_lost() {
    let (new, foreign) = (Name::new(1, 90, 0, 0), Name::new(2, 90, 0, 0));
    let own = || [ranges(0), vec![Range::module(new)]].concat();
    let ground = send_behind_a_registration(new, &[Range::module(new)], Some(own()));
    assert_eq!((ground.ends[1].2.delivered.len(), ground.server.counts().lost_for(Cause::Foreign)), (1, 0));
    for (from, ranges, may_host, why) in [
        (new, vec![], None, "it does not ask for the name"),
        (module(1), vec![Range::module(module(1))], None, "another hosts it"),
        (foreign, vec![Range::module(foreign)], None, "of another system"),
        (new, vec![Range::module(new)], Some(ranges(0)), "not of its node"),
    ] {
        let ground = send_behind_a_registration(from, &ranges, may_host);
        let counts = (ground.ends[1].2.delivered.len(), ground.server.counts().lost_for(Cause::Foreign));
        assert_eq!(counts, (0, 1), "{why}");
    }
}

#[test]
fn a_client_keeps_packages_until_its_registration_is_answered() {
    let mut ground = Ground::clients(2);
    // It has been up for longer than a package may wait.
    for _ in 0..50 {
        ground.pass(100 * MS);
    }
    ground.register(0, 100, &[]);
    let ranges = ranges(0);
    let now_ns = ground.now_ns;
    ground.ends[0].0.host(now_ns, ranges);
    ground.send(0, module(1), 0);
    assert_eq!((ground.delivered(1), ground.ends[0].0.is_up()), (vec![], false), "its registration waits for its turn");
    ground.pass(LOOK_EVERY_NS);
    assert_eq!(ground.delivered(1), [module(1)]);
    assert_eq!(ground.ends[0].2.lost, []);
    assert_eq!(ground.server.counts().lost_for(Cause::Foreign), 0);
}

#[test]
fn what_was_ready_for_a_connection_that_broke_is_gone_with_it() {
    let mut ground = Ground::clients(2);
    let head = Head { to: module(1), from: module(0).with_local(1), len: 100, ..Head::default() };
    ground.sends(0, head, 0);
    let (client, _, notes) = &mut ground.ends[0];
    assert_eq!(client.poll(ground.now_ns, notes), client::ClientStep::Write);
    // The connection breaks with half of a frame.
    client.took(ground.now_ns, 60);
    client.closed(ground.now_ns, notes);
    ground.now_ns += S;
    assert_eq!(client.poll(ground.now_ns, notes), client::ClientStep::Connect);
    client.connected(ground.now_ns);
    let first = frames(client.ready()).next();
    assert!(matches!(first, Some((_, SessionMessage::Hello(_)))), "nothing else goes by the next one");
}

#[test]
fn a_question_goes_behind_the_frame_that_has_begun_and_before_all_others() {
    let mut ground = Ground::clients(2);
    for len in [100, 200, 300] {
        ground.sends(0, Head { to: module(1), from: module(0).with_local(1), len, ..Head::default() }, 0);
    }
    let (client, _, notes) = &mut ground.ends[0];
    client.took(ground.now_ns, 60);
    let due_ns = ground.now_ns + 2 * S;
    client.poll(due_ns, notes);
    let behind = &client.ready()[HEAD_BYTES + 8 + 16 + 100 - 60..];
    let kinds: Vec<_> = frames(behind).map(|(head, _)| (head.kind, head.length)).collect();
    assert_eq!(kinds, [(SessionFrameKind::Ask, 8), (SessionFrameKind::Package, 224), (SessionFrameKind::Package, 324)]);
}

/// The same range among the names that only this client registers.
pub(super) fn own(client: usize, range: Range) -> Range {
    let turned = |name: Name| {
        let [system, class, instance, local] = name.raw().to_be_bytes();
        Name::new(system, (client / 3) as u8 * 8 + class + 1, instance, local)
    };
    Range { first: turned(range.first), last: turned(range.last) }
}
