//! Refuses what an earlier holder sends late.

use super::message::{Answer, Ask, Number, Wish};

/// Why data or a command of a holder does not pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, thiserror::Error)]
pub enum Fenced {
    /// A newer holder was heard.
    #[error("the lease {count} is over; {newest} is the newest one")]
    Old {
        /// Number that the package carries.
        count: u32,
        /// Newest number of the same witness.
        newest: u32,
    },
    /// Nothing tells whether its number is new or old: the witness is to be asked ([`Fence::look`]).
    #[error("the lease was given by another run of the witness than the one known here")]
    Unconfirmed,
}

/// Lets pass what the newest holder sends. One for each module with several candidates, on each computer that receives
/// from it. Time is that of its own monotonic clock, ns.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Fence {
    run: u32,
    newest: Option<Number>,
    /// Of the newest question, while it is not answered.
    asked_ns: Option<u64>,
}

impl Fence {
    /// A fence that knows no witness. `run` must not be that of an earlier run, or of another asking program.
    pub fn new(run: u32) -> Self {
        Self { run, newest: None, asked_ns: None }
    }

    /// Newest number that is known here.
    pub fn newest(&self) -> Option<Number> {
        self.newest
    }

    /// Whether what carries this number passes. From then on nothing older does.
    ///
    /// # Errors
    /// If a newer lease is known, or the witness has to be asked first.
    pub fn admit(&mut self, number: Number) -> Result<(), Fenced> {
        let newest = self.newest.filter(|newest| newest.witness == number.witness).ok_or(Fenced::Unconfirmed)?;
        if number.count < newest.count {
            return Err(Fenced::Old { count: number.count, newest: newest.count });
        }
        self.newest = Some(number);
        Ok(())
    }

    /// The question which witness is the present one. Only the answer to the last question counts: the run that answers
    /// it has begun after all that were known before.
    ///
    /// `now_ns` must be later than in the last call.
    pub fn look(&mut self, now_ns: u64) -> Ask {
        self.asked_ns = Some(now_ns);
        Ask { place: 0, run: self.run, asked_ns: now_ns, answered_ns: None, wish: Wish::Look }
    }

    /// Takes the witness's answer; whether it is the one that is waited for, which tells the present state.
    pub fn take(&mut self, answer: &Answer) -> bool {
        if answer.run != self.run || self.asked_ns != Some(answer.asked_ns) {
            return false;
        }
        self.asked_ns = None;
        let is_known = |newest: Number| newest.witness == answer.newest.witness && newest.count >= answer.newest.count;
        if !self.newest.is_some_and(is_known) {
            self.newest = Some(answer.newest);
        }
        true
    }
}
