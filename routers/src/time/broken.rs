//! Mistakes that can be switched on, to see that the tests and the simulation notice them.

/// A mistake.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Broken {
    /// Takes any reply for the answer to its last question.
    AnyReply,
    /// The bound does not grow with age.
    NoDrift,
    /// Does not add the master's own bound.
    NoMasterError,
    /// Sets the time within an epoch, instead of slewing.
    Steps,
    /// Takes half of the half delay for the bound.
    HalfBound,
    /// Goes on with what it measured of another master.
    OldSamples,
    /// Never yields to another master.
    Stubborn,
}

impl Broken {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::AnyReply,
        Self::NoDrift,
        Self::NoMasterError,
        Self::Steps,
        Self::HalfBound,
        Self::OldSamples,
        Self::Stubborn,
    ];
}
