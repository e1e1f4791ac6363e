//! What decoding one message may cost, whatever its description says. Python's client counts in the same way
//! (`clients/python/src/rohrpost/schema/budget.py`), and both are held to `tests/conformance/budget.json`.
//!
//! A description comes from the same stranger as the bytes. It may nest structs that add no byte, claim arrays of four
//! billion elements, and name a field with a hundred kilobytes. So each value is counted before it is made, and the
//! count bounds all that it costs:
//!
//! - **Values:** [`EMPTY_MAX`], and [`VALUES_PER_BYTE`] for each byte of the message, but no more than [`VALUES_MAX`].
//! - **Bytes:** a value is at most 48 bytes here with its name, and a block of memory of its own. Texts and bytes are
//!   copied once. Names are shared; where they are printed, each [`NAME_BYTES`] of one count as another value.
//! - **Steps:** what is asked of a type is asked once a message. Each value takes as many steps as types wrap it, at
//!   most [`DEPTH_MAX`](crate::DEPTH_MAX).

use crate::{EMPTY_MAX, NAME_BYTES, VALUES_MAX, VALUES_PER_BYTE, WalkProblem};

/// What is left for one message.
pub(crate) struct Budget {
    /// So many values there may be in all.
    most: usize,
    values_left: usize,
    empty_left: usize,
}

impl Budget {
    /// For a message of so many bytes.
    pub(crate) fn of_message(len_bytes: usize) -> Self {
        let most = len_bytes.saturating_mul(VALUES_PER_BYTE).saturating_add(EMPTY_MAX).min(VALUES_MAX);
        Self { most, values_left: most, empty_left: EMPTY_MAX }
    }

    /// One more value.
    pub(crate) fn value(&mut self) -> Result<(), WalkProblem> {
        self.take(1)
    }

    /// A name that is printed with its value.
    pub(crate) fn name(&mut self, name: &str) -> Result<(), WalkProblem> {
        self.take(name.len() / NAME_BYTES)
    }

    /// A value that took no bytes.
    pub(crate) fn empty(&mut self) -> Result<(), WalkProblem> {
        self.empty_left = self.empty_left.checked_sub(1).ok_or(WalkProblem::TooManyEmpty)?;
        Ok(())
    }

    /// So many numbers follow that are not counted: they take four bytes each, so the message bounds them.
    pub(crate) fn credit(&mut self, numbers: usize) {
        self.values_left = self.values_left.saturating_add(numbers);
    }

    /// Whether so many values may follow; nothing is taken yet.
    pub(crate) fn has_room(&self, values: usize) -> Result<(), WalkProblem> {
        if values > self.values_left { Err(self.too_many()) } else { Ok(()) }
    }

    /// The length of a list of values without bytes, if they may follow; nothing is taken yet.
    pub(crate) fn room_for_empty(&self, claimed: u64) -> Result<usize, WalkProblem> {
        let length = usize::try_from(claimed).ok().filter(|length| *length <= self.empty_left);
        length.ok_or(WalkProblem::TooManyEmpty)
    }

    fn take(&mut self, values: usize) -> Result<(), WalkProblem> {
        self.values_left = self.values_left.checked_sub(values).ok_or_else(|| self.too_many())?;
        Ok(())
    }

    fn too_many(&self) -> WalkProblem {
        WalkProblem::TooManyValues { most: self.most }
    }
}
