//! A network of simulated computers in virtual time: events in their order, datagrams on their links, layers called as
//! their threads would be.
//!
//! Here: what a world is made of, and the loop over its events. What happens at them is in `routers` and `carrying`,
//! and beside in `sim/faults` and `sim/modules`.

mod carrying;
mod event;
mod routers;

pub(super) use event::Event;

use super::calls::{Calls, NewGuard, Server};
use super::chance::Chance;
use super::clock::{Clock, Now};
use super::events::Events;
use super::host::DATA_MAILBOXES;
use super::leases::Leases;
use super::link::Link;
use super::oracle::Oracle;
use super::plan::Plan;
use super::promise::Problem;
use super::replicas::{RecordBooks, Rings, Streams};
use super::spans::{MS, S};
use super::station::{Arrived, Layer, Sent, Station};
use super::ticking;
use super::times::Left;
use super::times::Times;
use super::trace::Trace;
use super::wire::Wire;
use rohrpost_mailbox::{Name, local};
use std::collections::BTreeMap;
use std::rc::Rc;

/// Makes the layers of a router that begins to live: node, which edition of the configuration it has, incarnation, its
/// clocks, what its page of system time says.
pub(crate) type NewLayers<'a> = Box<dyn FnMut(usize, usize, u32, Now, Left) -> Vec<Box<dyn Layer>> + 'a>;

pub(crate) struct World<'a> {
    pub(crate) plan: Rc<Plan>,
    pub(super) now_ns: u64,
    events: Events<Event>,
    pub(super) chance: Chance,
    pub(crate) stations: Vec<Station>,
    /// From, to.
    pub(super) links: Vec<Vec<Link>>,
    pub(super) servers: BTreeMap<Name, Server>,
    pub(super) sequences: Vec<u32>,
    pub(crate) oracle: Oracle,
    /// The modules that write streams, and those that read them.
    pub(super) streams: Streams,
    pub(crate) calls: Calls,
    /// Of a module with several nodes, if there is one.
    pub(super) leases: Option<Leases>,
    pub(crate) trace: Trace,
    new_layers: NewLayers<'a>,
    lives: u32,
    /// The incarnation of each node's router.
    living: Vec<u32>,
    /// Datagrams that routers had, of which some come again: receiver, its incarnation.
    pub(super) old: Vec<(usize, u32, Arrived)>,
    sent: Vec<Sent>,
}

/// Between two looks at all, ns.
const LOOK_NS: u64 = 50 * MS;
/// Datagrams that are kept to come again.
const OLD_MAX: usize = 64;

impl<'a> World<'a> {
    /// A network as planned. `rings`: of its nodes; `layers` makes routers, `guard` makes what lets commands run.
    pub(crate) fn new(plan: Rc<Plan>, guard: NewGuard, rings: &Rc<Rings>, layers: NewLayers<'a>, trace: bool) -> Self {
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
        let mut oracle = Oracle::new(plan.shape.bulk_below);
        (oracle.is_sealed, oracle.records) = (plan.sealed, RecordBooks::new(&plan.streams));
        oracle.times = Times::new(stations.iter().map(|station| station.clock.clone()).collect());
        (oracle.wire, oracle.well_ns) = (Wire::new(count), plan.well_ns());
        let mut world = Self {
            now_ns: 0,
            events: Events::default(),
            stations,
            links: vec![vec![Link::new(plan.quality); count]; count],
            servers,
            sequences: vec![1; count],
            oracle,
            streams: Streams::new(&plan, rings),
            calls: Calls::default(),
            leases: plan.leases.as_ref().map(Leases::new),
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
        self.at(plan.fixed_ns, Event::Fixed);
        for (flow, its) in plan.flows.iter().enumerate() {
            let later_ns = if plan.moment_of(its).is_some() { 0 } else { self.chance.below(its.period_ns) };
            let at_ns = plan.traffic_begin_ns + later_ns;
            self.at(at_ns, Event::Flow { flow });
        }
        for (caller, its) in plan.calls.iter().enumerate() {
            let at_ns = self.chance.below(its.period_ns);
            self.at(at_ns, Event::Call { caller });
        }
        self.at(0, Event::SnapshotRequest);
        self.schedule_streams();
        self.schedule_leases();
    }

    pub(super) fn at(&mut self, at_ns: u64, event: Event) {
        self.events.push(at_ns, event);
    }

    pub(crate) fn now(&self, node: usize) -> Now {
        self.stations[node].clock.at(self.now_ns)
    }

    /// Runs to the end, or to the first broken promise.
    pub(crate) fn run(&mut self) -> &[Problem] {
        while let Some((at_ns, event)) = self.events.pop() {
            if at_ns > self.plan.end_ns || !self.oracle.problems.is_empty() {
                break;
            }
            self.now_ns = at_ns;
            self.happen(event);
        }
        if self.oracle.problems.is_empty() {
            self.look();
            self.close();
        }
        &self.oracle.problems
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
                // A stamp wakes the thread of a clock; that of time slots is woken by time alone.
                if self.plan.slots.is_none() && self.stations[node].runs() {
                    self.poll(node);
                }
            }
            Event::Start { node } => self.start(node),
            Event::Begin { fault } => self.begin(fault),
            Event::End { fault } => self.end(fault),
            Event::Fixed => self.fix(),
            Event::Flow { flow } => self.flow(flow),
            Event::Write { stream } => self.write(stream),
            Event::Read { reader } => self.read(reader),
            Event::Call { caller } => self.call(caller),
            Event::Try { call } => self.try_call(call),
            Event::Serve { node, module } => self.serve(node, module),
            Event::Launch { node } => self.wake_launch(node),
            Event::Publish { node, run } => self.publish(node, run),
            Event::SnapshotRequest => {
                self.look();
                self.at(self.now_ns + LOOK_NS, Event::SnapshotRequest);
            }
        }
    }

    fn look(&mut self) {
        for node in 0..self.stations.len() {
            self.wander(node);
            let now = self.now(node);
            // Nothing runs there.
            if self.stations[node].sleeps > 0 {
                continue;
            }
            self.oracle.times.read(now, node, &mut self.oracle.problems);
            let Some(life) = self.stations[node].router.as_ref().map(|router| router.life) else { continue };
            let well = self.now_ns >= self.oracle.well_ns;
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
        self.oracle.times.clocks[node] = station.clock.clone();
    }
}
