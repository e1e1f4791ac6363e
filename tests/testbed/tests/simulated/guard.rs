//! The product's guard of commands, as the simulated modules ask it.

use crate::sim::calls::{Attempt, Guard, Ruling};
use rohrpost_config::Principal;
use rohrpost_modules::call::{Deduplicator, Fault, Request, Verdict};

/// The real guard of commands.
struct RealGuard(Deduplicator);

fn request(attempt: &Attempt) -> Request {
    Request {
        from: attempt.from,
        principal: Principal::Module(attempt.from.module()),
        incarnation: attempt.incarnation,
        sequence: attempt.sequence,
        valid_for_ns: attempt.valid_for_ns,
        age_ns: attempt.age_ns,
        repeat: attempt.repeat,
        redelivered: attempt.redelivered,
        idempotent: false,
    }
}

impl Guard for RealGuard {
    fn validate(&mut self, attempt: &Attempt, now_ns: u64) -> Ruling {
        match self.0.validate(&request(attempt), now_ns) {
            Verdict::Run => Ruling::Run,
            Verdict::Again(_, body) => Ruling::Again(body.iter().fold(0, |run, byte| run << 8 | u32::from(*byte))),
            Verdict::Refuse(Fault::Interrupted) => Ruling::Interrupted,
            Verdict::Refuse(_) => Ruling::Refuse,
            Verdict::Ignore => Ruling::Ignore,
        }
    }

    fn done(&mut self, attempt: &Attempt, now_ns: u64, run: u32) {
        self.0.done(&request(attempt), now_ns, false, &run.to_be_bytes());
    }
}

pub(crate) fn guard(started_ns: u64) -> Box<dyn Guard> {
    Box::new(RealGuard(Deduplicator::new(started_ns, &[])))
}
