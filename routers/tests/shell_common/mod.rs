//! Two nodes in one process, each with its router, at addresses of the loopback.

use rohrpost_mailbox::{Label, Name, Node, Participant, Priority, Receiver, Sender, Shape, Type};
use rohrpost_network::{Security, Tdma};
use rohrpost_routers::flows::Flow;
use rohrpost_routers::security::{InstallationKey, KEY_BYTES, KeyId, KeyRing};
use rohrpost_routers::settings::Settings;
use rohrpost_routers::shell::clock::ClockParts;
use rohrpost_routers::shell::{Faults, Parts, Shell, Undelivered};
use rohrpost_testbed::lan;
pub(crate) use rohrpost_testbed::lan::{module, router};
use std::net::{IpAddr, Ipv4Addr};
use std::num::NonZeroU8;
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::Duration;

/// What takes longer does not come any more, however busy the computer is.
pub(crate) const PATIENCE: Duration = Duration::from_secs(30);

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
    lan::slots(2, 1000, [5000, 2000])
}

impl Side {
    /// Without a router yet. `addresses`: of both.
    pub(crate) fn new(own: u8, node: Arc<Node>, addresses: [IpAddr; 2], tdma: Option<Tdma>) -> Self {
        let flows = vec![declared(module(own), module(1 - own))];
        let settings = Settings { flows, ..lan::settings(own, &addresses, tdma) };
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
        let interval = self.settings.tdma.as_ref()?.cycle;
        let node = Some(self.node.clone());
        Some(ClockParts { node, ..ClockParts::of_router(&self.settings, &[0], interval) })
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
