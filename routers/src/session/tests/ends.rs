//! Both ends by hand: what a table shows better than chance.

use super::ground::{Ground, frames, package};
use super::plan::{QUOTA, address, client_settings, module, ranges};
use super::world::{MS, S};
use crate::report::NotDelivered;
use crate::session::client::{self, Client};
use crate::session::frame::{HOPS_MAX, Ranges, SessionMessage};
use crate::session::server::{self, MemberState};
use crate::session::{Cause, HANDSHAKE_MAX_NS, SILENT_AFTER_NS};
use rohrpost_mailbox::{ALL_SYSTEMS, Head, Name, Priority, Type};

#[test]
fn a_client_with_another_digest_takes_no_part_and_is_told_both() {
    let settings = client_settings(0, 9);
    let wrong = client::ClientSettings { common: 0xabc, ..settings.clone() };
    let ground = Ground::new([(wrong, ranges(0))]);
    let words = &ground.ends[0].2.events;
    assert!(words.len() == 1 && words[0].contains("0abc, that of the server 0000000000000007"), "{words:?}");
    assert!(ground.said.events[0].contains("Refused"), "{:?}", ground.said.events);
    // The server's own system, and one of which the first client says the digest.
    for (client, holder) in [(0, "the server"), (4, "client 1")] {
        let first = client_settings(1, 8);
        let wrong = client::ClientSettings { system_digest: 0xdef, ..client_settings(client, 9) };
        let ground = Ground::new([(first, ranges(1)), (wrong, ranges(client))]);
        let words = &ground.ends[1].2.events;
        assert!(words.len() == 1 && words[0].contains(&format!("0def, that of {holder} ")), "{words:?}");
        assert!(ground.ends[0].0.is_up() && !ground.ends[1].0.is_up());
    }
}

#[test]
fn a_name_that_is_hosted_is_refused_naming_the_holder_until_that_one_goes() {
    let mut ground = Ground::new([(client_settings(0, 8), ranges(0)), (client_settings(3, 9), ranges(0))]);
    let words = ground.ends[1].2.events.clone();
    assert!(words.len() == 1 && words[0].contains("is hosted by client 0; end it"), "{words:?}");
    assert!(ground.ends[0].0.is_up() && !ground.ends[1].0.is_up());
    // When its holder has gone, the names are free.
    let place = ground.ends[0].1.take().unwrap();
    ground.server.closed(ground.now_ns, place, &mut ground.said);
    ground.pass(S);
    assert!(ground.ends[1].0.is_up(), "{:?}", ground.ends[1].2.events);
}

#[test]
fn packages_go_to_the_host_of_the_name_and_never_back() {
    let mut ground = Ground::clients(4);
    let (between, behind) = (Name::new(1, 105, 0, 0), Name::new(1, 106, 1, 0));
    ground.send(1, between, 0);
    ground.send(1, behind, 0);
    assert_eq!((ground.delivered(0), ground.delivered(3)), (vec![behind], vec![between]));
    // What its host cannot deliver itself does not come back to it.
    ground.send(0, behind, 0);
    assert_eq!(ground.delivered(0), [behind]);
    assert_eq!(ground.said.lost, [Cause::NoRoute]);
    let (answer, _) = ground.ends[0].2.delivered.last().unwrap();
    assert_eq!((answer.from, answer.to, answer.kind), (behind, module(0).with_local(1), Type::reply(16)));
}

#[test]
fn a_package_that_goes_round_is_stopped() {
    let mut ground = Ground::clients(3);
    ground.send(0, module(1), 3);
    assert_eq!(ground.ends[1].2.delivered[0].1, 4, "one further");
    ground.send(0, module(1), HOPS_MAX - 1);
    assert_eq!(ground.ends[1].2.delivered[1].1, HOPS_MAX, "as far as it may go");
    ground.send(0, module(1), HOPS_MAX);
    assert_eq!(ground.delivered(1).len(), 2);
    assert_eq!(ground.said.lost, [Cause::Hops]);
}

#[test]
fn a_client_without_a_hello_is_closed_and_keeps_no_other_out() {
    let mut ground = Ground::clients(1);
    let slow = ground.server.accept(ground.now_ns, address(100, 0), &mut ground.said).unwrap();
    // Bytes come all the time, and never a whole hello.
    let mut waited_ns = 0;
    while ground.server.clients().any(|(index, _, _)| index == slow) {
        ground.server.received(
            ground.now_ns,
            slow,
            &[[200, 0, 0, 0, 1, 0, 0, 0, 9][(waited_ns / (100 * MS)).min(8) as usize]],
            &mut ground.said,
        );
        ground.now_ns += 100 * MS;
        waited_ns += 100 * MS;
        ground.settle();
        assert!(waited_ns < HANDSHAKE_MAX_NS + 2 * S, "still there");
    }
    // Many of them do not keep others out: the oldest gives way.
    for _ in 0..20 {
        let _ = ground.server.accept(ground.now_ns, address(100, 0), &mut ground.said);
    }
    ground.settle();
    let waiting = ground.server.clients().filter(|(_, _, state)| *state == MemberState::Handshake).count();
    assert!(waiting <= 4 && ground.ends[0].0.is_up(), "{waiting}");
}

