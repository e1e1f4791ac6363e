//! The layer that carries packages: `Outbound` and `Inbound`, called as the threads of the shell call them, and watched.

use super::book::{Promise, Role};
use super::host::{Closed, Parcel, TRANSIT_AGE_MAX_NS};
use super::plan::{Plan, SYSTEM};
use super::station::{Arrived, Io, Layer, Port, Sent};
use crate::fragment::PARTIAL_MAX;
use crate::frame::{Frame, NodeIndex};
use crate::inbound::{self, Datagram, Inbound, WINDOW};
use crate::link::State;
use crate::outbound::{Accepted, Outbound, Output, Package};
use crate::report::{Deliver, Event, NotDelivered, Report};
use crate::settings::{NodeSettings, Settings};
use crate::stats::{Cause, Side, Stats};
use rohrpost_config::{Network, Route};
use rohrpost_mailbox::{Head, Kind, Options, Type};
use std::net::{IpAddr, Ipv4Addr};
use std::rc::Rc;
use std::sync::Arc;

/// The socket of packages.
pub const PORT: Port = 0;
/// Of the configuration.
pub(super) const DIGEST: u64 = 0x1234_5678;
/// A body that a router, when it dies, may have in its hand.
const IN_HAND_BYTES_MAX: u16 = 400;
/// An address that no node has.
const STRANGER: IpAddr = IpAddr::V4(Ipv4Addr::new(10, 77, 255, 254));

/// Address of a node.
pub fn address(node: usize) -> IpAddr {
    IpAddr::V4(Ipv4Addr::new(10, 77, 0, node as u8 + 1))
}

/// What one life of a router is configured with.
pub fn settings(plan: &Plan, node: usize, incarnation: u64) -> Settings {
    let others = plan.nodes.iter().enumerate().filter(|(other, _)| *other != node);
    let mut routes: Vec<Route> = others
        .flat_map(|(index, other)| other.modules.iter().map(move |module| (index, *module)))
        .map(|(index, module)| Route { first: module, last: module.with_local(u8::MAX), node: index as NodeIndex })
        .collect();
    routes.sort_unstable_by_key(|route| route.first);
    let nodes = (0..plan.nodes.len()).map(|index| NodeSettings { name: format!("n{index}"), address: address(index) });
    Settings {
        system: SYSTEM,
        own: node as NodeIndex,
        nodes: nodes.collect(),
        digest: DIGEST,
        incarnation,
        network: Network {
            datagram_bytes_max: plan.shape.datagram_bytes_max,
            rate_bytes_s: plan.shape.rate_bytes_s,
            quota_bytes: plan.shape.quota_bytes,
            bulk_below: plan.shape.bulk_below,
            port: 21117,
            mtu: u16::MAX,
        },
        routes,
        senders: plan.nodes[node].modules.iter().map(|module| vec![*module]).collect(),
    }
}

/// One life of a router's packages.
pub struct Packages {
    stats: Arc<Stats>,
    outbound: Outbound,
    inbound: Inbound,
    buffer: Vec<u8>,
    /// Bytes that the queue may take up.
    queue_bytes_max: u64,
    /// Taken last from the transit mailbox.
    in_hand: Option<Parcel>,
    /// Losses when all began to be well.
    lost_before: Option<(u64, u64)>,
    /// Commands that could not be delivered here; their callers are to be told.
    undelivered: Vec<Head>,
}

impl Packages {
    /// A life that begins now.
    pub fn new(settings: &Settings, now_ns: u64) -> Self {
        let stats = Stats::new(settings, now_ns);
        Self {
            outbound: Outbound::new(settings, stats.clone()),
            inbound: Inbound::new(settings, stats.clone()),
            buffer: vec![0; settings.network.datagram_bytes_max.max(1500)],
            queue_bytes_max: (settings.network.quota_bytes as u64 + 1024) * (settings.senders.len() as u64 + 1),
            in_hand: None,
            lost_before: None,
            undelivered: Vec::new(),
            stats,
        }
    }

