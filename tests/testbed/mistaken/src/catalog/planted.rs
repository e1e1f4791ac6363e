//! What a mistake of the catalogue consists of.

use rohrpost_planted::Edit;

/// No test of the routers' own runs what makes such a mistake; a simulated network does.
pub const IN_NETWORKS: &str = "";

/// A mistake.
pub struct Planted {
    /// Its name, as in [`Mistake`](crate::mistakes::Mistake).
    pub name: &'static str,
    /// The core, and what it does wrong.
    pub text: &'static str,
    /// The routers' own test that fails with it; or [`IN_NETWORKS`].
    pub shows_in: &'static str,
    /// The changes.
    pub edits: &'static [Edit],
}

/// Mistakes that show in networks of one kind.
pub struct Group {
    /// The name of its constant in [`Mistake`](crate::mistakes::Mistake).
    pub name: &'static str,
    /// What they have in common.
    pub text: &'static str,
    /// All of them.
    pub mistakes: &'static [Planted],
}
