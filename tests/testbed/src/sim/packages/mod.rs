//! The layer that carries packages: `Outbound` and `Inbound`, called as the threads of the shell call them, and
//! watched.
//!
//! Here: what a router does as packages come. What differs with time slots is in `slotted`, what must hold in `checks`.

mod checks;
mod settings;
mod slotted;
mod watch;

pub(super) use settings::{ROUTER_CLASS, digest};
pub use settings::{address, settings};
pub(super) use slotted::Hands;
use watch::still_fresh;

use super::clock::Now;
use super::host::{Parcel, TRANSIT_AGE_MAX_NS};
use super::package::Role;
use super::promise::Promise;
use super::seals::{PackageSeals, checked, incarnation, opened, sealed};
use super::station::{Arrived, Io, Layer, Port, Sent};
use rohrpost_mailbox::{Head, Options, Type};
use rohrpost_routers::driver::NotSent;
use rohrpost_routers::frame::{Frame, FrameHead, FrameKind, HEAD_BYTES, NodeIndex};
use rohrpost_routers::inbound::{self, Datagram, Inbound};
use rohrpost_routers::intake::hurries;
use rohrpost_routers::outbound::{Accepted, Outbound, OutboundStep, Package};
use rohrpost_routers::security::{HELLO_DATAGRAM_BYTES, PeerSessions, Said, TAG_BYTES};
use rohrpost_routers::settings::Settings;
use rohrpost_routers::stats::Stats;
use std::collections::VecDeque;
use std::net::{IpAddr, Ipv4Addr};
use std::rc::Rc;
use std::sync::Arc;
use watch::{Came, Watch};

/// The socket of packages.
pub const PORT: Port = 0;
/// A router that did nothing for so long stood still: threads do not wake that late.
const STILL_NS: u64 = 400_000_000;
/// The thread that receives looks around so often, if nothing comes.
const LISTEN_NS: u64 = 100_000_000;
/// A body that a router, when it dies, may have in its hand.
const IN_HAND_BYTES_MAX: u16 = 400;
/// An address that no node has.
const STRANGER: IpAddr = IpAddr::V4(Ipv4Addr::new(10, 77, 255, 254));

/// One incarnation of a router's packages.
pub struct Packages {
    settings: Settings,
    stats: Arc<Stats>,
    outbound: Outbound,
    inbound: Inbound,
    buffer: Vec<u8>,
    /// Bytes that the queue may take up.
    queue_bytes_max: u64,
    /// Taken last from the transit mailbox.
    in_hand: Option<Parcel>,
    /// Since when it runs without standing still, and when it ran last.
    steady_since_ns: u64,
    polled_ns: u64,
    /// When each peer was heard last, or the router began.
    heard_ns: Vec<u64>,
    /// Since when each is heard without being silent: what it says of us is waited for from then on.
    present_since_ns: Vec<u64>,
    /// Losses when all began to be well.
    lost_before: Option<(u64, u64)>,
    /// What the receiving half wants to be sent.
    refusals: VecDeque<Sent>,
    seals: Option<PackageSeals>,
    /// With time slots: when the datagram was made that has not been handed over yet.
    made: Option<Now>,
    /// A datagram waits for the next slot that has left the queue, since then, ns.
    held_since_ns: Option<u64>,
    /// Commands that could not be delivered here; their callers are to be told.
    undelivered: Vec<Head>,
}

impl Packages {
    /// What it counts.
    pub fn stats(&self) -> &Stats {
        &self.stats
    }

    /// An incarnation that begins now.
    pub fn new(settings: &Settings, now_ns: u64) -> Self {
        let stats = Stats::new(settings, now_ns);
        Self {
            outbound: Outbound::new(settings, stats.clone()),
            inbound: Inbound::new(settings, stats.clone()),
            buffer: vec![0; settings.network.datagram_bytes_max.max(1500)],
            queue_bytes_max: (settings.network.quota_bytes as u64 + 1024) * (settings.senders.len() as u64 + 1),
            in_hand: None,
            lost_before: None,
            refusals: VecDeque::new(),
            seals: None,
            undelivered: Vec::new(),
            made: None,
            held_since_ns: None,
            steady_since_ns: now_ns,
            polled_ns: now_ns,
            heard_ns: vec![now_ns; settings.nodes.len()],
            present_since_ns: vec![now_ns; settings.nodes.len()],
            settings: settings.clone(),
            stats,
        }
    }

