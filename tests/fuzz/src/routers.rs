//! Two routers and a wire with any faults: accounts balance, memory is bounded, and no package of one incarnation of a
//! sender is delivered twice or out of order.

use crate::frames::checked;
use crate::split::Bytes;
use rohrpost_mailbox::{Head, Name, Priority, Type};
use rohrpost_network::{Network, Route, Security};
use rohrpost_routers::admission::Admission;
use rohrpost_routers::counts::{Cause, Side};
use rohrpost_routers::fragment::PARTIAL_MAX;
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::inbound::{self, Datagram, Inbound};
use rohrpost_routers::outbound::{Accepted, Outbound, OutboundStep, Package};
use rohrpost_routers::report::{Deliver, NotDelivered, Report, RouterEvent};
use rohrpost_routers::settings::{NodeSettings, Settings};
use rohrpost_routers::stats::Stats;
use std::net::{IpAddr, Ipv4Addr};
use std::sync::Arc;

/// Steps of one program.
const STEPS_MAX: usize = 300;
const MS: u64 = 1_000_000;
/// A datagram of the smallest size that there is.
const DATAGRAM_BYTES: usize = 548;

pub(crate) fn run(data: &[u8]) {
    let mut bytes = Bytes(data);
    let mut world = World::new();
    for _ in 0..STEPS_MAX {
        if bytes.is_empty() {
            break;
        }
        world.step(&mut bytes);
        world.check();
    }
}

fn address(node: NodeIndex) -> IpAddr {
    Ipv4Addr::new(10, 0, 0, node).into()
}

fn module(node: NodeIndex) -> Name {
    Name::new(1, 200, node, 0)
}

fn settings(own: NodeIndex, incarnation: u64) -> Settings {
    let other = 1 - own;
    Settings {
        system: 1,
        own,
        nodes: (0..2).map(|node| NodeSettings { name: format!("n{node}"), address: address(node) }).collect(),
        digest: 7,
        incarnation,
        network: Network {
            security: Security::None,
            port: 21117,
            mtu: 576,
            datagram_bytes_max: DATAGRAM_BYTES,
            rate_bytes_s: 1 << 20,
            quota_bytes: 128 << 10,
            bulk_below: 16,
        },
        tdma: None,
        routes: vec![Route { first: module(other), last: module(other).with_local(u8::MAX), node: other }],
        senders: Vec::new(),
        hosts: Vec::new(),
        moving: Default::default(),
        admission: Admission::default(),
        flows: Vec::new(),
        real_time_from: 0,
    }
}

/// A router's events.
#[derive(Default)]
struct Log {
    lost: u64,
    /// Number of each delivered package, and its priority.
    delivered: Vec<(u16, Priority)>,
}

impl Report for Log {
    fn lost(&mut self, _: Option<NodeIndex>, head: &Head, body: &[u8], _: Cause) {
        assert!(body.len() <= usize::from(head.len));
        self.lost += 1;
    }
}

impl Deliver for Log {
    fn deliver(&mut self, from: NodeIndex, head: &Head, body: &[u8]) -> Result<(), NotDelivered> {
        assert_eq!((from, usize::from(head.len)), (0, body.len()));
        if head.id == u16::MAX {
            return Err(NotDelivered::MailboxFull);
        }
        self.delivered.push((head.id, head.priority));
        Ok(())
    }

    fn event(&mut self, _: RouterEvent) {}
}

struct World {
    now_ns: u64,
    sender: (Outbound, Arc<Stats>, Log),
    receiver: (Inbound, Arc<Stats>, Log),
    /// Sent datagrams; they arrive as the program says.
    wire: Vec<Vec<u8>>,
    next_id: u16,
    /// The program made datagrams of its own: then only memory and accounts are checked.
    forged: bool,
}

impl World {
    fn new() -> Self {
        let now_ns = 1000 * MS;
        let (own, other) = (settings(0, 5), settings(1, 6));
        let stats = [Stats::new(&own, now_ns), Stats::new(&other, now_ns)];
        Self {
            now_ns,
            sender: (Outbound::new(&own, stats[0].clone()), stats[0].clone(), Log::default()),
            receiver: (Inbound::new(&other, stats[1].clone()), stats[1].clone(), Log::default()),
            wire: Vec::new(),
            next_id: 0,
            forged: false,
        }
    }

