//! What must always hold, seen from outside with true time.

use rohrpost_supervision::lease::Number;

/// Numbers in the order in which the witness, in all its runs, has given them.
#[derive(Default)]
pub(crate) struct Given(Vec<Number>);

impl Given {
    /// The witness's newest number, after each of its answers.
    pub(crate) fn note(&mut self, newest: Number) -> bool {
        let is_new = newest.count > 0 && !self.0.contains(&newest);
        if is_new {
            self.0.push(newest);
        }
        is_new
    }

    fn place(&self, number: Number) -> usize {
        self.0.iter().position(|given| *given == number).expect("a candidate sends with a number that was given")
    }

    /// A fence has let `number` pass, and `before` before.
    pub(crate) fn check_order(&self, seed: u64, before: Option<Number>, number: Number) {
        let in_order = before.is_none_or(|before| self.place(before) <= self.place(number));
        assert!(in_order, "seed {seed}: a fence let {number:?} pass after {before:?}");
    }
}
