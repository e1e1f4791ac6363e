//! What one client must not do to the others, by hand.

use super::ground::Ground;
use super::plan::{module, system_of};
use super::world::{MS, S};
use crate::session::client::{self, ClientPackage};
use crate::session::frame::{
    Carried, HEAD_BYTES, LENGTH_MAX, RANGES_MAX, Range, Ranges, SessionFrameHead, SessionFrameKind, SessionMessage,
};
use crate::session::server::Rights;
use crate::session::{Cause, LOOK_EVERY_NS};
use rohrpost_mailbox::{Head, Name};

/// As many ranges as a client may host.
pub(super) fn many(client: usize, first_class: u8) -> Vec<Range> {
    let system = system_of(client);
    let name = |index: usize| Name::new(system, first_class + (index >> 8) as u8, index as u8, 0);
    (0..RANGES_MAX).map(|index| Range::module(name(index))).collect()
}

pub(super) fn register(ground: &mut Ground, client: usize, number: u32, ranges: &[Range]) {
    let (mut laid_out, mut bytes) = (Vec::new(), Vec::new());
    SessionMessage::Register(Ranges::new(number, ranges, &mut laid_out)).write(&mut bytes);
    let place = ground.ends[client].1.unwrap();
    ground.server.received(ground.now_ns, place, &bytes, &mut ground.said);
}

#[test]
fn of_many_registrations_of_one_client_the_first_and_the_last_are_looked_at() {
    let mut ground = Ground::clients(3);
    ground.now_ns += S;
    ground.settle();
    let (place, ranges) = (ground.ends[1].1.unwrap(), many(1, 100));
    let before_bytes = ground.server.bytes_of(place);
    for number in 0..500 {
        register(&mut ground, 1, number, &ranges[number as usize..]);
    }
    assert_eq!(ground.server.superseded(), 498, "the first is looked at, the last waits");
    let hosted = |ground: &Ground| ground.server.views().find(|view| view.index == place).unwrap().ranges;
    assert_eq!(hosted(&ground), RANGES_MAX);
    assert!(ground.server.bytes_of(place) < before_bytes + 2 * RANGES_MAX * size_of::<Range>());
    // What another sends meanwhile is handed on.
    ground.send(0, module(2), 0);
    assert_eq!(ground.delivered(2), [module(2)]);
    ground.now_ns += LOOK_EVERY_NS;
    ground.settle();
    assert_eq!((hosted(&ground), ground.server.superseded()), (RANGES_MAX - 499, 498), "the last counts");
}

