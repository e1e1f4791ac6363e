//! A network of simulated computers in virtual time: events in their order, datagrams on their links, layers called as their threads
//! would be.

use super::book::{Book, Problem, Promise};
use super::calls::{Calls, NewGuard, Server};
use super::chance::Chance;
use super::clock::{Clock, Now};
use super::faults::damage;
use super::link::Link;
use super::modules::DATA_MAILBOXES;
use super::plan::{MS, Plan, RECOVERY_NS, S, US};
use super::station::{Arrived, Io, Layer, Port, Router, Sent, Station};
use super::ticking;
use super::times::Times;
use super::trace::Trace;
use super::wire::{LEAD_NS, Wire};
use crate::tdma::LATE_NS;
use rohrpost_mailbox::{Name, TimeRecord, local};
use std::cmp::{Ordering, Reverse};
use std::collections::{BTreeMap, BinaryHeap};
use std::rc::Rc;

/// Makes the layers of a router that begins to live: node, life, its clocks, what its page of system time says.
pub type NewLayers<'a> = Box<dyn FnMut(usize, u32, Now, Option<TimeRecord>) -> Vec<Box<dyn Layer>> + 'a>;

/// What happens.
pub(super) enum Event {
    /// A router has something to do.
    Wake { node: usize },
    /// A datagram comes out of a link.
    Arrive { to: usize, arrived: Arrived },
    /// An old one comes once more; if it is for that life, not to another.
    Again { to: usize, life: Option<u32>, arrived: Arrived },
    /// The kernel says when a datagram left.
    Left { node: usize, life: u32, port: Port, index: u64 },
    /// A router starts if nothing keeps it down.
    Start { node: usize },
    /// A fault of the plan begins.
    Begin { fault: usize },
    /// It is over.
    End { fault: usize },
    /// All faults are over.
    Mended,
    /// The next package of a flow, or the next of its burst.
    Flow { flow: usize },
    /// The next call of a caller.
    Call { caller: usize },
    /// The next try of a call.
    Try { call: usize },
    /// A module takes its next command.
    Serve { node: usize, module: Name },
    /// All is looked at; clocks wander.
    Look,
}

struct Entry {
    at_ns: u64,
    ticket: u64,
    event: Event,
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}
impl Eq for Entry {}
impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        (self.at_ns, self.ticket).cmp(&(other.at_ns, other.ticket))
    }
}

/// One run.
pub struct World<'a> {
    /// What is to happen.
    pub plan: Rc<Plan>,
    pub(super) now_ns: u64,
    events: BinaryHeap<Reverse<Entry>>,
    ticket: u64,
    pub(super) chance: Chance,
    /// The computers.
    pub stations: Vec<Station>,
    /// From, to.
    pub(super) links: Vec<Vec<Link>>,
    pub(super) servers: BTreeMap<Name, Server>,
    pub(super) sequences: Vec<u32>,
    /// The books.
    pub book: Book,
    /// The calls.
    pub calls: Calls,
    /// What is written down.
    pub trace: Trace,
    new_layers: NewLayers<'a>,
    lives: u32,
    /// The life of each node's router.
    living: Vec<u32>,
    /// Datagrams that routers had, of which some come again: receiver, its life.
    pub(super) old: Vec<(usize, u32, Arrived)>,
    sent: Vec<Sent>,
}

/// Between two looks at all, ns.
const LOOK_NS: u64 = 50 * MS;
/// Datagrams that are kept to come again.
const OLD_MAX: usize = 64;

impl<'a> World<'a> {
    /// A network as planned. `layers` makes routers, `guard` those who let commands run.
    pub fn new(plan: Rc<Plan>, guard: NewGuard, layers: NewLayers<'a>, trace: bool) -> Self {
        let mut chance = Chance::new(plan.seed ^ 0x5eed);
        let count = plan.nodes.len();
        let mut stations = Vec::new();
        let mut servers = BTreeMap::new();
        for node in &plan.nodes {
            let mut station = Station::new(Clock::new(node.monotonic_ns, node.realtime_ns, node.rate_ppb));
            station.down = 1;
            for module in &node.modules {
                servers.insert(*module, Server::new(guard, station.clock.at(0)));
                for local in local::COMMANDS..local::DATA + DATA_MAILBOXES {
                    station.host.boxes.insert(module.with_local(local), Default::default());
                }
            }
            stations.push(station);
        }
        let mut book = Book::new(plan.shape.bulk_below);
        book.times = Times::new(stations.iter().map(|station| station.clock.clone()).collect());
        (book.wire, book.well_ns) = (Wire::new(count), plan.mended_ns + RECOVERY_NS);
        let mut world = Self {
            now_ns: 0,
            events: BinaryHeap::new(),
            ticket: 0,
            stations,
            links: vec![vec![Link::new(plan.quality); count]; count],
            servers,
            sequences: vec![1; count],
            book,
            calls: Calls::default(),
            trace: Trace::new(trace),
            new_layers: layers,
            lives: 0,
            living: vec![0; count],
            old: Vec::new(),
            sent: Vec::new(),
            chance: chance.fork(),
            plan: plan.clone(),
        };
        world.schedule(&plan);
        world
    }

