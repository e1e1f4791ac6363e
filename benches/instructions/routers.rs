//! A package of 64 bytes through the cores of two routers, one package a datagram.

use super::Path;
use rohrpost_mailbox::{Head, Priority, Type};
use rohrpost_routers::counts::Cause;
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::inbound::{Datagram, Inbound};
use rohrpost_routers::outbound::{Accepted, DIRECT_HEAD_BYTES, Outbound, OutboundStep, Package};
use rohrpost_routers::report::{Deliver, NotDelivered, Report, RouterEvent};
use rohrpost_routers::stats::Stats;
use rohrpost_testbed::pair::{address, module, settings};

const BODY: [u8; 64] = [7; 64];
const START_NS: u64 = 1_000_000_000;
/// From one package to the next: the wire is free by then.
const PERIOD_NS: u64 = 10_000;

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
