//! Two nodes in one process, each with its router, at addresses of the loopback.

use rohrpost_mailbox::{Label, Name, Node, Participant, Priority, Receiver, Sender, Shape, Type};
use rohrpost_network::{Network, Route, Security, Tdma, TimeSlot};
use rohrpost_routers::admission::Admission;
use rohrpost_routers::flows::Flow;
use rohrpost_routers::security::{InstallationKey, KEY_BYTES, KeyId, KeyRing};
use rohrpost_routers::settings::{NodeSettings, Settings};
use rohrpost_routers::shell::clock::ClockParts;
use rohrpost_routers::shell::{Faults, Parts, Shell, Undelivered};
use rohrpost_routers::time::TimeSettings;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::num::NonZeroU8;
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::Duration;

/// What takes longer does not come any more, however busy the computer is.
pub(crate) const PATIENCE: Duration = Duration::from_secs(30);

/// The module of a node; its mailboxes are what packages go to.
pub(crate) fn module(node: u8) -> Name {
    Name::new(1, 100, node, 0)
}

/// The router of a node.
pub(crate) fn router(node: u8) -> Name {
    Name::new(1, 250, node, 0)
}

/// Answers with the cause's word, behind the first bytes of the command.
pub(crate) struct Words;

impl Faults for Words {
    fn write(&self, call: &[u8], why: &Undelivered<'_>, answer: &mut Vec<u8>) -> bool {
        answer.extend_from_slice(&call[..call.len().min(4)]);
        answer.extend_from_slice(why.cause.word().as_bytes());
        true
    }
}

fn keys() -> KeyRing {
    KeyRing::new(InstallationKey::new(KeyId(NonZeroU8::MIN), &[7; KEY_BYTES]), None)
}

/// A node of two.
pub(crate) struct Side {
    pub(crate) node: Arc<Node>,
    pub(crate) settings: Settings,
    /// What launch keeps for its routers; none: each makes its own.
    pub(crate) sockets: Vec<OwnedFd>,
    pub(crate) shell: Option<Shell>,
}

/// Two nodes that take turns, 2 ms each.
#[allow(dead_code, reason = "each test uses a part")]
pub(crate) fn turns() -> Tdma {
    let us = Duration::from_micros;
    let slot =
        |node: u8| TimeSlot { node, offset: us(1000 + 2000 * u64::from(node)), length: us(2000), period: 1, phase: 0 };
    Tdma {
        cycle: us(5000),
        synchronisation: us(1000),
        guard: us(400),
        link_bytes_s: 125_000_000,
        slots: vec![slot(0), slot(1)],
        tunnel: None,
    }
}

impl Side {
    /// Without a router yet. `addresses`: of both.
    pub(crate) fn new(own: u8, node: Arc<Node>, addresses: [IpAddr; 2], tdma: Option<Tdma>) -> Self {
        let there = module(1 - own);
        let nodes = [0, 1].map(|node| NodeSettings { name: format!("node{node}"), address: addresses[node] });
        let network = Network {
            security: Security::None,
            port: 21_117,
            mtu: 1500,
            datagram_bytes_max: 1472,
            rate_bytes_s: 1 << 30,
            quota_bytes: 1 << 20,
            bulk_below: 16,
        };
        let settings = Settings {
            system: 1,
            own,
            nodes: nodes.into(),
            digest: 7,
            incarnation: 1,
            network,
            tdma,
            routes: vec![Route { first: there, last: there.with_local(255), node: 1 - own }],
            senders: vec![vec![module(own)]],
            hosts: [module(own), router(own)].map(|name| (name, name.with_local(u8::MAX))).into(),
            admission: Admission { router: Some(router(own).class()), ..Admission::default() },
            flows: vec![declared(module(own), there)],
            real_time_from: 0,
        };
        Self { node, settings, sockets: Vec::new(), shell: None }
    }

    /// Ends its router, if it has one, and starts it anew.
    pub(crate) fn start(&mut self) {
        self.shell = None;
        self.settings.incarnation += 1;
        let name = router(self.settings.own);
        let (settings, faults, clock) = (self.settings.clone(), Arc::new(Words), self.clock());
        let sockets = self.sockets.iter().map(|kept| kept.try_clone().unwrap()).collect();
        let is_sealed = settings.is_sealed();
        let parts = Parts { node: &self.node, name, settings, faults, sockets, impair: None, clock };
        let shell = if is_sealed { Shell::start_sealed(parts, keys()) } else { Shell::start(parts) };
        self.shell = Some(shell.unwrap());
    }

    /// From now on its routers seal.
    #[allow(dead_code, reason = "each test uses a part")]
    pub(crate) fn seal(&mut self) {
        self.settings.network.security = Security::Keys;
        self.settings.network.datagram_bytes_max -= Security::Keys.tag_bytes();
        self.start();
    }

    /// Of the first node's time, where slots need one.
    fn clock(&self) -> Option<ClockParts> {
        let Settings { system, own, digest, incarnation, ref nodes, ref network, .. } = self.settings;
        let interval = self.settings.tdma.as_ref()?.cycle;
        let (masters, count) = (vec![0], nodes.len() as u8);
        let settings = TimeSettings { system, own, nodes: count, masters, interval, digest, incarnation };
        let nodes = nodes.iter().map(|node| SocketAddr::new(node.address, network.time_port())).collect();
        Some(ClockParts {
            settings,
            nodes,
            node: Some(self.node.clone()),
            impair: None,
            kernel_stamps: true,
            skew: None,
            observer: None,
        })
    }

    pub(crate) fn join(&self) -> Arc<Participant> {
        Participant::join(&self.node, Name::NONE).unwrap()
    }

    pub(crate) fn receiver(&self, name: Name, shape: Shape) -> Receiver {
        self.join().receiver(name, shape).unwrap()
    }

    pub(crate) fn sender(&self, to: Name) -> Sender {
        self.join().sender(to).unwrap()
    }
}

/// Two nodes; their directories go with this.
pub(crate) struct Pair {
    pub(crate) sides: [Side; 2],
    _folder: tempfile::TempDir,
}

impl Pair {
    #[allow(dead_code, reason = "each test uses a part")]
    pub(crate) fn new() -> Self {
        Self::with(None)
    }

    /// That sends in time slots, if there is a table.
    pub(crate) fn with(tdma: Option<Tdma>) -> Self {
        static COUNT: AtomicU8 = AtomicU8::new(0);
        let (pid, count) = (std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        // Addresses that no other test has, by process and count.
        let address = |node: u8| {
            IpAddr::V4(Ipv4Addr::new(127, 128 + (pid / 250 % 120) as u8, (pid % 250) as u8, 2 * (1 + count) + node))
        };
        let folder = tempfile::Builder::new().prefix("rohrpost-shell-").tempdir_in("/dev/shm").unwrap();
        let sides = [0, 1].map(|own: u8| {
            let node = Node::create(&folder.path().join(format!("node{own}")), 0o700).unwrap();
            let mut side = Side::new(own, node, [0, 1].map(address), tdma.clone());
            side.start();
            side
        });
        Self { sides, _folder: folder }
    }
}

/// All that the module of one node sends to that of the other.
fn declared(from: Name, to: Name) -> Flow {
    let (period, deadline) = (Duration::from_micros(10), Duration::from_millis(100));
    Flow { from: vec![from], to: vec![to], carries: None, size: u16::MAX.into(), period, deadline, bound: None }
}

pub(crate) fn label(from: Name, priority: u8, id: u16) -> Label {
    Label { from, kind: Type::command(16), id, priority: Priority(priority), ..Label::default() }
}
