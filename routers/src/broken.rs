//! Mistakes that can be switched on, one at a time: tests and the simulation must notice each of them.

/// What a core does wrong.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum Broken {
    /// Nothing.
    #[default]
    Nothing,
}