    fn step(&mut self, bytes: &mut Bytes<'_>) {
        match bytes.byte() % 8 {
            0 => self.now_ns += u64::from(bytes.byte()) * 20 * MS,
            1 | 2 => self.send(bytes),
            3 => self.leave(),
            4 => self.arrive(bytes.byte(), false),
            5 => self.arrive(bytes.byte(), true),
            6 => self.damage(bytes),
            _ => self.forge(bytes),
        }
        let mut refusal = [0; 64];
        while let inbound::InboundStep::Refuse { bytes, .. } =
            self.receiver.0.poll(self.now_ns, &mut refusal, &mut self.receiver.2)
        {
            assert!(bytes <= refusal.len());
        }
    }

    fn send(&mut self, bytes: &mut Bytes<'_>) {
        let (priority, len, how) = (bytes.byte(), bytes.half() % 3000, bytes.byte());
        let body = [how; 3000];
        let head = Head {
            to: module(1),
            from: module(0),
            len,
            kind: Type::data(1),
            id: self.next_id,
            priority: Priority(priority & 0xf3),
            ..Head::default()
        };
        self.next_id += 1;
        let package = Package { head, published_ns: self.now_ns, body: &body[..len.into()] };
        if let Accepted::Send { head, .. } =
            self.sender.0.accept(self.now_ns, &package, how & 1 == 0, &mut self.sender.2)
        {
            self.wire.push([&head[..], package.body].concat());
        }
    }

    fn leave(&mut self) {
        let mut datagram = [0; DATAGRAM_BYTES];
        while let OutboundStep::Send { bytes, .. } = self.sender.0.poll(self.now_ns, &mut datagram, &mut self.sender.2)
        {
            self.wire.push(datagram[..bytes].to_vec());
        }
    }

    /// Picks a datagram on the wire, which stays there or not.
    fn arrive(&mut self, which: u8, again: bool) {
        let count = self.wire.len();
        if count > 0 {
            let at = usize::from(which) % count;
            let datagram = if again { self.wire[at].clone() } else { self.wire.remove(at) };
            self.handle(&datagram, 0);
        }
    }

    /// A datagram with some changed bytes; the check detects it.
    fn damage(&mut self, bytes: &mut Bytes<'_>) {
        let Some(mut datagram) = self.wire.pop() else { return };
        let (at, change) = (usize::from(bytes.half()) % datagram.len(), bytes.byte());
        datagram[at] ^= change;
        self.handle(&datagram, 0);
    }

    /// A datagram that no router made, with a valid check.
    fn forge(&mut self, bytes: &mut Bytes<'_>) {
        self.forged = true;
        let (which, source, length) = (bytes.byte(), bytes.byte() % 3, usize::from(bytes.byte()));
        let mut datagram = self.wire.get(usize::from(which)).cloned().unwrap_or_else(|| vec![0; 80]);
        let at = usize::from(bytes.half()) % datagram.len();
        let change = bytes.take(length);
        let end = datagram.len().min(at + change.len());
        datagram[at..end].copy_from_slice(&change[..end - at]);
        if let Some((head, rest)) = datagram.split_first_chunk() {
            let datagram = [&checked(head, rest)[..], rest].concat();
            self.handle(&datagram, source);
        }
    }

    fn handle(&mut self, bytes: &[u8], source: NodeIndex) {
        let datagram = Datagram { source: address(source), arrived_ns: self.now_ns, bytes };
        self.receiver.0.handle(self.now_ns, &datagram, &mut self.receiver.2);
    }

    fn check(&mut self) {
        let sums = |side: &Side| {
            let all = side.classes().map(|(_, class)| (class.packages.get(), class.passed.get(), class.lost_in_all()));
            all.fold((0, 0, 0), |a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2))
        };
        let (_, stats, log) = &self.sender;
        let (packages, passed, lost) = sums(&stats.out);
        assert_eq!((packages, log.lost), (passed + lost + stats.waiting_in_all(), lost), "outgoing");
        assert!(stats.waiting_bytes.get() <= 128 << 10);
        let (inbound, stats, log) = &self.receiver;
        let (packages, passed, lost) = sums(&stats.inn);
        assert_eq!((packages, log.lost), (passed + lost + inbound.partial(), lost), "incoming");
        assert!(inbound.partial() <= PARTIAL_MAX as u64);
        if !self.forged {
            let mut last = [None; 256];
            for (id, priority) in &log.delivered {
                let before = last[usize::from(priority.0)].replace(*id);
                assert!(before < Some(*id), "once, and in order");
            }
        }
    }
}
