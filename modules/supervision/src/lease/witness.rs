//! Grants the lease to one candidate at a time.

use super::message::{Answer, Ask, Number, Wish};
use super::terms::{LEASE_MAX_NS, Terms};

/// Most candidates of a module.
pub const CANDIDATES_MAX: usize = 8;

/// A lease that was granted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Grant {
    place: u8,
    run: u32,
    /// Of its holder's newest question.
    asked_ns: u64,
    /// On the witness's clock.
    ends_ns: u64,
}

/// The witness of one module's lease. Time is that of its own monotonic clock, ns.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Witness {
    terms: Terms,
    newest: Number,
    opens_ns: u64,
    grant: Option<Grant>,
    /// When each candidate was last ready.
    ready_ns: [Option<u64>; CANDIDATES_MAX],
}

impl Witness {
    /// A witness that starts at `now_ns`, and grants nothing before each lease of an earlier run is over. `run` must
    /// not be that of an earlier run.
    pub fn new(now_ns: u64, terms: Terms, run: u32) -> Self {
        Self {
            terms,
            newest: Number { witness: run, count: 0 },
            opens_ns: now_ns.saturating_add(LEASE_MAX_NS),
            grant: None,
            ready_ns: [None; CANDIDATES_MAX],
        }
    }

    /// Place of the candidate that holds the lease at `now_ns`, and the lease's number.
    pub fn holder(&self, now_ns: u64) -> Option<(u8, Number)> {
        self.grant.filter(|grant| now_ns < grant.ends_ns).map(|grant| (grant.place, self.newest))
    }

    /// Takes a question that came at `now_ns`. No answer: it is older than one that came before, or of no candidate.
    pub fn ask(&mut self, now_ns: u64, ask: &Ask) -> Option<Answer> {
        self.grant = self.grant.filter(|grant| now_ns < grant.ends_ns);
        let granted_ns = match ask.wish {
            Wish::Look => None,
            Wish::Hold | Wish::Release => self.candidate(now_ns, ask)?,
        };
        Some(Answer {
            run: ask.run,
            asked_ns: ask.asked_ns,
            newest: self.newest,
            holder: self.grant.map(|grant| grant.place),
            granted_ns,
        })
    }

    /// For how long the candidate has the lease, if it has; nothing if the question is not to be answered.
    fn candidate(&mut self, now_ns: u64, ask: &Ask) -> Option<Option<u64>> {
        let is_ready = ask.wish == Wish::Hold && ask.is_answered(self.terms.lease_ns());
        *self.ready_ns.get_mut(usize::from(ask.place))? = is_ready.then_some(now_ns);
        let mut grant = match self.grant {
            Some(grant) if (grant.place, grant.run) != (ask.place, ask.run) => return Some(None),
            // Overrun by a later question; a release must not end what that one was granted.
            Some(grant) if ask.asked_ns <= grant.asked_ns => return None,
            Some(grant) => grant,
            None if is_ready && self.is_free_for(now_ns, ask.place) => {
                self.newest.count += 1;
                Grant { place: ask.place, run: ask.run, asked_ns: ask.asked_ns, ends_ns: now_ns }
            }
            None => return Some(None),
        };
        grant.asked_ns = ask.asked_ns;
        if is_ready {
            grant.ends_ns = now_ns.saturating_add(self.terms.lease_ns());
        }
        self.grant = (ask.wish == Wish::Hold).then_some(grant);
        Some(is_ready.then_some(self.terms.lease_ns()))
    }

    /// Whether earlier runs' leases are over, a number is left, and no better choice was ready within the last lease.
    fn is_free_for(&self, now_ns: u64, place: u8) -> bool {
        let mut better = self.ready_ns.iter().take(usize::from(place)).flatten();
        now_ns >= self.opens_ns
            && self.newest.count < u32::MAX
            && better.all(|ready_ns| now_ns.saturating_sub(*ready_ns) >= self.terms.lease_ns())
    }
}
