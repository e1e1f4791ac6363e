//! What the tests of the cores have in common: settings from plain values, a log of all that is told, and a router
//! without sockets.

use crate::admission::Admission;
use crate::counts::{Cause, Side};
use crate::flows::Flow;
use crate::frame::{FrameHead, NodeIndex};
use crate::inbound::{self, Datagram, Inbound};
use crate::outbound::{Accepted, Outbound, OutboundStep, Package};
use crate::report::{Deliver, NotDelivered, Report, RouterEvent};
use crate::settings::{NodeSettings, Settings};
use crate::stats::Stats;
use crate::time::TimeSettings;
use crate::time::message::{MESSAGE_BYTES, TimeMessage};
use rohrpost_mailbox::{Head, Name, Node, Participant, Priority, Receiver, Shape, Type};
use rohrpost_network::{Network, Route, Security, Tdma, TimeSlot};
use std::net::{IpAddr, Ipv4Addr};
use std::sync::Arc;
use std::time::Duration;

pub(crate) const MS: u64 = 1_000_000;
pub(crate) const S: u64 = 1000 * MS;
/// When all tests begin.
pub(crate) const START: u64 = 100 * S;
/// A command's interface, caller and so on: something to recognise in what is told of a lost one.
pub(crate) const ENVELOPE: [u8; 24] = *b"the envelope of a call..";

/// The module of a class on a node: instances are nodes.
pub(crate) fn module(class: u8, node: NodeIndex) -> Name {
    Name::new(1, class, node, 0)
}

pub(crate) fn address(node: NodeIndex) -> IpAddr {
    Ipv4Addr::new(10, 0, 0, node + 1).into()
}

/// A router of a few nodes; the module of class 200 has a quota of its own, all others share one.
pub(crate) fn settings(own: NodeIndex, nodes: NodeIndex) -> Settings {
    let route = |class, node| Route { first: module(class, node), last: module(class, node).with_local(u8::MAX), node };
    let others = || (0..nodes).filter(|node| *node != own);
    Settings {
        system: 1,
        own,
        nodes: (0..nodes).map(|node| NodeSettings { name: format!("n{node}"), address: address(node) }).collect(),
        digest: 7,
        incarnation: 100 + u64::from(own),
        network: Network {
            security: Security::None,
            port: 21117,
            mtu: 1500,
            datagram_bytes_max: 1472,
            rate_bytes_s: 100 << 20,
            quota_bytes: 128 << 10,
            bulk_below: 16,
        },
        tdma: None,
        routes: (1..=255).flat_map(|class| others().map(move |node| route(class, node))).collect(),
        moving: Default::default(),
        senders: vec![vec![module(200, own)], vec![module(100, own)]],
        hosts: Vec::new(),
        admission: Admission::default(),
        flows: Vec::new(),
        real_time_from: 0,
    }
}

/// Settings of a clock on one of three nodes.
pub(crate) fn time_settings(own: NodeIndex, masters: &[NodeIndex], interval: Duration) -> TimeSettings {
    TimeSettings { incarnation: 9, ..TimeSettings::of(&settings(own, 3), masters, interval) }
}

/// A frame of time, and the bytes behind its head.
pub(crate) fn time_frame(
    (from, to): (NodeIndex, NodeIndex),
    sequence: u64,
    message: &TimeMessage,
) -> (FrameHead, [u8; MESSAGE_BYTES]) {
    let head = FrameHead { kind: message.kind(), system: 1, from, to, digest: 7, incarnation: 5, sequence };
    (head, message.to_bytes())
}

/// A slot of each cycle: its node, where it begins and how long it is, µs.
pub(crate) fn slot(node: NodeIndex, offset_us: u64, length_us: u64) -> TimeSlot {
    let us = Duration::from_micros;
    TimeSlot { node, offset: us(offset_us), length: us(length_us), period: 1, phase: 0 }
}

/// Slots on a wire of 1 Gbit/s. `lengths_us`: of the cycle, of a master's synchronisation, and of guards.
pub(crate) fn tdma(lengths_us: [u64; 3], slots: Vec<TimeSlot>) -> Tdma {
    let [cycle, synchronisation, guard] = lengths_us.map(Duration::from_micros);
    Tdma { cycle, synchronisation, guard, link_bytes_s: 125_000_000, slots, tunnel: None }
}