#[test]
fn a_silent_end_is_gone() {
    let mut ground = Ground::clients(2);
    ground.ends[1].1 = None;
    for _ in 0..SILENT_AFTER_NS / (100 * MS) + 5 {
        ground.pass(100 * MS);
    }
    let names: Vec<_> = ground.server.clients().map(|(_, name, _)| name.to_owned()).collect();
    assert!(!names.contains(&"client 1".to_owned()) || ground.ends[1].1.is_some(), "{names:?}");
    assert!(ground.said.events.iter().any(|event| event.contains("Silent")), "{:?}", ground.said.events);
    assert!(ground.ends[0].0.is_up(), "the other is as it was");
}

#[test]
fn what_goes_to_all_systems_comes_once_to_each() {
    // Clients 0 and 3 are of system 1; 0 reaches its own system, 3 does not.
    let all = Name::new(ALL_SYSTEMS, 40, 0, 0);
    let at = |system| Name::new(system, 40, 0, 0);
    let mut ground = Ground::clients(6);
    ground.send(0, all, 0);
    let got = |ground: &Ground| (0..6).map(|client| ground.delivered(client)).collect::<Vec<_>>();
    assert_eq!(got(&ground), [vec![], vec![at(2)], vec![at(3)], vec![], vec![], vec![]]);
    ground.send(3, all, 0);
    assert_eq!(got(&ground), [vec![at(1)], vec![at(2); 2], vec![at(3); 2], vec![], vec![], vec![]]);
    // Nobody waits for an answer to it.
    ground.send(0, Name::new(ALL_SYSTEMS, 41, 0, 0), 0);
    assert_eq!(ground.said.lost, []);
    assert_eq!(ground.server.counts().lost_for(Cause::NoRoute), 1);
    // What only the sender's own system hosts reaches that without the server.
    ground.send(0, Name::new(ALL_SYSTEMS, 103, 0, 0), 0);
    assert_eq!(ground.server.counts().lost_for(Cause::NoRoute), 1);
}

#[test]
fn what_goes_to_all_systems_is_lost_where_its_own_node_hosts_the_name_and_nobody_is_there() {
    let mut ground = Ground::clients(1);
    let counts = |ground: &Ground| {
        let class = ground.ends[0].0.out().class(Priority(60));
        (class.packages.get(), class.passed.get(), class.lost(Cause::NoMailbox))
    };
    let (hosted, other, nobody) = (Name::new(1, 106, 0, 0), Name::new(1, 30, 0, 0), Err(NotDelivered::NoMailbox));
    ground.ends[0].0.reached_itself(other, Priority(60), nobody);
    assert_eq!(counts(&ground), (0, 0, 0), "another client hosts it, or nobody: the server counts that");
    ground.ends[0].0.reached_itself(hosted, Priority(60), nobody);
    assert_eq!(counts(&ground), (1, 0, 1));
    ground.ends[0].0.reached_itself(other, Priority(60), Ok(()));
    assert_eq!(counts(&ground), (2, 1, 1));
}

#[test]
fn what_the_streams_held_for_too_long_is_not_delivered() {
    let mut ground = Ground::clients(2);
    let head =
        Head { to: module(1), from: module(0).with_local(1), len: 8, kind: Type::command(16), ..Head::default() };
    ground.sends(0, head, 0);
    let (client, place, _) = &mut ground.ends[0];
    let bytes = client.ready().to_vec();
    client.took(ground.now_ns, bytes.len());
    // The stream holds it for a second, to the server and once more from there.
    ground.now_ns += S;
    ground.server.received(ground.now_ns, place.unwrap(), &bytes, &mut ground.said);
    let server::ServerStep::Write(index) = ground.server.poll(ground.now_ns, &mut ground.said) else {
        panic!("it leaves")
    };
    let bytes = ground.server.ready(index).to_vec();
    ground.server.took(ground.now_ns, index, bytes.len());
    ground.now_ns += S;
    let (client, _, notes) = &mut ground.ends[1];
    client.received(ground.now_ns, &bytes, notes);
    assert_eq!(
        (notes.delivered.len(), &notes.lost[..]),
        (0, &[Cause::Stale][..]),
        "a command two seconds old is not run"
    );
}

