//! Callers and servers of a simulated network: three tries of each command, and a guard that lets it run at most once.

use super::clock::Now;
use super::oracle::Oracle;
use super::package::Answer;
use super::promise::Promise;
use rohrpost_mailbox::Name;
use std::collections::VecDeque;

/// Tries of a command, as a module's link makes them.
const TRIES: u64 = 3;

/// A command as a server has it before it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Attempt {
    /// Reply mailbox of the caller.
    pub from: Name,
    /// The caller's incarnation.
    pub incarnation: u32,
    /// The call's number.
    pub sequence: u32,
    /// Validity from the first try on, ns.
    pub valid_for_ns: u64,
    /// Time since the first try, without the way, ns.
    pub age_ns: u64,
    /// Whether this is a repeat.
    pub repeat: bool,
    /// Whether a server died with it in hand.
    pub redelivered: bool,
}

/// What the guard says of it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Ruling {
    /// Run it.
    Run,
    /// It was run, as this run of all.
    Again(u32),
    /// It was not run, and will not be.
    Refuse,
    /// It may have been run by a server that is dead.
    Interrupted,
    /// Say nothing.
    Ignore,
}

/// Decides whether a command runs: `Deduplicator` of the crate `modules`, which this crate does not know.
pub trait Guard {
    /// Looks at a command; the clock is the node's monotonic one.
    fn validate(&mut self, attempt: &Attempt, now_ns: u64) -> Ruling;
    /// It was run, as this run of all.
    fn done(&mut self, attempt: &Attempt, now_ns: u64, run: u32);
}

/// Makes the guard of a server that starts now, on its monotonic clock.
pub type NewGuard = fn(started_ns: u64) -> Box<dyn Guard>;

/// A call.
#[derive(Clone, Debug)]
pub(crate) struct Call {
    /// Which of the plan's callers.
    pub(crate) caller: usize,
    /// Its number.
    pub(crate) sequence: u32,
    /// When it began, true ns.
    pub(crate) began_true_ns: u64,
    /// The same on its node's monotonic clock.
    began_ns: u64,
    /// Validity, ns.
    pub(crate) valid_for_ns: u64,
    tries: u64,
    /// What the caller was told first.
    pub(crate) outcome: Option<Answer>,
    runs: Vec<u32>,
    /// Server's incarnation that ran it last.
    life: Option<u32>,
    /// Run twice where no server could have known: a first try, still on its way while a server ran its repeat and
    /// died.
    unknowable: bool,
}

/// A command that waits in a server's mailbox.
#[derive(Clone, Copy, Debug)]
pub(crate) struct QueuedCommand {
    /// Number of the package.
    pub(crate) number: u32,
    /// Which call it is a try of.
    pub(crate) call: usize,
    /// Its age when it was posted, ns.
    pub(crate) age_ns: u64,
    /// When it was posted, true ns.
    pub(crate) posted_ns: u64,
    /// When it came, on the server's monotonic clock.
    pub(crate) published_ns: u64,
    /// When it came, true ns.
    pub(crate) published_true_ns: u64,
    /// Whether it was marked so.
    pub(crate) redelivered: bool,
}

/// A module that runs commands.
pub(crate) struct Server {
    guard: Box<dyn Guard>,
    new_guard: NewGuard,
    life: u32,
    /// How many faults keep it dead now.
    pub(crate) dead: u32,
    /// Commands in its mailbox.
    pub(crate) waiting: VecDeque<QueuedCommand>,
}

impl Server {
    /// One that starts now.
    pub(crate) fn new(new_guard: NewGuard, now: Now) -> Self {
        Self { guard: new_guard(now.monotonic_ns), new_guard, life: 0, dead: 0, waiting: VecDeque::new() }
    }

    /// It starts again.
    pub(crate) fn start(&mut self, now: Now) {
        self.life += 1;
        self.guard = (self.new_guard)(now.monotonic_ns);
    }
}

/// All calls.
#[derive(Default)]
pub(crate) struct Calls {
    /// By number.
    pub(crate) all: Vec<Call>,
    runs: u32,
}

impl Calls {
    /// A new call; its number. Incarnations and sequences are the caller's.
    pub(crate) fn begin(&mut self, now: Now, caller: usize, sequence: u32, valid_for_ns: u64) -> usize {
        self.all.push(Call {
            caller,
            sequence,
            began_true_ns: now.true_ns,
            began_ns: now.monotonic_ns,
            valid_for_ns,
            tries: 0,
            outcome: None,
            runs: Vec::new(),
            life: None,
            unknowable: false,
        });
        self.all.len() - 1
    }

