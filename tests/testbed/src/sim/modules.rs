//! The modules of a simulated network: they post data and commands, run commands, and read what comes.

use super::calls::QueuedCommand;
use super::host::{DATA_MAILBOXES, Parcel};
use super::package::Answer;
use super::package::{Role, SendStage, admitted};
use super::promise::{Problem, Promise};
use super::spans::{MS, US};
use super::world::{Event, World};
use rohrpost_mailbox::{Head, Name, Options, Priority, Type, local};

/// Bytes of a command and of its answer.
const CALL_BYTES: (u64, u64) = (8, 200);
/// A call that is valid for so long is answered, if all is well.
const ANSWERED_WITHIN_NS: u64 = 500 * MS;

impl World<'_> {
    pub(super) fn flow(&mut self, index: usize) {
        let flow = self.plan.flows[index];
        let end_ns = if flow.burst > 1 { self.plan.fixed_ns } else { self.plan.traffic_end_ns };
        if self.now_ns >= end_ns {
            return;
        }
        // A little off its period, so that flows meet in all ways.
        let next_ns = flow.period_ns * self.chance.between(90, 110) / 100;
        self.at(self.now_ns + self.plan.moment_of(&flow).unwrap_or(next_ns), Event::Flow { flow: index });
        if self.stations[flow.node].asleep > 0 {
            return;
        }
        for _ in 0..flow.burst {
            let len = self.chance.between(flow.bytes.0, flow.bytes.1) as u16;
            let (mut to, mut priority) = (flow.to, flow.priority);
            if flow.is_mixed {
                to = to.with_local(local::DATA + self.chance.below(DATA_MAILBOXES.into()) as u8);
                priority = self.chance.below(256) as u8;
            }
            let head =
                Head { to, from: flow.from, len, kind: Type::data(1), priority: Priority(priority), ..Head::default() };
            // Of what is lowered on its way, what its sender held for more urgent may have gone first.
            self.post(flow.node, admitted(&head), Role::Data);
            // The router reads while the sender still writes.
            if self.chance.percent(10) && self.stations[flow.node].runs() {
                self.poll(flow.node);
            }
        }
    }

    /// A module sends a package to another node.
    pub(super) fn post(&mut self, node: usize, head: Head, role: Role) {
        let now = self.now(node);
        let (number, head, body) = self.oracle.post(now, head, (node, usize::from(head.to.instance())), role);
        let station = &mut self.stations[node];
        let displaced = station.host.transit.post(Parcel { number, head, body, published_ns: now.monotonic_ns });
        if let Some(parcel) = displaced {
            self.oracle.saw("no room in the transit mailbox");
            self.trace.line(self.now_ns, || format!("{node} no room in the transit mailbox for {}", parcel.number));
        }
        self.trace.line(self.now_ns, || format!("{node} posts {number}, {head:?}, {role:?}"));
        if self.stations[node].runs() {
            // The bell rings.
            let late_ns = self.chance.between(US, 60 * US);
            self.wake_at(node, self.now_ns + late_ns);
        }
    }

    pub(super) fn call(&mut self, caller: usize) {
        let its = self.plan.calls[caller];
        if self.now_ns >= self.plan.traffic_end_ns {
            return;
        }
        let next_ns = its.period_ns * self.chance.between(80, 120) / 100;
        self.at(self.now_ns + next_ns, Event::Call { caller });
        if self.stations[its.node].asleep > 0 {
            return;
        }
        let sequence = &mut self.sequences[its.node];
        *sequence += 1;
        let sequence = *sequence;
        let call = self.calls.begin(self.now(its.node), caller, sequence, its.valid_for_ns);
        self.try_call(call);
    }

    pub(super) fn try_call(&mut self, call: usize) {
        let its = self.plan.calls[self.calls.all[call].caller];
        if self.stations[its.node].asleep > 0 {
            self.at(self.now_ns + MS, Event::Try { call });
            return;
        }
        let Some(age_ns) = self.calls.next_try(self.now(its.node), call) else { return };
        let len = self.chance.between(CALL_BYTES.0, CALL_BYTES.1) as u16;
        let head = Head {
            to: its.to.with_local(local::COMMANDS),
            from: its.from.with_local(local::REPLIES),
            len,
            kind: Type::command(16),
            priority: Priority(its.priority),
            ..Head::default()
        };
        self.post(its.node, head, Role::Command { call, age_ns });
        self.at(self.now_ns + self.calls.repeat_after_ns(call), Event::Try { call });
    }

    /// A module takes the next command from its mailbox.
    pub(super) fn serve(&mut self, node: usize, module: Name) {
        self.serve_or_die(node, module, false);
    }

    /// As [`World::serve`]; it may die of it, at any step.
    pub(super) fn serve_or_die(&mut self, node: usize, module: Name, dies: bool) {
        if self.stations[node].asleep > 0 {
            self.at(self.now_ns + MS, Event::Serve { node, module });
            return;
        }
        let now = self.now(node);
        let Some(server) = self.servers.get_mut(&module).filter(|server| server.dead == 0) else { return };
        let Some(first) = server.waiting.front() else { return };
        let command = self.oracle.packages[first.number as usize].head;
        let Some((waiting, answer)) = self.calls.serve(&mut self.oracle, server, now, command.from, dies) else {
            return;
        };
        if let Some(mailbox) = self.stations[node].host.boxes.get_mut(&command.to) {
            mailbox.waiting = mailbox.waiting.saturating_sub(1);
        }
        let Some(answer) = answer else { return };
        self.trace.line(self.now_ns, || format!("{node} {module} answers call {}: {answer:?}", waiting.call));
        let len = self.chance.between(CALL_BYTES.0, CALL_BYTES.1) as u16;
        let head = Head {
            to: command.from,
            from: command.to,
            len,
            kind: Type::reply(16),
            priority: command.priority,
            options: if matches!(answer, Answer::Ran(_)) { Options(0) } else { Options::ERROR },
            ..Head::default()
        };
        self.post(node, head, Role::Answer { call: waiting.call, answer });
    }

    /// A dead module comes back.
    pub(super) fn restart_module(&mut self, node: usize, module: Name) {
        let now = self.now(node);
        let Some(server) = self.servers.get_mut(&module) else { return };
        server.dead -= 1;
        if server.dead > 0 {
            return;
        }
        server.start(now);
        let waiting = server.waiting.len();
        if let Some(mailbox) = self.stations[node].host.boxes.get_mut(&module.with_local(local::COMMANDS)) {
            // One may have been dropped, since two servers died of it.
            mailbox.waiting = waiting;
        }
        for _ in 0..waiting {
            let busy_ns = self.chance.below(5 * MS);
            self.at(self.now_ns + busy_ns, Event::Serve { node, module });
        }
    }

    /// Modules look at what came into their mailboxes.
    pub(super) fn receive(&mut self, node: usize) {
        let now = self.now(node);
        for number in std::mem::take(&mut self.stations[node].host.arrived) {
            let package = &self.oracle.packages[number as usize];
            let (head, posted_ns) = (package.head, package.posted_ns);
            match package.role {
                Role::Data | Role::Intruder => {}
                role @ (Role::Asked(_) | Role::Answered(_) | Role::Held { .. }) => {
                    let from = package.from_node.into();
                    self.take_lease(from, node, role);
                }
                Role::Answer { call, answer } => self.calls.answered(&mut self.oracle, now, call, answer),
                Role::Report { call } => self.calls.answered(&mut self.oracle, now, call, Answer::NotRun),
                Role::Command { call, age_ns } => {
                    let Some(server) = self.servers.get_mut(&head.to.module()) else { continue };
                    server.waiting.push_back(QueuedCommand {
                        number,
                        call,
                        age_ns,
                        posted_ns,
                        published_ns: now.monotonic_ns,
                        published_true_ns: now.true_ns,
                        redelivered: package.redelivered,
                    });
                    let busy_ns = self.chance.below(MS);
                    self.at(self.now_ns + busy_ns, Event::Serve { node, module: head.to.module() });
                }
            }
        }
        for number in std::mem::take(&mut self.stations[node].host.returned) {
            let Role::Command { call, .. } = self.oracle.packages[number as usize].role else { continue };
            self.calls.answered(&mut self.oracle, now, call, Answer::NotRun);
        }
    }

    /// At the end: what was posted when all was well has come, and what was accepted has a fate.
    pub(super) fn close(&mut self) {
        for node in 0..self.stations.len() {
            let Some(life) = self.stations[node].router.as_ref().map(|router| router.life) else { continue };
            self.with_router(node, life, |router, io| router.layers.iter_mut().for_each(|layer| layer.close(io)));
        }
        self.close_readers();
        self.close_records();
        let well_ns = self.oracle.well_ns;
        let now = self.now(0);
        for (index, call) in self.calls.all.iter().enumerate() {
            let meant = call.began_true_ns > well_ns && call.valid_for_ns >= ANSWERED_WITHIN_NS;
            if meant && !matches!(call.outcome, Some(Answer::Ran(_))) {
                let text = format!("call {index}, begun at {} ns, has {:?}", call.began_true_ns, call.outcome);
                self.oracle.problems.push(Problem { promise: Promise::Recovery, at_ns: self.now_ns, text });
            }
        }
        for number in 0..self.oracle.packages.len() {
            let package = &self.oracle.packages[number];
            let is_answer = !matches!(package.role, Role::Data | Role::Command { .. });
            if package.posted_ns > well_ns && !is_answer && package.deliveries.is_empty() {
                let text = format!("package {number} was not delivered: {package:?}");
                self.oracle.broken(now, Promise::Recovery, text);
            }
            if self.oracle.packages[number].way == SendStage::Accepted {
                self.oracle.saw("died with its router");
            }
        }
    }
}
