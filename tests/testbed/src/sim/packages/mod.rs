//! The layer that carries packages: `Inbound` and `Outbound`, called by the drivers of the shell, and watched.
//!
//! Here: what comes in, and what all drivers use. Without time slots `free` runs the driver; with them `sim/slotted`
//! does, by what is in `slotted`. What the driver that receives has is in `receiving`, what must hold is in `checks`.

mod checks;
mod fate;
mod free;
mod receiving;
mod settings;
mod slotted;
mod watch;

pub(crate) use free::Free;
use receiving::RxSystem;
pub(super) use settings::{ROUTER_CLASS, digest};
pub(crate) use settings::{address, settings};
pub(super) use slotted::TransitAdapter;
use watch::still_fresh;

use super::clock::Now;
use super::host::{Parcel, TRANSIT_AGE_MAX_NS};
use super::package::Role;
use super::promise::Promise;
use super::seals::{PackageSeals, checked, incarnation, opened, sealed};
use super::station::{Arrived, Io, Port, STRANGER, Sent};
use rohrpost_mailbox::{Head, Options, Type};
use rohrpost_routers::driver::{Answer, NotSent, RxDriver};
use rohrpost_routers::frame::{Frame, FrameHead, HEAD_BYTES, NodeIndex};
use rohrpost_routers::inbound::{self, SOCKET_MAX_NS};
use rohrpost_routers::intake::hurries;
use rohrpost_routers::outbound::{Accepted, Outbound, Package};
use rohrpost_routers::report::Report;
use rohrpost_routers::security::{PeerSessions, TAG_BYTES};
use rohrpost_routers::settings::Settings;
use rohrpost_routers::stats::Stats;
use std::collections::VecDeque;
use std::rc::Rc;
use std::sync::Arc;
use watch::{Came, Watch};

/// The socket of packages.
pub(crate) const PORT: Port = 0;
/// A router that did nothing for so long stood still: threads do not wake that late.
const STILL_NS: u64 = 400_000_000;
/// The thread that receives looks around so often, if nothing comes.
const LISTEN_NS: u64 = 100_000_000;
/// Before a datagram, so many packages at most are taken that hurry more than they may.
const FEW: usize = 4;
/// A body that a router, when it dies, may have in its hand.
const IN_HAND_BYTES_MAX: u16 = 400;

/// One incarnation of a router's packages.
pub(crate) struct Packages {
    settings: Settings,
    stats: Arc<Stats>,
    outbound: Outbound,
    receiver: RxDriver,
    /// Bytes that the queue may take up.
    queue_bytes_max: u64,
    /// Packages that hurry more than they may, taken since the last datagram.
    hurried: usize,
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
    /// What the receiving half wants to have sent.
    answers: VecDeque<Answer>,
    seals: Option<PackageSeals>,
    /// The thread that receives has rung the one that sends.
    is_rung: bool,
    /// With time slots: when the datagram was made that has not been handed over yet.
    made: Option<Now>,
    /// A datagram waits for the next slot that has left the queue, since then, ns.
    held_since_ns: Option<u64>,
    /// Commands that could not be delivered here; their callers are to be told.
    undelivered: Vec<Head>,
}

impl Packages {
    pub(crate) fn stats(&self) -> &Stats {
        &self.stats
    }

    pub(super) fn all_stats(&self) -> &Arc<Stats> {
        &self.stats
    }

    /// Its sessions, where datagrams are sealed.
    pub(super) fn peer_sessions(&self) -> Option<&Arc<PeerSessions>> {
        self.seals.as_ref().map(|seals| &seals.all)
    }

