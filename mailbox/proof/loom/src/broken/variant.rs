//! What a variant is, and what several of them change or say.

pub(crate) use rohrpost_planted::{Edit, edit};

/// A mistake that one could make.
pub(crate) struct Broken {
    pub(crate) name: &'static str,
    pub(crate) edits: &'static [Edit],
    /// The model that fails.
    pub(crate) caught_by: &'static str,
    /// What the failure says.
    pub(crate) says: &'static str,
}

pub(crate) const fn broken(
    name: &'static str,
    edits: &'static [Edit],
    caught_by: &'static str,
    says: &'static str,
) -> Broken {
    Broken { name, edits, caught_by, says }
}

/// Two threads touch a body, and nothing orders them.
pub(crate) const RACE: &str = "Causality violation";
/// A promise was not kept.
pub(super) const WRONG: &str = "assertion";
/// The receiver sleeps for ever: nobody will ring.
pub(crate) const ENDLESS: &str = "maximum number of branches";

pub(super) const FENCE_E: &str = "turns to less important packages likewise.\n        seq_cst_accesses();\n";
pub(super) const NO_FENCE_E: &str = "turns to less important packages likewise.\n";