#[test]
fn clients_that_register_much_take_turns_and_each_has_its_own() {
    let clients = 60;
    let settings = |client: usize| (super::plan::client_settings(client, 100 + client as u64), Vec::new());
    let mut ground = Ground::with_room((clients as u16, clients as u16), (0..clients).map(settings));
    // They registered nothing so far; then those of one system register different names.
    ground.now_ns += S;
    ground.settle();
    for client in 0..clients {
        let ranges: Vec<Range> = many(client, 0).into_iter().map(|range| own(client, range)).collect();
        for number in 0..3 {
            register(&mut ground, client, number, &ranges[..1090]);
        }
    }
    let hosts = |ground: &Ground| ground.server.views().filter(|view| view.ranges == 1090).count();
    let at_once = hosts(&ground);
    assert!((1..clients).contains(&at_once), "{at_once} of {clients} had their turn at once");
    let mut looks = 0;
    while hosts(&ground) < clients {
        ground.now_ns += 100 * MS;
        ground.settle();
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
    register(&mut ground, 0, 7, &super::plan::ranges(0));
    let ranges: Vec<Range> = super::plan::ranges(0).into_iter().chain(more.iter().copied()).collect();
    register(&mut ground, 0, 8, &ranges);
    let (head, mut bytes) = (Head { to: module(1), from, ..Head::default() }, Vec::new());
    SessionMessage::Package(Carried { hops: 0, published_ns: 0, head, body: &[] }).write(&mut bytes);
    ground.server.received(ground.now_ns, place, &bytes, &mut ground.said);
    assert_eq!(ground.server.table().client_of(from).filter(|client| *client == place), None, "it waits");
    ground.settle();
    ground
}

#[test]
fn a_package_behind_a_registration_that_waits_for_its_turn_is_not_lost() {
    let (new, foreign) = (Name::new(1, 90, 0, 0), Name::new(2, 90, 0, 0));
    let own = || [super::plan::ranges(0), vec![Range::module(new)]].concat();
    let ground = send_behind_a_registration(new, &[Range::module(new)], Some(own()));
    assert_eq!((ground.ends[1].2.delivered.len(), ground.server.counts().lost_for(Cause::Foreign)), (1, 0));
    for (from, ranges, may_host, why) in [
        (new, vec![], None, "it does not ask for the name"),
        (module(1), vec![Range::module(module(1))], None, "another hosts it"),
        (foreign, vec![Range::module(foreign)], None, "of another system"),
        (new, vec![Range::module(new)], Some(super::plan::ranges(0)), "not of its node"),
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
        ground.now_ns += 100 * MS;
        ground.settle();
    }
    register(&mut ground, 0, 100, &[]);
    let ranges = super::plan::ranges(0);
    let now_ns = ground.now_ns;
    ground.ends[0].0.host(now_ns, ranges);
    ground.send(0, module(1), 0);
    assert_eq!((ground.delivered(1), ground.ends[0].0.is_up()), (vec![], false), "its registration waits for its turn");
    ground.now_ns += LOOK_EVERY_NS;
    ground.settle();
    assert_eq!(ground.delivered(1), [module(1)]);
    assert_eq!(ground.ends[0].2.lost, []);
    assert_eq!(ground.server.counts().lost_for(Cause::Foreign), 0);
}

#[test]
fn what_was_ready_for_a_connection_that_broke_is_gone_with_it() {
    let mut ground = Ground::clients(2);
    let head = Head { to: module(1), from: module(0).with_local(1), len: 100, ..Head::default() };
    let (client, _, notes) = &mut ground.ends[0];
    client.send(ground.now_ns, &ClientPackage { head, body: &[0; 100], published_ns: ground.now_ns, hops: 0 }, notes);
    assert_eq!(client.poll(ground.now_ns, notes), client::ClientStep::Write);
    // The connection breaks with half of a frame.
    client.took(ground.now_ns, 60);
    client.closed(ground.now_ns, notes);
    ground.now_ns += S;
    assert_eq!(client.poll(ground.now_ns, notes), client::ClientStep::Connect);
    client.connected(ground.now_ns);
    let (head, rest) = client.ready().split_first_chunk().unwrap();
    let head = SessionFrameHead::parse(head, LENGTH_MAX).unwrap();
    assert!(
        matches!(SessionMessage::parse(head, rest), Ok(SessionMessage::Hello(_))),
        "nothing else goes by the next one"
    );
}

#[test]
fn a_question_goes_behind_the_frame_that_has_begun_and_before_all_others() {
    let mut ground = Ground::clients(2);
    let (client, _, notes) = &mut ground.ends[0];
    for len in [100, 200, 300] {
        let head = Head { to: module(1), from: module(0).with_local(1), len, ..Head::default() };
        let body = vec![0; usize::from(len)];
        client.send(ground.now_ns, &ClientPackage { head, body: &body, published_ns: ground.now_ns, hops: 0 }, notes);
    }
    client.took(ground.now_ns, 60);
    let due_ns = ground.now_ns + 2 * S;
    client.poll(due_ns, notes);
    let mut kinds = Vec::new();
    let mut bytes = &client.ready()[HEAD_BYTES + 8 + 16 + 100 - 60..];
    while let Some((head, rest)) = bytes.split_first_chunk() {
        let head = SessionFrameHead::parse(head, LENGTH_MAX).unwrap();
        kinds.push((head.kind, head.length));
        bytes = &rest[head.length..];
    }
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
