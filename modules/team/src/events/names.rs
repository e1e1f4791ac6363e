//! Handles of what a plan declares, and limits.

/// Types of events that a plan has at most.
pub const TYPES_MAX: usize = 32;
/// Groups that a plan has at most, the root included.
pub const GROUPS_MAX: usize = 64;
/// Leaves that a plan has at most.
pub const LEAVES_MAX: usize = 128;
/// Groups and leaves in a walk over the tree, each counted once for each way from the root to it.
pub const STEPS_MAX: usize = 1024;

/// A type of events, of the plan that made it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct EventType(pub(super) u8);

impl EventType {
    /// Place of the type in the plan, from 0: its number in messages.
    pub const fn number(self) -> u8 {
        self.0
    }
}

/// A group of leaves and groups, of the plan that made it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct GroupId(pub(super) u8);

/// The group above all others, where hard events start.
pub const ROOT: GroupId = GroupId(0);

/// A leaf, of the plan that made it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub(super) struct LeafId(pub(super) u8);

/// How urgent events are. What comes from a teammate is low, whatever its type says (seed 000, 4.3.2).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Priority {
    /// At least three of four turns while any event is high.
    High,
    /// At least one of eight turns; all that high events leave.
    Normal,
    /// At least one of eight turns; all that others leave.
    Low,
}

impl Priority {
    /// All, the most urgent first.
    pub const ALL: [Self; 3] = [Self::High, Self::Normal, Self::Low];

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::High => "high",
            Self::Normal => "normal",
            Self::Low => "low",
        }
    }
}

/// Some types of a plan, a bit for each.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct TypeSet(u32);

impl TypeSet {
    pub(super) fn contains(self, event_type: EventType) -> bool {
        self.0 >> event_type.0 & 1 == 1
    }

    pub(super) fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    pub(super) fn iter(self) -> impl Iterator<Item = EventType> {
        (0..TYPES_MAX as u8).map(EventType).filter(move |it| self.contains(*it))
    }
}

impl FromIterator<EventType> for TypeSet {
    fn from_iter<I: IntoIterator<Item = EventType>>(types: I) -> Self {
        Self(types.into_iter().fold(0, |bits, it| bits | 1 << it.0))
    }
}