    /// Age of the next try, or none if there is to be none.
    pub(crate) fn next_try(&mut self, now: Now, call: usize) -> Option<u64> {
        let call = &mut self.all[call];
        let since_ns = now.monotonic_ns - call.began_ns;
        if call.outcome.is_some() || call.tries == TRIES || since_ns >= call.valid_for_ns {
            return None;
        }
        call.tries += 1;
        // As envelopes have it: microseconds, and at least one in a repeat.
        Some(if call.tries == 1 { 0 } else { (since_ns / 1000 * 1000).max(1000) })
    }

    /// From one try to the next, ns.
    pub(crate) fn repeat_after_ns(&self, call: usize) -> u64 {
        self.all[call].valid_for_ns / TRIES
    }

    /// A server takes the next command from its mailbox: the answer to give, if any, and what was taken. With `dies` it
    /// dies at some step of it, and the command stays.
    pub(crate) fn serve(
        &mut self,
        oracle: &mut Oracle,
        server: &mut Server,
        now: Now,
        from: Name,
        dies: bool,
    ) -> Option<(QueuedCommand, Option<Answer>)> {
        let waiting = server.waiting.pop_front()?;
        let call = &self.all[waiting.call];
        let attempt = Attempt {
            from,
            incarnation: 1,
            sequence: call.sequence,
            valid_for_ns: call.valid_for_ns,
            age_ns: waiting.age_ns + (now.monotonic_ns - waiting.published_ns),
            repeat: waiting.age_ns > 0,
            redelivered: waiting.redelivered,
        };
        let (what, answer) = match server.guard.validate(&attempt, now.monotonic_ns) {
            Ruling::Run => ("run", Some(Answer::Ran(self.runs))),
            Ruling::Again(run) => ("run before", Some(Answer::Ran(run))),
            Ruling::Refuse => ("refused by its server", Some(Answer::NotRun)),
            Ruling::Interrupted => ("interrupted", Some(Answer::Interrupted)),
            Ruling::Ignore => ("ignored", None),
        };
        oracle.saw(what);
        if what == "run" {
            self.run(oracle, now, server.life, &waiting);
            if !dies {
                server.guard.done(&attempt, now.monotonic_ns, self.runs - 1);
            }
        }
        if dies {
            // A package is dropped when its receiver dies a second time.
            if !waiting.redelivered {
                server.waiting.push_front(QueuedCommand { redelivered: true, ..waiting });
            }
            return None;
        }
        Some((waiting, answer))
    }

    fn run(&mut self, oracle: &mut Oracle, now: Now, life: u32, waiting: &QueuedCommand) {
        let call = &mut self.all[waiting.call];
        let on_the_way = waiting.age_ns == 0 && waiting.posted_ns < waiting.published_true_ns;
        call.unknowable |= on_the_way && call.life.is_some_and(|before| before != life);
        call.life = Some(life);
        call.runs.push(self.runs);
        self.runs += 1;
        if call.runs.len() > 1 && !call.unknowable {
            oracle.broken(now, Promise::AtMostOnce, format!("call {} was run {} times", waiting.call, call.runs.len()));
        } else if call.outcome == Some(Answer::NotRun) {
            oracle.broken(now, Promise::AtMostOnce, format!("call {} was said not to run, and is run", waiting.call));
        }
    }

    /// The caller has an answer.
    pub(crate) fn answered(&mut self, oracle: &mut Oracle, now: Now, index: usize, answer: Answer) {
        let call = &mut self.all[index];
        if call.outcome.is_some() || now.monotonic_ns - call.began_ns >= call.valid_for_ns {
            return;
        }
        // As `link` has it: once there are repeats, one that was refused says nothing of the others.
        if answer == Answer::NotRun && call.tries > 1 {
            return;
        }
        call.outcome = Some(answer);
        let wrong = match answer {
            Answer::Ran(run) => !call.runs.contains(&run),
            Answer::NotRun => !call.runs.is_empty(),
            Answer::Interrupted => false,
        };
        if wrong {
            let text = format!("call {index} was answered {answer:?}, its runs are {:?}", call.runs);
            oracle.broken(now, Promise::AtMostOnce, text);
        }
        oracle.saw(match answer {
            Answer::Ran(_) => "answered",
            Answer::Interrupted => "told that it was interrupted",
            Answer::NotRun => "told that it was not run",
        });
    }
}