    /// Takes all that waits in the transit mailbox.
    fn take_in(&mut self, io: &mut Io<'_>) {
        while let Some(parcel) = io.host.transit.take() {
            if io.now.monotonic_ns.saturating_sub(parcel.published_ns) > TRANSIT_AGE_MAX_NS {
                io.book.saw("too old in the transit mailbox");
                continue;
            }
            io.book.accepted(io.life, parcel.number);
            io.book.saw("accepted");
            let alone = io.host.transit.is_empty();
            self.accept(io, parcel.head, parcel.published_ns, &parcel.body, alone);
            self.in_hand = Some(parcel);
        }
    }

    fn accept(&mut self, io: &mut Io<'_>, head: Head, published_ns: u64, body: &[u8], alone: bool) {
        let package = Package { head, published_ns, body };
        let mut watch = Watch { io, is_out: true, undelivered: &mut self.undelivered };
        if let Accepted::Send { to, head } =
            self.outbound.accept(watch.io.now.monotonic_ns, &package, alone, &mut watch)
        {
            io.book.saw("sent at once");
            self.send(io, to, Rc::from([&head, body].concat()));
        }
    }

    fn send(&mut self, io: &mut Io<'_>, to: NodeIndex, bytes: Rc<[u8]>) {
        if io.host.unsendable > 0 && io.chance.percent(50) {
            let mut watch = Watch { io, is_out: true, undelivered: &mut self.undelivered };
            return self.outbound.unsent(&bytes, &[], &mut watch);
        }
        io.book.leaves(io.now, io.life, &bytes);
        io.line(|| format!("sends {} bytes to {to}: {}", bytes.len(), shown(&bytes)));
        io.sent.push(Sent { port: PORT, to: to.into(), bytes });
    }

    /// Tells callers on other nodes of commands that were not delivered here.
    fn answer(&mut self, io: &mut Io<'_>) {
        for command in std::mem::take(&mut self.undelivered) {
            let Some(number) = io.book.number(&command) else { continue };
            let package = &io.book.packages[number as usize];
            let (Role::Command { call, .. }, to_node) = (package.role, package.from_node) else { continue };
            let head = Head {
                to: command.from,
                from: command.to,
                len: 16,
                kind: Type(-command.kind.0),
                id: 0,
                priority: command.priority,
                options: Options::ERROR,
            };
            let role = Role::Report { call };
            let (number, head, body) = io.book.post(io.now, head, (io.node, to_node.into()), role);
            io.book.accepted(io.life, number);
            io.book.saw("told a caller on another node");
            self.accept(io, head, io.now.monotonic_ns, &body, false);
        }
    }

    fn counted(&self, source: Option<usize>) -> (u64, u64, u64) {
        let Some(peer) = source.map(|node| self.stats.peer(node as NodeIndex)) else {
            return (0, 0, self.stats.foreign.get());
        };
        let received = &peer.received;
        let dropped = received.old.get() + received.damaged.get() + received.refused.get() + self.stats.foreign.get();
        (received.datagrams.get(), received.copies.get(), dropped)
    }

    fn check_accounts(&self, io: &mut Io<'_>) {
        let account = io.book.account(io.life);
        let waiting = self.stats.waiting_in_all();
        if account.accepted != account.left + account.lost + waiting {
            let text = format!("{account:?}, and {waiting} packages wait in router {} of node {}", io.life, io.node);
            io.book.broken(io.now, Promise::Accounts, text);
        }
        let (out, inn) = (Sums::of(&self.stats.out), Sums::of(&self.stats.inn));
        if out != (Sums { packages: account.accepted, passed: account.left, lost: account.lost }) {
            io.book.broken(io.now, Promise::Accounts, format!("the router counts {out:?}, but did {account:?}"));
        }
        let partial = inn.packages.wrapping_sub(inn.passed + inn.lost);
        let most = PARTIAL_MAX as u64 * self.stats.waiting.len() as u64;
        if partial > most {
            io.book.broken(io.now, Promise::Bounded, format!("{partial} packages are being put together: {inn:?}"));
        }
        let used = self.stats.waiting_bytes.get();
        if used > self.queue_bytes_max {
            let text = format!("the queue takes up {used} bytes, {} at most", self.queue_bytes_max);
            io.book.broken(io.now, Promise::Bounded, text);
        }
    }

