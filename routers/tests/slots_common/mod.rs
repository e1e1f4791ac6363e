//! Nodes that send in time slots: each in a namespace of its own, all joined by a bridge, on which a capture sees what
//! crosses it and when.

#![allow(dead_code, reason = "each test uses a part")]

pub(crate) mod capture;
pub(crate) mod declared;
pub(crate) mod hog;
pub(crate) mod kept;
pub(crate) mod own_log;
pub(crate) mod process;
pub(crate) mod relay;
pub(crate) mod talk;

pub(crate) use capture::{Capture, Crossed};
use own_log::{EVERY, OwnLog, Recorder};
use rohrpost_mailbox::{
    Label, Name, Node, Participant, Priority, Receiver, Sender, Shape, Type, monotonic_ns, realtime_ns,
};
use rohrpost_network::{Tdma, Tunnel};
use rohrpost_routers::counts::Cause;
use rohrpost_routers::frame::{FrameHead, FrameKind};
use rohrpost_routers::impair;
use rohrpost_routers::lab::Lab;
use rohrpost_routers::security::{InstallationKey, KEY_BYTES, KeyId, KeyRing};
use rohrpost_routers::settings::Settings;
use rohrpost_routers::shell::clock::{ClockParts, Skew};
use rohrpost_routers::shell::{Faults, Parts, Shell, Undelivered, slots};
use rohrpost_routers::stats::Stats;
use rohrpost_testbed::lan;
pub(crate) use rohrpost_testbed::lan::module;
use rohrpost_testbed::lan::router;
use rohrpost_testbed::stalls::Late;
use std::cell::RefCell;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::num::NonZeroU8;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

pub(crate) const NODES: u8 = 3;
/// The possible masters, in order.
pub(crate) const MASTERS: [u8; 2] = [0, 1];
const PORT: u16 = 21_117;
/// What takes longer does not come any more, however busy the computer is.
pub(crate) const PATIENCE: Duration = Duration::from_secs(60);

/// Slots of 1 ms in a cycle of 10 ms; guards are wide, since all nodes share the processors of one computer with its
/// other work.
pub(crate) fn table() -> Tdma {
    lan::slots(NODES, 3000, [10_000, 1000])
}

/// A moment of the monotonic clock that is over.
pub(crate) fn instant(at_ns: u64) -> Instant {
    Instant::now() - Duration::from_nanos(monotonic_ns() - at_ns)
}

/// Where the router of a node takes datagrams.
pub(crate) fn at(node: u8) -> SocketAddr {
    SocketAddr::new(address(node), PORT)
}

/// "Still there", from a node that was launched from another file.
pub(crate) fn of_another_digest(from: u8, to: u8) -> Vec<u8> {
    lan::alive(FrameHead { kind: FrameKind::Alive, system: 1, from, to, digest: 8, incarnation: 1, sequence: 0 })
}

/// Kinds of the datagrams that came, until none comes for a moment.
pub(crate) fn frames<'a>(socket: &'a UdpSocket, buffer: &'a mut [u8]) -> impl Iterator<Item = FrameKind> + 'a {
    std::iter::from_fn(|| {
        let bytes = socket.recv(buffer).ok()?;
        FrameHead::parse(&buffer[..bytes]).ok().map(|(head, _)| head.kind)
    })
}

pub(crate) fn name(node: u8) -> String {
    format!("n{node}")
}

fn address(node: u8) -> IpAddr {
    IpAddr::from([10, 77, 0, node + 1])
}

struct Silence;

impl Faults for Silence {
    fn write(&self, _: &[u8], _: &Undelivered<'_>, _: &mut Vec<u8>) -> bool {
        false
    }
}

/// A node with its router.
pub(crate) struct Station {
    pub(crate) own: u8,
    pub(crate) node: Arc<Node>,
    pub(crate) settings: Settings,
    pub(crate) skew: Skew,
    /// Makes what this node hears of time come late.
    pub(crate) late: Option<impair::ImpairmentSettings>,
    pub(crate) shell: Option<Shell>,
    recorder: Option<Recorder>,
}

