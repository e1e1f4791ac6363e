//! One computer's part: it asks, and knows when it may be on.

use super::message::{Answer, Ask, Number, Wish};
use super::terms::Terms;

/// A lease as its holder sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Held {
    number: Number,
    /// Off from then on.
    until_ns: u64,
}

/// A candidate for one module's lease. Time is that of its own monotonic clock, ns, which must go on while the computer
/// is suspended (Linux: `CLOCK_BOOTTIME`).
///
/// ```
/// use rohrpost_supervision::lease::{Candidate, LEASE_MAX_NS, Terms, Witness};
/// let terms = Terms::new(1_000, 100, 50, 0)?;
/// let (mut witness, mut candidate) = (Witness::new(0, terms, 7), Candidate::new(terms, 0, 1));
/// candidate.set_ready(0, true);
/// for now_ns in [0, 100] {
///     let ask = candidate.poll(now_ns).unwrap();
///     // The first answer shows the candidate that it hears the witness, the second one grants.
///     let answer = witness.ask(LEASE_MAX_NS + now_ns, &ask).unwrap();
///     candidate.take(now_ns + 10, &answer);
/// }
/// assert!(candidate.holds(1_049).is_some());
/// assert_eq!(candidate.holds(1_050), None); // 100 + 1000 - 50
/// # Ok::<(), rohrpost_supervision::lease::BadTerms>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Candidate {
    terms: Terms,
    place: u8,
    run: u32,
    is_ready: bool,
    /// When the next question is due.
    due_ns: u64,
    /// Newest question that was answered.
    answered_ns: Option<u64>,
    /// Answers to questions from then or before grant nothing.
    released_ns: Option<u64>,
    held: Option<Held>,
}

impl Candidate {
    /// The candidate with this place in the order of choice. It is not ready. `run` must not be that of an earlier run.
    pub fn new(terms: Terms, place: u8, run: u32) -> Self {
        Self { terms, place, run, is_ready: false, due_ns: 0, answered_ns: None, released_ns: None, held: None }
    }

    /// Says whether the module could be on here. One that is no longer ready must be off before this is called: the
    /// lease is given back.
    pub fn set_ready(&mut self, now_ns: u64, is_ready: bool) {
        if self.is_ready && !is_ready {
            self.held = None;
            self.released_ns = Some(now_ns);
            self.due_ns = now_ns.saturating_add(1);
        }
        self.is_ready = is_ready;
    }

    /// Number of the lease under which the module may be on at `now_ns`; none: it must be off.
    pub fn holds(&self, now_ns: u64) -> Option<Number> {
        self.held.filter(|held| now_ns < held.until_ns).map(|held| held.number)
    }

    /// When to look at [`Self::holds`] again if no answer comes; none while it does not hold.
    pub fn until_ns(&self) -> Option<u64> {
        self.held.map(|held| held.until_ns)
    }

    /// When the next question is due.
    pub fn due_ns(&self) -> u64 {
        self.due_ns
    }

    /// The question that is to be sent now, if one is due.
    pub fn poll(&mut self, now_ns: u64) -> Option<Ask> {
        (now_ns >= self.due_ns).then(|| self.ask(now_ns))
    }

    /// The question, before it is due: together with those of other modules, say.
    pub fn ask(&mut self, now_ns: u64) -> Ask {
        self.due_ns = now_ns.saturating_add(self.terms.ask_every_ns());
        let wish = if self.is_ready { Wish::Hold } else { Wish::Release };
        Ask { place: self.place, run: self.run, asked_ns: now_ns, answered_ns: self.answered_ns, wish }
    }

    /// Takes an answer that came at `now_ns`. What it grants counts from when its question was asked.
    pub fn take(&mut self, now_ns: u64, answer: &Answer) {
        if answer.run != self.run || answer.asked_ns > now_ns {
            return;
        }
        self.answered_ns = self.answered_ns.max(Some(answer.asked_ns));
        let is_void = self.released_ns.is_some_and(|released_ns| answer.asked_ns <= released_ns);
        let Some(granted_ns) = answer.granted_ns.filter(|_| !is_void) else { return };
        let until_ns = answer.asked_ns.saturating_add(self.terms.held_ns(granted_ns));
        if self.held.is_none_or(|held| held.until_ns < until_ns) {
            self.held = Some(Held { number: answer.newest, until_ns });
        }
    }
}
