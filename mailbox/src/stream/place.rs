//! A record's bytes as an address, for programs in other languages that hand out views of them.

use crate::memory::Mapping;
use std::ptr::NonNull;

/// Where a record's bytes are. The memory stays mapped as long as this does, whatever becomes of the reader or the
/// writer: an address that was handed out leads to bytes, be they those of a later record by then.
///
/// ```
/// use rohrpost_mailbox::{Name, Node, Participant, Stamp, StreamId, StreamShape};
/// # let dir = tempfile::tempdir()?;
/// let node = Node::create(&dir.path().join("node"), 0o700)?;
/// let participant = Participant::join(&node, Name::new(1, 200, 0, 0))?;
/// let id = StreamId { name: Name::new(1, 200, 0, 0), number: 1 };
/// let mut writer = participant.stream_writer(id, StreamShape::default())?;
/// let mut reader = participant.stream_reader(id)?;
/// writer.write(Stamp { epoch: 1, ns: 1_000 }, b"a picture")?;
/// let place = reader.newest()?.ok_or("it is there")?.stay();
/// assert_eq!(place.len(), 9); // held until `reader` takes another record
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct RecordPlace {
    first: NonNull<u8>,
    len: usize,
    _mapping: Mapping,
}

// SAFETY: an address and a mapping that belongs to no thread; nothing is reached through it here.
unsafe impl Send for RecordPlace {}
// SAFETY: as above.
unsafe impl Sync for RecordPlace {}

impl RecordPlace {
    /// `len` bytes at `first`, which lies in the mapping.
    pub(super) fn new(first: NonNull<u8>, len: usize, mapping: &Mapping) -> Self {
        Self { first, len, _mapping: mapping.clone() }
    }

    /// Their address. What a reader has may not be written.
    pub fn address(&self) -> NonNull<u8> {
        self.first
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }
}
