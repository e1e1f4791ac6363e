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
    /// And two more: the monotonic clock,
    Monotonic,
    /// and the command that is being run.
    RunningCommand,
}

/// All kinds in the order of their codes, and what a module does there.
const ALL: [(Tag, &str); 39] = [
    (Tag::Begin, "begins"),
    (Tag::Event, "is called"),
    (Tag::Time, "reads the clock"),
    (Tag::TimeRecord, "asks what the clock goes by"),
    (Tag::Opened, "opens a stream"),
    (Tag::Position, "asks where it stands in a stream"),
    (Tag::HasNext, "asks whether a stream has a next record"),
    (Tag::Accounts, "asks how many records it has read"),
    (Tag::Newest, "reads the newest record of a stream"),
    (Tag::Next, "reads the next record of a stream"),
    (Tag::Record, "reads a record of a stream"),
    (Tag::Around, "looks for a time in a stream"),
    (Tag::Begun, "hands a command over"),
    (Tag::Answered, "waits for an answer"),
    (Tag::Wrote, "ends a record of its stream"),
    (Tag::Named, "is given what is recorded anyhow"),
    (Tag::TakenIn, "takes something in (`take_in`)"),
    (Tag::OpenedOutside, "opens a descriptor (`open_outside`)"),
    (Tag::Watched, "waits for a descriptor"),
    (Tag::Unwatched, "waits for a descriptor no longer"),
    (Tag::Accepted, "asks what came of what it gave out"),
    (Tag::Sought, "goes on elsewhere in a stream"),
    (Tag::Ticking, "wants to tick"),
    (Tag::Subscribed, "subscribes"),
    (Tag::Rewound, "goes back in a followed stream"),
    (Tag::MadeMailbox, "makes a mailbox"),
    (Tag::File, "asks for a file"),
    (Tag::Published, "publishes data"),
    (Tag::Written, "writes a record"),
    (Tag::Called, "sends a command"),
    (Tag::Replied, "replies to a command"),
    (Tag::GaveOut, "gives bytes out (`give_out`)"),
    (Tag::Failed, "fails"),
    (Tag::Panicked, "panics"),
    (Tag::Hole, "does what no journal sees"),
    (Tag::End, "ends"),
    (Tag::Missed, "asks which records it has missed"),
    (Tag::Monotonic, "reads the monotonic clock"),
    (Tag::RunningCommand, "asks for the command that it runs"),
];

impl Tag {
    pub(super) fn from_code(code: u8) -> Option<Self> {
        Some(ALL.get(usize::from(code).checked_sub(1)?)?.0)
    }

    /// What a module does there.
    pub(super) fn words(self) -> &'static str {
        ALL[self as usize - 1].1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_are_their_places() {
        for (code, (tag, _)) in (1..).zip(ALL) {
            assert_eq!((tag as u8, Tag::from_code(code)), (code, Some(tag)));
        }
        assert_eq!((Tag::from_code(0), Tag::from_code(40)), (None, None));
    }
}
