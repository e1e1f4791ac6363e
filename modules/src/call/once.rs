//! At most once: decides whether a command runs, is answered from memory, or is refused. Knows no clock and no mailbox.
//!
//! A caller repeats a command whose answer does not come. What one incarnation of the server has run, it never runs again:
//! it remembers the last [`REPLIES_KEPT`] answers of each caller and which sequence numbers they belong to. A server that was
//! restarted remembers nothing; it can tell, though, that a command was first tried before its own start, and then says that
//! the outcome is unknown, unless the function is idempotent.

use super::Fault;
use rohrpost_mailbox::Name;

/// Callers remembered at a time.
pub const CALLERS_MAX: usize = 64;
/// Answers remembered of each; a caller has at most so many calls under way.
pub const REPLIES_KEPT: usize = 8;

/// A command as it came in.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Request {
    /// Reply mailbox of the caller.
    pub from: Name,
    /// The caller's incarnation.
    pub incarnation: u32,
    /// The call's number in it.
    pub sequence: u32,
    /// Validity, counted from the first try, ns.
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
    /// Run it, then say [`Once::done`].
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
    incarnation: u32,
    /// Highest sequence number that was run.
    last: u32,
    /// Answers, the latest at `next - 1`.
    answers: [Answer; REPLIES_KEPT],
    next: usize,
    /// No repeat can come after this, ns on the server's clock.
    until_ns: u64,
}

#[derive(Default)]
struct Answer {
    /// None: an empty place.
    sequence: Option<u32>,
    error: bool,
    body: Vec<u8>,
}

/// What one server has run.
pub struct Once {
    started_ns: u64,
    callers: Vec<Memory>,
}

impl Once {
    /// For a server that started now.
    pub fn new(started_ns: u64) -> Self {
        Self { started_ns, callers: Vec::with_capacity(CALLERS_MAX) }
    }

    /// Decides on a command. `now_ns` is the monotonic clock.
    pub fn judge(&mut self, request: &Request, now_ns: u64) -> Verdict<'_> {
        let known = self.callers.iter().position(|caller| caller.from == request.from);
        if let Some(at) = known {
            // Incarnations count upwards and may wrap.
            let newer = request.incarnation.wrapping_sub(self.callers[at].incarnation) as i32;
            if newer < 0 {
                return Verdict::Ignore;
            }
            if newer == 0 && self.callers[at].knows(request.sequence) {
                return self.callers[at].again(request.sequence);
            }
        }
        if request.age_ns > request.valid_for_ns {
            return Verdict::Refuse(Fault::Expired);
        }
        // First tried before this server lived, or in the hands of one that died.
        let before_us = request.repeat && request.age_ns > now_ns.saturating_sub(self.started_ns);
        if (before_us || request.redelivered) && !request.idempotent {
            return Verdict::Refuse(Fault::Interrupted);
        }
        if known.is_none() && !self.make_room(now_ns) {
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
        let memory = &mut self.callers[at];
        if memory.incarnation != request.incarnation {
            memory.begin(request);
        }
        let left_ns = request.valid_for_ns.saturating_sub(request.age_ns);
        memory.until_ns = memory.until_ns.max(now_ns.saturating_add(left_ns));
        let newer = request.sequence.wrapping_sub(memory.last) as i32 > 0;
        memory.last = if newer { request.sequence } else { memory.last };
        let answer = &mut memory.answers[memory.next];
        memory.next = (memory.next + 1) % REPLIES_KEPT;
        answer.sequence = Some(request.sequence);
        answer.error = error;
        answer.body.clear();
        answer.body.extend_from_slice(body);
    }

    /// Forgets a caller of whom no repeat can come any more, if there is no room for another. Never one of whom it can:
    /// then a repeat would run twice.
    fn make_room(&mut self, now_ns: u64) -> bool {
        if self.callers.len() < CALLERS_MAX {
            return true;
        }
        let oldest = self.callers.iter().enumerate().min_by_key(|(_, caller)| caller.until_ns);
        match oldest {
            Some((at, caller)) if caller.until_ns < now_ns => {
                self.callers.swap_remove(at);
                true
            }
            _ => false,
        }
    }
}

impl Memory {
    fn new(request: &Request) -> Self {
        let mut memory = Self {
            from: request.from,
            incarnation: request.incarnation,
            last: 0,
            answers: Default::default(),
            next: 0,
            until_ns: 0,
        };
        memory.begin(request);
        memory
    }

    /// A new life of the same caller: its numbers begin anew.
    fn begin(&mut self, request: &Request) {
        self.incarnation = request.incarnation;
        self.last = request.sequence.wrapping_sub(1);
        self.answers.iter_mut().for_each(|answer| answer.sequence = None);
    }

    /// Whether it was run, or is so old that it may have been.
    fn knows(&self, sequence: u32) -> bool {
        let behind = self.last.wrapping_sub(sequence) as i32;
        behind >= REPLIES_KEPT as i32 || self.answers.iter().any(|answer| answer.sequence == Some(sequence))
    }

    fn again(&self, sequence: u32) -> Verdict<'_> {
        match self.answers.iter().find(|answer| answer.sequence == Some(sequence)) {
            Some(answer) => Verdict::Again(answer.error, &answer.body),
            // Older than all that is remembered: a caller with fewer than REPLIES_KEPT calls under way has its answer.
            None => Verdict::Ignore,
        }
    }
}
