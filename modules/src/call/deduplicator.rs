//! At most once: decides whether a command runs, is answered from memory, or is refused. Knows no clock and no mailbox.
//!
//! A caller repeats a command if the answer does not come. What one incarnation of the server has run, it never runs
//! again: of each caller it remembers which of the last [`WINDOW`] numbers it has run, and the last [`REPLIES_KEPT`]
//! answers. A server that was restarted remembers nothing; it can tell, though, that a command was first tried before
//! its own start, and then says that the outcome is unknown, unless the function is idempotent.
//!
//! The number of callers that it remembers is bounded, and shared out by principal: callers that configuration names
//! always find a place, and nobody else takes all of the others. A caller is remembered as long as its command is
//! valid, at most [`VALIDITY_MAX`], whatever the caller says.
//!
//! A command's age counts its wait with the caller and in the server's mailbox, but not its way in between. So routers
//! drop packages that were under way for longer than [`TRANSIT_MAX`], and drop duplicates. One thing nobody can tell: a
//! first try that arrives after its own repeat, and is on the wire while the server runs that repeat and is restarted,
//! looks new to the next server.

use super::Fault;
use super::envelope::TRANSIT_MAX;
use crate::places::Places;
use rohrpost_config::Principal;
use rohrpost_mailbox::Name;
use std::time::Duration;

/// Callers remembered at a time, besides one of each principal that always finds a place.
pub const CALLERS_MAX: usize = 64;
/// A caller's word for longer ones is not taken: a command that is older does not run.
pub const VALIDITY_MAX: Duration = Duration::from_secs(60);
const VALIDITY_MAX_NS: u64 = VALIDITY_MAX.as_nanos() as u64;
/// Answers remembered of each; a caller has at most so many calls under way to one server.
pub const REPLIES_KEPT: usize = 8;
/// Numbers of each caller of which it is known whether they were run. More than answers, since a caller counts all its
/// calls, and those to others come in between.
pub const WINDOW: u32 = u128::BITS;
const TRANSIT_MAX_NS: u64 = TRANSIT_MAX.as_nanos() as u64;
const _: () = assert!(WINDOW as usize > REPLIES_KEPT, "an answer that is kept belongs to a number that is known");

/// A command as it came in.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Request {
    /// Reply mailbox of the caller.
    pub from: Name,
    /// The principal that is charged for its place.
    pub principal: Principal,
    /// The caller's incarnation.
    pub incarnation: u32,
    /// The call's number in it.
    pub sequence: u32,
    /// Validity, counted from the first try, ns; of a longer one [`VALIDITY_MAX`] counts.
    pub valid_for_ns: u64,
    /// Time since the first try, waiting in mailboxes included, ns; 0 for a first try that did not wait.
    pub age_ns: u64,
    /// Whether this is a repeat.
    pub repeat: bool,
    /// Whether a receiver died with this package in hand.
    pub redelivered: bool,
    /// Whether the function may be run twice without harm.
    pub idempotent: bool,
}

/// What to do with a command.
#[derive(PartialEq, Eq, Debug)]
pub enum Verdict<'a> {
    /// Run it, then say [`Deduplicator::done`].
    Run,
    /// It was run; this was the answer (option `error` set, body).
    Again(bool, &'a [u8]),
    /// Say this; it was not run.
    Refuse(Fault),
    /// Say nothing: nobody waits for it any more.
    Ignore,
}

struct Memory {
    from: Name,
    principal: Principal,
    incarnation: u32,
    /// Highest sequence number that was run.
    last: u32,
    /// Which numbers were run: bit n is `last - n`.
    run: u128,
    /// Answers, the latest at `next - 1`.
    answers: [Answer; REPLIES_KEPT],
    next: usize,
    /// No repeat can come after this, ns on the server's clock.
    until_ns: u64,
}

/// Where a command stands among those that are remembered of its caller.
enum Place {
    /// It was run.
    WasRun,
    /// It was not run by this server.
    New,
    /// A request of an earlier incarnation of the caller. If that still waits, it learns why it is not served.
    Earlier,
    /// Older than what is remembered.
    Before,
}

#[derive(Default)]
struct Answer {
    /// None: an empty place.
    sequence: Option<u32>,
    error: bool,
    body: Vec<u8>,
}

/// What one server has run.
pub struct Deduplicator {
    started_ns: u64,
    callers: Vec<Memory>,
    places: Places,
}

impl Deduplicator {
    /// For a server that started now. One caller of each of these principals always finds a place.
    pub fn new(started_ns: u64, named: &[Principal]) -> Self {
        let places = Places::new(named, 1, CALLERS_MAX);
        Self { started_ns, callers: Vec::with_capacity(places.total()), places }
    }

    /// The server has stood by for another one, which ran nothing after this time: what that may have run is refused.
    pub fn takes_over(&mut self, now_ns: u64) {
        self.started_ns = now_ns;
    }

