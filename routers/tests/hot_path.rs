//! A package on its way through a router takes nothing from the heap, and gives nothing back to it: at once or through
//! the queue, packed or in parts, delivered or lost, in order or not. Only putting together the first large packages of
//! a peer takes memory.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "../../benches/src/counting.rs"]
pub mod counting;

use counting::{CountingHeap, heap_uses};
use rohrpost_mailbox::{Head, Name, Priority, Type};
use rohrpost_routers::counts::Cause;
use rohrpost_routers::flows::Flow;
use rohrpost_routers::frame::{FrameHead, NodeIndex};
use rohrpost_routers::inbound::{Datagram, Inbound};
use rohrpost_routers::outbound::{Accepted, Outbound, OutboundStep, Package};
use rohrpost_routers::report::{Deliver, NotDelivered, Report, RouterEvent};
use rohrpost_routers::session::frame::Range;
use rohrpost_routers::session::{ClientIndex, RoutingTable};
use rohrpost_routers::settings::Settings;
use rohrpost_routers::stats::Stats;
use rohrpost_routers::time::{Clock, Role, Stamp, Step, TIME_BYTES, TimeSettings};
use rohrpost_testbed::pair::{self, address, module};
use std::sync::Arc;
use std::time::Duration;

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

const MS: u64 = 1_000_000;

/// With a declared flow from each module to the other.
fn settings(own: NodeIndex) -> Settings {
    let flow = Flow {
        from: vec![module(own)],
        to: vec![module(1 - own)],
        carries: None,
        size: 9000,
        period: Duration::from_millis(1),
        deadline: Duration::from_millis(10),
        bound: None,
    };
    Settings { flows: vec![flow], ..pair::settings(own) }
}

#[derive(Default)]
struct Counts {
    lost: [u64; Cause::ALL.len()],
    delivered: u64,
    closed: Option<NotDelivered>,
}

impl Report for Counts {
    fn lost(&mut self, _: Option<NodeIndex>, _: &Head, _: &[u8], cause: Cause) {
        self.lost[cause as usize] += 1;
    }
}

impl Deliver for Counts {
    fn deliver(&mut self, _: NodeIndex, _: &Head, _: &[u8]) -> Result<(), NotDelivered> {
        self.delivered += 1;
        self.closed.map_or(Ok(()), Err)
    }

    fn event(&mut self, _: RouterEvent) {}
}

/// Two routers and a wire that now and then loses, copies and holds back.
struct Pair {
    out: Outbound,
    out_stats: Arc<Stats>,
    inn: Inbound,
    back: (Outbound, Inbound),
    counts: Counts,
    held: ([u8; 1472], usize),
    datagrams: u64,
}

impl Pair {
    fn new(now_ns: u64) -> Self {
        let (base, arm) = (settings(0), settings(1));
        let stats: [Arc<Stats>; 2] = [Stats::new(&base, now_ns), Stats::new(&arm, now_ns)];
        Self {
            out: Outbound::new(&base, stats[0].clone()),
            out_stats: stats[0].clone(),
            inn: Inbound::new(&arm, stats[1].clone()),
            back: (Outbound::new(&arm, stats[1].clone()), Inbound::new(&base, stats[0].clone())),
            counts: Counts::default(),
            held: ([0; 1472], 0),
            datagrams: 0,
        }
    }

    fn send(&mut self, now_ns: u64, priority: u8, body: &[u8], alone: bool) {
        let kind = if priority.is_multiple_of(2) { Type::command(16) } else { Type::data(1) };
        let head = Head {
            to: module(1),
            from: module(0),
            len: body.len() as u16,
            kind,
            priority: Priority(priority),
            ..Head::default()
        };
        let package = Package { head, published_ns: now_ns, body };
        if let Accepted::Send { head, .. } = self.out.accept(now_ns, &package, alone, &mut self.counts) {
            let mut datagram = [0; 1472];
            datagram[..head.len()].copy_from_slice(&head);
            datagram[head.len()..head.len() + body.len()].copy_from_slice(body);
            self.out.sent(now_ns);
            self.wire(now_ns, &datagram[..head.len() + body.len()]);
        }
    }

    fn leave(&mut self, now_ns: u64) {
        let mut datagram = [0; 1472];
        while let OutboundStep::Send { bytes, .. } = self.out.poll(now_ns, &mut datagram, &mut self.counts) {
            if self.datagrams % 31 == 30 {
                self.out.unsent(&datagram[..bytes], &[], &mut self.counts);
            } else {
                self.out.sent(now_ns);
            }
            self.wire(now_ns, &datagram[..bytes]);
        }
        while let OutboundStep::Send { bytes, .. } = self.back.0.poll(now_ns, &mut datagram, &mut self.counts) {
            let datagram = Datagram { source: address(1), arrived_ns: now_ns, bytes: &datagram[..bytes] };
            self.back.1.handle(now_ns, &datagram, &mut self.counts);
        }
        self.inn.poll(now_ns, &mut datagram, &mut self.counts);
        self.back.1.poll(now_ns, &mut datagram, &mut self.counts);
    }

    fn wire(&mut self, now_ns: u64, datagram: &[u8]) {
        self.datagrams += 1;
        match self.datagrams % 23 {
            3 => {}
            5 => {
                self.held.0[..datagram.len()].copy_from_slice(datagram);
                self.held.1 = datagram.len();
            }
            7 => (0..2).for_each(|_| self.arrive(now_ns, datagram)),
            9 => {
                let (held, bytes) = self.held;
                self.arrive(now_ns, datagram);
                self.arrive(now_ns, &held[..bytes]);
            }
            11 => self.arrive(now_ns, &datagram[1..]),
            _ => self.arrive(now_ns, datagram),
        }
    }

