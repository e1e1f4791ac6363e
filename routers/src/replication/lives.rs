//! Lives of a stream, as its sender counts them: in each, sequences begin anew.

/// What the sender of parts may count sequences from anew.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct Life {
    /// Incarnation of the router.
    pub(super) router: u64,
    /// How often that has seen the stream made anew.
    pub(super) generation: u16,
}

impl Life {
    /// Whether the same router says that this ended. As it wraps: earlier by less than half of all numbers.
    fn is_before(self, other: Self) -> bool {
        self.router == other.router && (other.generation.wrapping_sub(self.generation) as i16) > 0
    }
}

/// The lives that are known.
#[derive(Default)]
pub(super) struct Lives {
    /// Of the newest record; none: it was written before this router began.
    pub(super) newest: Option<Life>,
    /// What the description that came last says: of which life, and how many records were written.
    pub(super) announced: Option<(Life, u64)>,
}

impl Lives {
    /// Whether the stream was made anew since, as its router has said. `open`: of records that are open.
    pub(super) fn is_over(&self, life: Life, open: impl Iterator<Item = Life>) -> bool {
        let announced = self.announced.map(|(life, _)| life);
        [announced, self.newest].into_iter().flatten().chain(open).any(|known| life.is_before(known))
    }

    /// Whether a record that is not newer says that its stream was made anew.
    pub(super) fn is_anew(&self, life: Life, sequence: u64, next: u64) -> bool {
        match self.newest {
            Some(newest) => newest.is_before(life) || newest.router != life.router,
            None => {
                let written = self.announced.filter(|(announced, _)| *announced == life).map(|(_, written)| written);
                sequence + 1 == next || written.is_some_and(|written| written < next)
            }
        }
    }
}