    /// The same, sealing what it sends.
    pub(super) fn sealed(self, all: &Arc<PeerSessions>, incarnation: u64) -> Self {
        let seals = Some(PackageSeals::new(all, incarnation));
        Self { outbound: self.outbound.sealed(all.clone()), seals, ..self }
    }

    /// Takes all that waits in the transit mailbox.
    fn take_in(&mut self, io: &mut Io<'_>) {
        while self.take_one(io).is_some() {}
    }

    /// Takes the most important package from the transit mailbox.
    fn take_one(&mut self, io: &mut Io<'_>) -> Option<(Head, Accepted)> {
        let parcel = loop {
            let parcel = io.host.transit.take()?;
            if io.now.monotonic_ns.saturating_sub(parcel.published_ns) <= TRANSIT_AGE_MAX_NS {
                break parcel;
            }
            io.oracle.saw("too old in the transit mailbox");
        };
        io.oracle.accepted(io.life, parcel.number, parcel.published_ns);
        io.oracle.saw("accepted");
        let to = self.settings.node_of(parcel.head.to);
        if let (Some(seals), Some(to)) = (&self.seals, to)
            && !seals.knows(to)
        {
            io.oracle.held(parcel.number);
        }
        let alone = io.host.transit.is_empty() && io.plan.slots.is_none();
        let does_harm = io.oracle.packages[parcel.number as usize].role == Role::Intruder;
        let package = Package { head: parcel.head, published_ns: parcel.published_ns, body: &parcel.body };
        let accepted = self.accept(io, &package, alone, does_harm);
        io.oracle.queued(io.now, io.life, parcel.number, self.settings.network.quota_bytes);
        let head = parcel.head;
        self.in_hand = Some(parcel);
        Some((head, accepted))
    }

    /// `does_harm`: the router of an intruder lets its program write any priority.
    fn accept(&mut self, io: &mut Io<'_>, package: &Package<'_>, alone: bool, does_harm: bool) -> Accepted {
        let mut watch = Watch::out(io, &mut self.undelivered);
        let now_ns = watch.io.now.monotonic_ns;
        let accepted = if does_harm {
            self.outbound.accept_capped(now_ns, package, alone, &mut watch)
        } else {
            self.outbound.accept(now_ns, package, alone, &mut watch)
        };
        if let Accepted::Send { to, head } = &accepted {
            io.oracle.saw("sent at once");
            self.send(io, *to, Rc::from([&head[..], package.body].concat()));
        }
        accepted
    }

    fn send(&mut self, io: &mut Io<'_>, to: NodeIndex, bytes: Rc<[u8]>) {
        if self.hand_over(io, to, &bytes).is_err() {
            let mut watch = Watch::out(io, &mut self.undelivered);
            self.outbound.unsent(&bytes, &[], &mut watch);
        }
    }

    /// Hands a datagram to the kernel, sealed if it is to be.
    fn hand_over(&mut self, io: &mut Io<'_>, to: NodeIndex, bytes: &[u8]) -> Result<(), NotSent> {
        if io.host.unsendable > 0 && io.chance.percent(50) {
            return Err(NotSent);
        }
        let (sealed, bytes) = match &mut self.seals {
            None => (Rc::from(bytes), Rc::from(bytes)),
            Some(seals) => (sealed(&mut seals.sealing, bytes).ok_or(NotSent)?, checked(bytes)),
        };
        match self.held_since_ns.take() {
            None => self.leaves(io, &bytes),
            Some(since_ns) => still_fresh(io, since_ns),
        }
        io.line(|| format!("sends {} bytes to {to}: {}", bytes.len(), shown(&bytes)));
        io.sent.push(Sent { port: PORT, to: to.into(), bytes: sealed, handed: io.now });
        Ok(())
    }

    /// A datagram leaves the queue; with time slots when it is made, however long the thread stands still with it.
    fn leaves(&mut self, io: &mut Io<'_>, bytes: &[u8]) {
        let now = self.made.take().unwrap_or(io.now);
        io.oracle.leaves(now, io.life, bytes);
        if io.plan.slots.is_some() {
            let reaches = |to| self.seals.as_ref().is_none_or(|seals| seals.knows(to));
            // Of those that hurry more than they may, only a few are taken before a datagram.
            let first = io.host.transit.first().filter(|first| !hurries(&first.head));
            let first = first.filter(|first| self.settings.node_of(first.head.to).is_some_and(reaches));
            let behind = first.map(|first| first.number);
            io.oracle.is_strict(now, io.life, bytes, behind, reaches);
        } else {
            io.oracle.paces(now, io.life, bytes, &io.plan.shape, self.settings.overhead_bytes());
        }
    }