    pub(crate) fn new(settings: &Settings, now_ns: u64) -> Self {
        let stats = Stats::new(settings, now_ns);
        Self {
            outbound: Outbound::new(settings, stats.clone()),
            receiver: RxDriver::new(settings, &stats, None),
            queue_bytes_max: (settings.network.quota_bytes as u64 + 1024) * (settings.senders.len() as u64 + 1),
            in_hand: None,
            hurried: 0,
            lost_before: None,
            answers: VecDeque::new(),
            seals: None,
            undelivered: Vec::new(),
            is_rung: false,
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
        let seals = PackageSeals::new(all);
        let receiver = RxDriver::new(&self.settings, &self.stats, Some(seals.gate(incarnation)));
        Self { outbound: self.outbound.sealed(all.clone()), receiver, seals: Some(seals), ..self }
    }

    /// Takes the most important package from the transit mailbox.
    fn take_parcel(&mut self, io: &mut Io<'_>) -> Option<Parcel> {
        let parcel = loop {
            let parcel = io.host.transit.take()?;
            if io.now.monotonic_ns.saturating_sub(parcel.published_ns) <= TRANSIT_AGE_MAX_NS {
                break parcel;
            }
            io.oracle.saw("too old in the transit mailbox");
        };
        io.oracle.accepted(io.life, parcel.number, parcel.published_ns);
        io.oracle.saw("accepted");
        self.hurried += usize::from(hurries(&parcel.head));
        let to = self.settings.node_of(parcel.head.to);
        if let (Some(seals), Some(to)) = (&self.seals, to)
            && !seals.knows(to)
        {
            io.oracle.held(parcel.number);
        }
        Some(parcel)
    }

    /// The router has done with it what it does at once.
    fn took(&mut self, io: &mut Io<'_>, parcel: Parcel) {
        io.oracle.queued(io.now, io.life, parcel.number, self.settings.network.quota_bytes);
        self.in_hand = Some(parcel);
    }

    /// The router of an intruder lets its program write any priority, which no router that ships does.
    fn accept_uncapped(&mut self, io: &mut Io<'_>, parcel: &Parcel) -> Accepted {
        let package = Package { head: parcel.head, published_ns: parcel.published_ns, body: &parcel.body };
        let (now_ns, (outbound, mut report)) = (io.now.monotonic_ns, self.queue(io));
        let accepted = outbound.accept_capped(now_ns, &package, false, &mut report);
        drop(report);
        if let Accepted::Send { to, head } = &accepted
            && self.hand_over(io, *to, &[&head[..], &parcel.body].concat()).is_err()
        {
            let (outbound, mut report) = self.queue(io);
            outbound.unsent(head, &parcel.body, &mut report);
        }
        accepted
    }

    /// The queue, and what takes its reports of losses.
    pub(super) fn queue<'a, 'b>(&'a mut self, io: &'a mut Io<'b>) -> (&'a mut Outbound, impl Report) {
        (&mut self.outbound, Watch::out(io, &mut self.undelivered))
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
        let sealed_to = self.seals.as_ref().and_then(|seals| seals.all.incarnation(to));
        io.sent.push(Sent { port: PORT, to: to.into(), bytes: sealed, handed: io.now, sealed_to });
        Ok(())
    }

    /// A datagram leaves the queue; with time slots when it is made, however long the thread stands still with it.
    fn leaves(&mut self, io: &mut Io<'_>, bytes: &[u8]) {
        let now = self.made.take().unwrap_or(io.now);
        io.oracle.leaves(now, io.life, bytes);
        if io.plan.slots.is_some() {
            let reaches = |to| self.seals.as_ref().is_none_or(|seals| seals.knows(to));
            // Of those that hurry more than they may, only a few are taken before a datagram; what is behind waits.
            let is_held_up = std::mem::take(&mut self.hurried) >= FEW;
            let first = io.host.transit.first().filter(|first| !is_held_up && !hurries(&first.head));
            let first = first.filter(|first| self.settings.node_of(first.head.to).is_some_and(reaches));
            let behind = first.map(|first| first.number);
            io.oracle.is_strict(now, io.life, bytes, behind, reaches);
        } else {
            io.oracle.paces(now, io.life, bytes, &io.plan.shape, self.settings.overhead_bytes());
        }
    }

    /// Takes a datagram; what was in it, if that could be read. None: it is passed over.
    fn take(&mut self, io: &mut Io<'_>, arrived: &Arrived) -> Option<Rc<[u8]>> {
        let now_ns = io.now.monotonic_ns;
        let (source, arrived_ns) = (arrived.source.map_or(STRANGER, address), arrived.stamp.monotonic_ns);
        if self.receiver.passes_over(now_ns.saturating_sub(arrived_ns)) {
            if now_ns.saturating_sub(arrived_ns) <= SOCKET_MAX_NS {
                io.oracle.broken(io.now, Promise::Rejection, format!("what came at {arrived_ns} ns is passed over"));
            }
            return None;
        }
        let is_newest = io.oracle.is_newest(io.life, &arrived.bytes);
        let came = Some(Came { at_ns: arrived_ns, incarnation: incarnation(&arrived.bytes), is_newest });
        let mut bytes = arrived.bytes.to_vec();
        let envelope = inbound::Envelope { source, arrived_ns, bytes: bytes.len() };
        let (receiver, mut system) = self.receiving(io, came);
        receiver.take(&mut system, now_ns, &envelope, &mut bytes);
        let is_clear = self.seals.is_none() || bytes.len() < HEAD_BYTES + TAG_BYTES;
        Some(if is_clear { arrived.bytes.clone() } else { opened(&bytes) })
    }

    /// The driver of the thread that receives, and what it has of the simulated computer.
    fn receiving<'a, 'b>(&'a mut self, io: &'a mut Io<'b>, came: Option<Came>) -> (&'a mut RxDriver, RxSystem<'a, 'b>) {
        let Self { receiver, stats, undelivered, answers, is_rung, .. } = self;
        let is_young = stats.is_young(io.now.monotonic_ns);
        (receiver, RxSystem { io, came, is_young, undelivered, answers, is_rung })
    }

    /// Tells callers on other nodes of commands that were not delivered here, by the router's own mailbox.
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
            io.oracle.saw("told a caller on another node");
            let published_ns = io.now.monotonic_ns;
            if io.host.transit.post(Parcel { number, head, body, published_ns }).is_some() {
                io.oracle.saw("no room in the transit mailbox");
            }
        }
    }

    /// Does what is due of the receiving half; when to ask again.
    fn poll_inbound(&mut self, io: &mut Io<'_>) -> u64 {
        let now_ns = io.now.monotonic_ns;
        if now_ns > self.polled_ns + STILL_NS {
            self.steady_since_ns = now_ns;
        }
        self.polled_ns = now_ns;
        let ask_ns = if self.seals.is_some() { now_ns + LISTEN_NS } else { u64::MAX };
        let (receiver, mut system) = self.receiving(io, None);
        receiver.poll(&mut system, now_ns).min(ask_ns)
    }

    /// From which sequence on the incarnation is heard that said a datagram, as it said when it began.
    fn first_of(&self, datagram: &[u8]) -> Option<u64> {
        let gate = self.receiver.gate()?;
        Some(FrameHead::read(datagram).map_or(0, |(head, _)| gate.first(head.from)))
    }
}

