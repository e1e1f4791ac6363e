//! Faults of a simulated network: how they begin, and how they end.

use super::chance::Chance;
use super::clock::Now;
use super::modules::DATA_MAILBOXES;
use super::plan::{Fault, MS, mended};
use super::seals::altered;
use super::station::Arrived;
use super::world::{Event, World};
use crate::frame::{Alive, FrameHead, Kind};
use rohrpost_mailbox::local;
use std::rc::Rc;

impl World<'_> {
    pub(super) fn begin(&mut self, index: usize) {
        let fault = self.plan.faults[index].fault;
        self.trace.line(self.now_ns, || format!("begins: {fault:?}"));
        match fault {
            Fault::Freeze { node, whole } => {
                self.book.saw("frozen");
                self.stations[node].frozen += 1;
                self.stations[node].asleep += u32::from(whole);
            }
            Fault::Restart { node } => {
                self.book.saw("router killed");
                self.kill(node);
            }
            Fault::Cut { from, to } => {
                self.book.saw("cut");
                self.links[from][to].cuts += 1;
            }
            Fault::Split { side } => {
                self.book.saw("split");
                self.split(side, |cuts| *cuts += 1);
            }
            Fault::Bad { from, to, quality } => {
                self.book.saw("bad link");
                self.links[from][to].quality = quality;
            }
            Fault::Echo { to, delay_ns } => {
                self.book.saw("echoed");
                self.stations[to].echo_ns = Some(delay_ns);
            }
            Fault::Absent { node, module } => self.mailboxes(node, module, |mailbox| mailbox.absent += 1),
            Fault::Full { node, module } => self.mailboxes(node, module, |mailbox| mailbox.full += 1),
            Fault::ModuleRestart { node, module } => {
                self.book.saw("module killed");
                let dies = self.chance.percent(70);
                self.serve_or_die(node, module, dies);
                if let Some(server) = self.servers.get_mut(&module) {
                    server.dead += 1;
                }
            }
            Fault::Unsendable { node } => self.stations[node].host.unsendable += 1,
            Fault::Step { node, by_ns } => {
                self.book.saw("clock stepped");
                self.stations[node].clock.step_realtime(by_ns);
            }
            Fault::Foreign { to, count } => {
                for _ in 0..count {
                    let bytes = self.foreign(to);
                    let known = self.chance.percent(70).then(|| self.chance.below(self.stations.len() as u64) as usize);
                    let at_ns = self.now_ns + self.chance.below(100 * MS);
                    let port = usize::from(self.chance.percent(20));
                    let arrived = Arrived { port, source: known, bytes, stamp: Now::default(), damaged: false };
                    self.at(at_ns, Event::Arrive { to, arrived });
                }
            }
            Fault::Replay { to, count } => {
                for _ in 0..count.min(self.old.len() as u64) {
                    let (whose, life, arrived) = self.chance.pick_ref(&self.old).clone();
                    // To whom it was for, mostly. A router that began since cannot know it from one that is new: that the wire keeps
                    // nothing for long is relied on.
                    let is_same = self.stations[whose].router.as_ref().is_some_and(|router| router.life == life);
                    let to = if is_same && self.chance.percent(80) { whose } else { to };
                    if to == whose && !is_same && !self.plan.sealed {
                        continue;
                    }
                    let alters = self.plan.sealed && self.chance.percent(50);
                    let bytes = if alters { altered(&arrived.bytes, &mut self.chance) } else { arrived.bytes.clone() };
                    let arrived = Arrived { bytes, ..arrived };
                    let at_ns = self.now_ns + self.chance.below(100 * MS);
                    let life = (to == whose && !self.plan.sealed).then_some(life);
                    self.at(at_ns, Event::Again { to, life, arrived });
                }
            }
        }
    }

    pub(super) fn end(&mut self, index: usize) {
        let fault = self.plan.faults[index].fault;
        self.trace.line(self.now_ns, || format!("is over: {fault:?}"));
        match fault {
            Fault::Freeze { node, whole } => {
                self.stations[node].frozen -= 1;
                self.stations[node].asleep -= u32::from(whole);
                if self.stations[node].runs() {
                    self.catch_up(node);
                }
            }
            Fault::Restart { node } => self.at(self.now_ns, Event::Start { node }),
            Fault::Cut { from, to } => self.links[from][to].cuts -= 1,
            Fault::Split { side } => self.split(side, |cuts| *cuts -= 1),
            Fault::Bad { from, to, .. } => self.links[from][to].quality = self.plan.quality,
            Fault::Absent { node, module } => self.mailboxes(node, module, |mailbox| mailbox.absent -= 1),
            Fault::Full { node, module } => self.mailboxes(node, module, |mailbox| mailbox.full -= 1),
            Fault::ModuleRestart { node, module } => self.restart_module(node, module),
            Fault::Unsendable { node } => self.stations[node].host.unsendable -= 1,
            Fault::Echo { to, .. } => self.stations[to].echo_ns = None,
            Fault::Step { .. } | Fault::Foreign { .. } | Fault::Replay { .. } => {}
        }
    }

    /// After the last fault all links are as good as they get.
    pub(super) fn mend(&mut self) {
        self.trace.line(self.now_ns, || "all faults are over".into());
        let quality = mended(self.plan.quality);
        self.links.iter_mut().flatten().for_each(|link| link.quality = quality);
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

    /// Something that no router of this installation sends: noise, or a frame of another version, installation or system.
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
            kind: chance.pick(&[Kind::Packages, Kind::Fragment, Kind::Alive, Kind::Refusal, Kind::Sync, Kind::Reply]),
            system: if chance.percent(20) { 9 } else { super::plan::SYSTEM },
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

/// Flips some bits.
pub(super) fn damage(bytes: &[u8], chance: &mut Chance) -> Rc<[u8]> {
    let mut bytes = bytes.to_vec();
    for _ in 0..chance.between(1, 4) {
        let at = chance.below(bytes.len() as u64) as usize;
        if let Some(byte) = bytes.get_mut(at) {
            *byte ^= 1 << chance.below(8);
        }
    }
    if chance.percent(20) {
        bytes.truncate(chance.below(bytes.len() as u64) as usize);
    }
    Rc::from(bytes)
}
