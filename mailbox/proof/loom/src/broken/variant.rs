//! What a variant is, and what several of them change or say.

/// A change of the real source. `from` must be there exactly once, so that a variant cannot rot unseen.
pub(crate) struct Edit {
    pub(crate) file: &'static str,
    pub(crate) from: &'static str,
    pub(crate) to: &'static str,
}

pub(super) const fn edit(file: &'static str, from: &'static str, to: &'static str) -> Edit {
    Edit { file, from, to }
}

/// A mistake that one could make.
pub(crate) struct Broken {
    pub(crate) name: &'static str,
    pub(crate) edits: &'static [Edit],
    /// The model that fails.
    pub(crate) caught_by: &'static str,
    /// What the failure says.
    pub(crate) says: &'static str,
}

/// Two threads touch a body, and nothing orders them.
pub(super) const RACE: &str = "Causality violation";
/// A promise was not kept.
pub(super) const WRONG: &str = "assertion";
/// The receiver sleeps for ever: nobody will ring.
pub(super) const ENDLESS: &str = "maximum number of branches";

pub(super) const FENCE_E: &str = "turns to less important packages likewise.\n        seq_cst_accesses();\n";
pub(super) const NO_FENCE_E: &str = "turns to less important packages likewise.\n";
