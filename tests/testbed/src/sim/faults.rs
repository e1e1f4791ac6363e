//! Faults of a simulated network: how they begin, and how they end.

use super::chance::Chance;
use super::clock::Now;
use super::fault::Fault;
use super::host::DATA_MAILBOXES;
use super::package::Role;
use super::packages::{ROUTER_CLASS, digest};
use super::plan::{SYSTEM, fixed, incarnation};
use super::seals::altered;
use super::spans::MS;
use super::station::{Arrived, Origin, Port};
use super::ticking;
use super::world::{Event, World};
use rohrpost_mailbox::{Head, Name, Priority, Type, local};
use rohrpost_routers::admission::{PACKET, TUNNEL};
use rohrpost_routers::frame::{self, Alive, FrameHead, FrameKind, Refusal, RefusalReason};
use rohrpost_routers::security::Port as RouterPort;
use std::rc::Rc;

/// The last that a router could send.
const SEQUENCE_MAX: u64 = (1 << 48) - 1;

/// A datagram that no router sent.
fn made(port: Port, source: Option<usize>, bytes: Rc<[u8]>) -> Arrived {
    Arrived { port, source, bytes, stamp: Now::default(), origin: Origin::Made }
}

impl World<'_> {
    pub(super) fn begin(&mut self, index: usize) {
        let fault = self.plan.faults[index].fault;
        self.trace.line(self.now_ns, || format!("begins: {fault:?}"));
        self.lease_suffers(&fault, 1);
        match fault {
            Fault::Death { node } => {
                self.oracle.saw("node killed");
                self.kill_launch(node);
                self.kill(node);
            }
            Fault::Unready { node } => self.change_unready(node, |unready| *unready += 1),
            Fault::Freeze { node, whole } => {
                self.oracle.saw("frozen");
                self.stations[node].frozen += 1;
                self.stations[node].asleep += u32::from(whole);
            }
            Fault::Restart { node } => {
                self.oracle.saw("router killed");
                self.kill(node);
            }
            Fault::Sleep { node, .. } => {
                self.oracle.saw("asleep");
                self.stations[node].frozen += 1;
                self.stations[node].asleep += 1;
                self.stations[node].sleeps += 1;
            }
            Fault::Slew { node, slewed_ppb } => {
                self.oracle.saw("slewed");
                self.slew(node, slewed_ppb);
            }
            Fault::Edited { node, edition } => {
                self.oracle.saw("edited");
                self.edit(node, edition);
            }
            Fault::Cut { from, to } => {
                self.oracle.saw("cut");
                self.links[from][to].cuts += 1;
            }
            Fault::Split { side } => {
                self.oracle.saw("split");
                self.split(side, |cuts| *cuts += 1);
            }
            Fault::Bad { from, to, quality } => {
                self.oracle.saw("bad link");
                self.links[from][to].quality = quality;
            }
            Fault::Echo { to, delay_ns } => {
                self.oracle.saw("echoed");
                self.stations[to].echo_ns = Some(delay_ns);
            }
            Fault::Absent { node, module } => self.mailboxes(node, module, |mailbox| mailbox.absent += 1),
            Fault::Full { node, module } => self.mailboxes(node, module, |mailbox| mailbox.full += 1),
            Fault::ModuleRestart { node, module } => {
                self.oracle.saw("module killed");
                let dies = self.chance.percent(70);
                self.serve_or_die(node, module, dies);
                if let Some(server) = self.servers.get_mut(&module) {
                    server.dead += 1;
                }
            }
            Fault::Unsendable { node } => self.stations[node].host.unsendable += 1,
            Fault::Step { node, by_ns } => {
                self.oracle.saw("clock stepped");
                self.stations[node].clock.step_realtime(by_ns);
            }
            Fault::Foreign { to, count } => {
                for _ in 0..count {
                    let bytes = self.foreign(to);
                    let known = self.chance.percent(70).then(|| self.chance.below(self.stations.len() as u64) as usize);
                    let at_ns = self.now_ns + self.chance.below(100 * MS);
                    let port = usize::from(self.chance.percent(20));
                    let arrived = made(port, known, bytes);
                    self.at(at_ns, Event::Arrive { to, arrived });
                }
            }
            Fault::Parts { from, to, count } => self.send_hostile(from, to, count),
            Fault::Intruder { node, count } => (0..count).for_each(|_| self.intrude(node)),
            Fault::Forged { from, to, count } => {
                self.oracle.saw("forged");
                for _ in 0..count {
                    let bytes = self.forged(from, to);
                    let arrived = made(0, Some(from), bytes);
                    let at_ns = self.now_ns + self.chance.below(50 * MS);
                    self.at(at_ns, Event::Arrive { to, arrived });
                }
            }
            Fault::Stray { from, to, count } => {
                self.oracle.saw("strayed");
                let first = self.chance.pick(&[RouterPort::Rest, RouterPort::Replicas]).first_sequence();
                let first = first + self.chance.below(1 << 20);
                let life = self.stations[from].router.as_ref().map_or(0, |router| router.life);
                let its = incarnation(self.plan.seed, life);
                for sequence in first..first + count {
                    let arrived = made(0, Some(from), self.alive((from, to), its, sequence, 0));
                    let at_ns = self.now_ns + self.chance.below(50 * MS);
                    self.at(at_ns, Event::Arrive { to, arrived });
                }
            }
            Fault::Replay { to, count } => {
                for _ in 0..count.min(self.old.len() as u64) {
                    let (receiver, life, arrived) = self.chance.pick_ref(&self.old).clone();
                    // To the router that it was for, mostly. One that began since cannot tell it from a new datagram:
                    // that the wire keeps nothing for long is relied on.
                    let is_same = self.stations[receiver].router.as_ref().is_some_and(|router| router.life == life);
                    let to = if is_same && self.chance.percent(80) { receiver } else { to };
                    if to == receiver && !is_same && !self.plan.sealed {
                        continue;
                    }
                    let alters = self.plan.sealed && self.chance.percent(50);
                    let bytes = if alters { altered(&arrived.bytes, &mut self.chance) } else { arrived.bytes.clone() };
                    // From an address that is not its sender's.
                    let strays = arrived.port == ticking::PORT && self.chance.percent(30);
                    let nodes = self.stations.len();
                    let source = arrived.source.map(|node| if strays { (node + 1) % nodes } else { node });
                    let origin = if alters || strays || to != receiver { Origin::Made } else { arrived.origin };
                    let arrived = Arrived { bytes, source, origin, ..arrived };
                    let at_ns = self.now_ns + self.chance.below(100 * MS);
                    let life = (to == receiver && !self.plan.sealed).then_some(life);
                    self.at(at_ns, Event::Again { to, life, arrived });
                }
            }
        }
    }

    pub(super) fn end(&mut self, index: usize) {
        let fault = self.plan.faults[index].fault;
        self.trace.line(self.now_ns, || format!("is over: {fault:?}"));
        self.lease_suffers(&fault, -1);
        match fault {
            Fault::Death { node } => {
                self.start_launch(node);
                self.at(self.now_ns, Event::Start { node });
            }
            Fault::Unready { node } => self.change_unready(node, |unready| *unready -= 1),
            Fault::Freeze { node, whole } => {
                self.stations[node].frozen -= 1;
                self.stations[node].asleep -= u32::from(whole);
                if self.stations[node].runs() {
                    self.catch_up(node);
                }
            }
            Fault::Restart { node } => self.at(self.now_ns, Event::Start { node }),
            Fault::Sleep { node, wrong_ns } => {
                let slept_ns = self.now_ns - self.plan.faults[index].from_ns;
                self.stations[node].clock.wakes(self.now_ns, slept_ns, wrong_ns);
                self.oracle.times.changes(&self.stations[node].clock, node);
                self.stations[node].frozen -= 1;
                self.stations[node].asleep -= 1;
                self.stations[node].sleeps -= 1;
                if self.stations[node].runs() {
                    self.catch_up(node);
                }
            }
            Fault::Slew { node, .. } => self.slew(node, 0),
            Fault::Edited { node, .. } => self.edit(node, 0),
            Fault::Cut { from, to } => self.links[from][to].cuts -= 1,
            Fault::Split { side } => self.split(side, |cuts| *cuts -= 1),
            Fault::Bad { from, to, .. } => self.links[from][to].quality = self.plan.quality,
            Fault::Absent { node, module } => self.mailboxes(node, module, |mailbox| mailbox.absent -= 1),
            Fault::Full { node, module } => self.mailboxes(node, module, |mailbox| mailbox.full -= 1),
            Fault::ModuleRestart { node, module } => self.restart_module(node, module),
            Fault::Unsendable { node } => self.stations[node].host.unsendable -= 1,
            Fault::Echo { to, .. } => self.stations[to].echo_ns = None,
            Fault::Step { .. } | Fault::Foreign { .. } | Fault::Forged { .. } | Fault::Replay { .. } => {}
            Fault::Intruder { .. } | Fault::Parts { .. } | Fault::Stray { .. } => {}
        }
    }

    /// Leases are as they should be only a while after a fault; while a node is dead, another one holds them.
    fn lease_suffers(&mut self, fault: &Fault, change: i32) {
        let change = if matches!(fault, Fault::Death { .. } | Fault::Unready { .. }) { 0 } else { change };
        self.leases.as_mut().into_iter().for_each(|leases| leases.goes_wrong(self.now_ns, change));
    }

    fn slew(&mut self, node: usize, slewed_ppb: i64) {
        self.stations[node].clock.slew(self.now_ns, slewed_ppb);
        self.oracle.times.changes(&self.stations[node].clock, node);
    }

    /// A router is started anew, from another file.
    fn edit(&mut self, node: usize, edition: usize) {
        self.kill(node);
        self.stations[node].edition = edition;
        let at_ns = self.now_ns + self.chance.between(MS, 50 * MS);
        self.at(at_ns, Event::Start { node });
    }

    /// After the last fault all links are as good as they get.
    pub(super) fn fix(&mut self) {
        self.trace.line(self.now_ns, || "all faults are over".into());
        let quality = fixed(self.plan.quality);
        self.links.iter_mut().flatten().for_each(|link| link.quality = quality);
        let clear_ns = self.plan.clear_ns();
        self.leases.as_mut().into_iter().for_each(|leases| leases.goes_wrong(clear_ns, 0));
    }

    fn split(&mut self, side: u64, change: impl Fn(&mut u32)) {
        for (from, links) in self.links.iter_mut().enumerate() {
            for (to, link) in links.iter_mut().enumerate() {
                if side >> from & 1 != side >> to & 1 {
                    change(&mut link.cuts);
                }
            }
        }
    }

    fn mailboxes(&mut self, node: usize, module: rohrpost_mailbox::Name, change: impl Fn(&mut super::host::Mailbox)) {
        for local in local::COMMANDS..local::DATA + DATA_MAILBOXES {
            if let Some(mailbox) = self.stations[node].host.boxes.get_mut(&module.with_local(local)) {
                change(mailbox);
            }
        }
    }

    /// A package of a hostile program.
    fn intrude(&mut self, node: usize) {
        let nodes = self.stations.len();
        let [to, third] = [1, 2].map(|further| (node + further) % nodes);
        let module = |of: usize, chance: &mut Chance| chance.pick(&self.plan.nodes[of].modules);
        let router = |of: usize, local| Name::new(SYSTEM, ROUTER_CLASS.0, of as u8, local);
        let chance = &mut self.chance;
        let (own, others) = (module(node, chance), module(third, chance));
        let data = module(to, chance).with_local(local::DATA + chance.below(DATA_MAILBOXES.into()) as u8);
        let (from, to) = match chance.below(6) {
            0 => (own, data),
            1 => (own, data.with_local(local::REPLIES)),
            2 => (others, data),
            3 => (own, router(to, local::TRANSIT)),
            4 => (own, router(to, TUNNEL)),
            _ => (router(node, TUNNEL), router(to, TUNNEL)),
        };
        let kind = if to.local() == local::REPLIES { Type::reply(16) } else { PACKET };
        let len = chance.between(8, 200) as u16;
        let priority = Priority(chance.pick(&[0, 100, u8::MAX]));
        self.oracle.saw("intruder");
        self.post(node, Head { to, from, len, kind, priority, ..Head::default() }, Role::Intruder);
    }

    /// Something that a router could have sent, if it had been started anew, had sent far more than it has, or had
    /// another configuration.
    fn forged(&mut self, from: usize, to: usize) -> Rc<[u8]> {
        let life = self.stations[from].router.as_ref().map_or(0, |router| router.life);
        let chance = &mut self.chance;
        if chance.percent(30) {
            let head = FrameHead {
                kind: FrameKind::Refusal,
                system: SYSTEM,
                from: from as u8,
                to: to as u8,
                digest: chance.bits(),
                incarnation: chance.bits() | 1,
                sequence: 0,
            };
            let reason = chance.pick(&[
                RefusalReason::Version,
                RefusalReason::Stranger,
                RefusalReason::Sealed,
                RefusalReason::Key,
            ]);
            let rest = Refusal { version: frame::VERSION, reason, digest: head.digest }.to_bytes();
            return Rc::from([&head.to_bytes(&[&rest])[..], &rest].concat());
        }
        let is_of_incarnation = chance.percent(50);
        // Far from all that is sent in these seconds.
        let any = chance.between(1 << 32, SEQUENCE_MAX);
        let sequence = chance.pick(&[SEQUENCE_MAX, SEQUENCE_MAX / 2, any]);
        let incarnation = if is_of_incarnation { incarnation(self.plan.seed, life) } else { chance.bits() | 1 };
        let sequence = if is_of_incarnation { sequence } else { chance.below(1 << 20) };
        let heard_incarnation = chance.bits();
        self.alive((from, to), incarnation, sequence, heard_incarnation)
    }

    /// "Still there", from a node to a node.
    fn alive(&self, (from, to): (usize, usize), incarnation: u64, sequence: u64, heard_incarnation: u64) -> Rc<[u8]> {
        let head = FrameHead {
            kind: FrameKind::Alive,
            system: SYSTEM,
            from: from as u8,
            to: to as u8,
            digest: digest(self.stations[to].edition),
            incarnation,
            sequence,
        };
        let rest = Alive { heard_incarnation, ..Alive::default() }.to_bytes();
        Rc::from([&head.to_bytes(&[&rest])[..], &rest].concat())
    }

    /// Something that no router of this installation sends: noise, or a frame of another version, installation or
    /// system.
    fn foreign(&mut self, to: usize) -> Rc<[u8]> {
        let chance = &mut self.chance;
        let mut noise = vec![0; chance.below(200) as usize];
        chance.fill(&mut noise);
        if chance.percent(30) {
            return Rc::from(noise);
        }
        let from = chance.below(self.stations.len() as u64) as u8;
        let rest = if chance.percent(50) { Alive::default().to_bytes().to_vec() } else { noise };
        let head = FrameHead {
            kind: chance.pick(&[
                FrameKind::Packages,
                FrameKind::Fragment,
                FrameKind::Alive,
                FrameKind::Refusal,
                FrameKind::Sync,
                FrameKind::Reply,
            ]),
            system: if chance.percent(20) { 9 } else { SYSTEM },
            from: if chance.percent(20) { chance.below(256) as u8 } else { from },
            to: if chance.percent(20) { chance.below(256) as u8 } else { to as u8 },
            // Never the right one.
            digest: chance.bits() | 1 << 63,
            incarnation: chance.bits() | 1,
            sequence: chance.below(1 << 20),
        };
        let mut bytes = head.to_bytes(&[&rest]).to_vec();
        bytes.extend_from_slice(&rest);
        Rc::from(bytes)
    }
}