    fn check_well(&mut self, io: &mut Io<'_>) {
        for node in (0..io.nodes).filter(|node| *node != io.node) {
            let state = self.stats.state(node as NodeIndex, io.now.monotonic_ns);
            if state != State::Alive {
                io.book.broken(io.now, Promise::Recovery, format!("for node {}, node {node} is {state:?}", io.node));
            }
        }
        let lost = (Sums::of(&self.stats.out).lost, Sums::of(&self.stats.inn).lost);
        if *self.lost_before.get_or_insert(lost) != lost {
            let text = format!("node {} lost packages: {:?}, then {lost:?}", io.node, self.lost_before);
            io.book.broken(io.now, Promise::Recovery, text);
        }
    }
}

impl Layer for Packages {
    fn handle(&mut self, io: &mut Io<'_>, arrived: &Arrived) {
        let source = arrived.source.filter(|node| *node != io.node);
        let before = self.counted(source);
        let ended_before = io.book.delivered_or_lost;
        let datagram = Datagram {
            source: arrived.source.map_or(STRANGER, address),
            arrived_ns: arrived.stamp.monotonic_ns,
            bytes: &arrived.bytes,
        };
        let mut watch = Watch { io, is_out: false, undelivered: &mut self.undelivered };
        self.inbound.handle(watch.io.now.monotonic_ns, &datagram, &mut watch);
        let after = self.counted(source);
        let (taken, copies, dropped) = (after.0 - before.0, after.1 - before.1, after.2 - before.2);
        io.line(|| format!("from {source:?}: {}, taken {taken}, copies {copies}", shown(&arrived.bytes)));
        let is_refusal = matches!(Frame::parse(&arrived.bytes), Ok((_, Frame::Refusal(_))));
        if taken + copies + dropped != 1 && !is_refusal {
            let text = format!("a datagram was counted as {taken} taken, {copies} copies, {dropped} dropped");
            io.book.broken(io.now, Promise::Accounts, text);
        }
        if taken > 0 {
            io.book.took(io.now, io.life, &arrived.bytes);
        } else if copies > 0 {
            io.book.saw("dropped as a copy");
            io.book.dropped_as_copy(io.now, io.life, &arrived.bytes, WINDOW);
        } else {
            io.book.saw("dropped as wrong or old");
            if io.book.delivered_or_lost != ended_before && !arrived.damaged {
                io.book.saw("given up since a new life came");
            }
        }
        self.answer(io);
    }