#[test]
fn frames_that_come_byte_by_byte_are_whole() {
    let mut ground = Ground::clients(2);
    let head = Head { to: module(1), from: module(0), len: 3, ..Head::default() };
    let bytes = package(head, &[1, 2, 3]).to_bytes().repeat(3);
    let place = ground.ends[0].1.unwrap();
    bytes.iter().for_each(|byte| ground.server.received(ground.now_ns, place, &[*byte], &mut ground.said));
    ground.settle();
    assert_eq!(ground.ends[1].2.delivered.len(), 3);
}

#[test]
fn what_a_stranger_says_takes_no_memory_and_is_told_to_him() {
    for (bytes, words) in [
        (b"GET / HTTP/1.1\r\nHost: robot\r\n\r\n".to_vec(), "unknown kind"),
        (vec![0xff, 0xff, 0xff, 0xff, 1, 0, 0, 0], "4294967295 bytes is too long"),
        (vec![8, 0, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], "not for now"),
    ] {
        let mut ground = Ground::new([]);
        let place = ground.server.accept(ground.now_ns, address(100, 0), &mut ground.said).unwrap();
        ground.server.received(ground.now_ns, place, &bytes, &mut ground.said);
        assert!(ground.said.events[0].contains(words), "{:?}", ground.said.events);
        assert!(ground.server.bytes_of(place) < 4096);
        let server::ServerStep::Write(index) = ground.server.poll(ground.now_ns, &mut ground.said) else {
            panic!("{words}")
        };
        let told = frames(ground.server.ready(index)).next();
        assert!(matches!(told, Some((_, SessionMessage::Refusal(refusal))) if refusal.text.contains(words)));
        let bytes = ground.server.ready(index).len();
        ground.server.took(ground.now_ns, index, bytes);
        assert_eq!(ground.server.poll(ground.now_ns, &mut ground.said), server::ServerStep::Close(place));
    }
}

#[test]
fn an_idle_client_takes_up_little() {
    let mut ground = Ground::clients(2);
    for _ in 0..100 {
        ground.send(0, module(1), 0);
        ground.now_ns += 100 * MS;
    }
    for (index, _, _) in ground.server.clients() {
        assert!(ground.server.bytes_of(index) < 32 * 1024, "{}", ground.server.bytes_of(index));
    }
}

#[test]
fn what_waits_is_bounded_and_the_least_important_gives_way() {
    let mut ground = Ground::clients(2);
    let reader = ground.ends[1].1.unwrap();
    // The reader's stream takes nothing any more.
    let send = |ground: &mut Ground, priority: u8, count: usize| {
        for _ in 0..count {
            let priority = Priority(priority);
            let head =
                Head { to: module(1), from: module(0), len: 1000, kind: Type::data(1), priority, ..Head::default() };
            ground.receives(0, &package(head, &[0; 1000]));
            while let server::ServerStep::Write(index) = ground.server.poll(ground.now_ns, &mut ground.said) {
                let taken = if index == reader { 0 } else { ground.server.ready(index).len() };
                ground.server.took(ground.now_ns, index, taken);
            }
        }
    };
    send(&mut ground, 40, 500);
    let full = |ground: &Ground, class: u8| ground.server.counts().class(Priority(class)).lost(Cause::Full);
    assert!(full(&ground, 40) > 300);
    let before = full(&ground, 40);
    send(&mut ground, 200, 20);
    assert_eq!((full(&ground, 200), full(&ground, 40)), (0, before + 20), "one gives way for each");
    assert!(ground.server.bytes_of(reader) < QUOTA + 32 * 1024);
}

#[test]
fn names_of_others_are_sent_by_nobody() {
    let mut ground = Ground::clients(2);
    for from in [module(1), Name::NONE] {
        ground.receives(0, &package(Head { to: module(1), from, ..Head::default() }, &[]));
    }
    ground.settle();
    assert_eq!(ground.delivered(1), []);
    assert_eq!(ground.server.counts().lost_for(Cause::Foreign), 2);
}

#[test]
fn a_later_connection_of_the_same_incarnation_takes_the_place_of_the_earlier() {
    let mut ground = Ground::clients(2);
    let old = ground.ends[0].1.unwrap();
    let place = ground.server.accept(ground.now_ns, address(0, 2), &mut ground.said).unwrap();
    let mut later = Client::new(client_settings(0, 100), Vec::new(), ground.now_ns);
    (0..2).for_each(|_| later.connected(ground.now_ns));
    let register = SessionMessage::Register(Ranges::new(1, &ranges(0), &mut Vec::new())).to_bytes();
    ground.server.received(ground.now_ns, place, &[later.ready(), &register].concat(), &mut ground.said);
    assert_eq!(ground.server.table().client_of(module(0)), Some(place));
    let state = ground.server.clients().find(|(index, _, _)| *index == old).map(|(_, _, state)| state);
    assert!(matches!(state, Some(MemberState::Leaving { .. })), "{state:?}");
}
