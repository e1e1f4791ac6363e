//! What crosses, what a dead server costs, and which client holds up which.

use crate::ground::{COMMON, Router, System, module, two, wait};
use rohrpost_config::{Access, AccessRule, ClassSet, Commanded};
use rohrpost_mailbox::{ALL_SYSTEMS, Class, Head, Priority, Sender, Type};
use rohrpost_routers::admission::Admission;
use rohrpost_routers::session::frame::{Carried, Range, Ranges, SessionHello, SessionMessage};
use rohrpost_routers::tcp::{ClientLink, LinkState};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

/// What a client says first.
pub(crate) fn hello(system: u8, common: u64) -> SessionHello<'static> {
    SessionHello {
        system,
        reaches_own: false,
        common,
        system_digest: system.into(),
        incarnation: 1000 + u64::from(system),
        attempt: 1,
        asked_ns: 0,
        name: "raw",
    }
}

/// A client that says what it likes.
pub(crate) struct Raw(pub(crate) TcpStream);

impl Raw {
    pub(crate) fn new(server: SocketAddr, system: u8, common: u64) -> Self {
        let mut raw = Self(wait("it listens", || TcpStream::connect(server).ok()));
        raw.0.set_read_timeout(Some(Duration::from_millis(10))).unwrap();
        raw.say(&SessionMessage::Hello(hello(system, common)));
        raw
    }

    pub(crate) fn say(&mut self, message: &SessionMessage<'_>) {
        self.0.write_all(&message.to_bytes()).unwrap();
    }

    pub(crate) fn hosts(&mut self, system: u8) {
        let range = Range { first: module(system), last: module(system).with_local(255) };
        self.say(&SessionMessage::Register(Ranges::new(1, &[range], &mut Vec::new())));
    }

    /// Reads until the connection is closed; what came.
    fn rest(&mut self) -> Vec<u8> {
        let mut all = Vec::new();
        wait("the end of the connection", || {
            let mut piece = [0; 4096];
            match self.0.read(&mut piece) {
                Ok(0) => Some(()),
                Ok(bytes) => {
                    all.extend_from_slice(&piece[..bytes]);
                    None
                }
                Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => None,
                Err(_) => Some(()),
            }
        });
        all
    }
}

#[test]
fn packages_cross_from_system_to_system_and_what_is_not_there_is_answered() {
    let server = Router::start();
    let (mut one, mut two) = two(server.address, None);
    let mut sender = one.sender(2);
    for number in 0..100 {
        one.say(&mut sender, number);
        assert_eq!(two.hear_within("a package"), number);
    }
    let mut back = two.sender(1);
    two.say(&mut back, 7);
    assert_eq!(one.hear_within("the way back"), 7);
    // Nobody hosts this one; the answer says so.
    let mut nowhere = one.participant.sender(module(3)).unwrap();
    one.say(&mut nowhere, 8);
    assert_eq!(one.answer(), "no-route");
    // What one node cannot deliver itself is told by it.
    let mut absent = one.participant.sender(module(2).with_local(9)).unwrap();
    one.say(&mut absent, 9);
    assert_eq!(one.answer(), "no-mailbox");
}

#[test]
fn a_node_takes_commands_from_beyond_only_as_its_configuration_allows() {
    let server = Router::start();
    let mut one = System::new(1, "one", server.address);
    let callers = ClassSet::from_iter([Class(101)]);
    let only_others = AccessRule { commanded: Commanded::Module(module(2)), callers, line: 12 };
    let admission = Admission { access: Access::new(vec![only_others]), ..Admission::default() };
    let mut two = System::guarded(2, "two", server.address, None, admission);
    one.wait_up();
    two.wait_up();
    let mut sender = one.sender(2);
    one.say(&mut sender, 1);
    assert_eq!(one.answer(), "not-allowed, line 12");
    assert_eq!(two.hear(), None);
}

#[test]
fn a_server_that_dies_and_lives_again_costs_a_gap_and_nothing_else() {
    let mut server = Router::start();
    let (one, mut two) = two(server.address, None);
    let (mut sender, mut number, mut last) = (one.sender(2), 0, None);
    let mut cross = |number: &mut u32, sender: &mut Sender| {
        let before = last;
        wait("packages that cross", || {
            *number += 1;
            one.say(sender, *number);
            while let Some(heard) = two.hear() {
                assert!(last.is_none_or(|last| heard > last), "in order, and none twice: {heard} after {last:?}");
                last = Some(heard);
            }
            (last != before && last > Some(number.saturating_sub(20))).then_some(())
        });
    };
    for _ in 0..4 {
        // Under load until some came, then without a server while the load goes on.
        cross(&mut number, &mut sender);
        server.end();
        for _ in 0..50 {
            number += 1;
            one.say(&mut sender, number);
            std::thread::sleep(Duration::from_millis(1));
        }
        server.begin_again(None);
        one.wait_up();
    }
    cross(&mut number, &mut sender);
    wait("a connection to each incarnation", || (one.client.link().connections >= 5).then_some(()));
}

