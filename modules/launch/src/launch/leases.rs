//! Modules with several nodes: which of them runs one, and which names are where.
//!
//! ```text
//!  launch of brain: Candidate 0 ─┐                          ┌─▶ its process runs, or is kept off
//!  launch of desk:  Candidate 1 ─┼─ calls `lease` of ─▶ launch of the witness's node: Witness
//!  each launch:     Fence       ─┘                          └─▶ file `holders` of its node, which its router reads
//! ```
//!
//! The protocol and what it promises stand in `rohrpost_supervision::lease`; here are its messages and its effects. One
//! call asks a witness for all modules of which it grants the leases.
//!
//! - **Off in time.** Launch lets the process go on when it holds the lease, and ends it when that is over. A timer of
//!   the kernel (`timerfd`, `CLOCK_BOOTTIME`) that both have ends the process even if launch is stopped: the module
//!   goes to its safe state, and is gone 100 ms later at the latest. Launch kills one that is stopped.
//! - **The name.** A node that stands by has no mailbox of the module, so packages go to the router. Each launch asks
//!   the witness which node holds the lease, and writes that into `holders`. Routers send to that node. A name that
//!   nobody is known to hold is not there: a node that has had no answer for one lease knows of no holder.
//! - **Older packages.** A router takes packages under the name from the holder's node alone. That is the fence: the
//!   node tells a package's number, since one node at a time has the newest, and of a node's earlier ones no process is
//!   left when the next one begins. The witness's own router is told before a lease is granted to another node. Other
//!   nodes are told with their next question. So what a former holder sends when it goes on is refused at the witness's
//!   node as soon as the kernel has told the router of the file; elsewhere a question later; and at a node that cannot
//!   reach the witness, one lease later.
//! - **Numbers.** Each question and answer carries its node's newest incarnation, and the other node passes it. A node
//!   that begins to hold a lease passes [`INCARNATIONS`] more. So servers take the calls of the new process as those of
//!   a later one, and remember nothing that they could take for a repeat.
//! - **Standing by**, hot: the process is made up to its first call, off, and its mailboxes have no names yet
//!   (`Participant::hide_mailboxes`). When its node holds the lease, an event (`eventfd`) tells it so: it gives them
//!   their names, takes a later incarnation and switches itself on. Cold: it is not started before.
//! - **Calls under way** end as those to a module that was killed and started again.

use super::child::Child;
use super::error::LeaseError;
use crate::launcher::{LEASE, LauncherInterface, LeaseMessage};
use nix::sys::eventfd::{EfdFlags, EventFd};
use nix::sys::time::TimeSpec;
use nix::sys::timerfd::{ClockId as TimerClock, Expiration, TimerFd, TimerFlags, TimerSetTimeFlags};
use rohrpost_config::{HOLDERS_FILE, Installation, MOVING_MODULES_MAX, Module, holder_line};
use rohrpost_mailbox::{Name, Node, monotonic_ns};
use rohrpost_modules::call::{CallError, append};
use rohrpost_modules::runtime::ToolLink;
use rohrpost_supervision::lease::{ASK_BYTES, Answer, Ask, Candidate, Fence, Terms, Witness};
use std::collections::VecDeque;
use std::hash::{BuildHasher, RandomState};
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::time::{Duration, Instant};

/// Calls of a witness that wait for an answer; the oldest is given up for a new one.
const CALLS_MAX: usize = 6;
/// Most error of the rate of a computer's clock: twice what Linux lets a time service slew it.
const RATE_ERROR_PPM: u32 = 1_000;
/// Bytes of a question in a command: the module's name, the question, its length.
const QUESTION_BYTES: usize = 5 + 1 + ASK_BYTES;
// Of each module two fit the command mailbox of launch, 1024 bytes, beside 64 bytes of all around them.
const _: () = assert!(64 + MOVING_MODULES_MAX * 2 * QUESTION_BYTES <= 1024);
/// A node gives out fewer incarnations between its last question and the end of its lease.
const INCARNATIONS: u32 = 4096;

/// The leases of an installation, as one launch sees them.
pub(super) struct Leases {
    seats: Vec<Seat>,
    /// Leases that this node grants, by the modules' names.
    witnesses: Vec<(Name, Witness)>,
    /// Launches that grant the others.
    granting: Vec<Granting>,
    period_ns: u64,
    lease_ns: u64,
    /// What `holders` says; none: that could not be written.
    written: Option<String>,
}

/// Launch of another node, which grants leases.
struct Granting {
    launch: Name,
    calls: VecDeque<u32>,
    /// Whether the launch could not be called the last time.
    is_refused: bool,
}

