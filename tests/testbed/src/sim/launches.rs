//! Launches of a simulated network, as far as they see to leases: when each does something, and what goes from one to
//! another.

use super::leased::launch;
use super::leases::{PUBLISH_NS, Posted};
use super::package::Role;
use super::promise::Promise;
use super::spans::MS;
use super::world::{Event, World};
use rohrpost_mailbox::{Head, Name, Priority, Type, local};

/// Bytes of a question, of an answer, and of what a holder publishes.
const BYTES: u16 = 60;

impl World<'_> {
    pub(super) fn schedule_leases(&mut self) {
        for node in 0..self.stations.len() {
            self.begin_launch(node);
        }
    }

    /// A node's launch lives, and so do the processes that it starts.
    fn begin_launch(&mut self, node: usize) {
        let Some(run) = self.leases.as_ref().map(|leases| leases.run_of(node)) else { return };
        self.at(self.now_ns, Event::Publish { node, run });
        self.after_launch(node);
    }

    pub(super) fn wake_launch(&mut self, node: usize) {
        let Some(leases) = self.leases.as_mut().filter(|leases| leases.is_due(self.now_ns, node)) else { return };
        if self.stations[node].asleep > 0 {
            leases.put_off(node, self.now_ns + MS);
            return self.at(self.now_ns + MS, Event::Launch { node });
        }
        leases.poll(self.now_ns, node);
        self.after_launch(node);
    }

    pub(super) fn publish(&mut self, node: usize, run: u32) {
        let Some(leases) = self.leases.as_mut().filter(|leases| leases.run_of(node) == run) else { return };
        let is_stopped = self.stations[node].asleep > 0;
        if leases.publish(self.now_ns, node, is_stopped) {
            self.oracle.saw("a stopped holder goes on");
        }
        self.at(self.now_ns + if is_stopped { MS } else { PUBLISH_NS }, Event::Publish { node, run });
        self.after_launch(node);
    }

    /// All processes of a node die, or start again.
    pub(super) fn kill_launch(&mut self, node: usize) {
        self.leases.as_mut().into_iter().for_each(|leases| leases.die(node));
    }

    pub(super) fn start_launch(&mut self, node: usize) {
        self.leases.as_mut().into_iter().for_each(|leases| leases.start(self.now_ns, node));
        self.begin_launch(node);
    }

    /// A module cannot be on at a node any more, or can again.
    pub(super) fn change_unready(&mut self, node: usize, change: impl Fn(&mut u32)) {
        let Some(leases) = &mut self.leases else { return };
        leases.change_unready(self.now_ns, node, change);
        self.after_launch(node);
    }

    /// A package that has to do with leases came to a node.
    pub(super) fn take_lease(&mut self, from: usize, node: usize, role: Role) {
        let Some(leases) = self.leases.as_mut().filter(|leases| leases.run_of(node) > 0) else { return };
        match role {
            Role::Asked(ask) => leases.asked(self.now_ns, from, ask),
            Role::Answered(answer) => leases.answered(self.now_ns, node, &answer),
            Role::Held { lease } => {
                self.oracle.saw("heard a holder");
                if let Some(text) = leases.heard(from, node, lease) {
                    self.oracle.broken(self.now(node), Promise::Leases, text);
                }
            }
            _ => {}
        }
        self.after_launch(node);
    }

    /// A launch has done something: what it sends leaves, and all is looked at.
    fn after_launch(&mut self, node: usize) {
        let Some(leases) = &mut self.leases else { return };
        let wakes_ns = leases.next_wake(self.now_ns, node);
        let posted = std::mem::take(&mut leases.posted);
        let floods = self.plan.flows.iter().any(|flow| flow.burst > 1);
        let may_lose = self.now_ns < self.plan.fixed_ns && (floods || self.plan.is_lossy());
        let (wrong, given) = (leases.check(self.now_ns, may_lose), leases.given() as u64);
        self.oracle.seen.insert("leases given", given);
        wakes_ns.into_iter().for_each(|at_ns| self.at(at_ns, Event::Launch { node }));
        if let Some(text) = wrong {
            self.oracle.broken(self.now(node), Promise::Leases, text);
        }
        for Posted { from, to, role } in posted {
            let held = matches!(role, Role::Held { .. });
            let moves = self.plan.leases.as_ref().map_or(Name::NONE, |leases| leases.name);
            let sender = if held { moves } else { launch(from) };
            let head = Head {
                to: launch(to).with_local(local::DATA + u8::from(held)),
                from: sender.with_local(local::REPLIES),
                len: BYTES,
                kind: Type::data(1),
                priority: Priority(sender.class().0),
                ..Head::default()
            };
            self.post(from, head, role);
        }
    }
}