    fn schedule(&mut self, plan: &Plan) {
        for (node, its) in plan.nodes.iter().enumerate() {
            self.at(its.boot_ns, Event::Start { node });
        }
        for (fault, its) in plan.faults.iter().enumerate() {
            self.at(its.from_ns, Event::Begin { fault });
            self.at(its.until_ns, Event::End { fault });
        }
        self.at(plan.mended_ns, Event::Mended);
        for (flow, its) in plan.flows.iter().enumerate() {
            let at_ns = plan.traffic_begin_ns + self.chance.below(its.period_ns);
            self.at(at_ns, Event::Flow { flow });
        }
        for (caller, its) in plan.calls.iter().enumerate() {
            let at_ns = self.chance.below(its.period_ns);
            self.at(at_ns, Event::Call { caller });
        }
        self.at(0, Event::Look);
    }

    pub(super) fn at(&mut self, at_ns: u64, event: Event) {
        self.ticket += 1;
        self.events.push(Reverse(Entry { at_ns, ticket: self.ticket, event }));
    }

    /// The clocks of a node.
    pub fn now(&self, node: usize) -> Now {
        self.stations[node].clock.at(self.now_ns)
    }

    /// Runs to the end, or to the first broken promise.
    pub fn run(&mut self) -> &[Problem] {
        while let Some(Reverse(entry)) = self.events.pop() {
            if entry.at_ns > self.plan.end_ns || !self.book.problems.is_empty() {
                break;
            }
            self.now_ns = entry.at_ns;
            self.happen(entry.event);
        }
        if self.book.problems.is_empty() {
            self.look();
            self.close();
        }
        &self.book.problems
    }

    fn happen(&mut self, event: Event) {
        match event {
            Event::Wake { node } if self.stations[node].wake_ns == Some(self.now_ns) => self.wake(node),
            // There was another, earlier one.
            Event::Wake { .. } => {}
            Event::Arrive { to, arrived } => {
                if let Some(delay_ns) = self.stations[to].echo_ns.filter(|_| arrived.port == ticking::PORT) {
                    self.at(self.now_ns + delay_ns, Event::Again { to, life: None, arrived: arrived.clone() });
                }
                self.arrive(to, arrived);
            }
            Event::Again { to, life, arrived } => {
                if life.is_none_or(|life| self.living[to] == life) {
                    self.arrive(to, arrived);
                }
            }
            Event::Left { node, life, port, index } => {
                let stamp = self.now(node);
                self.with_router(node, life, |router, io| {
                    if let Some(layer) = router.layer(port) {
                        layer.left(io, port, index, stamp);
                    }
                });
            }
            Event::Start { node } => self.start(node),
            Event::Begin { fault } => self.begin(fault),
            Event::End { fault } => self.end(fault),
            Event::Mended => self.mend(),
            Event::Flow { flow } => self.flow(flow),
            Event::Call { caller } => self.call(caller),
            Event::Try { call } => self.try_call(call),
            Event::Serve { node, module } => self.serve(node, module),
            Event::Look => {
                self.look();
                self.at(self.now_ns + LOOK_NS, Event::Look);
            }
        }
    }

