//! Datagrams on their way from router to router: handed to the kernel, put on the wire, passed by a link, taken at the
//! other end.

use super::{Event, OLD_MAX, World};
use crate::sim::clock::Now;
use crate::sim::promise::{Problem, Promise};
use crate::sim::seals::damage;
use crate::sim::spans::US;
use crate::sim::station::{Arrived, Io, Origin, Router, Sent};
use crate::sim::wire::LEAD_NS;

impl World<'_> {
    /// Lets the layers of a node do something, if that incarnation of its router still runs, and carries away what
    /// comes of it.
    pub(in crate::sim) fn with_router(&mut self, node: usize, life: u32, what: impl FnOnce(&mut Router, &mut Io<'_>)) {
        let station = &mut self.stations[node];
        let now = station.clock.at(self.now_ns);
        let Some(router) = station.router.as_mut().filter(|router| router.life == life) else { return };
        let mut io = Io {
            plan: &self.plan,
            lives: &self.living,
            now,
            clock: &station.clock,
            began_ns: self.now_ns,
            node,
            life,
            host: &mut station.host,
            oracle: &mut self.oracle,
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
        for sent in std::mem::take(&mut self.sent) {
            let port = sent.port;
            let Some(router) = &mut self.stations[node].router else { return };
            let (life, index) = (router.life, router.sent[port]);
            router.sent[port] += 1;
            let (left_ns, out_ns) = self.transmit(node, sent.bytes.len(), sent.handed.true_ns.max(self.now_ns));
            if port > 0 || self.plan.slots.is_some() {
                self.at(left_ns, Event::Left { node, life, port, index });
            }
            self.pass(node, &sent, out_ns);
        }
    }

    /// It takes a while from the call to the wire: when a datagram leaves, and when all of it has.
    fn transmit(&mut self, node: usize, bytes: usize, handed_ns: u64) -> (u64, u64) {
        let Some(slots) = self.plan.slots_of(self.stations[node].edition) else {
            let left_ns = handed_ns + self.chance.between(US, 30 * US);
            return (left_ns, left_ns);
        };
        let oracle = &mut self.oracle;
        let at_ns = handed_ns + self.chance.between(LEAD_NS.0, LEAD_NS.1);
        let sent = oracle.wire.transmit(node, at_ns, bytes, slots, &mut oracle.problems);
        let clock = &self.stations[node].clock;
        let local_ns = [sent.begin_ns, sent.end_ns].map(|true_ns| clock.at(true_ns).monotonic_ns);
        if let Some(text) = oracle.wire.window(node, bytes, slots, local_ns) {
            oracle.problems.push(Problem { promise: Promise::InWindow, at_ns: sent.begin_ns, text });
        }
        self.trace.line(self.now_ns, || format!("{node} transmits from {} to {} ns", sent.begin_ns, sent.end_ns));
        (sent.begin_ns, sent.end_ns)
    }

    /// Lets a link do with a datagram what it does.
    fn pass(&mut self, from: usize, sent: &Sent, out_ns: u64) {
        let Sent { port, to, ref bytes, sealed_to, .. } = *sent;
        let passages = self.links[from][to].pass(out_ns, bytes.len(), &mut self.chance);
        if passages[0].is_none() {
            self.trace.line(self.now_ns, || format!("the wire loses {} bytes from {from} to {to}:{port}", bytes.len()));
            self.oracle.saw("lost on the wire");
        }
        for passage in passages.into_iter().flatten() {
            let (mut bytes, mut origin) = (bytes.clone(), Origin::Sent { sealed_to });
            if passage.damaged {
                self.oracle.saw("damaged on the wire");
                if self.plan.checksum {
                    continue;
                }
                (bytes, origin) = (damage(&bytes, &mut self.chance), Origin::Damaged);
            }
            let arrived = Arrived { port, source: Some(from), bytes, stamp: Now::default(), origin };
            self.at(passage.at_ns, Event::Arrive { to, arrived });
        }
    }

    /// A datagram is in the kernel of its receiver.
    pub(in crate::sim) fn arrive(&mut self, to: usize, mut arrived: Arrived) {
        arrived.stamp = self.now(to);
        if self.stations[to].sleeps > 0 {
            return self.oracle.saw("came to a computer that sleeps");
        }
        if !self.stations[to].runs() {
            let is_up = self.stations[to].router.is_some();
            if !is_up || !self.stations[to].keep(arrived) {
                self.oracle.saw(if is_up { "socket full" } else { "no router" });
            }
            return;
        }
        self.hand_in(to, &arrived);
        self.poll(to);
    }

    pub(super) fn hand_in(&mut self, node: usize, arrived: &Arrived) {
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
}