/// A flow that has 10 ms, and for which 5 ms are sure.
pub(crate) fn flow(from: Name, to: Name, size: u32) -> Flow {
    let ms = Duration::from_millis;
    Flow { from: vec![from], to: vec![to], carries: None, size, period: ms(90), deadline: ms(10), bound: Some(ms(5)) }
}

pub(crate) fn head(to: Name, from: Name, priority: u8) -> Head {
    Head { to, from, priority: Priority(priority), kind: Type::data(1), ..Head::default() }
}

/// A node's memory; its folder goes with it.
pub(crate) struct TestNode {
    pub(crate) node: Arc<Node>,
    _folder: tempfile::TempDir,
}

impl TestNode {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        Self { node: Node::create(&folder.path().join("node"), 0o700).unwrap(), _folder: folder }
    }

    pub(crate) fn join(&self) -> Arc<Participant> {
        Participant::join(&self.node, Name::NONE).unwrap()
    }

    /// A mailbox with so many slots for bodies of this size.
    pub(crate) fn mailbox(&self, name: Name, slots: u16, body_bytes_max: u16) -> Receiver {
        self.join().receiver(name, Shape { slots, body_bytes_max, ..Shape::default() }).unwrap()
    }
}

#[derive(Default)]
pub(crate) struct Log {
    pub(crate) lost: Vec<(Head, Vec<u8>, Cause)>,
    pub(crate) delivered: Vec<(NodeIndex, Head, Vec<u8>)>,
    pub(crate) events: Vec<RouterEvent>,
    /// What mailboxes say.
    pub(crate) closed: Option<NotDelivered>,
}

impl Log {
    pub(crate) fn causes(&self) -> Vec<Cause> {
        self.lost.iter().map(|(.., cause)| *cause).collect()
    }

    /// Ids of what was delivered, in order.
    pub(crate) fn ids(&self) -> Vec<u16> {
        self.delivered.iter().map(|(_, head, _)| head.id).collect()
    }
}

impl Report for Log {
    fn lost(&mut self, _: Option<NodeIndex>, head: &Head, body: &[u8], cause: Cause) {
        self.lost.push((*head, body.to_vec(), cause));
    }
}

impl Deliver for Log {
    fn deliver(&mut self, from: NodeIndex, head: &Head, body: &[u8]) -> Result<(), NotDelivered> {
        assert_eq!(body.len(), usize::from(head.len));
        if let Some(why) = self.closed {
            return Err(why);
        }
        self.delivered.push((from, *head, body.to_vec()));
        Ok(())
    }

    fn event(&mut self, event: RouterEvent) {
        self.events.push(event);
    }
}

/// A router without sockets.
pub(crate) struct End {
    pub(crate) settings: Settings,
    pub(crate) stats: Arc<Stats>,
    pub(crate) outbound: Outbound,
    pub(crate) inbound: Inbound,
    pub(crate) log: Log,
    next_id: u16,
}

impl End {
    pub(crate) fn new(own: NodeIndex, change: impl FnOnce(&mut Settings)) -> Self {
        Self::begin(own, START, change)
    }

    pub(crate) fn begin(own: NodeIndex, now_ns: u64, change: impl FnOnce(&mut Settings)) -> Self {
        let mut settings = settings(own, 3);
        change(&mut settings);
        let stats = Stats::new(&settings, now_ns);
        let (outbound, inbound) = (Outbound::new(&settings, stats.clone()), Inbound::new(&settings, stats.clone()));
        let mut end = Self { settings, stats, outbound, inbound, log: Log::default(), next_id: 0 };
        // The first "still there" is out of the way.
        end.leave(now_ns);
        end
    }

    /// Hands a package to the router; its ids count from 0. What leaves at once is returned.
    pub(crate) fn send(&mut self, now_ns: u64, head: Head, body: &[u8], alone: bool) -> Option<(NodeIndex, Vec<u8>)> {
        let head = Head { len: body.len() as u16, id: self.next_id, ..head };
        self.next_id += 1;
        let package = Package { head, published_ns: now_ns, body };
        match self.outbound.accept(now_ns, &package, alone, &mut self.log) {
            Accepted::Send { to, head } => Some((to, [&head[..], body].concat())),
            Accepted::Waits | Accepted::Lost => None,
        }
    }

