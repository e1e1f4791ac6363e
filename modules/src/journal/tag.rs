//! Kinds of entries.

/// The kind of an entry.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub(crate) enum Tag {
    /// The first one.
    Begin = 1,
    /// The module is called.
    Event,
    /// Answers: a reading of the clock,
    Time,
    /// what the clock goes by,
    TimeRecord,
    /// whether a stream could be opened,
    Opened,
    /// where its reader stands,
    Position,
    /// whether there is a next record,
    HasNext,
    /// how many it has read and lost,
    Accounts,
    /// its newest record,
    Newest,
    /// its next one,
    Next,
    /// one by its sequence,
    Record,
    /// those around a time,
    Around,
    /// whether a command went out,
    Begun,
    /// what came of it,
    Answered,
    /// whether a record was written,
    Wrote,
    /// which record the next entry has, that is recorded anyhow,
    Named,
    /// what the module took in by itself,
    TakenIn,
    /// whether it could open a descriptor by itself,
    OpenedOutside,
    /// watch one,
    Watched,
    /// and watch it no longer,
    Unwatched,
    /// what came of what it gave out by itself.
    Accepted,
    /// Asked without an answer: to go on from another record,
    Sought,
    /// to tick,
    Ticking,
    /// for data,
    Subscribed,
    /// for older records of a followed stream,
    Rewound,
    /// for a mailbox.
    MadeMailbox,
    /// A file that it was given.
    File,
    /// Outputs: data,
    Published,
    /// a record of its own stream,
    Written,
    /// a command,
    Called,
    /// a reply,
    Replied,
    /// bytes past its interfaces,
    GaveOut,
    /// why it is in error,
    Failed,
    /// why it panicked.
    Panicked,
    /// Something that a journal does not see.
    Hole,
    /// The module ended as it should.
    End,
    /// One more answer, behind all others since it is younger: what a reader missed, by cause.
    Missed,
}

const ALL: [Tag; 37] = [
    Tag::Begin,
    Tag::Event,
    Tag::Time,
    Tag::TimeRecord,
    Tag::Opened,
    Tag::Position,
    Tag::HasNext,
    Tag::Accounts,
    Tag::Newest,
    Tag::Next,
    Tag::Record,
    Tag::Around,
    Tag::Begun,
    Tag::Answered,
    Tag::Wrote,
    Tag::Named,
    Tag::TakenIn,
    Tag::OpenedOutside,
    Tag::Watched,
    Tag::Unwatched,
    Tag::Accepted,
    Tag::Sought,
    Tag::Ticking,
    Tag::Subscribed,
    Tag::Rewound,
    Tag::MadeMailbox,
    Tag::File,
    Tag::Published,
    Tag::Written,
    Tag::Called,
    Tag::Replied,
    Tag::GaveOut,
    Tag::Failed,
    Tag::Panicked,
    Tag::Hole,
    Tag::End,
    Tag::Missed,
];

impl Tag {
    pub(super) fn from_code(code: u8) -> Option<Self> {
        ALL.get(usize::from(code).checked_sub(1)?).copied()
    }

    /// What a module does there.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Begin => "begins",
            Self::Event => "is called",
            Self::Time => "reads the clock",
            Self::TimeRecord => "asks what the clock goes by",
            Self::Opened => "opens a stream",
            Self::Position => "asks where it stands in a stream",
            Self::HasNext => "asks whether a stream has a next record",
            Self::Accounts => "asks how many records it has read",
            Self::Newest => "reads the newest record of a stream",
            Self::Next => "reads the next record of a stream",
            Self::Record => "reads a record of a stream",
            Self::Around => "looks for a time in a stream",
            Self::Begun => "hands a command over",
            Self::Answered => "waits for an answer",
            Self::Wrote => "ends a record of its stream",
            Self::Named => "is given what is recorded anyhow",
            Self::TakenIn => "takes something in (`take_in`)",
            Self::OpenedOutside => "opens a descriptor (`open_outside`)",
            Self::Watched => "waits for a descriptor",
            Self::Unwatched => "waits for a descriptor no longer",
            Self::Accepted => "asks what came of what it gave out",
            Self::Sought => "goes on elsewhere in a stream",
            Self::Ticking => "wants to tick",
            Self::Subscribed => "subscribes",
            Self::Rewound => "goes back in a followed stream",
            Self::MadeMailbox => "makes a mailbox",
            Self::File => "asks for a file",
            Self::Published => "publishes data",
            Self::Written => "writes a record",
            Self::Called => "sends a command",
            Self::Replied => "replies to a command",
            Self::GaveOut => "gives bytes out (`give_out`)",
            Self::Failed => "fails",
            Self::Panicked => "panics",
            Self::Hole => "does what no journal sees",
            Self::End => "ends",
            Self::Missed => "asks which records it has missed",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_are_their_places() {
        for (code, tag) in (1..).zip(ALL) {
            assert_eq!((tag as u8, Tag::from_code(code)), (code, Some(tag)));
        }
        assert_eq!((Tag::from_code(0), Tag::from_code(38)), (None, None));
    }
}
