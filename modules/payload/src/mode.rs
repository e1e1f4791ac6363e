//! The three modes of a robot, and the branches of the tree that go with them.

use rohrpost_team::events::GroupId;
use std::fmt;

/// What a robot does, by what its view has (seed 000, 4.4.1).
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Mode {
    /// The view has no intruder.
    #[default]
    Wandering,
    /// There is an intruder, and nobody is certain where.
    Searching,
    /// The place of at least one is certain.
    Blocking,
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Wandering => "wandering",
            Self::Searching => "searching",
            Self::Blocking => "blocking",
        })
    }
}

/// The branches of which one is on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Branches {
    pub(crate) wandering: GroupId,
    pub(crate) searching: GroupId,
    pub(crate) blocking: GroupId,
}

impl Branches {
    pub(crate) fn of(self, mode: Mode) -> GroupId {
        match mode {
            Mode::Wandering => self.wandering,
            Mode::Searching => self.searching,
            Mode::Blocking => self.blocking,
        }
    }
}
