//! What a mailbox does with a package that finds no free slot.

/// What happens to a package that finds no free slot. The numbers stand in the segment.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum OverflowPolicy {
    /// It takes the place of the newest of the least important packages, if it is more important; else it is refused.
    #[default]
    Displace = 0,
    /// For state, of which only the newest counts. A package replaces the older one of the same sender, type and id
    /// that still waits, whether or not the mailbox is full, and takes its place in the order: the older one is counted
    /// as replaced. One that has nothing to replace and finds no free slot displaces as above.
    ///
    /// Commands are never replaced, since each has an id of its own. A sender knows what it sent itself, through this
    /// [`Sender`](crate::Sender): what it sent before it was started again is received as well, before the newer.
    /// Between different states of one sender there is no order when one of them has replaced an older package.
    Latest = 2,
    /// It is refused (seed 002, 3.2).
    Reject = 1,
}

impl OverflowPolicy {
    /// All policies, in the order of their codes in a segment.
    pub const ALL: [Self; 3] = [Self::Displace, Self::Reject, Self::Latest];

    /// The word for it in configuration and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Displace => "displace",
            Self::Latest => "latest",
            Self::Reject => "reject",
        }
    }
}

/// Why a slot was not to be had.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum NoSlot {
    /// All are in use by packages as important or more.
    Full,
    /// The mailbox has been given up.
    Retired,
}