/// What launch does about one module with several nodes.
struct Seat {
    module: Name,
    /// All names that move with it.
    names: Vec<Name>,
    /// Places of the module's nodes among the routers, first choice first.
    nodes: Vec<u8>,
    /// Place in `granting` of the launch that grants; none: this one.
    granting: Option<usize>,
    own: Option<OwnSeat>,
    fence: Fence,
    /// When to look next which node holds the lease.
    look_ns: u64,
    /// Place of the holder by the last look, if there was one, and when that was asked.
    seen: (Option<u8>, u64),
}

/// This node is one of the module's.
struct OwnSeat {
    place: u8,
    candidate: Candidate,
    timer: TimerFd,
    /// Is there while this node holds the lease: its process waits for that.
    event: EventFd,
    /// When the timer ends the module's process; none: it need not.
    ends_ns: Option<u64>,
}

/// A number that no other run has: the standard library takes the keys of its hash tables from the kernel.
fn run() -> u32 {
    RandomState::new().hash_one(0) as u32
}

impl Leases {
    /// The leases of all modules with several nodes. `holders` is written anew: nobody is known to hold any.
    pub(super) fn begin(installation: &Installation, node: &Node, node_name: &str) -> Result<Self, LeaseError> {
        let times = installation.lease_times();
        let [lease_ns, period_ns, off_ns] =
            [times.lease, times.ask_every, times.off].map(|time| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
        let terms = Terms::new(lease_ns, period_ns, off_ns, RATE_ERROR_PPM)?;
        let (mut seats, mut witnesses, mut granting) = (Vec::new(), Vec::new(), Vec::new());
        for module in installation.modules_with_standby() {
            let witness = installation.witness_of(module).and_then(|name| installation.node(name));
            let is_here = witness.is_some_and(|witness| witness.name == node_name);
            if is_here {
                witnesses.push((module.name, Witness::new(monotonic_ns(), terms, run())));
            }
            let launch = witness.filter(|_| !is_here).map(|witness| installation.launch_of(witness));
            seats.push(Seat {
                module: module.name,
                names: module.names().collect(),
                nodes: module.nodes.iter().filter_map(|node| installation.lan_index(node)).collect(),
                granting: launch.map(|launch| place_of(launch, &mut granting)),
                own: OwnSeat::of(module, terms, node_name)?,
                fence: Fence::new(run()),
                look_ns: 0,
                seen: (None, 0),
            });
        }
        let mut leases = Self { seats, witnesses, granting, period_ns, lease_ns, written: None };
        leases.tell(node);
        Ok(leases)
    }

    /// What tells a module's process that its lease begins, and ends.
    pub(super) fn kept_for(&self, module: Name) -> io::Result<Vec<OwnedFd>> {
        let own = self.seats.iter().find(|seat| seat.module == module).and_then(|seat| seat.own.as_ref());
        let kept = own.into_iter().flat_map(|own| [own.event.as_fd(), own.timer.as_fd()]);
        kept.map(|kept| kept.try_clone_to_owned()).collect()
    }

    /// Answers questions about leases that this node grants. Its own router is told first of a new holder, or nothing
    /// is answered.
    pub(super) fn answer(&mut self, asks: &LeaseMessage, node: &Node) -> LeaseMessage {
        node.pass_incarnation(asks.incarnation);
        let answer = |(module, ask): &(u32, Vec<u8>)| {
            let answer = ask_here(&mut self.witnesses, Name::from_raw(*module), &Ask::from_bytes(ask)?)?;
            Some((*module, answer.to_bytes().to_vec()))
        };
        let mut leases: Vec<_> = asks.leases.iter().filter_map(answer).collect();
        if !self.tell(node) {
            leases.clear();
        }
        LeaseMessage { incarnation: node.last_incarnation(), leases }
    }

    /// How long until something is due.
    pub(super) fn due_in(&self) -> Option<Duration> {
        let now_ns = monotonic_ns();
        self.seats.iter().map(|seat| Duration::from_nanos(seat.due_ns().saturating_sub(now_ns))).min()
    }

    /// Takes answers, asks what is due, starts or ends processes, and tells the router which node holds what. What
    /// there is to say.
    pub(super) fn step(
        &mut self,
        children: &mut [Child],
        tool: &mut ToolLink,
        node: &Node,
        now: Instant,
    ) -> Option<String> {
        // First: of a lease that is over the process is ended, even if an answer that is there by now renews it.
        self.seats.iter_mut().for_each(|seat| seat.act(children, node, now));
        self.take_answers(tool, node);
        let now_ns = monotonic_ns();
        self.seats.iter_mut().for_each(|seat| seat.set_ready(now_ns, children));
        self.ask_own(now_ns);
        let refused = (0..self.granting.len()).filter_map(|at| self.ask(at, now_ns, tool, node).err()).last();
        self.seats.iter_mut().for_each(|seat| seat.act(children, node, now));
        self.tell(node);
        refused.map(|error| format!("leases of modules with several nodes cannot be asked for: {error}"))
    }

    fn take_answers(&mut self, tool: &mut ToolLink, node: &Node) {
        tool.link.collect();
        for Granting { calls, .. } in &mut self.granting {
            calls.retain(|call| {
                let answer = tool.link.poll_for(*call, |bytes| postcard::from_bytes::<LeaseMessage>(bytes));
                if let Some(Ok(message)) = &answer {
                    node.pass_incarnation(message.incarnation);
                    for (module, answer) in &message.leases {
                        let seat = self.seats.iter_mut().find(|seat| seat.module.raw() == *module);
                        let answer = Answer::from_bytes(answer);
                        seat.zip(answer).into_iter().for_each(|(seat, answer)| seat.take(&answer, self.period_ns));
                    }
                }
                answer.is_none()
            });
        }
    }

    /// Asks this node's own witnesses what is due.
    fn ask_own(&mut self, now_ns: u64) {
        let Self { seats, witnesses, period_ns, .. } = self;
        for seat in seats.iter_mut().filter(|seat| seat.granting.is_none()) {
            seat.look_ns = now_ns.saturating_add(*period_ns);
            let ask = seat.own.as_mut().and_then(|own| own.candidate.poll(now_ns));
            let answer = ask.and_then(|ask| ask_here(witnesses, seat.module, &ask));
            answer.into_iter().for_each(|answer| seat.take(&answer, *period_ns));
        }
    }

    /// Asks another node, if anything is due, for all that it grants.
    ///
    /// # Errors
    /// If too many calls are under way, when that begins. A node that cannot be asked is asked again when that is due.
    fn ask(&mut self, at: usize, now_ns: u64, tool: &mut ToolLink, node: &Node) -> Result<(), CallError> {
        let (lease_ns, Granting { launch, calls, is_refused }) = (self.lease_ns, &mut self.granting[at]);
        let its = |seat: &&mut Seat| seat.granting == Some(at);
        if !self.seats.iter_mut().filter(its).any(|seat| seat.due_ns() <= now_ns) {
            return Ok(());
        }
        let asks = self.seats.iter_mut().filter(its).flat_map(|seat| {
            let module = seat.module.raw();
            seat.questions(now_ns, lease_ns).map(move |ask| (module, ask.to_bytes().to_vec()))
        });
        let asks = (LeaseMessage { incarnation: node.last_incarnation(), leases: asks.collect() },);
        let write = |body: &mut Vec<u8>| append(body, &asks);
        let began = tool.link.begin(*launch, LEASE, LauncherInterface::hash(), Duration::from_nanos(lease_ns), write);
        let was_refused = std::mem::replace(is_refused, matches!(began, Err(CallError::TooMany(_))));
        match began {
            Ok(call) => calls.push_back(call),
            Err(error @ CallError::TooMany(_)) if !was_refused => return Err(error),
            Err(_) => {}
        }
        if calls.len() > CALLS_MAX {
            calls.pop_front().into_iter().for_each(|oldest| tool.link.forget(oldest));
        }
        Ok(())
    }

    /// Writes where each name is that somebody is known to hold. False: the router could not be told.
    fn tell(&mut self, node: &Node) -> bool {
        let (now_ns, mut text) = (monotonic_ns(), String::new());
        for seat in &self.seats {
            let Some(at) = self.holder_of(seat, now_ns).and_then(|place| seat.nodes.get(usize::from(place))) else {
                continue;
            };
            seat.names.iter().for_each(|name| text += &holder_line(*name, *at));
        }
        if self.written.as_ref() != Some(&text) {
            // A full disk is told by all that writes there; it is tried again at the next step.
            self.written = node.put_file(HOLDERS_FILE, text.as_bytes()).is_ok().then_some(text);
        }
        self.written.is_some()
    }

    /// Place of the node that holds a module's lease, if that is known.
    fn holder_of(&self, seat: &Seat, now_ns: u64) -> Option<u8> {
        let own = seat.own.as_ref();
        if let Some(own) = own.filter(|own| own.ends_ns.is_some()) {
            return Some(own.place);
        }
        let place = match seat.granting {
            None => self.witnesses.iter().find(|(name, _)| *name == seat.module)?.1.holder(now_ns)?.0,
            Some(_) if now_ns >= seat.seen.1.saturating_add(self.lease_ns) => return None,
            Some(_) => seat.seen.0?,
        };
        // This node knows better whether it holds it.
        (own.map(|own| own.place) != Some(place)).then_some(place)
    }
}

/// Asks a witness of this node.
fn ask_here(witnesses: &mut [(Name, Witness)], module: Name, ask: &Ask) -> Option<Answer> {
    let (_, witness) = witnesses.iter_mut().find(|(name, _)| *name == module)?;
    witness.ask(monotonic_ns(), ask)
}

/// Place of a launch among those that grant.
fn place_of(launch: Name, granting: &mut Vec<Granting>) -> usize {
    granting.iter().position(|known| known.launch == launch).unwrap_or_else(|| {
        granting.push(Granting { launch, calls: VecDeque::new(), is_refused: false });
        granting.len() - 1
    })
}

impl Seat {
    fn due_ns(&self) -> u64 {
        let own = self.own.as_ref();
        let own = own.map(|own| own.candidate.due_ns().min(own.ends_ns.unwrap_or(u64::MAX)));
        own.map_or(self.look_ns, |own| own.min(self.look_ns))
    }