#[test]
fn a_name_that_is_hosted_is_refused_naming_the_holder_until_that_one_goes() {
    let server = Router::start();
    let first = System::new(1, "the first", server.address);
    first.wait_up();
    let second = System::new(1, "the second", server.address);
    let why = |link: ClientLink| (!link.why.is_empty()).then_some(link.why);
    let why = wait("an objection", || why(second.client.link()));
    assert!(why.contains("hosted by the first"), "{why}");
    assert_eq!(first.client.link().state, LinkState::Up);
    drop(first);
    second.wait_up();
}

#[test]
fn a_client_of_another_installation_or_no_client_at_all_is_told_and_closed() {
    let server = Router::start();
    let told = Raw::new(server.address, 1, COMMON + 1).rest();
    assert!(told.windows(14).any(|bytes| bytes == b"the TCP router"), "a refusal that names the end that differs");
    let mut stranger = Raw(TcpStream::connect(server.address).unwrap());
    stranger.0.set_read_timeout(Some(Duration::from_millis(10))).unwrap();
    stranger.0.write_all(b"GET / HTTP/1.1\r\nHost: robot\r\n\r\n").unwrap();
    assert!(stranger.rest().windows(4).any(|bytes| bytes == b"RpTc"), "a refusal");
    wait("both are counted", || (server.members().refused >= 2).then_some(()));
    // Half open: it said nothing after its hello, and nothing for good.
    let mut silent = Raw::new(server.address, 2, COMMON);
    wait("it takes part", || server.members().members.iter().any(|member| member.is_member).then_some(()));
    silent.rest();
    wait("it is gone", || server.members().members.is_empty().then_some(()));
}

#[test]
fn a_client_that_reads_nothing_holds_up_nobody() {
    let server = Router::start();
    let (one, mut two) = two(server.address, None);
    // It hosts names, and speaks now and then, but never reads.
    let mut slow = Raw::new(server.address, 3, COMMON);
    slow.hosts(3);
    wait("it hosts", || {
        server.members().members.iter().any(|member| member.system == 3 && member.ranges == 1).then_some(())
    });
    let mut flood = Raw::new(server.address, 4, COMMON);
    flood.hosts(4);
    let body = vec![0; 32 << 10];
    let head = Head {
        to: module(3),
        from: module(4),
        len: body.len() as u16,
        kind: Type::data(1),
        priority: Priority(90),
        ..Head::default()
    };
    let mut sender = one.sender(2);
    for number in 0..200 {
        // 16 times 32 KiB into a connection that takes nothing, before each package beside it.
        for _ in 0..16 {
            flood.say(&SessionMessage::Package(Carried { hops: 0, published_ns: 0, head, body: &body }));
        }
        slow.say(&SessionMessage::Ask(0));
        flood.say(&SessionMessage::Ask(0));
        one.say(&mut sender, number);
        assert_eq!(two.hear_within("a package beside the flood"), number);
    }
    let lost = || {
        let classes = server.members().classes.into_iter().filter(|class| class.priority == Priority(90));
        classes.flat_map(|class| class.lost).map(|(_, count)| count).sum::<u64>()
    };
    wait("what does not fit is lost, and counted", || (lost() > 0).then_some(()));
    let bytes = server.members().members.iter().map(|member| member.bytes).max();
    assert!(bytes < Some(2 << 20), "{bytes:?} B for one client");
}

#[test]
fn what_is_for_all_systems_comes_once_to_each() {
    let server = Router::start();
    let mut systems = [1, 2, 3].map(|id| System::new(id, "a system", server.address));
    systems.iter().for_each(System::wait_up);
    let mut to_all = systems[0].sender(ALL_SYSTEMS);
    let mut to_each = [1, 2, 3].map(|id| systems[0].sender(id));
    systems[0].say(&mut to_all, 7);
    // What is sent behind it shows that nothing else comes. In its own system that goes another way, and may be
    // quicker.
    to_each.iter_mut().for_each(|sender| systems[0].say(sender, 8));
    for system in &mut systems {
        let mut heard = [system.hear_within("one for all"), system.hear_within("one for each")];
        heard.sort_unstable();
        assert_eq!(heard, [7, 8]);
        assert_eq!(system.hear(), None);
    }
    // Two of those for each, one for all, and its copy that goes no further than its own node.
    let came = || systems[0].client.link().out.iter().map(|class| (class.packages, class.passed)).collect::<Vec<_>>();
    wait("all are counted", || (came() == [(4, 4)]).then_some(()));
}