    /// A package that waits: others stand behind it.
    pub(crate) fn queue(&mut self, now_ns: u64, head: Head, body: &[u8]) {
        assert_eq!(self.send(now_ns, head, body, false), None);
    }

    pub(crate) fn poll(&mut self, now_ns: u64) -> Result<(NodeIndex, Vec<u8>), u64> {
        let mut datagram = vec![0; self.settings.network.datagram_bytes_max];
        match self.outbound.poll(now_ns, &mut datagram, &mut self.log) {
            OutboundStep::Send { to, bytes } => Ok((to, datagram[..bytes].to_vec())),
            OutboundStep::Wait { until_ns } => Err(until_ns),
        }
    }

    /// All that leaves now.
    pub(crate) fn leave(&mut self, now_ns: u64) -> Vec<(NodeIndex, Vec<u8>)> {
        std::iter::from_fn(|| self.poll(now_ns).ok()).collect()
    }

    pub(crate) fn take(&mut self, now_ns: u64, from: NodeIndex, bytes: &[u8]) {
        self.take_from(now_ns, address(from), bytes);
    }

    pub(crate) fn take_from(&mut self, now_ns: u64, source: IpAddr, bytes: &[u8]) {
        let datagram = Datagram { source, arrived_ns: now_ns, bytes };
        self.inbound.handle(now_ns, &datagram, &mut self.log);
    }

    /// Refusals that it says now.
    pub(crate) fn refusals(&mut self, now_ns: u64) -> Vec<(IpAddr, Vec<u8>)> {
        let mut datagram = [0; 64];
        let mut all = Vec::new();
        while let inbound::InboundStep::Refuse { to, bytes } = self.inbound.poll(now_ns, &mut datagram, &mut self.log) {
            all.push((to, datagram[..bytes].to_vec()));
        }
        all
    }

    /// What a peer knows of this router is what it needs to know: it hears it, and is heard.
    pub(crate) fn meet(&mut self, now_ns: u64, other: &mut Self) {
        let (own, theirs) = (self.settings.own, other.settings.own);
        for (_, datagram) in self.alive(now_ns).into_iter().filter(|(to, _)| *to == theirs) {
            other.take(now_ns, own, &datagram);
        }
        for (_, datagram) in other.alive(now_ns).into_iter().filter(|(to, _)| *to == own) {
            self.take(now_ns, theirs, &datagram);
        }
    }

    /// As if a peer had just said that it hears this router.
    pub(crate) fn hears(&self, peer: NodeIndex, now_ns: u64) {
        let link = &self.stats.peer(peer).link;
        link.heard_ns.set(now_ns);
        link.hears_us(now_ns, true);
    }

    fn alive(&mut self, now_ns: u64) -> Vec<(NodeIndex, Vec<u8>)> {
        let peers: Vec<_> = self.settings.peers().collect();
        self.outbound.tell_all(now_ns);
        let all = self.leave(now_ns);
        assert!(all.len() >= peers.len());
        all
    }

    /// Accounts of both sides, by class; `waiting`: what is still there, packages of which parts came included.
    pub(crate) fn assert_balanced(&self) {
        let sums = |side: &Side| {
            let all = side.classes().map(|(_, class)| (class.packages.get(), class.passed.get(), class.lost_in_all()));
            all.fold((0, 0, 0), |a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2))
        };
        let (packages, passed, lost) = sums(&self.stats.out);
        assert_eq!(packages, passed + lost + self.stats.waiting_in_all(), "outgoing");
        let (packages, passed, inn_lost) = sums(&self.stats.inn);
        assert_eq!(packages, passed + inn_lost + self.inbound.partial(), "incoming");
        assert_eq!(lost + inn_lost, self.log.lost.len() as u64, "each is told once");
        let mut told = [0; Cause::ALL.len()];
        self.log.lost.iter().for_each(|(.., cause)| told[*cause as usize] += 1);
        for cause in Cause::ALL {
            let counted = |side: &Side| side.classes().map(|(_, class)| class.lost(cause)).sum::<u64>();
            assert_eq!(counted(&self.stats.out) + counted(&self.stats.inn), told[cause as usize], "{cause:?}");
        }
    }
}
