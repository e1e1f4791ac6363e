//! Entries as bytes, one behind the other:
//!
//! ```text
//! len u32     bytes of tag and content, little endian
//! check u32   of the sum before and the length: a changed length is not taken for the journal's end
//! sum u32     of the sum before, tag and content: no entry is missing, and none is changed
//! tag u8      which kind
//! content     postcard
//! ```

use super::bytes::{digest, spread};
use serde::Serialize;
use std::io::{self, Read};

/// Version of all that is in a journal. Others are not read.
pub(super) const VERSION: u32 = 3;
/// Bytes before the tag.
const HEAD_BYTES: usize = 12;

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
    fn from_code(code: u8) -> Option<Self> {
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

/// Appends an entry, of which the one before had the sum `before`; its own sum.
pub(super) fn append<T: Serialize + ?Sized>(
    to: &mut Vec<u8>,
    before: u32,
    tag: Tag,
    content: &T,
) -> Result<u32, postcard::Error> {
    let begin = head(to, tag);
    let mut counted = Counted { bytes: std::mem::take(to) };
    let written = postcard::serialize_with_flavor::<T, &mut Counted, ()>(content, &mut counted);
    *to = counted.bytes;
    if let Err(error) = written {
        // What fails leaves no half an entry behind.
        to.truncate(begin);
        return Err(error);
    }
    seal(to, begin, before)
}

/// Room for the head of an entry, and its tag; where it begins.
fn head(to: &mut Vec<u8>, tag: Tag) -> usize {
    let begin = to.len();
    to.extend_from_slice(&[0; HEAD_BYTES]);
    to.push(tag as u8);
    begin
}

/// What an entry of this length says of it, behind one with this sum. Lengths that differ have checks that differ.
fn check(before: u32, len: u32) -> u32 {
    before ^ spread(len)
}

/// Fills in the head of the entry that begins there.
fn seal(to: &mut [u8], begin: usize, before: u32) -> Result<u32, postcard::Error> {
    let body = begin + HEAD_BYTES;
    let len = u32::try_from(to.len() - body).map_err(|_| postcard::Error::SerializeBufferFull)?;
    let sum = digest(before.into(), &to[body..]) as u32;
    for (word, at) in [len, check(before, len), sum].into_iter().zip((begin..).step_by(4)) {
        to[at..at + 4].copy_from_slice(&word.to_le_bytes());
    }
    Ok(sum)
}

/// The same with content that is postcard already.
#[cfg(test)]
pub(super) fn append_raw(to: &mut Vec<u8>, before: u32, tag: Tag, content: &[u8]) -> Result<u32, postcard::Error> {
    let begin = head(to, tag);
    to.extend_from_slice(content);
    seal(to, begin, before)
}

/// A vector that postcard writes to; it stays where it is if that fails.
struct Counted {
    bytes: Vec<u8>,
}

impl postcard::ser_flavors::Flavor for &mut Counted {
    type Output = ();

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.bytes.push(byte);
        Ok(())
    }

    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        self.bytes.extend_from_slice(bytes);
        Ok(())
    }

    fn finalize(self) -> postcard::Result<()> {
        Ok(())
    }
}

/// What is there instead of an entry.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum NoEntry {
    /// The journal ends here.
    End,
    /// It ends within an entry, as a process leaves it that was killed.
    Cut,
    /// An entry is changed, or one before it is missing.
    Sum,
    /// It is of a kind that this version does not know.
    Tag(u8),
    /// The file cannot be read.
    Unreadable(io::ErrorKind),
}

/// Entries, read one after the other. One of them is in memory.
pub(super) struct Entries<R> {
    from: R,
    /// Of the entry before.
    sum: u32,
    /// Tag and content of the entry that was looked at.
    body: Vec<u8>,
    /// What is next: its kind and its sum; none until it is looked at.
    next: Option<Result<(Tag, u32), NoEntry>>,
}

impl<R: Read> Entries<R> {
    pub(super) fn new(from: R) -> Self {
        Self { from, sum: 0, body: Vec::new(), next: None }
    }