    /// Asks whoever is not known.
    fn ask(&mut self, io: &mut Io<'_>) {
        let Some(seals) = &mut self.seals else { return };
        while let Some(said) = seals.gate.ask(io.now.monotonic_ns, &self.stats, &mut self.buffer) {
            io.oracle.saw("asked");
            let to_say = &self.buffer[..said.bytes];
            say(io, seals, &mut self.refusals, said, to_say);
        }
    }

    /// Takes a datagram; what was in it, if that could be read.
    fn take(&mut self, io: &mut Io<'_>, arrived: &Arrived) -> Rc<[u8]> {
        let now_ns = io.now.monotonic_ns;
        let (source, arrived_ns) = (arrived.source.map_or(STRANGER, address), arrived.stamp.monotonic_ns);
        let came = Some(Came { at_ns: arrived_ns, incarnation: incarnation(&arrived.bytes) });
        let is_young = self.stats.is_young(now_ns);
        let mut watch = Watch { io, came, is_out: false, is_young, undelivered: &mut self.undelivered };
        let Some(seals) = &mut self.seals else {
            self.inbound.handle(now_ns, &Datagram { source, arrived_ns, bytes: &arrived.bytes }, &mut watch);
            return arrived.bytes.clone();
        };
        let came = inbound::Envelope { source, arrived_ns, bytes: arrived.bytes.len() };
        let (mut bytes, mut reply) = (arrived.bytes.to_vec(), [0; HELLO_DATAGRAM_BYTES]);
        let inbound = &mut self.inbound;
        if let Some(said) = seals.gate.take(now_ns, &came, &mut bytes, inbound, &mut watch, &mut reply) {
            say(io, seals, &mut self.refusals, said, &reply[..said.bytes]);
        }
        seals.gate.begin(now_ns);
        if bytes.len() < HEAD_BYTES + TAG_BYTES { arrived.bytes.clone() } else { opened(&bytes) }
    }

    /// Tells callers on other nodes of commands that were not delivered here.
    fn answer_callers(&mut self, io: &mut Io<'_>) {
        for command in std::mem::take(&mut self.undelivered) {
            let Some(number) = io.oracle.number(&command) else { continue };
            let package = &io.oracle.packages[number as usize];
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
            let (number, head, body) = io.oracle.post(io.now, head, (io.node, to_node.into()), role);
            io.oracle.accepted(io.life, number, io.now.monotonic_ns);
            io.oracle.saw("told a caller on another node");
            let package = Package { head, published_ns: io.now.monotonic_ns, body: &body };
            self.accept(io, &package, false, false);
        }
    }

    /// Does what is due of the receiving half, and writes the refusals that it wants to be sent; when to ask again.
    fn poll_inbound(&mut self, io: &mut Io<'_>) -> u64 {
        if io.now.monotonic_ns > self.polled_ns + STILL_NS {
            self.steady_since_ns = io.now.monotonic_ns;
        }
        self.polled_ns = io.now.monotonic_ns;
        let is_young = self.stats.is_young(io.now.monotonic_ns);
        self.ask(io);
        let ask_ns = if self.seals.is_some() { io.now.monotonic_ns + LISTEN_NS } else { u64::MAX };
        loop {
            let mut watch = Watch { io, came: None, is_out: false, is_young, undelivered: &mut self.undelivered };
            match self.inbound.poll(watch.io.now.monotonic_ns, &mut self.buffer, &mut watch) {
                inbound::InboundStep::Refuse { to, bytes } => {
                    let node = (0..io.plan.nodes.len()).find(|node| address(*node) == to);
                    if let Some(to) = node {
                        io.oracle.saw("refused");
                        let bytes = Rc::from(&self.buffer[..bytes]);
                        self.refusals.push_back(Sent { port: PORT, to, bytes, handed: Now::default() });
                    }
                }
                inbound::InboundStep::Wait { until_ns } => return until_ns.min(ask_ns),
            }
        }
    }

    fn counted(&self, source: Option<usize>) -> (u64, u64, u64) {
        let Some(peer) = source.map(|node| self.stats.peer(node as NodeIndex)) else {
            let rejected = self.seals.as_ref().map_or(0, |seals| seals.rejected(None));
            return (0, 0, self.stats.foreign.get() + rejected);
        };
        let rejected = self.seals.as_ref().map_or(0, |seals| seals.rejected(source.map(|node| node as NodeIndex)));
        let received = &peer.received;
        let dropped =
            rejected + received.old.get() + received.damaged.get() + received.refused.get() + self.stats.foreign.get();
        (received.datagrams.get(), received.duplicates.get(), dropped)
    }
}