    fn left(&mut self, _: &mut Io<'_>, _: u64, _: super::clock::Now) {}

    fn poll(&mut self, io: &mut Io<'_>) -> u64 {
        self.take_in(io);
        let mut until_ns = u64::MAX;
        loop {
            let mut watch = Watch { io, is_out: false, undelivered: &mut self.undelivered };
            match self.inbound.poll(watch.io.now.monotonic_ns, &mut self.buffer, &mut watch) {
                inbound::Output::Refuse { to, bytes } => {
                    let node = (0..io.nodes).find(|node| address(*node) == to);
                    if let Some(to) = node {
                        io.book.saw("refused");
                        io.sent.push(Sent { port: PORT, to, bytes: Rc::from(&self.buffer[..bytes]) });
                    }
                }
                inbound::Output::Wait { until_ns: then_ns } => {
                    until_ns = until_ns.min(then_ns);
                    break;
                }
            }
        }
        self.answer(io);
        loop {
            let mut watch = Watch { io, is_out: true, undelivered: &mut self.undelivered };
            match self.outbound.poll(watch.io.now.monotonic_ns, &mut self.buffer, &mut watch) {
                Output::Send { to, bytes } => {
                    let bytes = Rc::from(&self.buffer[..bytes]);
                    self.send(io, to, bytes);
                }
                Output::Wait { until_ns: then_ns } => return until_ns.min(then_ns),
            }
        }
    }

    fn dies(&mut self, io: &mut Io<'_>) {
        self.check_accounts(io);
        let in_hand = self.in_hand.take().filter(|parcel| parcel.head.len <= IN_HAND_BYTES_MAX);
        if let Some(parcel) = in_hand.filter(|parcel| !parcel.head.options.has(Options::REDELIVERED))
            && io.chance.percent(50)
        {
            io.book.saw("in the hand of a router that died");
            io.host.transit.put_back(parcel);
        }
    }

    fn check(&mut self, io: &mut Io<'_>, well: bool) {
        self.check_accounts(io);
        if well {
            self.check_well(io);
        }
    }

    fn close(&mut self, io: &mut Io<'_>) {
        io.book.close(io.now, io.life);
    }
}

/// What all classes of one direction counted.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
struct Sums {
    packages: u64,
    passed: u64,
    lost: u64,
}

impl Sums {
    fn of(side: &Side) -> Self {
        side.classes().fold(Self::default(), |sums, (_, class)| Self {
            packages: sums.packages + class.packages.get(),
            passed: sums.passed + class.passed.get(),
            lost: sums.lost + class.lost_in_all(),
        })
    }
}

/// Takes what the cores tell of.
struct Watch<'a, 'b> {
    io: &'a mut Io<'b>,
    is_out: bool,
    undelivered: &'a mut Vec<Head>,
}

impl Report for Watch<'_, '_> {
    fn lost(&mut self, peer: Option<NodeIndex>, head: &Head, _body: &[u8], cause: Cause) {
        let io = &mut *self.io;
        io.book.saw(cause.word());
        io.line(|| format!("{}: from or to {peer:?}, {head:?}", cause.word()));
        let number = if self.is_out {
            io.book.lost_before(io.now, io.life, head)
        } else {
            io.book.lost_behind(io.now, io.life, head)
        };
        // One that was handed out before may have been delivered then: nobody knows.
        let is_known = matches!(head.kind.kind(), Kind::Command(_)) && !head.options.has(Options::REDELIVERED);
        match number {
            Some(number) if self.is_out && is_known => io.host.returned.push(number),
            Some(_) if is_known => self.undelivered.push(*head),
            _ => {}
        }
    }
}

impl Deliver for Watch<'_, '_> {
    fn deliver(&mut self, from: NodeIndex, head: &Head, body: &[u8]) -> Result<(), NotDelivered> {
        let io = &mut *self.io;
        let Some(number) = io.book.arrives(io.now, io.node, head, body) else { return Ok(()) };
        let taken = io.host.deliver(head.to, number);
        io.line(|| format!("delivers {number} from {from}: {taken:?}"));
        taken.map_err(|closed| match closed {
            Closed::Absent => NotDelivered::NoMailbox,
            Closed::Full => NotDelivered::MailboxFull,
        })?;
        io.book.saw("delivered");
        io.book.delivered(io.now, io.life, number, head.options.has(Options::REDELIVERED));
        Ok(())
    }

    fn event(&mut self, event: Event) {
        self.io.line(|| format!("{event:?}"));
    }
}

fn shown(datagram: &[u8]) -> String {
    match Frame::parse(datagram) {
        Ok((head, frame)) => {
            let numbers = match frame {
                Frame::Packages(packages) => {
                    packages.filter_map(|(_, body)| super::book::number_of(body)).map(|n| format!(" {n}")).collect()
                }
                Frame::Fragment(part) => format!(" part {} of {} of {}", part.index, part.count, part.first),
                _ => String::new(),
            };
            format!("{:?} {} of {:x}{numbers}", head.kind, head.sequence, head.incarnation)
        }
        Err(error) => error.to_string(),
    }
}
