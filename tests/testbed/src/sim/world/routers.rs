//! Lives of routers: they start, wake, do what is due, and die.

use super::{Event, World};
use crate::sim::spans::{MS, US};
use crate::sim::station::Router;
use rohrpost_routers::tdma::LATE_NS;

impl World<'_> {
    pub(super) fn start(&mut self, node: usize) {
        let station = &mut self.stations[node];
        station.down = station.down.saturating_sub(1);
        if station.down > 0 || station.router.is_some() {
            return;
        }
        self.lives += 1;
        let life = self.lives;
        self.living[node] = life;
        let now = self.now(node);
        let layers = (self.new_layers)(node, self.stations[node].edition, life, now, self.oracle.times.left(now, node));
        self.stations[node].router = Some(Router { life, layers, sent: Default::default() });
        self.trace.line(self.now_ns, || format!("{node}/{life} the router starts"));
        if self.stations[node].runs() {
            self.poll(node);
        }
    }

    /// A router dies; what it had in its hand comes again, what it had in its memory is gone.
    pub(in crate::sim) fn kill(&mut self, node: usize) {
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

    pub(super) fn wake(&mut self, node: usize) {
        self.stations[node].wake_ns = None;
        if self.stations[node].runs() {
            self.poll(node);
        }
    }

    pub(in crate::sim) fn wake_at(&mut self, node: usize, at_ns: u64) {
        if at_ns <= self.plan.end_ns
            && self.stations[node].wake_ns.is_none_or(|before| at_ns < before || before <= self.now_ns)
        {
            self.stations[node].wake_ns = Some(at_ns);
            self.at(at_ns, Event::Wake { node });
        }
    }

    /// A router reads its sockets, in whatever order, and does what is due.
    pub(in crate::sim) fn catch_up(&mut self, node: usize) {
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
    pub(in crate::sim) fn poll(&mut self, node: usize) {
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
                let late_ns = slots.late_ns(self.now_ns >= self.plan.fixed_ns, has_rested, &mut self.chance);
                station.late_at_ns = if late_ns > LATE_NS { self.now_ns } else { station.late_at_ns };
                late_ns
            }
        };
        let at_ns = self.stations[node].clock.when(until_ns, self.now_ns).max(self.now_ns + 1).saturating_add(late_ns);
        self.wake_at(node, at_ns);
    }
}