    fn take(&mut self, answer: &Answer, period_ns: u64) {
        if let Some(own) = &mut self.own {
            own.candidate.take(monotonic_ns(), answer);
        }
        if self.fence.take(answer) {
            self.seen = (answer.holder, answer.asked_ns);
            self.look_ns = answer.asked_ns.saturating_add(period_ns);
        }
    }

    fn set_ready(&mut self, now_ns: u64, children: &[Child]) {
        let Some(own) = &mut self.own else { return };
        let is_ready = children.iter().any(|child| child.name() == self.module && child.may_hold());
        own.candidate.set_ready(now_ns, is_ready);
    }

    /// For the lease, if this node may run the module; and for the holder, if that is due. An answer to an earlier look
    /// tells nothing, so each has half a lease to come.
    fn questions(&mut self, now_ns: u64, lease_ns: u64) -> impl Iterator<Item = Ask> {
        let own = self.own.as_mut().map(|own| own.candidate.ask(now_ns));
        let look = (now_ns >= self.look_ns).then(|| {
            self.look_ns = now_ns.saturating_add(lease_ns / 2);
            self.fence.look(now_ns)
        });
        own.into_iter().chain(look)
    }

    /// Lets the process run, or ends it, and sets its timer.
    fn act(&mut self, children: &mut [Child], node: &Node, now: Instant) {
        let Some(own) = &mut self.own else { return };
        let until_ns = own.candidate.until_ns();
        if let Some(until_ns) = until_ns {
            let at = TimeSpec::from_duration(Duration::from_nanos(until_ns));
            // A timer that is there can be set.
            let _ = own.timer.set(Expiration::OneShot(at), TimerSetTimeFlags::TFD_TIMER_ABSTIME);
        }
        let now_ns = monotonic_ns();
        // Asked after the timer was set: otherwise the process may have been told to end meanwhile.
        let has_fired = own.ends_ns.is_some_and(|ends_ns| now_ns >= ends_ns);
        let until_ns = until_ns.filter(|_| !has_fired && own.candidate.holds(now_ns).is_some());
        if until_ns.is_some() && own.ends_ns.is_none() {
            node.pass_incarnation(node.last_incarnation().wrapping_add(INCARNATIONS));
        }
        match (own.ends_ns.is_some(), until_ns.is_some()) {
            // An event that is there can be set and taken back.
            (false, true) => _ = own.event.write(1),
            (true, false) => _ = own.event.read(),
            _ => {}
        }
        own.ends_ns = until_ns;
        let child = children.iter_mut().find(|child| child.name() == self.module);
        child.into_iter().for_each(|child| child.hold(until_ns, node, now));
    }
}

impl OwnSeat {
    fn of(module: &Module, terms: Terms, node_name: &str) -> Result<Option<Self>, LeaseError> {
        let place = module.nodes.iter().position(|node| node == node_name);
        let Some(place) = place.and_then(|place| u8::try_from(place).ok()) else { return Ok(None) };
        let timer = TimerFd::new(TimerClock::CLOCK_BOOTTIME, TimerFlags::TFD_CLOEXEC).map_err(io::Error::from)?;
        let event = EventFd::from_flags(EfdFlags::EFD_CLOEXEC | EfdFlags::EFD_NONBLOCK).map_err(io::Error::from)?;
        Ok(Some(Self { place, candidate: Candidate::new(terms, place, run()), timer, event, ends_ns: None }))
    }
}

#[cfg(test)]
mod tests;
