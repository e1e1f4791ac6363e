//! A stream seen from outside: its shape, its writer, its readers, and the ends of what it keeps. Looking takes no
//! seat, changes nothing and asks nobody; so what is seen is a moment, and its parts are of moments that lie a little
//! apart.

use crate::figures::inspect::Party;
use crate::memory::owned::{BadSegment, OWNER_BYTE};
use crate::name::Name;
use crate::node::directory::Node;
use crate::node::lock;
use crate::stream::error::StreamError;
use crate::stream::lookup;
use crate::stream::missed::Missed;
use crate::stream::omission::LeftOut;
use crate::stream::record::RecordInfo;
use crate::stream::ring::Seat;
use crate::stream::segment::{StreamSegment, file_name};
use crate::stream::shape::{StreamId, StreamShape};
use std::fs::File;
use std::io;
use std::sync::atomic::Ordering;

/// A stream seen from outside.
#[derive(Clone, Debug, Default)]
pub struct StreamInfo {
    /// Which stream.
    pub id: StreamId,
    /// What it was made as.
    pub shape: StreamShape,
    /// The writer, or the last one; none when there never was one.
    pub writer: Option<Party>,
    /// Times a new writer took over.
    pub adoptions: u32,
    /// Records ever written: the sequence of the next one.
    pub written: u64,
    /// Records ever refused since their stamps were too far behind.
    pub refused: u64,
    /// The oldest record that is kept.
    pub oldest: Option<RecordInfo>,
    /// The newest record; none also if the writer turns the whole ring during each of some looks.
    pub newest: Option<RecordInfo>,
    /// Readers now.
    pub readers: u16,
    /// The modules among them, each once.
    pub reader_modules: Vec<Name>,
    /// Readers that read a record in place now.
    pub holding: u16,
    /// Readers that sleep until the next record.
    pub sleeping: u16,
    /// Records lost on the way and left out by sampling since the ring began, both up to the newest record; and passed
    /// over by its readers of now, in sum.
    pub missed: Missed,
}

impl Node {
    /// A stream as it is now; none when there is no such stream.
    ///
    /// ```
    /// use rohrpost_mailbox::{Name, Node, Participant, Stamp, StreamId, StreamShape};
    /// # let dir = tempfile::tempdir()?;
    /// let node = Node::create(&dir.path().join("node"), 0o700)?;
    /// let participant = Participant::join(&node, Name::new(1, 200, 0, 0))?;
    /// let id = StreamId { name: Name::new(1, 200, 0, 0), number: 1 };
    /// assert!(node.inspect_stream(id)?.is_none());
    /// let mut writer = participant.stream_writer(id, StreamShape::default())?;
    /// writer.write(Stamp { epoch: 1, ns: 1_000 }, b"a picture")?;
    /// let info = node.inspect_stream(id)?.expect("it was made");
    /// assert_eq!((info.written, info.readers), (1, 0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// When its file cannot be used, or is something else.
    pub fn inspect_stream(&self, id: StreamId) -> Result<Option<StreamInfo>, StreamError> {
        let (segment, file) = match StreamSegment::open(self.directory(), id) {
            Ok(opened) => opened,
            Err(BadSegment::Io(error)) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(why) => return Err(StreamError::of_bad(&self.path().join(file_name(id)), id, why)),
        };
        let (says, ring) = (&segment.page().writer, segment.ring());
        // The first byte is the writer's. What a dead reader left in its seat says nothing any more.
        let newest = ring.newest();
        let left_out = newest.map_or_else(LeftOut::default, |line| line.about.left_out);
        let taken: Vec<_> = (OWNER_BYTE + 1..).zip(ring.seats()).filter(|(byte, _)| is_taken(&file, *byte)).collect();
        let mut reader_modules: Vec<Name> =
            taken.iter().map(|(_, seat)| Name::from_raw(seat.module.load(Ordering::Relaxed))).collect();
        reader_modules.sort_unstable();
        reader_modules.dedup();
        reader_modules.retain(|module| *module != Name::NONE);
        Ok(Some(StreamInfo {
            id,
            shape: segment.shape,
            writer: writer_of(&segment, is_taken(&file, OWNER_BYTE)),
            adoptions: says.adoptions.load(Ordering::Relaxed),
            written: ring.written(),
            refused: says.refused.load(Ordering::Relaxed),
            oldest: lookup::oldest(&ring).map(|line| RecordInfo::of(&segment, &line)),
            newest: newest.map(|line| RecordInfo::of(&segment, &line)),
            readers: taken.len() as u16,
            reader_modules,
            holding: taken.iter().filter(|(_, seat)| seat.hold.load(Ordering::Relaxed) != 0).count() as u16,
            sleeping: taken.iter().filter(|(_, seat)| seat.sleeper.load(Ordering::Relaxed) != 0).count() as u16,
            missed: Missed {
                lost: left_out.lost,
                sampled: left_out.sampled,
                passed_over: taken.iter().fold(0, |all, (_, seat)| all.saturating_add(passed_over(seat))),
            },
        }))
    }
}

fn passed_over(seat: &Seat) -> u64 {
    seat.passed_over.load(Ordering::Relaxed)
}

/// Whether somebody holds the lock of this byte. When that cannot be asked, nobody does.
fn is_taken(file: &File, byte: u64) -> bool {
    lock::is_locked(file, byte).unwrap_or(false)
}

fn writer_of(segment: &StreamSegment, is_alive: bool) -> Option<Party> {
    let says = &segment.page().writer;
    let pid = says.pid.load(Ordering::Relaxed);
    (pid != 0).then(|| Party {
        participant: says.participant.load(Ordering::Relaxed) as u16,
        pid: Some(pid),
        module: Name::from_raw(says.module.load(Ordering::Relaxed)),
        is_alive,
    })
}