    /// The kind of the next entry. It stays the next one.
    pub(super) fn look(&mut self) -> Result<Tag, NoEntry> {
        let next = match self.next {
            Some(next) => next,
            None => {
                let next = self.read();
                *self.next.insert(next)
            }
        };
        next.map(|(tag, _)| tag)
    }

    /// Content of the entry that was looked at last.
    pub(super) fn content(&self) -> &[u8] {
        self.body.get(1..).unwrap_or_default()
    }

    /// Goes on behind the entry that was looked at, if it is one. Its content stays until the next look.
    pub(super) fn pass(&mut self) {
        if let Some(Ok((_, sum))) = self.next {
            (self.sum, self.next) = (sum, None);
        }
    }

    fn read(&mut self) -> Result<(Tag, u32), NoEntry> {
        self.fill(HEAD_BYTES as u64)?;
        if self.body.is_empty() {
            return Err(NoEntry::End);
        }
        let head: [u8; HEAD_BYTES] = self.body[..].try_into().map_err(|_| NoEntry::Cut)?;
        let [len, checked, sum] = [0, 4, 8].map(|at| head[at..at + 4].try_into().map_or(0, u32::from_le_bytes));
        if check(self.sum, len) != checked {
            return Err(NoEntry::Sum);
        }
        self.fill(len.into())?;
        if self.body.len() < len as usize {
            return Err(NoEntry::Cut);
        }
        if digest(self.sum.into(), &self.body) as u32 != sum {
            return Err(NoEntry::Sum);
        }
        let code = self.body.first().copied().ok_or(NoEntry::Sum)?;
        Ok((Tag::from_code(code).ok_or(NoEntry::Tag(code))?, sum))
    }

    /// The next bytes; fewer at the journal's end. Takes no memory for those that are not there.
    fn fill(&mut self, len: u64) -> Result<(), NoEntry> {
        self.body.clear();
        let read = self.from.by_ref().take(len).read_to_end(&mut self.body);
        read.map(drop).map_err(|error| NoEntry::Unreadable(error.kind()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> (Vec<u8>, u32, usize) {
        let mut bytes = Vec::new();
        let sum = append(&mut bytes, 0, Tag::Time, &(1u64, "one")).unwrap();
        let second = bytes.len();
        append(&mut bytes, sum, Tag::Published, &2u8).unwrap();
        (bytes, sum, second)
    }

    fn first(bytes: &[u8], before: u32) -> Result<(Tag, Vec<u8>), NoEntry> {
        let mut entries = Entries { sum: before, ..Entries::new(bytes) };
        let tag = entries.look()?;
        Ok((tag, entries.content().to_vec()))
    }

    #[test]
    fn tags_are_their_places() {
        for (code, tag) in (1..).zip(ALL) {
            assert_eq!((tag as u8, Tag::from_code(code)), (code, Some(tag)));
        }
        assert_eq!((Tag::from_code(0), Tag::from_code(38)), (None, None));
    }

    #[test]
    fn entries_come_back_and_what_is_changed_or_missing_is_found() {
        let (bytes, sum, second) = two();
        let mut entries = Entries::new(&bytes[..]);
        assert_eq!((entries.look(), entries.look()), (Ok(Tag::Time), Ok(Tag::Time)), "it stays the next one");
        assert_eq!(entries.content(), [1, 3, b'o', b'n', b'e']);
        entries.pass();
        assert_eq!((entries.look(), entries.content()), (Ok(Tag::Published), &[2][..]));
        entries.pass();
        assert_eq!(entries.look(), Err(NoEntry::End));
        entries.pass();
        assert_eq!(entries.look(), Err(NoEntry::End), "that stays");
        assert_eq!(first(&bytes[second..], sum), Ok((Tag::Published, vec![2])));
        assert_eq!(first(&bytes[second..], 0), Err(NoEntry::Sum), "the one before is missing");
        for len in 1..second {
            assert_eq!(first(&bytes[..len], 0), Err(NoEntry::Cut), "{len} bytes");
        }
        for bit in 0..second * 8 {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(first(&flipped, 0), Err(NoEntry::Sum), "bit {bit}");
        }
    }
}