    /// Lets the layers of a node do something, if that life of its router still runs, and carries away what comes of it.
    pub(super) fn with_router(&mut self, node: usize, life: u32, what: impl FnOnce(&mut Router, &mut Io<'_>)) {
        let station = &mut self.stations[node];
        let now = station.clock.at(self.now_ns);
        let Some(router) = station.router.as_mut().filter(|router| router.life == life) else { return };
        let mut io = Io {
            plan: &self.plan,
            lives: &self.living,
            now,
            node,
            life,
            host: &mut station.host,
            book: &mut self.book,
            chance: &mut self.chance,
            sent: &mut self.sent,
            trace: &mut self.trace,
        };
        what(router, &mut io);
        self.carry(node);
        self.receive(node);
    }

    /// Puts on the wire what a router has sent.
    fn carry(&mut self, node: usize) {
        for Sent { port, to, bytes } in std::mem::take(&mut self.sent) {
            let Some(router) = &mut self.stations[node].router else { return };
            let (life, index) = (router.life, router.sent[port]);
            router.sent[port] += 1;
            let (left_ns, out_ns) = self.transmit(node, bytes.len());
            if port > 0 || self.plan.slots.is_some() {
                self.at(left_ns, Event::Left { node, life, port, index });
            }
            self.pass(node, to, port, bytes, out_ns);
        }
    }

    /// It takes a while from the call to the wire: when a datagram leaves, and when all of it has.
    fn transmit(&mut self, node: usize, bytes: usize) -> (u64, u64) {
        let Some(slots) = &self.plan.slots else {
            let left_ns = self.now_ns + self.chance.between(US, 30 * US);
            return (left_ns, left_ns);
        };
        let book = &mut self.book;
        let at_ns = self.now_ns + self.chance.between(LEAD_NS.0, LEAD_NS.1);
        let sent = book.wire.transmit(node, at_ns, bytes, slots, &mut book.problems);
        let clock = &self.stations[node].clock;
        let local_ns = [self.now_ns, sent.begin_ns, sent.end_ns].map(|true_ns| clock.at(true_ns).monotonic_ns);
        if let Some(text) = book.wire.window(node, bytes, slots, local_ns) {
            book.problems.push(Problem { promise: Promise::InWindow, at_ns: sent.begin_ns, text });
        }
        self.trace.line(self.now_ns, || format!("{node} transmits from {} to {} ns", sent.begin_ns, sent.end_ns));
        (sent.begin_ns, sent.end_ns)
    }

    /// Lets a link do with a datagram what it does.
    fn pass(&mut self, from: usize, to: usize, port: Port, bytes: Rc<[u8]>, out_ns: u64) {
        let passages = self.links[from][to].pass(out_ns, bytes.len(), &mut self.chance);
        if passages[0].is_none() {
            self.trace.line(self.now_ns, || format!("the wire loses {} bytes from {from} to {to}:{port}", bytes.len()));
            self.book.saw("lost on the wire");
        }
        for passage in passages.into_iter().flatten() {
            let mut bytes = bytes.clone();
            if passage.damaged {
                self.book.saw("damaged on the wire");
                if self.plan.checksum {
                    continue;
                }
                bytes = damage(&bytes, &mut self.chance);
            }
            let arrived = Arrived { port, source: Some(from), bytes, stamp: Now::default(), damaged: passage.damaged };
            self.at(passage.at_ns, Event::Arrive { to, arrived });
        }
    }

    /// A datagram is in the kernel of its receiver.
    pub(super) fn arrive(&mut self, to: usize, mut arrived: Arrived) {
        arrived.stamp = self.now(to);
        if !self.stations[to].runs() {
            let is_up = self.stations[to].router.is_some();
            if !is_up || !self.stations[to].keep(arrived) {
                self.book.saw(if is_up { "socket full" } else { "no router" });
            }
            return;
        }
        self.hand_in(to, &arrived);
        self.poll(to);
    }

    fn hand_in(&mut self, node: usize, arrived: &Arrived) {
        let Some(life) = self.stations[node].router.as_ref().map(|router| router.life) else { return };
        if self.chance.below(50) == 0 && arrived.source.is_some() {
            self.old.push((node, life, arrived.clone()));
            if self.old.len() > OLD_MAX {
                let gone = self.chance.below(OLD_MAX as u64) as usize;
                self.old.swap_remove(gone);
            }
        }
        self.with_router(node, life, |router, io| {
            if let Some(layer) = router.layer(arrived.port) {
                layer.handle(io, arrived);
            }
        });
    }

    fn wake(&mut self, node: usize) {
        self.stations[node].wake_ns = None;
        if self.stations[node].runs() {
            self.poll(node);
        }
    }

    /// A router reads its sockets, in whatever order, and does what is due.
    pub(super) fn catch_up(&mut self, node: usize) {
        for port in 0..self.stations[node].sockets.len() {
            while let Some(arrived) = self.stations[node].sockets[port].pop_front() {
                self.hand_in(node, &arrived);
                if self.chance.percent(20) {
                    self.poll(node);
                }
            }
        }
        self.poll(node);
    }

    /// Does what is due in a router that runs.
    pub(super) fn poll(&mut self, node: usize) {
        let Some(life) = self.stations[node].router.as_ref().map(|router| router.life) else { return };
        let mut until_ns = u64::MAX;
        self.with_router(node, life, |router, io| {
            until_ns = router.layers.iter_mut().map(|layer| layer.poll(io)).min().unwrap_or(u64::MAX);
        });
        let late_ns = match &self.plan.slots {
            // Threads wake a little late, and seldom much.
            None if self.chance.below(500) == 0 => self.chance.below(5 * MS),
            None => self.chance.below(60 * US),
            Some(slots) => {
                let station = &mut self.stations[node];
                let has_rested = self.now_ns >= station.late_at_ns + slots.rest_ns();
                let late_ns = slots.late_ns(self.now_ns >= self.plan.mended_ns, has_rested, &mut self.chance);
                station.late_at_ns = if late_ns > LATE_NS { self.now_ns } else { station.late_at_ns };
                late_ns
            }
        };
        let at_ns = self.stations[node].clock.when(until_ns, self.now_ns).max(self.now_ns + 1).saturating_add(late_ns);
        self.wake_at(node, at_ns);
    }

    pub(super) fn wake_at(&mut self, node: usize, at_ns: u64) {
        if at_ns <= self.plan.end_ns
            && self.stations[node].wake_ns.is_none_or(|before| at_ns < before || before <= self.now_ns)
        {
            self.stations[node].wake_ns = Some(at_ns);
            self.at(at_ns, Event::Wake { node });
        }
    }

    fn start(&mut self, node: usize) {
        let station = &mut self.stations[node];
        station.down = station.down.saturating_sub(1);
        if station.down > 0 || station.router.is_some() {
            return;
        }
        self.lives += 1;
        let life = self.lives;
        self.living[node] = life;
        let now = self.now(node);
        let layers = (self.new_layers)(node, life, now, self.book.times.page(node));
        self.stations[node].router = Some(Router { life, layers, sent: Default::default() });
        self.trace.line(self.now_ns, || format!("{node}/{life} the router starts"));
        if self.stations[node].runs() {
            self.poll(node);
        }
    }

    /// A router dies; what it had in its hand comes again, what it had in its memory is gone.
    pub(super) fn kill(&mut self, node: usize) {
        self.stations[node].down += 1;
        let Some(life) = self.stations[node].router.as_ref().map(|router| router.life) else { return };
        self.trace.line(self.now_ns, || format!("{node}/{life} the router dies"));
        self.with_router(node, life, |router, io| router.layers.iter_mut().for_each(|layer| layer.dies(io)));
        self.living[node] = 0;
        let station = &mut self.stations[node];
        station.router = None;
        station.sockets.iter_mut().for_each(|socket| socket.clear());
        station.wake_ns = None;
    }

    fn look(&mut self) {
        for node in 0..self.stations.len() {
            self.wander(node);
            let now = self.now(node);
            self.book.times.read(now, node, &mut self.book.problems);
            let Some(life) = self.stations[node].router.as_ref().map(|router| router.life) else { continue };
            let well = self.now_ns >= self.book.well_ns;
            self.with_router(node, life, |router, io| router.layers.iter_mut().for_each(|layer| layer.check(io, well)));
        }
    }

    /// A clock's rate changes a little.
    fn wander(&mut self, node: usize) {
        let its = &self.plan.nodes[node];
        let step_ppb = its.wander_ppb * LOOK_NS as i64 / S as i64;
        let station = &mut self.stations[node];
        let drift_ppb = station.drift_ppb + self.chance.around(step_ppb.max(1));
        station.drift_ppb = drift_ppb.clamp(-10 * its.wander_ppb, 10 * its.wander_ppb);
        station.clock.set_rate(self.now_ns, its.rate_ppb + station.drift_ppb);
        self.book.times.clocks[node] = station.clock.clone();
    }
}
