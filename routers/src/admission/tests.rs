use super::*;
use rohrpost_config::{ClassSet, Commanded};
use std::net::Ipv4Addr;

const ROUTER: Class = Class(250);
const TCP: Class = Class(64);
const TEAM: Class = Class(65);
const TUNNEL_NET: Tunnel = Tunnel { network: Ipv4Addr::new(10, 78, 0, 0), prefix: 24 };

/// Admission of node 0, with a tunnel, where only class 100 may command class 200, and only class 90 the module of
/// instance 5 there.
fn admission() -> Admission {
    let rule = |commanded, caller, line| AccessRule { commanded, callers: ClassSet::from_iter([Class(caller)]), line };
    let of_class = rule(Commanded::Class(Class(200)), 100, 7);
    let of_module = rule(Commanded::Module(name(1, 200, 5, 0)), 90, 8);
    Admission {
        access: Access::new(vec![of_module, of_class]),
        router: Some(ROUTER),
        tcp: Some(TCP),
        team: Some(TEAM),
        tunnel: Some((TUNNEL_NET, 0)),
    }
}

fn name(system: u8, class: u8, instance: u8, local: u8) -> Name {
    Name::new(system, class, instance, local)
}

fn lan(node: NodeIndex) -> ArrivalPath {
    ArrivalPath::Lan { node, is_its_name: true }
}

const BEYOND: ArrivalPath = ArrivalPath::Beyond { is_our_name: false };

fn validated(way: ArrivalPath, kind: Type, from: Name, to: Name) -> Result<(), NotAdmitted> {
    admission().validate(way, &Head { to, from, kind, ..Head::default() }, &[])
}

#[test]
fn a_sender_under_a_name_of_another_is_refused() {
    let (mine, yours) = (name(1, 60, 1, 1), name(1, 90, 0, 2));
    for (way, from, is_admitted, why) in [
        (lan(1), mine, true, "a node speaks for its own names"),
        (ArrivalPath::Lan { node: 1, is_its_name: false }, mine, false, "and for no others"),
        (BEYOND, name(2, 60, 1, 1), true, "the TCP router vouches"),
        (ArrivalPath::Beyond { is_our_name: true }, mine, false, "nobody beyond hosts our names"),
        (BEYOND, Name::NONE, false, "none"),
        (BEYOND, name(0, 60, 1, 1), false, "no system"),
        (BEYOND, name(255, 60, 1, 1), false, "all systems"),
        (BEYOND, name(2, 0, 1, 1), false, "no class"),
    ] {
        let expected = if is_admitted { Ok(()) } else { Err(NotAdmitted::ForeignName) };
        assert_eq!(validated(way, Type::data(1), from, yours), expected, "{why}");
    }
}

#[test]
fn the_mailboxes_of_routers_take_nothing_and_their_modules_are_as_any() {
    let tool = name(1, 32, 40, 1);
    for class in [ROUTER.0, TCP.0, TEAM.0] {
        for local in 0..=u8::MAX {
            let expected = if local < local::TRANSIT { Ok(()) } else { Err(NotAdmitted::RoutersOwn) };
            for way in [lan(1), BEYOND] {
                let (to, kinds) = (name(1, class, 0, local), [Type::command(16), Type::reply(16), Type::data(1)]);
                for kind in kinds {
                    assert_eq!(validated(way, kind, tool, to), expected, "{way:?} to {to}");
                    let expected = if kind == Type::reply(16) { Ok(()) } else { expected };
                    assert_eq!(validated(way, kind, name(1, class, 1, local), tool), expected, "{way:?} from {to}");
                }
            }
        }
    }
    let module = name(1, 90, 0, local::TRANSIT);
    assert_eq!(validated(lan(1), Type::data(1), tool, module), Ok(()), "the same local id of a module is its own");
}

#[test]
fn of_another_systems_routers_the_tcp_router_alone_is_for_all() {
    for (from, to, is_admitted, why) in [
        (2, name(1, TCP.0, TCP_SERVER, 0), true, "the client asks what is hosted"),
        (2, name(1, TCP.0, 0, 0), false, "the client of a node"),
        (2, name(1, ROUTER.0, 0, 0), false, "the router of a node"),
        (1, name(1, TCP.0, 0, 0), true, "a tool of the same system, beyond the LAN"),
        (1, name(1, ROUTER.0, 0, 0), true, "the same of the LAN's router"),
        (2, name(1, 90, 0, 0), true, "a module"),
    ] {
        let expected = if is_admitted { Ok(()) } else { Err(NotAdmitted::RoutersOwn) };
        assert_eq!(validated(BEYOND, Type::command(4), name(from, 32, 40, 1), to), expected, "{why}");
    }
    let answer = validated(BEYOND, Type::reply(4), name(2, TCP.0, TCP_SERVER, 0), name(1, 32, 40, 1));
    assert_eq!(answer, Ok(()), "and what it answers");
}