    /// Decides on a command. `now_ns` is the monotonic clock.
    pub fn validate(&mut self, request: &Request, now_ns: u64) -> Verdict<'_> {
        let known = self.callers.iter().position(|caller| caller.from == request.from);
        if let Some(at) = known {
            match self.callers[at].place(request) {
                Place::WasRun => return self.callers[at].again(request.sequence),
                Place::Earlier if now_ns <= self.callers[at].until_ns => {
                    return Verdict::Refuse(Fault::EarlierIncarnation);
                }
                Place::Before if now_ns <= self.callers[at].until_ns => return Verdict::Ignore,
                // Nothing of what is remembered can be repeated any more: the caller's numbers have begun anew (its
                // computer's clock was reset), or have gone half way round since it last called.
                Place::Earlier | Place::Before | Place::New => {}
            }
        }
        // First tried before this server lived, or in the hands of one that died.
        let oldest_ns = request.age_ns.saturating_add(TRANSIT_MAX_NS);
        let before_us = request.repeat && oldest_ns > now_ns.saturating_sub(self.started_ns);
        if (before_us || request.redelivered) && !request.idempotent {
            return Verdict::Refuse(Fault::Interrupted);
        }
        if request.age_ns > request.validity_ns() {
            // To say `Expired` is to say that it was not run. Of a repeat that is unknown, and nobody waits for it any
            // more.
            let first = !request.repeat && !request.redelivered;
            return if first { Verdict::Refuse(Fault::Expired) } else { Verdict::Ignore };
        }
        // One that is remembered, but need not be, holds no place: others may have taken all.
        let has_place = known.is_some_and(|at| self.callers[at].until_ns >= now_ns);
        if !has_place && !self.make_room(request.principal, now_ns) {
            return Verdict::Refuse(Fault::Busy);
        }
        Verdict::Run
    }

    /// Remembers the answer of a command that was run.
    pub fn done(&mut self, request: &Request, now_ns: u64, error: bool, body: &[u8]) {
        let at = match self.callers.iter().position(|caller| caller.from == request.from) {
            Some(at) => at,
            None => {
                self.callers.push(Memory::new(request));
                self.callers.len() - 1
            }
        };
        let left_ns = request.validity_ns().saturating_sub(request.age_ns).saturating_add(TRANSIT_MAX_NS);
        self.callers[at].note(request, error, body, now_ns.saturating_add(left_ns));
    }

    /// Whether there is room for another caller of this principal. Forgets a caller from which no repeat can come any
    /// more, if that is what it takes; never one that can still repeat: then a repeat would run twice.
    fn make_room(&mut self, principal: Principal, now_ns: u64) -> bool {
        let held = self.callers.iter().filter(|caller| caller.until_ns >= now_ns).map(|caller| caller.principal);
        if !self.places.allows(principal, held) {
            return false;
        }
        if self.callers.len() >= self.places.total() {
            let oldest = self.callers.iter().enumerate().min_by_key(|(_, caller)| caller.until_ns);
            // Of those that count fewer are there than places, so this one does not.
            oldest.map(|(at, _)| at).map(|at| self.callers.swap_remove(at));
        }
        true
    }
}

impl Request {
    fn validity_ns(&self) -> u64 {
        self.valid_for_ns.min(VALIDITY_MAX_NS)
    }
}

impl Memory {
    fn new(request: &Request) -> Self {
        let mut memory = Self {
            from: request.from,
            principal: request.principal,
            incarnation: request.incarnation,
            last: 0,
            run: 0,
            answers: Default::default(),
            next: 0,
            until_ns: 0,
        };
        memory.begin(request);
        memory
    }

    /// A new incarnation of the same caller: its numbers begin anew.
    fn begin(&mut self, request: &Request) {
        self.incarnation = request.incarnation;
        self.last = request.sequence;
        self.run = 0;
        self.answers.iter_mut().for_each(|answer| answer.sequence = None);
    }

    /// Incarnations and numbers count upwards and wrap.
    fn place(&self, request: &Request) -> Place {
        match request.incarnation.wrapping_sub(self.incarnation) as i32 {
            ..0 => return Place::Earlier,
            1.. => return Place::New,
            0 => {}
        }
        match self.last.wrapping_sub(request.sequence) as i32 {
            ..0 => Place::New,
            behind if behind as u32 >= WINDOW => Place::Before,
            behind if self.run & 1 << behind != 0 => Place::WasRun,
            _ => Place::New,
        }
    }

    /// Remembers that a command was run.
    fn note(&mut self, request: &Request, error: bool, body: &[u8], until_ns: u64) {
        if request.incarnation != self.incarnation || matches!(self.place(request), Place::Earlier | Place::Before) {
            self.begin(request);
        }
        self.until_ns = self.until_ns.max(until_ns);
        // Told apart as `place` does, also half way round, where both sides are equally far.
        match self.last.wrapping_sub(request.sequence) as i32 {
            ahead @ ..0 if ahead.unsigned_abs() < WINDOW => {
                self.run = self.run << ahead.unsigned_abs() | 1;
                self.last = request.sequence;
            }
            // Nothing that is remembered is known any more. Its answers go too: the numbers may come round again.
            ..0 => {
                self.begin(request);
                self.run = 1;
            }
            behind => self.run |= 1 << behind,
        }
        let answer = &mut self.answers[self.next];
        self.next = (self.next + 1) % REPLIES_KEPT;
        answer.sequence = Some(request.sequence);
        answer.error = error;
        answer.body.clear();
        answer.body.extend_from_slice(body);
    }

    fn again(&self, sequence: u32) -> Verdict<'_> {
        match self.answers.iter().find(|answer| answer.sequence == Some(sequence)) {
            Some(answer) => Verdict::Again(answer.error, &answer.body),
            // Older than all that is remembered: a caller with fewer than REPLIES_KEPT calls under way has its answer.
            None => Verdict::Ignore,
        }
    }
}

#[cfg(test)]
#[path = "deduplicator_simulation.rs"]
mod simulation;
#[cfg(test)]
#[path = "deduplicator_simulation_places.rs"]
mod simulation_places;
#[cfg(test)]
#[path = "deduplicator_tests.rs"]
mod tests;
