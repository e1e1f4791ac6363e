//! What one principal may have of what all share, by hand: connections, ranges, memory and the line of a queue; and
//! names that it never gets.

use super::ground::{Ground, package};
use super::plan::{QUOTA, address, classes, client_settings, loud, module, ranges, server_settings, system_of};
use super::strain::{many, own};
use super::world::{MS, S};
use crate::session::client::{Client, ClientSettings, ClientStep};
use crate::session::frame::{RANGES_MAX, Range};
use crate::session::server::{self, MemberState, OwnNode, OwnNodes, Rights, ServerSettings};
use crate::session::{Cause, ClientIndex, ENTRIES_MAX};
use rohrpost_mailbox::{Head, Name, Priority, Type};

/// A package of a client comes to the server.
fn send(ground: &mut Ground, from: usize, to: usize, priority: u8, kind: Type, len: usize) {
    // Nothing hurries more than its sender.
    let sender = if priority > 200 { loud(from) } else { module(from).with_local(1) };
    let priority = Priority(priority);
    let head = Head { to: module(to), from: sender, len: len as u16, kind, priority, ..Head::default() };
    ground.receives(from, &package(head, &vec![0; len]));
}

/// What the stream of one client takes, so many bytes; those of others take all.
fn write(ground: &mut Ground, slow: ClientIndex, mut room: usize) {
    if room > 0 {
        ground.server.writable(slow);
    }
    while let server::ServerStep::Write(index) = ground.server.poll(ground.now_ns, &mut ground.said) {
        let ready = ground.server.ready(index).to_vec();
        let taken = if index == slow { ready.len().min(room) } else { ready.len() };
        ground.server.took(ground.now_ns, index, taken);
        let end = ground.ends.iter_mut().find(|(_, place, _)| *place == Some(index));
        if let Some((client, _, notes)) = end {
            client.received(ground.now_ns, &ready[..taken], notes);
        }
        if index == slow {
            room -= taken;
        }
    }
}

fn lost(ground: &Ground, priority: u8, cause: Cause) -> u64 {
    ground.server.counts().class(Priority(priority)).lost(cause)
}

#[test]
fn a_flood_of_a_queue_displaces_no_sender_with_less_in_it() {
    let mut ground = Ground::clients(3);
    let robot = ground.ends[2].1.unwrap();
    let data = Type::data(1);
    // Something is ready, which the robot's stream does not take; then the queue is filled.
    for _ in 0..2 * QUOTA / 1000 {
        send(&mut ground, 0, 2, 250, data, 1000);
        write(&mut ground, robot, 0);
    }
    let full = lost(&ground, 250, Cause::Full);
    assert!(full > 20, "{full}");
    for _ in 0..20 {
        send(&mut ground, 1, 2, 60, Type::command(16), 100);
        send(&mut ground, 0, 2, 250, data, 1000);
        write(&mut ground, robot, 0);
    }
    assert_eq!((lost(&ground, 60, Cause::Full), lost(&ground, 60, Cause::Share)), (0, 0), "the operator's commands");
    assert!(lost(&ground, 250, Cause::Share) > 5, "the flood gives way to them: {}", lost(&ground, 250, Cause::Share));
    let lost_of = |end: usize| {
        let place = ground.ends[end].1.unwrap();
        ground.server.snapshots(0).find(|(index, _)| *index == place).unwrap().1.lost
    };
    let all = ground.server.counts().lost_for(Cause::Full) + ground.server.counts().lost_for(Cause::Share);
    assert_eq!((lost_of(0), lost_of(1)), (all, 0), "counted for its sender");
}

/// A client that sends more than an equal share gives way, however important its packages are.
#[test]
fn two_senders_have_equal_parts_of_a_queue() {
    let mut ground = Ground::clients(3);
    let robot = ground.ends[2].1.unwrap();
    for (client, priority) in [(0, 250), (1, 60)] {
        for _ in 0..2 * QUOTA / 1000 {
            send(&mut ground, client, 2, priority, Type::data(1), 1000);
            write(&mut ground, robot, 0);
        }
    }
    let kept = |priority| {
        let class = ground.server.counts().class(Priority(priority));
        class.packages.get() - class.settled()
    };
    let (one, other) = (kept(250), kept(60));
    assert!(one.abs_diff(other) <= 2 && one > 30, "equal parts: {one} and {other}");
    assert!(ground.server.bytes_of(robot) < QUOTA + 32 * 1024);
}

#[test]
fn an_urgent_flood_of_a_line_leaves_others_their_share() {
    let mut ground = Ground::clients(3);
    let robot = ground.ends[2].1.unwrap();
    // 32 kB a second, as the shell measures it.
    ground.server.set_batch(robot, 4096);
    let mut commands = 0;
    for step in 0..400 {
        (0..8).for_each(|_| send(&mut ground, 0, 2, 250, Type::data(1), 1000));
        if step % 10 == 0 && step < 300 {
            send(&mut ground, 1, 2, 60, Type::command(16), 100);
            commands += 1;
        }
        write(&mut ground, robot, 320);
        ground.now_ns += 10 * MS;
    }
    assert_eq!(lost(&ground, 60, Cause::Stale), 0);
    assert_eq!(ground.delivered(2).len(), commands, "urgent or not, each has an equal part of the line");
    assert!(ground.server.counts().class(Priority(250)).passed.get() > 50, "and so has the flood");
}

