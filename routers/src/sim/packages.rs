//! The layer that carries packages: `Outbound` and `Inbound`, called as the threads of the shell call them, and watched.

use super::book::{Promise, Role};
use super::clock::Now;
use super::host::{Closed, Parcel, TRANSIT_AGE_MAX_NS, TRANSIT_SLOTS};
use super::plan::{Plan, SYSTEM};
use super::seals::{PackageSeals, checked, incarnation, opened, sealed};
use super::station::{Arrived, Io, Layer, Port, Sent};
use crate::access::Access;
use crate::fragment::PARTIAL_MAX;
use crate::frame::{Frame, FrameHead, HEAD_BYTES, Kind as FrameKind, NodeIndex};
use crate::inbound::{self, Datagram, Inbound, SOCKET_MAX_NS, TICK_EVERY_NS};
use crate::intake::{Intake, Transit};
use crate::link::{SILENT_AFTER_NS, State, TELL_EVERY_NS, UNHEARD_AFTER_NS};
use crate::outbound::{Accepted, Outbound, Output, Package};
use crate::report::{Deliver, Event, NotDelivered, Report};
use crate::security::{Acquaintances, HELLO_DATAGRAM_BYTES, HELLO_SLOT_BYTES, Said, TAG_BYTES};
use crate::settings::{NodeSettings, Settings};
use crate::stats::{Cause, Side, Stats};
use crate::tdma::Permit;
use rohrpost_config::{Network, Route, Security};
use rohrpost_mailbox::{Head, Kind, Options, Priority, Type};
use std::collections::VecDeque;
use std::net::{IpAddr, Ipv4Addr};
use std::rc::Rc;
use std::sync::Arc;

/// The socket of packages.
pub const PORT: Port = 0;
/// Of the configuration.
pub(super) const DIGEST: u64 = 0x1234_5678;
/// A router that did nothing for so long stood still: threads do not wake that late.
const STILL_NS: u64 = 400_000_000;
/// So long after a datagram came what went before it, and is missing, is counted as lost: at the third tick.
const SETTLED_NS: u64 = 3 * TICK_EVERY_NS + STILL_NS;
/// The thread that receives looks around so often, if nothing comes.
const LISTEN_NS: u64 = 100_000_000;
/// A body that a router, when it dies, may have in its hand.
const IN_HAND_BYTES_MAX: u16 = 400;
/// An address that no node has.
const STRANGER: IpAddr = IpAddr::V4(Ipv4Addr::new(10, 77, 255, 254));

/// Says a hello, or has it wait for a slot.
fn say(io: &Io<'_>, seals: &mut PackageSeals, line: &mut VecDeque<Sent>, said: Said, datagram: &[u8]) {
    if io.plan.slots.is_none() {
        return line.push_back(Sent { port: PORT, to: said.to.into(), bytes: Rc::from(datagram) });
    }
    let PackageSeals { gate, waiting, .. } = seals;
    gate.waits(said, || {
        waiting.put(io.now.monotonic_ns, said, datagram);
        true
    });
}

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
            security: if plan.sealed { Security::Keys } else { Security::None },
            datagram_bytes_max: plan.shape.datagram_bytes_max,
            rate_bytes_s: plan.shape.rate_bytes_s,
            quota_bytes: plan.shape.quota_bytes,
            bulk_below: plan.shape.bulk_below,
            port: 21117,
            mtu: u16::MAX,
        },
        tdma: plan.slots.as_ref().map(|slots| slots.table.clone()),
        routes,
        senders: plan.nodes[node].modules.iter().map(|module| vec![*module]).collect(),
        access: Access::default(),
        flows: Vec::new(),
    }
}

/// One life of a router's packages.
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
    /// Commands that could not be delivered here; their callers are to be told.
    undelivered: Vec<Head>,
}

