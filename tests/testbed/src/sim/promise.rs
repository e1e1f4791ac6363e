//! What must hold of a simulated network, and how it is told that it did not.

/// A promise that was broken.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Problem {
    /// Name of the promise.
    pub promise: Promise,
    /// When, true ns.
    pub at_ns: u64,
    /// What was seen.
    pub text: String,
}

/// What must hold whatever the network does.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Promise {
    /// Every accepted package is delivered, or counted with a cause, or was in a datagram that the network lost.
    Accounts,
    /// No command runs twice, and one that is said not to have run has not.
    AtMostOnce,
    /// A router delivers no package twice within one incarnation of both ends.
    NoCopies,
    /// Of one sender and priority, packages come in their order.
    Order,
    /// Nothing is delivered that was not sent, unchanged, to that mailbox.
    Unchanged,
    /// An urgent package is behind at most one datagram of lower levels.
    Urgency,
    /// What gives way to what has no room is the sender's own newest of its lowest level.
    Displacing,
    /// Nothing leaves or is delivered that waited for too long, and a command hurries no more than its sender.
    Fresh,
    /// No more bytes a second than allowed, and no datagram of its own for what others wait behind that fit in it.
    Pace,
    /// Queue, quotas and reassembly stay within their limits, and no flood is taken in faster than it leaves.
    Bounded,
    /// What a router sent, and nobody altered, is rejected only for what is so: it came before, it is too old, or its
    /// incarnation, key or configuration is not the one that its receiver goes by.
    Rejection,
    /// What a router says of its peers and of losses on the wire is so.
    Links,
    /// Nothing is delivered that is not admitted: where datagrams are sealed, in the name of another node; to a
    /// router's own mailbox; with more priority than its sender, or the module that asked for it, may have.
    Admission,
    /// A while after the last fault all is well.
    Recovery,
    /// System time is within its stated bound.
    TimeBound,
    /// System time never goes back within an epoch.
    TimeForward,
    /// One master in a term, and one master a while after the last fault; a node that sends in its place does so only
    /// when it was not heard, and nobody goes by it.
    OneMaster,
    /// With time slots no two nodes transmit at once, unless a fault parts them: see [`Divisions::excuse`].
    ///
    /// [`Divisions::excuse`]: super::divided::Divisions::excuse
    Exclusive,
    /// With time slots each datagram is on the wire in a window of its sender, before its guard, as the sender reckons,
    /// and none is sent in a window for which the wake-up came too late.
    InWindow,
    /// A record that a reader of a replica gets is whole and unchanged, with the sequence, incarnation and stamp of its
    /// origin; so is each part that leaves, and what was damaged, or made without the key, is not taken.
    Records,
    /// Sequences of one life of a stream do not go back, lives do not go back, and no record is read twice.
    RecordOrder,
    /// Each record is sent, or not sent for a cause that is counted; it is read, or its reader is told of one more that
    /// it lost; what both ends count agrees.
    RecordAccounts,
    /// Requests for parts and parts that leave again are few, parts leave the wire to packages, and a node has no more
    /// than its replicas.
    RecordBounds,
    /// No two nodes hold the lease of a module, and a while after the last fault one does; nothing of an earlier holder
    /// is delivered where a later one was heard.
    Leases,
    /// With time slots nobody sends while its own bound is greater than what is allowed, or while it is further off in
    /// truth.
    SilentWhenUnsure,
}

impl Promise {
    /// All; the last one stands last.
    pub const ALL: [Self; Self::SilentWhenUnsure as usize + 1] = [
        Self::Accounts,
        Self::AtMostOnce,
        Self::NoCopies,
        Self::Order,
        Self::Unchanged,
        Self::Urgency,
        Self::Displacing,
        Self::Fresh,
        Self::Pace,
        Self::Bounded,
        Self::Rejection,
        Self::Links,
        Self::Admission,
        Self::Recovery,
        Self::TimeBound,
        Self::TimeForward,
        Self::OneMaster,
        Self::Exclusive,
        Self::InWindow,
        Self::Records,
        Self::RecordOrder,
        Self::RecordAccounts,
        Self::RecordBounds,
        Self::Leases,
        Self::SilentWhenUnsure,
    ];
}