#[test]
fn one_certificate_does_not_fill_the_table_however_often_it_connects() {
    let clients = 12;
    let settings = |client: usize| (client_settings(3 * client, 100 + client as u64), Vec::new());
    let mut ground = Ground::with_room((clients as u16, clients as u16), (0..clients).map(settings));
    // All but the last are connections of one certificate.
    for client in 0..clients - 1 {
        let place = ground.ends[client].1.take().unwrap();
        ground.server.closed(ground.now_ns, place, &mut ground.said);
    }
    ground.now_ns += S;
    for (client, place, notes) in ground.ends[..clients - 1].iter_mut() {
        client.closed(ground.now_ns - S, notes);
        assert_eq!(client.poll(ground.now_ns, notes), ClientStep::Connect);
        let index = ground.server.accept(ground.now_ns, address(9, 0), &mut ground.said).unwrap();
        ground.server.certify(index, 1, "node hostile of system 1", Rights::any());
        client.connected(ground.now_ns);
        *place = Some(index);
    }
    ground.settle();
    let names = |client: usize| many(0, 0).into_iter().map(move |range| own(3 * client, range)).collect::<Vec<Range>>();
    for number in 1..30 {
        (0..clients - 1).for_each(|client| ground.register(client, 100 + number, &names(client)));
        ground.pass(100 * MS);
    }
    ground.register(clients - 1, 200, &names(clients - 1));
    ground.pass(100 * MS);
    let hosts = |client: usize| ground.server.table().count_of(ground.ends[client].1.unwrap());
    let of_one: usize = (0..clients - 1).map(hosts).sum();
    assert!(of_one <= ENTRIES_MAX / 8 && of_one > ENTRIES_MAX / 8 - RANGES_MAX, "{of_one} ranges of one certificate");
    assert_eq!(hosts(clients - 1), RANGES_MAX, "another has its own");
    assert!(ground.server.crowded().ranges > 10, "{:?}", ground.server.crowded());
}

/// A client that says hello from an address; its place, or none.
fn joins(ground: &mut Ground, client: usize, from: usize) -> Option<ClientIndex> {
    let place = says_hello(ground, (client_settings(client, 500 + client as u64), 1), (from, None))?;
    is_member(ground, place).then_some(place)
}

fn is_member(ground: &Ground, place: ClientIndex) -> bool {
    ground.server.clients().any(|(index, _, state)| index == place && state == MemberState::Member)
}

#[test]
fn one_address_does_not_take_all_places_of_clients() {
    let mut ground = Ground::with_room((6, 6), []);
    let greedy: Vec<_> = (0..6).map(|client| joins(&mut ground, client, 1).unwrap()).collect();
    // One after the other comes from an address of its own, until all have equal parts.
    for (client, from) in [(10, 2), (11, 3), (12, 4), (13, 5)] {
        assert!(joins(&mut ground, client, from).is_some(), "{client} of another address has a place");
    }
    let left = greedy.iter().filter(|place| is_member(&ground, **place)).count();
    assert!(left == 2 && is_member(&ground, greedy[0]), "the newest of the largest give way: {left} left");
    assert_eq!(joins(&mut ground, 20, 1), None, "it does not get them back");
    assert!(joins(&mut ground, 21, 6).is_some(), "the last that has more than one gives way");
    assert_eq!(joins(&mut ground, 22, 7), None, "all have one");
    assert_eq!(ground.server.crowded().clients, 6, "{:?}", ground.server.crowded());
    let told = ground.said.events.iter().filter(|event| event.contains("Left") && event.contains("Full"));
    assert_eq!(told.count(), 5);
}

#[test]
fn one_address_does_not_push_others_out_before_their_hello() {
    let mut ground = Ground::with_room((4, 4), []);
    let mut accept = |from, connection| {
        ground.now_ns += MS;
        ground.server.accept(ground.now_ns, address(from, connection), &mut ground.said)
    };
    let slow = accept(1, 0).unwrap();
    for connection in 0..20 {
        let _ = accept(2, connection);
    }
    let states: Vec<_> = ground.server.clients().map(|(index, _, state)| (index, state)).collect();
    assert!(states.contains(&(slow, MemberState::Handshake)), "a slow client beside a flood does not give way");
    assert!(ground.server.crowded().handshakes > 3);
}

/// A connection says hello as a client in this attempt, behind the certificate that it shows; its place, or none.
fn says_hello(
    ground: &mut Ground,
    (settings, attempt): (ClientSettings, u64),
    (from, certificate): (usize, Option<(u8, &str)>),
) -> Option<ClientIndex> {
    let mut end = Client::new(settings, Vec::new(), ground.now_ns);
    (0..attempt).for_each(|_| end.connected(ground.now_ns));
    let place = ground.server.accept(ground.now_ns, address(from, attempt), &mut ground.said)?;
    if let Some((system, name)) = certificate {
        ground.server.certify(place, system, name, Rights::any());
    }
    ground.server.received(ground.now_ns, place, end.ready(), &mut ground.said);
    Some(place)
}

