//! What the server brings is validated where it arrives, by the same rules as on the LAN.

use super::ground::Ground;
use super::plan::{client_settings, module, ranges};
use crate::admission::{Admission, PACKET, TUNNEL};
use crate::session::Cause;
use crate::session::client::ClientSettings;
use crate::session::frame::{Carried, SessionMessage};
use rohrpost_config::{Access, AccessRule, ClassSet, Commanded};
use rohrpost_mailbox::{Class, Head, Name, Priority, Type, local};

const ROUTER: Class = Class(103);
const BARRED: Class = Class(60);

/// A client of system 2, in which only class 40 may command modules of class 60, joined to its server.
fn guarded() -> Ground {
    let callers = ClassSet::from_iter([Class(40)]);
    let rule = AccessRule { commanded: Commanded::Class(BARRED), callers, line: 12 };
    let admission = Admission { access: Access::new(vec![rule]), router: Some(ROUTER), ..Admission::default() };
    Ground::new([(ClientSettings { admission, ..client_settings(1, 9) }, ranges(1))])
}

/// What becomes of a package that the server brings: with which priority it is delivered, or why it is lost.
fn brought(ground: &mut Ground, head: Head) -> Result<u8, Cause> {
    let bytes = SessionMessage::Package(Carried { hops: 1, published_ns: ground.now_ns, head, body: &[] }).to_bytes();
    let (client, _, notes) = &mut ground.ends[0];
    let before = notes.delivered.len();
    client.received(ground.now_ns, &bytes, notes);
    if let Some((delivered, _)) = notes.delivered.get(before) {
        return Ok(delivered.priority.0);
    }
    let lost = |cause: &Cause| client.inn().lost_for(*cause) > 0;
    let causes: Vec<Cause> = Cause::ALL.into_iter().filter(lost).collect();
    assert_eq!(causes.len(), 1, "{causes:?}");
    Err(causes[0])
}

#[test]
fn what_the_server_brings_is_admitted_as_on_the_lan() {
    let ours = module(1);
    let (router, tool) = (Name::new(2, ROUTER.0, 0, 0), Name::new(3, 32, 40, local::REPLIES));
    let (command, reply, data) = (Type::command(16), Type::reply(16), Type::data(1));
    let allowed = Name::new(3, 40, 0, local::REPLIES);
    for (to, from, kind, expected, why) in [
        (ours, allowed, command, Ok(40), "a command, as its sender"),
        (ours.with_local(1), Name::new(3, 200, 0, 0), reply, Ok(60), "a reply, as its receiver"),
        (ours.with_local(2), allowed, data, Ok(60), "data that were asked for"),
        (ours.with_local(2), Name::new(3, 200, 0, 0), data, Ok(200), "data that were not"),
        (ours, tool, command, Err(Cause::NotAllowed), "a class that may not"),
        (ours.with_local(2), ours.with_local(0), data, Err(Cause::Foreign), "in our own name"),
        (ours.with_local(1), ours, reply, Ok(60), "but the server's reply for an absent receiver"),
        (ours.with_local(2), Name::NONE, data, Err(Cause::Foreign), "in no name"),
        (router.with_local(local::TRANSIT), tool, data, Err(Cause::RoutersOwn), "for a transit mailbox"),
        (router.with_local(TUNNEL), router.with_local(TUNNEL), PACKET, Err(Cause::RoutersOwn), "an IP packet"),
        (router, tool, command, Err(Cause::RoutersOwn), "for a router of another system"),
        (router, Name::new(2, 32, 40, 1), command, Ok(32), "for one of the same"),
    ] {
        let head = Head { to, from, kind, priority: Priority(255), ..Head::default() };
        assert_eq!(brought(&mut guarded(), head), expected, "{why}");
    }
}

#[test]
fn a_refused_command_names_its_rule() {
    let mut ground = guarded();
    let head = Head { to: module(1), from: Name::new(3, 32, 40, 1), kind: Type::command(16), ..Head::default() };
    assert_eq!(brought(&mut ground, head), Err(Cause::NotAllowed));
    let notes = &ground.ends[0].2;
    assert_eq!((&notes.lost[..], &notes.rules[..]), (&[Cause::NotAllowed][..], &[Some(12)][..]));
}

/// A client sends a package of the greatest priority; with which its receiver gets it.
fn crossed(kind: Type, to: Name, from: Name) -> u8 {
    let mut ground = Ground::clients(2);
    let head = Head { to, from, kind, priority: Priority(255), ..Head::default() };
    ground.sends(0, head, 0);
    assert_eq!(ground.ends[0].0.out().class(Priority(255)).packages.get(), 0, "it is counted as what it is");
    ground.settle();
    assert_eq!(ground.server.counts().class(Priority(255)).packages.get(), 0, "at the server too");
    ground.ends[1].2.delivered[0].0.priority.0
}

#[test]
fn a_program_that_says_the_greatest_priority_sends_with_its_own() {
    let low = Name::new(1, 100, 9, 0);
    assert_eq!(crossed(Type::command(16), module(1), low), 100);
    assert_eq!(crossed(Type::reply(16), module(1).with_local(1), low), 60);
    assert_eq!(crossed(Type::data(1), module(1).with_local(2), low), 100);
    assert_eq!(crossed(Type::data(1), module(1).with_local(2), module(0)), 60);
}