impl Station {
    fn new(own: u8, node: Arc<Node>, tunnel: Option<Tunnel>, begin_ns: u64) -> Self {
        // One computer has one clock: without this, all would be in step from the first moment on.
        let (offset_ns, rate_ppb) = (u64::from(own) * 1_234_000_000, i64::from(own) * 20_000);
        let skew = Skew { offset_ns, rate_ppb, begin_ns, ..Skew::default() };
        let settings = lan::settings(own, &[0, 1, 2].map(address), Some(Tdma { tunnel, ..table() }));
        Self { own, node, settings, skew, late: None, shell: None, recorder: None }
    }

    pub(crate) fn start(&mut self, lab: &Lab) {
        let _inside = lab.enter(&name(self.own)).unwrap();
        self.start_here();
    }

    fn start_here(&mut self) {
        self.settings.incarnation = self.settings.incarnation.max(realtime_ns()) + 1;
        let settings = self.settings.clone();
        let is_true = self.skew == Skew { begin_ns: self.skew.begin_ns, ..Skew::default() };
        let cycle = settings.tdma.as_ref().unwrap().cycle;
        let clock = ClockParts {
            // Readers of a page go by the true clock: a skewed one would seem to go back there.
            node: is_true.then(|| self.node.clone()),
            impair: self.late,
            skew: Some(self.skew),
            ..ClockParts::of_router(&settings, &MASTERS, cycle)
        };
        let name = router(self.own);
        let parts = Parts {
            node: &self.node,
            name,
            settings,
            faults: Arc::new(Silence),
            sockets: Vec::new(),
            impair: None,
            clock: Some(clock),
        };
        let shell = if self.settings.is_sealed() {
            let key = InstallationKey::new(KeyId(NonZeroU8::MIN), &[9; KEY_BYTES]);
            Shell::start_sealed(parts, KeyRing::new(key, None)).unwrap()
        } else {
            Shell::start(parts).unwrap()
        };
        self.recorder = Some(Recorder::start(self.node.path().parent().unwrap(), self.own, &shell));
        self.shell = Some(shell);
    }

    pub(crate) fn shell(&self) -> &Shell {
        self.shell.as_ref().unwrap()
    }

    pub(crate) fn slots(&self) -> slots::SlotSnapshot {
        self.shell().slots().unwrap().snapshot()
    }

    pub(crate) fn clock(&self) -> rohrpost_routers::shell::clock::ClockSnapshot {
        self.shell().clock().unwrap().snapshot()
    }

    /// It sends, and hears both others.
    pub(crate) fn is_ready(&self) -> bool {
        let stats = self.shell().stats();
        let alive = |peer| stats.state(peer, monotonic_ns()) == rohrpost_routers::link::PeerLinkState::Alive;
        self.slots().silent.is_none() && self.shell().settings().peers().all(alive)
    }

    pub(crate) fn receiver(&self) -> Receiver {
        let shape = Shape { slots: 256, body_bytes_max: 1024, ..Shape::default() };
        self.join().receiver(module(self.own), shape).unwrap()
    }

    pub(crate) fn sender(&self, to: u8) -> Sender {
        self.join().sender(module(to)).unwrap()
    }

    fn join(&self) -> Arc<Participant> {
        Participant::join(&self.node, Name::NONE).unwrap()
    }
}

pub(crate) fn label(from: u8, priority: u8, id: u16) -> Label {
    Label { from: module(from), kind: Type::data(1), id, priority: Priority(priority), ..Label::default() }
}

/// The nodes, in their network.
pub(crate) struct Segment {
    pub(crate) stations: Vec<Station>,
    pub(crate) lab: Lab,
    /// Routers that were killed, and when.
    deaths: RefCell<Vec<(u8, u64)>>,
    folder: tempfile::TempDir,
    _turn: MutexGuard<'static, ()>,
}

impl Segment {
    /// Starts all; none where namespaces are not allowed.
    pub(crate) fn start() -> Option<Self> {
        Self::with(None)
    }