impl Packages {
    pub(super) fn handle(&mut self, io: &mut Io<'_>, arrived: &Arrived) {
        let source = arrived.source.filter(|node| *node != io.node);
        let before = self.counted(source);
        let Some(clear) = self.take(io, arrived) else { return io.oracle.saw("older than its router") };
        self.handled(io, arrived, &clear, &before);
        self.answer_callers(io);
    }

    /// The thread that receives: does what passing time does; when to ask again.
    pub(super) fn receive(&mut self, io: &mut Io<'_>) -> u64 {
        let until_ns = self.poll_inbound(io);
        self.answer_callers(io);
        until_ns
    }

    pub(super) fn dies(&mut self, io: &mut Io<'_>) {
        self.check_accounts(io);
        let in_hand = self.in_hand.take().filter(|parcel| parcel.head.len <= IN_HAND_BYTES_MAX);
        if let Some(parcel) = in_hand.filter(|parcel| !parcel.head.options.has(Options::REDELIVERED))
            && io.chance.percent(50)
        {
            io.oracle.saw("in the hand of a router that died");
            io.host.transit.put_back(parcel);
        }
    }

    /// What must hold at any time.
    pub(super) fn check(&mut self, io: &mut Io<'_>, well: bool) {
        self.check_accounts(io);
        self.check_links(io);
        if well {
            self.check_well(io);
        }
    }

    /// What must hold at the end.
    pub(super) fn close(&mut self, io: &mut Io<'_>) {
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
