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
use super::tag::Tag;
use serde::Serialize;
use std::io::{self, Read};

/// Version of all that is in a journal. Others are not read.
pub(super) const VERSION: u32 = 3;
/// Bytes before the tag.
const HEAD_BYTES: usize = 12;
/// Tag and content of an entry. One of them is in memory when a journal is read, and a recording may have any.
pub(super) const ENTRY_BYTES_MAX: u32 = 64 << 20;

/// Appends an entry, of which the one before had the sum `before`; its own sum.
pub(super) fn append<T: Serialize + ?Sized>(
    to: &mut Vec<u8>,
    before: u32,
    tag: Tag,
    content: &T,
) -> Result<u32, postcard::Error> {
    let begin = head(to, tag);
    let written = postcard::to_io(content, &mut *to).map(drop);
    let sealed = written.and_then(|()| seal(to, begin, before));
    if sealed.is_err() {
        // What fails leaves no half an entry behind.
        to.truncate(begin);
    }
    sealed
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
    let len = u32::try_from(to.len() - body).ok().filter(|len| *len <= ENTRY_BYTES_MAX);
    let len = len.ok_or(postcard::Error::SerializeBufferFull)?;
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

/// What is there instead of an entry.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum NoEntry {
    /// The journal ends here.
    End,
    /// It ends within an entry, as a process leaves it that was killed.
    Cut,
    /// An entry is changed, or one before it is missing.
    Sum,
    /// It is longer than any: so many bytes.
    Long(u32),
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
        if len > ENTRY_BYTES_MAX {
            return Err(NoEntry::Long(len));
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
    use super::super::bytes::Blob;
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

    /// Also if the length is confirmed.
    #[test]
    fn an_entry_of_gigabytes_is_neither_read_nor_written() {
        for len in [ENTRY_BYTES_MAX + 1, u32::MAX] {
            let head = [len, check(0, len), 0].map(u32::to_le_bytes).concat();
            let mut entries = Entries::new(head.chain(std::io::repeat(7)));
            assert_eq!(entries.look(), Err(NoEntry::Long(len)));
            assert!(entries.body.capacity() < 1 << 10, "nothing was taken for it");
        }
        let (mut bytes, long) = (Vec::new(), vec![0; ENTRY_BYTES_MAX as usize]);
        assert!(append(&mut bytes, 0, Tag::Published, &Blob(&long)).is_err() && bytes.is_empty());
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
