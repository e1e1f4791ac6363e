//! The layer of a router with time slots: packages and time in the hands of one thread, which sends in the node's own windows alone.

use super::book::Promise;
use super::clock::Now;
use super::packages::Packages;
use super::plan::{Plan, RECOVERY_NS};
use super::station::{Arrived, Io, Layer, PORTS, Port, Sent};
use super::ticking::{self, Ticking};
use crate::frame::{FrameHead, Kind};
use crate::tdma::{Carries, Discipline, Next, Permit, Planned, Table, Verdict};
use crate::time::Term;
use std::collections::VecDeque;

/// The thread wakes so long before its call, to spin.
const SPIN_NS: u64 = 100_000;
/// First datagrams of windows whose stamps are waited for at a time.
const AWAITED_MAX: usize = 16;

/// One life of a router's timing thread.
pub struct Slotted {
    packages: Packages,
    time: Ticking,
    discipline: Discipline,
    planned: Option<Planned>,
    /// Datagrams that left each socket.
    sent: [u64; PORTS],
    /// First datagrams of windows: socket, how many went before, and when they were handed over.
    firsts: VecDeque<(Port, u64, u64)>,
}

impl Slotted {
    /// A life that begins now, of these two.
    pub fn new(packages: Packages, time: Ticking, table: Table) -> Self {
        let (time, discipline) = (time.in_slots(&table), Discipline::new(table, SPIN_NS));
        Self { packages, time, discipline, planned: None, sent: [0; PORTS], firsts: VecDeque::new() }
    }

    /// It is time for a window.
    fn window(&mut self, io: &mut Io<'_>, planned: &Planned) {
        let verdict = self.discipline.judge(planned, io.now.monotonic_ns, self.time.clock());
        io.line(|| format!("{:?}: {verdict:?}", planned.window));
        match verdict {
            Verdict::Send(permit) => self.send(io, permit),
            Verdict::Late => io.book.saw("window late"),
            Verdict::Silent(_) => io.book.saw("window silent"),
            Verdict::Early | Verdict::Idle => {}
        }
    }

    /// Sends what there is, time first.
    fn send(&mut self, io: &mut Io<'_>, mut permit: Permit) {
        let before = io.sent.len();
        let is_sure = self.is_sure(io);
        let clock = self.time.clock();
        let term = if is_sure { clock.reading(io.now.monotonic_ns).term } else { Term::NONE };
        io.book.wire.goes_by(io.now, io.node, term, clock.reckoning().filter(|_| is_sure), clock.is_beginning());
        self.time.poll_in(io, Some(&mut permit));
        if permit.carries == Carries::All {
            self.packages.poll_in(io, &mut permit);
        }
        self.discipline.close(&permit);
        if let Some(first) = io.sent.get(before) {
            io.book.saw("window used");
            self.firsts.push_back((first.port, self.sent[first.port], io.now.monotonic_ns));
            self.firsts.truncate(AWAITED_MAX);
        }
        for sent in &io.sent[before..] {
            self.sent[sent.port] += 1;
            if self.time.replaces_in_vain(sent) {
                let text = format!("node {} sends in the place of a master that it has heard", io.node);
                io.book.broken(io.now, Promise::OneMaster, text);
            }
            if !is_sure && !asks(sent) {
                let text = format!("node {} is not sure of the time, and sends more than questions", io.node);
                io.book.broken(io.now, Promise::SilentWhenUnsure, text);
            }
        }
    }

    /// Whether this node may be off by half of the guard at most, as it says.
    fn is_sure(&mut self, io: &Io<'_>) -> bool {
        let now_ns = io.now.monotonic_ns;
        let allowed_ns = allowance_ns(io.plan);
        self.time.clock().reckoning().is_some_and(|reckoning| reckoning.bound_ns(now_ns) <= allowed_ns)
    }
}

impl Layer for Slotted {
    fn handle(&mut self, io: &mut Io<'_>, arrived: &Arrived) {
        if arrived.port == ticking::PORT {
            self.time.handle(io, arrived);
        } else {
            self.packages.handle(io, arrived);
        }
    }

    fn left(&mut self, io: &mut Io<'_>, port: Port, index: u64, at: Now) {
        let first = self.firsts.iter().position(|first| (first.0, first.1) == (port, index));
        if let Some((_, _, user_ns)) = first.and_then(|first| self.firsts.remove(first)) {
            let stamp = self.time.stamp(io, at);
            self.discipline.left(user_ns, stamp);
        }
        if port == ticking::PORT {
            self.time.left(io, port, index, at);
        }
    }

    fn poll(&mut self, io: &mut Io<'_>) -> u64 {
        let idle_ns = self.packages.tidy(io).min(self.time.poll_in(io, None));
        let now_ns = io.now.monotonic_ns;
        let until_ns = loop {
            // Once awake for a window, the thread spins until its call.
            match self.planned.filter(|planned| planned.wake_ns <= now_ns) {
                Some(planned) if now_ns < planned.call_ns => break planned.call_ns,
                Some(planned) => {
                    self.planned = None;
                    self.window(io, &planned);
                }
                None => match self.discipline.next(now_ns, self.time.clock()) {
                    Next::Silent { until_ns, .. } => {
                        self.planned = None;
                        break until_ns;
                    }
                    Next::Window(planned) => {
                        self.planned = Some(planned);
                        if now_ns < planned.wake_ns {
                            break planned.wake_ns;
                        }
                    }
                },
            }
        };
        until_ns.min(idle_ns)
    }

    fn dies(&mut self, io: &mut Io<'_>) {
        self.time.dies(io);
        self.packages.dies(io);
    }

    fn check(&mut self, io: &mut Io<'_>, well: bool) {
        let clock = self.time.clock();
        let off_ns = io.book.times.off_ns(io.now, io.node, clock.term());
        let masters = clock.master().and_then(|master| io.book.times.page(master.into()));
        let is_of_later_epoch = masters.is_some_and(|page| page.epoch < clock.record().epoch);
        // Who is further off than it may be says nothing, and slews for up to five seconds, or waits until a master begins an epoch, see
        // [`EPOCH_PAUSE_NS`](super::plan::EPOCH_PAUSE_NS).
        let waits = is_of_later_epoch || off_ns.is_some_and(|off_ns| off_ns > allowance_ns(io.plan));
        if waits && io.now.true_ns < io.plan.stepped_ns {
            io.book.saw("waits for an epoch");
            io.book.well_ns = io.book.well_ns.max(io.now.true_ns + RECOVERY_NS);
        }
        self.time.check(io, well);
        self.packages.check(io, well);
    }

    fn close(&mut self, io: &mut Io<'_>) {
        self.time.close(io);
        self.packages.close(io);
    }
}

/// Who sends may be off by half of the guard.
fn allowance_ns(plan: &Plan) -> u64 {
    plan.slots.as_ref().map_or(0, |slots| slots.table.guard.as_nanos() as u64 / 2)
}

/// Whether a datagram asks what time it is.
fn asks(sent: &Sent) -> bool {
    FrameHead::parse(&sent.bytes).is_ok_and(|(head, _)| matches!(head.kind, Kind::Request | Kind::WarmUp))
}