    /// With a tunnel for ordinary traffic.
    pub(crate) fn with(tunnel: Option<Tunnel>) -> Option<Self> {
        let mut segment = Self::at_rest(tunnel)?;
        segment.stations.iter_mut().for_each(|station| station.start(&segment.lab));
        Some(segment)
    }

    /// Starts no router yet.
    pub(crate) fn at_rest(tunnel: Option<Tunnel>) -> Option<Self> {
        // Two networks at a time would be in each other's way.
        static TURN: Mutex<()> = Mutex::new(());
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let lab = lan::lab(&lan::specs(&[0, 1, 2].map(address)), 1500)?;
        let folder = tempfile::Builder::new().prefix("rohrpost-slots-").tempdir_in("/dev/shm").unwrap();
        let begin_ns = monotonic_ns();
        let station = |own: u8| {
            let node = Node::create(&folder.path().join(name(own)), 0o700).unwrap();
            Station::new(own, node, tunnel, begin_ns)
        };
        let stations: Vec<_> = (0..NODES).map(station).collect();
        Some(Self { stations, lab, deaths: RefCell::default(), folder, _turn: turn })
    }

    /// What a node has said of its slots so far.
    pub(crate) fn own_log(&self, node: u8) -> OwnLog {
        OwnLog::read(self.folder.path(), node)
    }

    /// System time at a moment, as a node of this process knew it then.
    pub(crate) fn time_of(&self, node: u8) -> impl Fn(u64) -> u64 {
        let (log, skew) = (self.own_log(node), self.stations[usize::from(node)].skew);
        move |at_ns| log.system_ns(skew.local_ns(at_ns))
    }

    /// What is too late if a node followed another master since then, as it does when three Syncs of one are missing:
    /// rightly, if that stood still for two cycles.
    pub(crate) fn replaced(&self, node: u8, since_ns: u64) -> Option<Late> {
        let turned_ns = self.own_log(node).turned_ns(since_ns)?;
        let (until, cycle) = (instant(turned_ns), table().cycle);
        let what = format!("node {node} followed another master");
        Some(Late { what, since: until - 6 * cycle, until, by: 2 * cycle })
    }

    /// Whether the node's router was killed so soon after that that it could not tell what it did.
    pub(crate) fn has_died(&self, node: u8, after_ns: u64) -> bool {
        let untold_ns = 4 * EVERY.as_nanos() as u64;
        let is_it = |(dead, at_ns): &(u8, u64)| *dead == node && (after_ns..after_ns + untold_ns).contains(at_ns);
        self.deaths.borrow().iter().any(is_it)
    }

    /// In the place of a node's router.
    pub(crate) fn socket(&self, node: u8) -> UdpSocket {
        let _inside = self.lab.enter(&name(node)).unwrap();
        let socket = UdpSocket::bind(at(node)).unwrap();
        socket.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
        socket
    }

    /// What the routers of this process have lost: node, cause, packages.
    pub(crate) fn lost(&self) -> Vec<(u8, Cause, u64)> {
        let running = self.stations.iter().filter_map(|station| Some((station.own, station.shell.as_ref()?.stats())));
        let of = |(own, stats): (u8, &Stats)| {
            let classes: Vec<_> = stats.out.classes().chain(stats.inn.classes()).collect();
            let lost = move |cause: Cause| classes.iter().map(|(_, class)| class.lost(cause)).sum::<u64>();
            Cause::ALL.map(|cause| (own, cause, lost(cause))).into_iter().filter(|(.., lost)| *lost > 0)
        };
        running.flat_map(|(own, stats)| of((own, stats))).collect()
    }

    /// All routers of this process send, and hear each other.
    pub(crate) fn wait_until_all_send(&self) {
        self.wait_until("all send", |segment| segment.stations.iter().all(Station::is_ready));
    }

    pub(crate) fn wait_until(&self, what: &str, mut done: impl FnMut(&Self) -> bool) {
        let began = Instant::now();
        while !done(self) {
            let running = self.stations.iter().filter(|station| station.shell.is_some());
            let seen = || running.map(|station| (station.own, station.slots(), station.clock())).collect::<Vec<_>>();
            assert!(began.elapsed() < PATIENCE, "waited too long until {what}: {:#?}", seen());
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}
