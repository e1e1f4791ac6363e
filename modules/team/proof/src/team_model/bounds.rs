//! What a run of the model begins with, and the faults that it may have.

/// What a restarted robot remembers of its incarnation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Store {
    Kept,
    /// The robot begins with the incarnation that it had, or with the one before.
    Lost,
    Old,
}

/// What robots know of intruders when they begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Story {
    /// Nothing: only hellos are looked at.
    Nothing,
    /// One has told of an intruder while nobody heard it, and tells of a later one.
    Unheard,
    /// One has ended what it had made up, and the others have its older copy.
    Ended,
    /// One has seen that the place of another one's intruder is empty, and the third one has the older copy.
    Refuted,
}

/// All with records.
pub(crate) const STORIES: [Story; 3] = [Story::Unheard, Story::Ended, Story::Refuted];

/// Of which messages one may be lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Loss {
    Nothing,
    Records,
    Anything,
}

/// What a run begins with, and faults that may happen, each at most once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Bounds {
    pub(crate) story: Story,
    pub(crate) may_lose: Loss,
    /// The last messages from one robot to another come in the round after the one in which they were sent.
    pub(crate) may_delay: bool,
    pub(crate) may_die: bool,
    /// Ends of rounds after a fault that are counted.
    pub(crate) calm_max: u8,
}
