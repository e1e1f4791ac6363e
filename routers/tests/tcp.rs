//! The TCP router and its clients with real sockets: what crosses, what a dead server costs, and who holds up whom.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_mailbox::{
    Head, Label, Name, Node, Participant, Priority, Receiver, Sender, Shape, Type, local, monotonic_ns,
};
use rohrpost_routers::session::client::ClientSettings;
use rohrpost_routers::session::frame::{Carried, Hello, Message, Range, Ranges};
use rohrpost_routers::session::server::ServerSettings;
use rohrpost_routers::shell::{Faults, Undelivered};
use rohrpost_routers::tcp::{ClientParts, ClientShell, Link, LinkState, ServerError, ServerParts, ServerShell};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What takes longer does not come any more, however busy the computer is.
const PATIENCE: Duration = Duration::from_secs(60);
const COMMON: u64 = 0xc0;

fn wait<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let began = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(began.elapsed() < PATIENCE, "waited in vain: {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Says the cause's word.
struct Words;

impl Faults for Words {
    fn write(&self, _: &[u8], why: &Undelivered<'_>, answer: &mut Vec<u8>) -> bool {
        answer.extend_from_slice(why.cause.word().as_bytes());
        true
    }
}

/// A port that nobody had a moment ago.
fn address() -> SocketAddr {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap()
}

fn node() -> (tempfile::TempDir, Arc<Node>) {
    let folder = tempfile::tempdir().unwrap();
    let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
    (folder, node)
}

fn start(address: SocketAddr, node: &Arc<Node>, life: u64) -> Result<ServerShell, ServerError> {
    let settings = ServerSettings {
        name: "the TCP router".into(),
        common: COMMON,
        system: None,
        life,
        clients_max: 16,
        greetings_max: 16,
        quota_bytes: 256 << 10,
        levels: [0; 256],
    };
    ServerShell::start(ServerParts { address, settings, faults: Arc::new(Words), node })
}

/// A system of one node, with a module that hears and speaks.
struct System {
    id: u8,
    client: ClientShell,
    participant: Arc<Participant>,
    heard: Receiver,
    replies: Receiver,
    _folder: tempfile::TempDir,
}

fn module(system: u8) -> Name {
    Name::new(system, 100, 0, 0)
}

impl System {
    fn new(id: u8, name: &str, server: SocketAddr) -> Self {
        let (folder, node) = node();
        let settings = ClientSettings {
            name: name.into(),
            system: id,
            reaches_own: false,
            common: COMMON,
            system_digest: id.into(),
            life: monotonic_ns(),
            quota_bytes: 256 << 10,
            levels: [0; 256],
        };
        let own = (module(id).with_local(0), module(id).with_local(255));
        let [before, after] = [own.0.raw() - 1, own.1.raw() + 1].map(Name::from_raw);
        let beyond = vec![(Name::new(1, 1, 0, 0), before), (after, Name::from_raw(u32::MAX))];
        let (tcp, faults) = (Name::new(id, 64, 0, 0), Arc::new(Words));
        let parts = ClientParts { node: &node, name: tcp, server, settings, hosts: vec![own], beyond, faults };
        let client = ClientShell::start(parts).unwrap();
        let participant = Participant::join(&node, module(id)).unwrap();
        let shape = Shape { slots: 64, body_bytes_max: 1024, ..Shape::default() };
        let heard = participant.receiver(module(id), shape).unwrap();
        let replies = participant.receiver(module(id).with_local(local::REPLIES), shape).unwrap();
        Self { id, client, participant, heard, replies, _folder: folder }
    }

    fn wait_up(&self) {
        wait("it takes part", || (self.client.link().state == LinkState::Up).then_some(()));
    }

    fn sender(&self, to: u8) -> Sender {
        self.participant.sender(module(to)).unwrap()
    }

    fn say(&self, sender: &mut Sender, number: u32) {
        let from = module(self.id).with_local(local::REPLIES);
        let label = Label { from, kind: Type::command(16), priority: Priority(100), ..Label::default() };
        // A mailbox that is full for a moment is no matter here.
        let _ = sender.send(&label, &[&number.to_le_bytes()]);
    }

    /// The next number that came.
    fn hear(&mut self) -> Option<u32> {
        let package = self.heard.try_receive()?;
        Some(u32::from_le_bytes(package.body().try_into().unwrap()))
    }

    fn hear_within(&mut self, what: &str) -> u32 {
        wait(what, || self.hear())
    }
}

#[test]
fn packages_cross_from_system_to_system_and_what_is_not_there_is_answered() {
    let (address, (_folder, own)) = (address(), node());
    let _server = start(address, &own, 1).unwrap();
    let (mut one, mut two) = (System::new(1, "one", address), System::new(2, "two", address));
    one.wait_up();
    two.wait_up();
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
    let answer = wait("an answer", || one.replies.try_receive().map(|package| package.body().to_vec()));
    assert_eq!(String::from_utf8_lossy(&answer), "no-route");
    // What one node cannot deliver itself is told by it.
    let mut absent = one.participant.sender(module(2).with_local(9)).unwrap();
    one.say(&mut absent, 9);
    let answer = wait("an answer", || one.replies.try_receive().map(|package| package.body().to_vec()));
    assert_eq!(String::from_utf8_lossy(&answer), "no-mailbox");
}

#[test]
fn a_server_that_dies_and_lives_again_costs_a_gap_and_nothing_else() {
    let (address, (_folder, own)) = (address(), node());
    let mut server = Some(start(address, &own, 1).unwrap());
    let (one, mut two) = (System::new(1, "one", address), System::new(2, "two", address));
    one.wait_up();
    two.wait_up();
    let (mut sender, mut number, mut last) = (one.sender(2), 0, None);
    for life in 2..6 {
        // Under load until some came, then without a server while the load goes on.
        let before = last;
        wait("packages that cross", || {
            number += 1;
            one.say(&mut sender, number);
            while let Some(heard) = two.hear() {
                assert!(last.is_none_or(|last| heard > last), "in order, and none twice: {heard} after {last:?}");
                last = Some(heard);
            }
            (last != before && last > Some(number.saturating_sub(20))).then_some(())
        });
        drop(server.take());
        for _ in 0..50 {
            number += 1;
            one.say(&mut sender, number);
            std::thread::sleep(Duration::from_millis(1));
        }
        server = Some(wait("its port is free", || start(address, &own, life).ok()));
        one.wait_up();
        two.wait_up();
    }
    wait("packages that cross again", || {
        number += 1;
        one.say(&mut sender, number);
        while let Some(heard) = two.hear() {
            assert!(last.is_none_or(|last| heard > last), "{heard} after {last:?}");
            last = Some(heard);
        }
        (last > Some(number.saturating_sub(20))).then_some(())
    });
    assert!(one.client.link().connections >= 5);
}

#[test]
fn a_name_that_is_hosted_is_refused_naming_the_holder_until_that_one_goes() {
    let (address, (_folder, own)) = (address(), node());
    let _server = start(address, &own, 1).unwrap();
    let first = System::new(1, "the first", address);
    first.wait_up();
    let second = System::new(1, "the second", address);
    let why = |link: Link| (!link.why.is_empty()).then_some(link.why);
    let why = wait("an objection", || why(second.client.link()));
    assert!(why.contains("hosted by the first"), "{why}");
    assert_eq!(first.client.link().state, LinkState::Up);
    drop(first);
    second.wait_up();
}

/// A client that says what it likes.
struct Raw(TcpStream);

impl Raw {
    fn new(server: SocketAddr, system: u8, common: u64) -> Self {
        let mut raw = Self(TcpStream::connect(server).unwrap());
        raw.0.set_read_timeout(Some(Duration::from_millis(10))).unwrap();
        raw.say(&Message::Hello(Hello {
            system,
            reaches_own: false,
            common,
            system_digest: system.into(),
            life: 1000 + u64::from(system),
            attempt: 1,
            asked_ns: 0,
            name: "raw",
        }));
        raw
    }

    fn say(&mut self, message: &Message<'_>) {
        let mut bytes = Vec::new();
        message.write(&mut bytes);
        self.0.write_all(&bytes).unwrap();
    }

    fn hosts(&mut self, system: u8) {
        let range = Range { first: module(system), last: module(system).with_local(255) };
        let mut bytes = Vec::new();
        self.say(&Message::Register(Ranges::new(1, &[range], &mut bytes)));
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
fn who_is_of_another_installation_or_no_client_at_all_is_told_and_closed() {
    let (address, (_folder, own)) = (address(), node());
    let server = start(address, &own, 1).unwrap();
    let told = Raw::new(address, 1, COMMON + 1).rest();
    assert!(told.windows(14).any(|bytes| bytes == b"the TCP router"), "a refusal that says whose digest differs");
    let mut stranger = Raw(TcpStream::connect(address).unwrap());
    stranger.0.set_read_timeout(Some(Duration::from_millis(10))).unwrap();
    stranger.0.write_all(b"GET / HTTP/1.1\r\nHost: robot\r\n\r\n").unwrap();
    assert!(stranger.rest().windows(4).any(|bytes| bytes == b"RpTc"), "a refusal");
    wait("both are counted", || (server.members().refused >= 2).then_some(()));
    // Half open: it said nothing after its hello, and nothing for good.
    let mut silent = Raw::new(address, 2, COMMON);
    wait("it takes part", || server.members().members.iter().any(|member| member.is_member).then_some(()));
    silent.rest();
    wait("it is gone", || server.members().members.is_empty().then_some(()));
}

#[test]
fn a_client_that_reads_nothing_holds_up_nobody() {
    let (address, (_folder, own)) = (address(), node());
    let server = start(address, &own, 1).unwrap();
    let (one, mut two) = (System::new(1, "one", address), System::new(2, "two", address));
    one.wait_up();
    two.wait_up();
    // It hosts names, and speaks now and then, but never reads.
    let mut slow = Raw::new(address, 3, COMMON);
    slow.hosts(3);
    wait("it hosts", || {
        server.members().members.iter().any(|member| member.system == 3 && member.ranges == 1).then_some(())
    });
    let mut flood = Raw::new(address, 4, COMMON);
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
            flood.say(&Message::Package(Carried { hops: 0, published_ns: 0, head, body: &body }));
        }
        slow.say(&Message::Ask(0));
        flood.say(&Message::Ask(0));
        one.say(&mut sender, number);
        assert_eq!(two.hear_within("a package beside the flood"), number);
    }
    let seen = server.members();
    let bytes = seen.members.iter().map(|member| member.bytes).max().unwrap();
    assert!(bytes < 2 << 20, "{bytes} B for one client");
    let lost: u64 = seen
        .classes
        .iter()
        .filter(|class| class.priority == Priority(90))
        .flat_map(|class| &class.lost)
        .map(|(_, count)| count)
        .sum();
    assert!(lost > 0, "what does not fit is lost, and counted");
}
