//! Why a sequence of a stream has no record, and counts of such.

/// Why a sequence has no record.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum OmissionCause {
    /// It never came.
    Lost,
    /// Its sender left it out on purpose.
    Sampled,
}

/// Sequences that were left out, by cause.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct LeftOut {
    pub(crate) lost: u64,
    pub(crate) sampled: u64,
}

impl LeftOut {
    /// With one more. Only damaged files come to the end of a count.
    pub(crate) fn with(self, cause: OmissionCause) -> Self {
        match cause {
            OmissionCause::Lost => Self { lost: self.lost.saturating_add(1), ..self },
            OmissionCause::Sampled => Self { sampled: self.sampled.saturating_add(1), ..self },
        }
    }
}