    fn arrive(&mut self, now_ns: u64, bytes: &[u8]) {
        let datagram = Datagram { source: address(0), arrived_ns: now_ns, bytes };
        self.inn.handle(now_ns, &datagram, &mut self.counts);
    }

    /// What a busy router does in some milliseconds.
    fn round(&mut self, now_ns: u64, round: u64) {
        let bodies = [7; 9000];
        self.counts.closed = round.is_multiple_of(3).then_some(NotDelivered::MailboxFull);
        (0..10).for_each(|_| self.send(now_ns, 200, &bodies[..64], true));
        for n in 0..40 {
            self.send(now_ns, 120 + n, &bodies[..20 + usize::from(n)], false);
        }
        self.leave(now_ns);
        for n in 0..8 {
            self.send(now_ns, 20 + n * 30, &bodies, n == 0);
        }
        self.leave(now_ns + MS);
        // More than its quota.
        for n in 0..40 {
            self.send(now_ns + 2 * MS, 250 - n * 5, &bodies, false);
        }
        self.leave(now_ns + 20 * MS);
        if round.is_multiple_of(16) {
            self.send(now_ns + 20 * MS, 90, &bodies, false);
        }
        self.leave(now_ns + if round.is_multiple_of(16) { 2100 } else { 40 } * MS);
    }
}

#[test]
fn no_package_touches_the_heap() {
    let mut now_ns = 1000 * MS;
    let mut pair = Pair::new(now_ns);
    let mut rounds = |pair: &mut Pair, from: u64, to: u64| {
        for round in from..to {
            pair.round(now_ns, round);
            now_ns += if round.is_multiple_of(16) { 2200 } else { 50 } * MS;
        }
    };
    rounds(&mut pair, 0, 100);
    let before = heap_uses();
    assert!(before > 0, "counts");
    rounds(&mut pair, 100, 1000);
    assert_eq!(heap_uses(), before, "used the heap");
    let happened = |cause: Cause| pair.counts.lost[cause as usize];
    for cause in [Cause::Quota, Cause::Socket, Cause::Late, Cause::Incomplete, Cause::MailboxFull] {
        assert!(happened(cause) > 10, "{cause:?}: {} times", happened(cause));
    }
    assert!(pair.counts.delivered > 10_000 && pair.datagrams > 10_000);
    let flow = &pair.out_stats.flows.counts()[0];
    assert_eq!(flow.latency().count(), pair.out_stats.peer(1).sent.packages.get(), "each is measured");
    assert!(flow.lost(Cause::Quota) > 10 && flow.over_deadline.get() > 10, "{flow:?}");
}

/// Two clocks without a network: what one sends the other has at once.
struct Clocks {
    clocks: [Clock; 2],
    now_ns: u64,
    frames: u64,
}

impl Clocks {
    fn new() -> Self {
        let clock = |own| {
            let interval = Duration::from_millis(100);
            let settings =
                TimeSettings { system: 1, own, nodes: 2, masters: vec![0], interval, digest: 7, incarnation: 9 };
            Clock::new(settings, 0, 1_790_000_000 * 1000 * MS, None)
        };
        Self { clocks: [clock(0), clock(1)], now_ns: 0, frames: 0 }
    }

    /// Until nothing is due; then until the next is.
    fn step(&mut self) {
        let mut until = u64::MAX;
        for own in [0, 1] {
            let mut datagram = [0; TIME_BYTES];
            loop {
                match self.clocks[own].poll(self.now_ns, &mut datagram) {
                    Step::Wait { until_ns } => break until = until.min(until_ns),
                    Step::Send { stamp, .. } => {
                        let stamped = |ns| Stamp { ns, doubt_ns: 50, by_kernel: true };
                        if let Some(id) = stamp {
                            self.clocks[own].sent(id, stamped(self.now_ns + 1_000));
                        }
                        self.now_ns += 10_000;
                        let (head, rest) = FrameHead::parse(&datagram).unwrap();
                        let _ = self.clocks[1 - own].handle(self.now_ns, stamped(self.now_ns), &head, rest);
                        self.frames += 1;
                    }
                }
            }
        }
        self.now_ns = self.now_ns.max(until);
    }
}

#[test]
fn a_clock_takes_nothing_from_the_heap() {
    let mut clocks = Clocks::new();
    while clocks.clocks[1].role() != Role::Slave || !clocks.clocks[1].reading(clocks.now_ns).synchronised {
        assert!(clocks.now_ns < 10_000 * MS, "{:?}", clocks.clocks[1].reading(clocks.now_ns));
        clocks.step();
    }
    let before = heap_uses();
    clocks.frames = 0;
    while clocks.frames < 10_000 {
        clocks.step();
    }
    assert_eq!(heap_uses() - before, 0);
    // Without a master, too.
    for _ in 0..1_000 {
        clocks.now_ns += 10 * MS;
        let _ = clocks.clocks[1].poll(clocks.now_ns, &mut [0; TIME_BYTES]);
    }
    assert_eq!(heap_uses() - before, 0);
}

#[test]
fn the_host_of_a_name_at_the_tcp_router_is_looked_up_without_the_heap() {
    let mut table = RoutingTable::default();
    for client in 0..16 {
        let module = |index: usize| Range::module(Name::new(1 + client as u8, (index >> 8) as u8, index as u8, 0));
        table.register(ClientIndex(client), 1000, |_| true, (0..1000).map(module)).unwrap();
    }
    let before = heap_uses();
    let hosted = (0..1 << 14).filter(|name| table.client_of(Name::from_raw(name << 14)).is_some()).count();
    assert_eq!(heap_uses(), before);
    assert!(hosted > 100, "{hosted} names are hosted");
}
