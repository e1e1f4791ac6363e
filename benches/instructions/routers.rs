//! A package of 64 bytes through the cores of two routers, one package a datagram.

use super::Path;
use rohrpost_mailbox::{Head, Name, Priority, Type};
use rohrpost_network::{Network, Route, Security};
use rohrpost_routers::admission::Admission;
use rohrpost_routers::counts::Cause;
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::inbound::{Datagram, Inbound};
use rohrpost_routers::outbound::{Accepted, DIRECT_HEAD_BYTES, Outbound, OutboundStep, Package};
use rohrpost_routers::report::{Deliver, NotDelivered, Report, RouterEvent};
use rohrpost_routers::settings::{NodeSettings, Settings};
use rohrpost_routers::stats::Stats;
use std::net::{IpAddr, Ipv4Addr};

const BODY: [u8; 64] = [7; 64];
const START_NS: u64 = 1_000_000_000;
/// From one package to the next: the wire is free by then.
const PERIOD_NS: u64 = 10_000;

fn address(node: NodeIndex) -> IpAddr {
    Ipv4Addr::new(10, 0, 0, node + 1).into()
}

/// The module that a node has.
fn module(node: NodeIndex) -> Name {
    Name::new(1, 200, node, 0)
}

/// One of two nodes.
fn settings(own: NodeIndex) -> Settings {
    let other = 1 - own;
    Settings {
        system: 1,
        own,
        nodes: (0..2).map(|node| NodeSettings { name: format!("n{node}"), address: address(node) }).collect(),
        digest: 7,
        incarnation: 9,
        network: Network {
            security: Security::None,
            port: 21117,
            mtu: 1500,
            datagram_bytes_max: 1472,
            rate_bytes_s: 1 << 30,
            quota_bytes: 128 << 10,
            bulk_below: 16,
        },
        tdma: None,
        routes: vec![Route { first: module(other), last: module(other).with_local(u8::MAX), node: other }],
        senders: vec![vec![module(own)]],
        hosts: Vec::new(),
        admission: Admission::default(),
        real_time_from: 0,
        flows: Vec::new(),
    }
}

/// Takes all that is delivered.
#[derive(Default)]
struct Everything {
    delivered: usize,
}

impl Report for Everything {
    fn lost(&mut self, _: Option<NodeIndex>, head: &Head, _: &[u8], cause: Cause) {
        panic!("lost {head:?}: {cause:?}");
    }
}

impl Deliver for Everything {
    fn deliver(&mut self, _: NodeIndex, _: &Head, _: &[u8]) -> Result<(), NotDelivered> {
        self.delivered += 1;
        Ok(())
    }

    fn event(&mut self, _: RouterEvent) {}
}

/// Both halves of a router.
struct Router {
    own: NodeIndex,
    outbound: Outbound,
    inbound: Inbound,
}

impl Router {
    fn new(own: NodeIndex) -> Self {
        let settings = settings(own);
        let stats = Stats::new(&settings, START_NS);
        Self { own, outbound: Outbound::new(&settings, stats.clone()), inbound: Inbound::new(&settings, stats) }
    }

    /// Tells the other that this one is there, and hears it.
    fn greet(&mut self, other: &mut Self) {
        let (mut room, mut host) = ([0; 1472], Everything::default());
        while let OutboundStep::Send { bytes, .. } = self.outbound.poll(START_NS, &mut room, &mut host) {
            self.outbound.sent(START_NS);
            let datagram = Datagram { source: address(self.own), arrived_ns: START_NS, bytes: &room[..bytes] };
            other.inbound.handle(START_NS, &datagram, &mut host);
        }
    }
}

/// Takes a package that leaves at once.
pub(super) struct Accept {
    from: Router,
    to: Router,
    now_ns: u64,
    report: Everything,
    /// What the router puts before the body.
    head: [u8; DIRECT_HEAD_BYTES],
}

impl Default for Accept {
    fn default() -> Self {
        let [mut from, mut to] = [0, 1].map(Router::new);
        from.greet(&mut to);
        to.greet(&mut from);
        Self { from, to, now_ns: START_NS, report: Everything::default(), head: [0; DIRECT_HEAD_BYTES] }
    }
}

impl Path for Accept {
    fn prepare(&mut self) {
        self.now_ns += PERIOD_NS;
    }

    fn operate(&mut self) {
        let head = Head {
            to: module(1),
            from: module(0),
            len: BODY.len() as u16,
            kind: Type::data(1),
            priority: Priority(100),
            ..Head::default()
        };
        let package = Package { head, published_ns: self.now_ns, body: &BODY };
        match self.from.outbound.accept(self.now_ns, &package, true, &mut self.report) {
            Accepted::Send { head, .. } => self.head = head,
            Accepted::Waits | Accepted::Lost => panic!("it does not leave at once"),
        }
        self.from.outbound.sent(self.now_ns);
    }
}

/// Takes a datagram, and delivers its package.
#[derive(Default)]
pub(super) struct Handle {
    sent: Accept,
    datagram: Vec<u8>,
    host: Everything,
}

impl Path for Handle {
    fn prepare(&mut self) {
        self.sent.prepare();
        self.sent.operate();
        self.datagram.clear();
        self.datagram.extend_from_slice(&self.sent.head);
        self.datagram.extend_from_slice(&BODY);
    }

    fn operate(&mut self) {
        let now_ns = self.sent.now_ns;
        let datagram = Datagram { source: address(0), arrived_ns: now_ns, bytes: &self.datagram };
        self.sent.to.inbound.handle(now_ns, &datagram, &mut self.host);
    }

    fn finish(&mut self) {
        assert_eq!(std::mem::take(&mut self.host.delivered), 1);
    }
}