/// An incarnation is no secret: it stands in each hello.
#[test]
fn nobody_takes_the_place_of_a_client_of_another_principal() {
    let own = || client_settings(0, 100);
    let of_other_system = || ClientSettings { system: 2, system_digest: 22, ..own() };
    let (node, other) = (Some((1, "node a of system 1")), Some((1, "node b of system 1")));
    let foreign = Some((2, "node a of system 2"));
    for (first, then, settings, replaces, what) in [
        ((0, None), (0, None), own(), true, "a later connection from the same address"),
        ((0, None), (9, None), own(), false, "from another address"),
        ((0, None), (0, node), own(), false, "with a certificate, where the first has none"),
        ((0, node), (9, node), own(), true, "with the same certificate, from anywhere"),
        ((0, node), (0, other), own(), false, "with a certificate of another node"),
        ((0, node), (0, foreign), of_other_system(), false, "with a certificate of another system"),
        ((0, node), (0, None), own(), false, "without a certificate"),
    ] {
        let mut ground = Ground::with_room((16, 4), []);
        let victim = says_hello(&mut ground, (own(), 1), first).unwrap();
        let later = says_hello(&mut ground, (settings, 2), then).unwrap();
        let are_members = (is_member(&ground, victim), is_member(&ground, later));
        assert_eq!(are_members, (!replaces, true), "{what}: {:?}", ground.said.events);
        // Nor does it keep the first one out, when that comes again.
        let again = says_hello(&mut ground, (own(), 3), first).unwrap();
        assert!(is_member(&ground, again), "{what}: {:?}", ground.said.events);
    }
}

#[test]
fn of_what_one_client_hosts_no_other_gets_a_part() {
    let inside = Range::module(Name::new(1, 104, 0, 0));
    let own = |client: usize| client_settings(client, 100 + client as u64);
    let ends = [(own(0), ranges(0)), (own(1), ranges(1)), (own(3), vec![inside])];
    let mut ground = Ground::new(ends);
    let words = ground.ends[2].2.events.clone();
    assert!(words.len() == 1 && words[0].contains("is hosted by client 0"), "{words:?}");
    ground.send(1, inside.first, 0);
    assert_eq!(
        (ground.delivered(0), ground.delivered(2)),
        (vec![inside.first], vec![]),
        "it goes where it went before"
    );
    // Nor does it get a part of it by asking for more than it.
    let (now_ns, around) = (ground.now_ns + S, classes(90, 120));
    ground.ends[2].0.host(now_ns, vec![around]);
    ground.now_ns = now_ns;
    ground.settle();
    assert!(!ground.ends[2].0.is_up() && ground.server.table().client_of(inside.first) == ground.ends[0].1);
}

#[test]
fn what_the_file_gives_a_node_no_other_client_gets_where_nobody_shows_a_certificate() {
    let node = |client: usize| OwnNode {
        name: format!("client {client}"),
        names: ranges(client).into_iter().collect(),
        all: ranges(client).into_iter().collect(),
        address: Some(address(client, 0).ip()),
    };
    let own_nodes = OwnNodes::new([node(0), node(3)]);
    let settings = ServerSettings { own_nodes, ..server_settings(5) };
    let is_up = |named: usize, ranges: Vec<Range>| {
        let name = format!("client {named}");
        let settings_of = ClientSettings { name, ..client_settings(3, 100) };
        Ground::with(settings.clone(), [(settings_of, ranges)]).ends[0].0.is_up()
    };
    assert_eq!(system_of(3), 1);
    for (named, wanted, may, what) in [
        (0, ranges(0), true, "a node has what the file gives it"),
        (9, ranges(0), false, "nobody else has that, though nobody hosts it"),
        (9, vec![Range::module(module(0))], false, "nor a part of it"),
        (9, vec![classes(1, 254)], false, "nor what lies around it"),
        (3, ranges(0), false, "nor another node"),
        (9, vec![classes(80, 81)], true, "what the file gives nobody is free"),
        (3, [ranges(3), vec![classes(80, 81)]].concat(), true, "for its nodes, too"),
    ] {
        assert_eq!(is_up(named, wanted), may, "{what}");
    }
    // One that says it is a node gives way when that comes from its own address, and does not come back.
    let liar = ClientSettings { name: "client 3".into(), ..client_settings(0, 100) };
    let ends = [
        (liar, ranges(3)),
        (client_settings(1, 8), ranges(1)),
        (client_settings(2, 9), ranges(2)),
        (client_settings(3, 7), ranges(3)),
    ];
    let mut ground = Ground::with(settings.clone(), ends);
    ground.pass(S);
    assert_eq!(ground.server.table().client_of(module(3)), ground.ends[3].1, "{:?}", ground.said.events);
    let told = &ground.ends[0].2.events;
    assert!(
        ground.ends[3].0.is_up() && !ground.ends[0].0.is_up() && told.iter().any(|text| text.contains("own address")),
        "{told:?}"
    );
}
