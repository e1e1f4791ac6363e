//! A TCP router and systems of one node each, in this process.

use crate::sealed::{Authority, seal};
use rohrpost_mailbox::{Label, Name, Node, Participant, Priority, Receiver, Sender, Shape, Type, local, monotonic_ns};
use rohrpost_routers::admission::Admission;
use rohrpost_routers::session::client::ClientSettings;
use rohrpost_routers::session::server::{MovingHosts, Names, OwnNodes, ServerSettings};
use rohrpost_routers::shell::{Faults, Undelivered};
use rohrpost_routers::tcp::{
    ClientParts, ClientSeal, ClientShell, LinkState, Members, ServerError, ServerParts, ServerSeal, ServerShell,
};
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::{Duration, Instant};

/// What takes longer does not come any more, however busy the computer is.
pub(crate) const PATIENCE: Duration = Duration::from_secs(60);
pub(crate) const COMMON: u64 = 0xc0;

pub(crate) fn wait<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let began = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(began.elapsed() < PATIENCE, "waited in vain: {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Says the cause's word, and the rule's line if one refused.
pub(crate) struct Words;

impl Faults for Words {
    fn write(&self, _: &[u8], why: &Undelivered<'_>, answer: &mut Vec<u8>) -> bool {
        answer.extend_from_slice(why.cause.word().as_bytes());
        if let Some(line) = why.rule {
            answer.extend_from_slice(format!(", line {line}").as_bytes());
        }
        true
    }
}

/// An address that nobody has: of this process and this call alone. Not a port that the kernel chose and has back:
/// until it is used, it may be another's, or still open in a child that another test starts.
pub(crate) fn address() -> SocketAddr {
    static COUNT: AtomicU8 = AtomicU8::new(1);
    let (pid, count) = (std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
    ([127, (1 + pid / 250 % 250) as u8, (pid % 250) as u8, count], 7610).into()
}

pub(crate) fn node() -> (tempfile::TempDir, Arc<Node>) {
    let folder = tempfile::tempdir().unwrap();
    let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
    (folder, node)
}

/// A TCP router, and the node that it runs on.
pub(crate) struct Router {
    pub(crate) address: SocketAddr,
    shell: Option<ServerShell>,
    incarnation: u64,
    seal: Option<ServerSeal>,
    node: Arc<Node>,
    _folder: tempfile::TempDir,
}

impl Router {
    /// At an address of its own, without security.
    pub(crate) fn start() -> Self {
        Self::at(address(), None)
    }

    pub(crate) fn at(address: SocketAddr, seal: Option<ServerSeal>) -> Self {
        Self::of(address, seal, None)
    }

    /// For system 1, if the names that its nodes host are given.
    pub(crate) fn of(address: SocketAddr, seal: Option<ServerSeal>, names: Option<BTreeMap<String, Names>>) -> Self {
        let (folder, node) = node();
        let mut router = Self { address, shell: None, incarnation: 1, seal, node, _folder: folder };
        router.shell = Some(router.shell_for(names).unwrap());
        router
    }

    pub(crate) fn end(&mut self) {
        self.shell = None;
    }

    /// The next incarnation of it.
    pub(crate) fn begin_again(&mut self, names: Option<BTreeMap<String, Names>>) {
        self.incarnation += 1;
        self.shell = Some(wait("its port is free", || self.shell_for(names.clone()).ok()));
    }

    pub(crate) fn members(&self) -> Members {
        self.shell.as_ref().unwrap().members()
    }

    fn shell_for(&self, names: Option<BTreeMap<String, Names>>) -> Result<ServerShell, ServerError> {
        let settings = ServerSettings {
            name: "the TCP router".into(),
            common: COMMON,
            system: names.is_some().then_some((1, 1)),
            own_nodes: OwnNodes::default(),
            moving: MovingHosts::default(),
            incarnation: self.incarnation,
            clients_max: 16,
            handshakes_max: 16,
            quota_bytes: 256 << 10,
            levels: [0; 256],
        };
        ServerShell::start(ServerParts {
            address: self.address,
            settings,
            faults: Arc::new(Words),
            seal: self.seal.clone(),
            names: names.unwrap_or_default(),
            node: &self.node,
            replicas: None,
        })
    }
}

/// The systems 1 and 2, which take part.
pub(crate) fn two(server: SocketAddr, authority: Option<&Authority>) -> (System, System) {
    let [one, two] = [(1, "one"), (2, "two")].map(|(id, name)| System::sealed(id, name, server, seal(authority, id)));
    one.wait_up();
    two.wait_up();
    (one, two)
}

/// A system of one node, with a module that hears and speaks.
pub(crate) struct System {
    id: u8,
    pub(crate) client: ClientShell,
    pub(crate) participant: Arc<Participant>,
    heard: Receiver,
    replies: Receiver,
    _folder: tempfile::TempDir,
}

pub(crate) fn module(system: u8) -> Name {
    Name::new(system, 100, 0, 0)
}

impl System {
    pub(crate) fn new(id: u8, name: &str, server: SocketAddr) -> Self {
        Self::sealed(id, name, server, None)
    }

    pub(crate) fn sealed(id: u8, name: &str, server: SocketAddr, seal: Option<ClientSeal>) -> Self {
        Self::guarded(id, name, server, seal, Admission::default())
    }

    pub(crate) fn guarded(
        id: u8,
        name: &str,
        server: SocketAddr,
        seal: Option<ClientSeal>,
        admission: Admission,
    ) -> Self {
        let (folder, node) = node();
        let settings = ClientSettings {
            name: name.into(),
            system: id,
            reaches_own: false,
            common: COMMON,
            system_digest: id.into(),
            incarnation: monotonic_ns(),
            quota_bytes: 256 << 10,
            levels: [0; 256],
            admission,
        };
        let own = (module(id).with_local(0), module(id).with_local(255));
        let [before, after] = [own.0.raw() - 1, own.1.raw() + 1].map(Name::from_raw);
        let beyond = vec![(Name::new(1, 1, 0, 0), before), (after, Name::from_raw(u32::MAX))];
        let (tcp, faults) = (Name::new(id, 64, 0, 0), Arc::new(Words));
        let parts = ClientParts {
            node: &node,
            name: tcp,
            server,
            settings,
            others: Vec::new(),
            hosts: vec![own],
            registers: vec![own],
            beyond,
            faults,
            seal,
            keeps_time: false,
            impair: None,
            team: None,
            replicas: None,
        };
        let client = ClientShell::start(parts).unwrap();
        let participant = Participant::join(&node, module(id)).unwrap();
        let shape = Shape { slots: 64, body_bytes_max: 1024, ..Shape::default() };
        let heard = participant.receiver(module(id), shape).unwrap();
        let replies = participant.receiver(module(id).with_local(local::REPLIES), shape).unwrap();
        Self { id, client, participant, heard, replies, _folder: folder }
    }

    pub(crate) fn wait_up(&self) {
        wait("it takes part", || (self.client.link().state == LinkState::Up).then_some(()));
    }

    pub(crate) fn sender(&self, to: u8) -> Sender {
        self.participant.sender(module(to)).unwrap()
    }

    pub(crate) fn say(&self, sender: &mut Sender, number: u32) {
        let from = module(self.id).with_local(local::REPLIES);
        let label = Label { from, kind: Type::command(16), priority: Priority(100), ..Label::default() };
        // A mailbox that is full for a moment is no matter here.
        let _ = sender.send(&label, &[&number.to_le_bytes()]);
    }

    /// The body of the next answer.
    pub(crate) fn answer(&mut self) -> String {
        wait("an answer", || self.replies.try_receive().map(|package| String::from_utf8_lossy(package.body()).into()))
    }

    /// The next number that came.
    pub(crate) fn hear(&mut self) -> Option<u32> {
        let package = self.heard.try_receive()?;
        Some(u32::from_le_bytes(package.body().try_into().unwrap()))
    }

    /// The next body that came.
    pub(crate) fn hear_bytes(&mut self) -> Option<Vec<u8>> {
        self.heard.try_receive().map(|package| package.body().to_vec())
    }

    pub(crate) fn hear_within(&mut self, what: &str) -> u32 {
        wait(what, || self.hear())
    }
}