impl Layer for Packages {
    fn handle(&mut self, io: &mut Io<'_>, arrived: &Arrived) {
        let source = arrived.source.filter(|node| *node != io.node);
        let before = self.counted(source);
        let clear = self.take(io, arrived);
        let after = self.counted(source);
        let (taken, copies, dropped) = (after.0 - before.0, after.1 - before.1, after.2 - before.2);
        io.line(|| format!("from {source:?}: {}, taken {taken}, copies {copies}", shown(&clear)));
        let kind = FrameHead::read(&arrived.bytes).ok().map(|(head, _)| head.kind);
        let is_answer = match self.seals {
            None => kind == Some(FrameKind::Refusal),
            Some(_) => kind == Some(FrameKind::Hello),
        };
        if taken + copies + dropped != 1 && !(is_answer && taken + copies + dropped == 0) {
            let text = format!("a datagram was counted as {taken} taken, {copies} copies, {dropped} dropped");
            io.oracle.broken(io.now, Promise::Accounts, text);
        }
        if taken > 0 {
            let first = self.seals.as_ref().map(|seals| seals.first(&clear));
            io.oracle.took(io.now, io.life, (&clear, first), self.settings.digest);
            self.hears(io, source);
        } else if copies > 0 {
            io.oracle.saw("dropped as a copy");
            io.oracle.dropped_as_copy(io.now, io.life, &arrived.bytes);
        } else if dropped > 0 && self.seals.is_some() {
            io.oracle.saw("rejected");
        } else {
            io.oracle.saw("dropped as wrong or old");
        }
        self.answer_callers(io);
    }

    fn left(&mut self, _: &mut Io<'_>, _: Port, _: u64, _: Now) {}

    fn poll(&mut self, io: &mut Io<'_>) -> u64 {
        self.take_in(io);
        let until_ns = self.poll_inbound(io);
        io.sent.extend(self.refusals.drain(..));
        self.answer_callers(io);
        loop {
            let mut watch = Watch::out(io, &mut self.undelivered);
            match self.outbound.poll(watch.io.now.monotonic_ns, &mut self.buffer, &mut watch) {
                OutboundStep::Send { to, bytes } => {
                    let bytes = Rc::from(&self.buffer[..bytes]);
                    self.send(io, to, bytes);
                }
                OutboundStep::Wait { until_ns: then_ns } => return until_ns.min(then_ns),
            }
        }
    }

    fn dies(&mut self, io: &mut Io<'_>) {
        self.check_accounts(io);
        let in_hand = self.in_hand.take().filter(|parcel| parcel.head.len <= IN_HAND_BYTES_MAX);
        if let Some(parcel) = in_hand.filter(|parcel| !parcel.head.options.has(Options::REDELIVERED))
            && io.chance.percent(50)
        {
            io.oracle.saw("in the hand of a router that died");
            io.host.transit.put_back(parcel);
        }
    }

    fn check(&mut self, io: &mut Io<'_>, well: bool) {
        self.check_accounts(io);
        self.check_links(io);
        if well {
            self.check_well(io);
        }
    }

    fn close(&mut self, io: &mut Io<'_>) {
        io.oracle.close_receipts(io.now, io.life);
        self.check_losses(io);
    }
}

fn shown(datagram: &[u8]) -> String {
    match Frame::parse(datagram) {
        Ok((head, frame)) => {
            let numbers = match frame {
                Frame::Packages(packages) => {
                    packages.filter_map(|(_, body)| super::oracle::number_of(body)).map(|n| format!(" {n}")).collect()
                }
                Frame::Fragment(part) => format!(" part {} of {} of {}", part.index, part.count, part.first),
                _ => String::new(),
            };
            format!("{:?} {} of {:x}{numbers}", head.kind, head.sequence, head.incarnation)
        }
        Err(error) => error.to_string(),
    }
}

/// Says a hello, or has it wait for a slot.
fn say(io: &Io<'_>, seals: &mut PackageSeals, line: &mut VecDeque<Sent>, said: Said, datagram: &[u8]) {
    if io.plan.slots.is_none() {
        let bytes = Rc::from(datagram);
        return line.push_back(Sent { port: PORT, to: said.to.into(), bytes, handed: Now::default() });
    }
    let PackageSeals { gate, waiting, .. } = seals;
    gate.waits(said, || {
        waiting.put(io.now.monotonic_ns, said, datagram);
        true
    });
}