impl Packages {
    /// What it counts.
    pub fn stats(&self) -> &Stats {
        &self.stats
    }

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
            refusals: VecDeque::new(),
            seals: None,
            undelivered: Vec::new(),
            steady_since_ns: now_ns,
            polled_ns: now_ns,
            heard_ns: vec![now_ns; settings.nodes.len()],
            present_since_ns: vec![now_ns; settings.nodes.len()],
            settings: settings.clone(),
            stats,
        }
    }

    /// The same, sealing what it sends.
    pub(super) fn sealed(self, all: &Arc<Acquaintances>, incarnation: u64) -> Self {
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
            io.book.saw("too old in the transit mailbox");
        };
        io.book.accepted(io.life, parcel.number, parcel.published_ns);
        io.book.saw("accepted");
        let to = self.settings.node_of(parcel.head.to);
        if let (Some(seals), Some(to)) = (&self.seals, to)
            && !seals.knows(to)
        {
            io.book.held(parcel.number);
        }
        let alone = io.host.transit.is_empty() && io.plan.slots.is_none();
        let accepted = self.accept(io, parcel.head, parcel.published_ns, &parcel.body, alone);
        io.book.queued(io.now, io.life, parcel.number, self.settings.network.quota_bytes);
        let head = parcel.head;
        self.in_hand = Some(parcel);
        Some((head, accepted))
    }

    fn accept(&mut self, io: &mut Io<'_>, head: Head, published_ns: u64, body: &[u8], alone: bool) -> Accepted {
        let package = Package { head, published_ns, body };
        let mut watch = Watch { io, came: None, is_out: true, is_young: false, undelivered: &mut self.undelivered };
        let accepted = self.outbound.accept(watch.io.now.monotonic_ns, &package, alone, &mut watch);
        if let Accepted::Send { to, head } = &accepted {
            io.book.saw("sent at once");
            self.send(io, *to, Rc::from([&head[..], body].concat()));
        }
        accepted
    }

    fn send(&mut self, io: &mut Io<'_>, to: NodeIndex, bytes: Rc<[u8]>) {
        if io.host.unsendable > 0 && io.chance.percent(50) {
            let mut watch = Watch { io, came: None, is_out: true, is_young: false, undelivered: &mut self.undelivered };
            return self.outbound.unsent(&bytes, &[], &mut watch);
        }
        let sealed = match &mut self.seals {
            None => Some(bytes.clone()),
            Some(seals) => sealed(&mut seals.sealing, &bytes),
        };
        let bytes = if self.seals.is_some() { checked(&bytes) } else { bytes };
        let Some(sealed) = sealed else {
            let mut watch = Watch { io, came: None, is_out: true, is_young: false, undelivered: &mut self.undelivered };
            return self.outbound.unsent(&bytes, &[], &mut watch);
        };
        io.book.leaves(io.now, io.life, &bytes);
        if io.plan.slots.is_some() {
            let reaches = |to| self.seals.as_ref().is_none_or(|seals| seals.knows(to));
            io.book.is_strict(io.now, io.life, &bytes, reaches);
        } else {
            io.book.paces(io.now, io.life, &bytes, &io.plan.shape, self.settings.overhead_bytes());
        }
        io.line(|| format!("sends {} bytes to {to}: {}", bytes.len(), shown(&bytes)));
        io.sent.push(Sent { port: PORT, to: to.into(), bytes: sealed });
    }

    /// Asks whoever is not known.
    fn ask(&mut self, io: &mut Io<'_>) {
        let Some(seals) = &mut self.seals else { return };
        while let Some(said) = seals.gate.ask(io.now.monotonic_ns, &self.stats, &mut self.buffer) {
            io.book.saw("asked");
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
        let came = inbound::Came { source, arrived_ns, bytes: arrived.bytes.len() };
        let (mut bytes, mut reply) = (arrived.bytes.to_vec(), [0; HELLO_DATAGRAM_BYTES]);
        let inbound = &mut self.inbound;
        if let Some(said) = seals.gate.take(now_ns, &came, &mut bytes, inbound, &mut watch, &mut reply) {
            say(io, seals, &mut self.refusals, said, &reply[..said.bytes]);
        }
        seals.gate.begin(now_ns);
        if bytes.len() < HEAD_BYTES + TAG_BYTES { arrived.bytes.clone() } else { opened(&bytes) }
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
            io.book.accepted(io.life, number, io.now.monotonic_ns);
            io.book.saw("told a caller on another node");
            self.accept(io, head, io.now.monotonic_ns, &body, false);
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
                inbound::Output::Refuse { to, bytes } => {
                    let node = (0..io.plan.nodes.len()).find(|node| address(*node) == to);
                    if let Some(to) = node {
                        io.book.saw("refused");
                        self.refusals.push_back(Sent { port: PORT, to, bytes: Rc::from(&self.buffer[..bytes]) });
                    }
                }
                inbound::Output::Wait { until_ns } => return until_ns.min(ask_ns),
            }
        }
    }

    /// With time slots, where all is sealed: sends a hello in one, to this node before others; whether there was any.
    pub(super) fn say_in(&mut self, io: &mut Io<'_>, first: Option<NodeIndex>, permit: &mut Permit) -> bool {
        let (Some(seals), now_ns) = (&mut self.seals, io.now.monotonic_ns) else { return false };
        let fits = permit.carries_hello() && permit.fits(now_ns, HELLO_SLOT_BYTES);
        let Some((said, datagram)) = fits.then(|| seals.waiting.take(now_ns, first)).flatten() else { return false };
        permit.takes(now_ns, HELLO_SLOT_BYTES);
        io.sent.push(Sent { port: PORT, to: said.to.into(), bytes: Rc::from(datagram) });
        seals.waiting.left(said);
        true
    }

    /// With time slots: sends in one what must be said, and then what is most important, as long as it fits.
    pub(super) fn poll_in(&mut self, io: &mut Io<'_>, intake: &mut Intake, permit: &mut Permit) {
        let now_ns = io.now.monotonic_ns;
        while let Some(refusal) = self.refusals.pop_front_if(|refusal| permit.fits(now_ns, refusal.bytes.len())) {
            permit.takes(now_ns, refusal.bytes.len());
            io.sent.push(refusal);
        }
        loop {
            intake.take_on(&mut Hands { packages: self, io });
            let Some(room_bytes) = permit.room_bytes(now_ns) else { break };
            let mut watch = Watch { io, came: None, is_out: true, is_young: false, undelivered: &mut self.undelivered };
            let Some((to, bytes)) = self.outbound.poll_slot(now_ns, room_bytes, &mut self.buffer, &mut watch) else {
                break;
            };
            permit.takes(now_ns, bytes);
            let bytes = Rc::from(&self.buffer[..bytes]);
            self.send(io, to, bytes);
        }
    }

    /// With time slots: does between them what passing time does; when to ask again.
    pub(super) fn tidy(&mut self, io: &mut Io<'_>) -> u64 {
        let until_ns = self.poll_inbound(io);
        self.answer(io);
        let mut watch = Watch { io, came: None, is_out: true, is_young: false, undelivered: &mut self.undelivered };
        self.outbound.tidy(watch.io.now.monotonic_ns, &mut watch);
        until_ns
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
        let most = (PARTIAL_MAX * (io.plan.nodes.len() - 1)) as u64;
        if partial > most {
            io.book.broken(io.now, Promise::Bounded, format!("{partial} packages are being put together: {inn:?}"));
        }
        let used = self.stats.waiting_bytes.get();
        if used > self.queue_bytes_max {
            let text = format!("the queue takes up {used} bytes, {} at most", self.queue_bytes_max);
            io.book.broken(io.now, Promise::Bounded, text);
        }
    }

    /// A datagram of a peer was taken.
    fn hears(&mut self, io: &mut Io<'_>, source: Option<usize>) {
        let Some(peer) = source else { return };
        let before_ns = std::mem::replace(&mut self.heard_ns[peer], io.now.monotonic_ns);
        if io.now.monotonic_ns - before_ns >= SILENT_AFTER_NS {
            self.present_since_ns[peer] = io.now.monotonic_ns;
        }
        let heard = (io.now.true_ns, io.life, io.lives[peer]);
        io.book.heard.insert((io.node, peer), heard);
    }

    /// What this router says of its peers: a silent one is called so, and one that does not hear us.
    fn check_links(&self, io: &mut Io<'_>) {
        let now_ns = io.now.monotonic_ns;
        if now_ns > self.polled_ns + STILL_NS {
            return;
        }
        for peer in (0..io.plan.nodes.len()).filter(|peer| *peer != io.node) {
            let state = self.stats.state(peer as NodeIndex, now_ns);
            let since_ns = |then_ns: u64| now_ns - then_ns.max(self.steady_since_ns);
            let is_there = matches!(state, State::Unknown | State::Alive);
            if is_there && since_ns(self.heard_ns[peer]) > SILENT_AFTER_NS + STILL_NS {
                let text = format!("node {peer} is {state:?} for node {}, which does not hear it", io.node);
                io.book.broken(io.now, Promise::Links, text);
            }
            let (heard_ns, life, own_life) = io.book.heard.get(&(peer, io.node)).copied().unwrap_or_default();
            let goes_on = life == io.lives[peer] && own_life == io.life;
            let doubt_ns = (io.now.true_ns - heard_ns.min(io.now.true_ns)).min(since_ns(self.present_since_ns[peer]));
            if is_there && goes_on && doubt_ns > UNHEARD_AFTER_NS + TELL_EVERY_NS + 2 * STILL_NS {
                let text = format!("node {peer} is {state:?} for node {}, which it does not hear", io.node);
                io.book.broken(io.now, Promise::Links, text);
            }
        }
    }

    /// At the end all losses on the wire are known, but of who came so late that what is missing may still come.
    fn check_losses(&self, io: &mut Io<'_>) {
        let is_settled = |peer: &usize| io.now.monotonic_ns - self.present_since_ns[*peer] > SETTLED_NS;
        for peer in (0..io.plan.nodes.len()).filter(|peer| *peer != io.node).filter(is_settled) {
            let missing = io.book.missing(io.life, peer as NodeIndex);
            let counted = self.stats.peer(peer as NodeIndex).received.missing();
            if missing.is_some_and(|missing| missing != counted) {
                let text =
                    format!("of node {peer} {missing:?} datagrams never came, node {} counts {counted}", io.node);
                io.book.broken(io.now, Promise::Links, text);
            }
        }
    }

    fn check_well(&mut self, io: &mut Io<'_>) {
        for node in (0..io.plan.nodes.len()).filter(|node| *node != io.node) {
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
            io.book.broken(io.now, Promise::Accounts, text);
        }
        if taken > 0 {
            let first = self.seals.as_ref().map(|seals| seals.first(&clear));
            io.book.took(io.now, io.life, (&clear, first), DIGEST);
            self.hears(io, source);
        } else if copies > 0 {
            io.book.saw("dropped as a copy");
            io.book.dropped_as_copy(io.now, io.life, &arrived.bytes);
        } else if dropped > 0 && self.seals.is_some() {
            io.book.saw("rejected");
        } else {
            io.book.saw("dropped as wrong or old");
        }
        self.answer(io);
    }

    fn left(&mut self, _: &mut Io<'_>, _: Port, _: u64, _: Now) {}

    fn poll(&mut self, io: &mut Io<'_>) -> u64 {
        self.take_in(io);
        let until_ns = self.poll_inbound(io);
        io.sent.extend(self.refusals.drain(..));
        self.answer(io);
        loop {
            let mut watch = Watch { io, came: None, is_out: true, is_young: false, undelivered: &mut self.undelivered };
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
        self.check_links(io);
        if well {
            self.check_well(io);
        }
    }

    fn close(&mut self, io: &mut Io<'_>) {
        io.book.close_receipts(io.now, io.life);
        self.check_losses(io);
    }
}

/// What a package goes through when it is taken from the transit mailbox.
pub(super) struct Hands<'a, 'b> {
    pub(super) packages: &'a mut Packages,
    pub(super) io: &'a mut Io<'b>,
}

impl Transit for Hands<'_, '_> {
    fn waits(&mut self) -> (usize, Option<Priority>) {
        self.io.host.transit.waits()
    }

    fn slots(&self) -> usize {
        TRANSIT_SLOTS
    }

    fn has_queued(&self) -> bool {
        self.packages.outbound.waits()
    }

    fn take(&mut self) -> Option<(Head, Accepted)> {
        self.packages.take_one(self.io)
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

/// A datagram that came.
#[derive(Clone, Copy)]
struct Came {
    /// To this computer, ns of its monotonic clock.
    at_ns: u64,
    /// Life of its sender, as it says.
    incarnation: u64,
}

/// Takes what the cores tell of.
struct Watch<'a, 'b> {
    io: &'a mut Io<'b>,
    /// The datagram that is being looked at.
    came: Option<Came>,
    is_out: bool,
    /// The router began so short a time ago that the wire may hold copies of what its last life took.
    is_young: bool,
    undelivered: &'a mut Vec<Head>,
}

impl Report for Watch<'_, '_> {
    fn lost(&mut self, peer: Option<NodeIndex>, head: &Head, _body: &[u8], cause: Cause) {
        let io = &mut *self.io;
        io.book.saw(cause.word());
        io.line(|| format!("{}: from or to {peer:?}, {head:?}", cause.word()));
        let number = if self.is_out {
            io.book.lost_before(io.now, io.life, head, cause)
        } else {
            io.book.lost_behind(io.now, io.life, head)
        };
        // One that was handed out before may have been delivered then; so may the copy that a router finds on the wire when it begins.
        let is_first = !head.options.has(Options::REDELIVERED) && (self.is_out || !self.is_young);
        // Of these the caller's next try comes through, or brings another answer.
        let is_final = !matches!(cause, Cause::Socket | Cause::Late | Cause::Incomplete);
        let is_known = matches!(head.kind.kind(), Kind::Command(_)) && is_first && is_final;
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
        if self.came.is_some_and(|came| io.now.monotonic_ns.saturating_sub(came.at_ns) > SOCKET_MAX_NS) {
            io.book.broken(io.now, Promise::Fresh, format!("package {number} waited in the socket, and is delivered"));
        }
        let incarnation = self.came.map_or(0, |came| came.incarnation);
        io.book.delivered(io.now, (incarnation, io.life), number, head.options.has(Options::REDELIVERED));
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