#[test]
fn only_classes_that_are_listed_may_command_by_whichever_way() {
    let (command, reply, data) = (Type::command(16), Type::reply(16), Type::data(1));
    let [any, of_module, neighbour, other] =
        [(200, 0), (200, 5), (200, 6), (199, 5)].map(|(class, instance)| name(1, class, instance, local::COMMANDS));
    for (kind, from, to, rule, why) in [
        (command, 100, any, None, "its class is listed"),
        (command, 90, any, Some(7), "its class is not"),
        (command, 90, any.with_local(3), Some(7), "at no mailbox"),
        (data, 90, any, Some(7), "data in the mailbox for commands"),
        (reply, 90, any, Some(7), "replies there"),
        (data, 90, any.with_local(local::DATA), None, "else data go to all"),
        (reply, 90, any.with_local(local::REPLIES), None, "replies too"),
        (command, 90, of_module, None, "it is listed for this module"),
        (command, 100, of_module, Some(8), "the line of the class does not count there"),
        (command, 100, of_module.with_local(3), Some(8), "at no mailbox"),
        (data, 100, of_module, Some(8), "data in the mailbox for commands"),
        (data, 100, of_module.with_local(local::DATA), None, "else data go to all"),
        (command, 90, neighbour, Some(7), "nor that of the module for its neighbour"),
        (command, 100, neighbour, None, "which takes what its class takes"),
        (command, 90, other, None, "a class without a line takes all"),
        (command, 100, other, None, "whatever the same instance of another does"),
    ] {
        let expected = if rule.is_none() { Ok(()) } else { Err(NotAdmitted::NotAllowed) };
        for (way, from) in [(lan(1), name(1, from, 1, 1)), (BEYOND, name(2, from, 1, 1))] {
            assert_eq!(validated(way, kind, from, to), expected, "{way:?}: {why}");
            let head = Head { to, from, kind, ..Head::default() };
            assert_eq!(admission().rule_against(&head).map(|rule| rule.line), rule, "{way:?}: {why}");
        }
    }
}

#[test]
fn packets_of_the_tunnel_come_from_the_node_with_their_address() {
    let (ours, theirs) = (TUNNEL_NET.address(0), TUNNEL_NET.address(1));
    let end = |node| name(1, ROUTER.0, node, TUNNEL);
    let packet = v4(theirs, ours, b"payload");
    let head = Head { to: end(0), from: end(1), kind: PACKET, ..Head::default() };
    let (own, bad) = (Err(NotAdmitted::RoutersOwn), Err(NotAdmitted::BadPacket));
    for (way, head, body, expected, why) in [
        (lan(1), head, packet.clone(), Ok(()), "as it should be"),
        (lan(1), head, v4(TUNNEL_NET.address(2), ours, b""), bad, "the address of a third node"),
        (lan(1), head, v4(Ipv4Addr::new(192, 168, 0, 9), ours, b""), bad, "an address outside"),
        (lan(1), head, v4(theirs, TUNNEL_NET.address(2), b""), bad, "for a third node"),
        (lan(1), head, v4(theirs, Ipv4Addr::BROADCAST, b""), bad, "for all"),
        (lan(1), head, packet[..24].to_vec(), bad, "cut short"),
        (lan(1), head, b"no packet at all".to_vec(), bad, "something else"),
        (lan(2), head, packet.clone(), own, "of another node than it says"),
        (lan(1), Head { from: name(1, 60, 1, TUNNEL), ..head }, packet.clone(), own, "of a module"),
        (lan(1), Head { from: end(1).with_local(3), ..head }, packet.clone(), own, "of another mailbox of that router"),
        (lan(1), Head { to: end(0).with_local(3), ..head }, packet.clone(), own, "for the transit mailbox"),
        (lan(1), Head { to: name(1, TCP.0, 0, 3), ..head }, packet.clone(), own, "for that of the TCP router's client"),
        (lan(1), Head { kind: Type::command(1), ..head }, packet.clone(), own, "a command"),
        (BEYOND, head, packet.clone(), own, "by the TCP router"),
    ] {
        assert_eq!(admission().validate(way, &head, &body), expected, "{why}");
    }
    let without = Admission { tunnel: None, ..admission() };
    assert_eq!(without.validate(lan(1), &head, &packet), own, "without a tunnel there is nobody to take it");
}

#[test]
fn no_sender_exceeds_its_class_or_that_of_its_request() {
    for (kind, from, to, limit, why) in [
        (Type::command(16), 60, 200, 60, "a command, as its sender"),
        (Type::command(16), 200, 60, 200, "a command, as its sender"),
        (Type::reply(16), 200, 60, 60, "a reply, as its receiver"),
        (Type::reply(16), 60, 200, 200, "a reply, as its receiver"),
        (Type::data(1), 60, 200, 200, "data that were asked for"),
        (Type::data(1), 200, 60, 200, "data that were not"),
        (Type(0), 60, 200, 60, "nothing that there is"),
    ] {
        let head = |priority| Head {
            to: name(1, to, 0, 2),
            from: name(1, from, 1, 0),
            kind,
            priority: Priority(priority),
            ..Head::default()
        };
        for priority in 0..=u8::MAX {
            assert_eq!(capped(&head(priority)), head(priority.min(limit)), "{why}");
        }
    }
    for kind in [Type::command(16), Type::reply(16), Type::data(1)] {
        let to = name(1, 200, 0, local::COMMANDS);
        let head = Head { to, from: name(1, 60, 1, 0), kind, priority: Priority(255), ..Head::default() };
        assert_eq!(capped(&head).priority, Priority(60), "among commands all go as their sender");
    }
    let unasked = Head { to: name(1, 60, 0, 0), kind: Type::command(1), priority: Priority(1), ..Head::default() };
    assert_eq!(capped(&unasked).priority, Priority(0), "a sender without a name has no importance");
}
