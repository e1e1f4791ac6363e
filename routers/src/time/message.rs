//! Datagrams of time, behind the frame's head: 72 bytes each, of every kind.
//!
//! ```text
//!           0    8         16        24       32      40      48     56      64      65      68       72
//!           ┌────┬─────────┬─────────┬────────┬───────┬───────┬──────┬───────┬───────┬───────┬────────┐
//!  Sync     │ id │ cycle   │ nominal │ sent   │ error │ epoch │ term │ began │ flags │ 0     │ 0      │
//!  Request  │ id │ 0       │ 0       │ sent   │ error │ epoch │ term │ 0     │ flags │ 0     │ 0      │
//!  Reply    │ id │ sync    │ request │ sent   │ error │ epoch │ term │ began │ flags │ 0     │ doubt  │
//!  WarmUp   │ 0  │ 0       │ 0       │ 0      │ 0     │ 0     │ 0    │ 0     │ 0     │ 0     │ 0      │
//!           └────┴─────────┴─────────┴────────┴───────┴───────┴──────┴───────┴───────┴───────┴────────┘
//! ```
//!
//! All have one length, so that both directions take equally long. Times are system time, ns since 1970, by the
//! sender's page.

use super::Term;
use crate::frame::{BadFrame, FrameKind};
pub use rohrpost_network::TIME_BYTES as MESSAGE_BYTES;

/// Times lie before the year 2262, so that differences of two fit in 64 bits.
const TIME_MAX_NS: u64 = i64::MAX as u64;

const FOLLOWED: u8 = 1;
const REPLACEMENT: u8 = 2;
const EAGER: u8 = 1;
const FAR: u8 = 2;
const TIMED: u8 = 4;
const SYNC_BY_KERNEL: u8 = 1;
const REQUEST_BY_KERNEL: u8 = 2;

/// A datagram of time.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum TimeMessage {
    /// From the master: its present time.
    Sync(Sync),
    /// Empty: it warms the path for the next frame.
    WarmUp,
    /// From a slave, after a [`Sync`]: it asks when that left and when this came.
    Request(Request),
    /// The master's answer.
    Reply(Reply),
}

/// The master's time.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Sync {
    /// Matches Sync, Request and Reply; never 0, never twice in one incarnation of a master.
    pub id: u64,
    /// Counts intervals of system time since 1970, so that every master counts the same.
    pub cycle: u64,
    /// When this frame was due, system ns.
    pub nominal_ns: u64,
    /// Just before it was handed to the kernel, system ns. When it really left is in the [`Reply`].
    pub sent_ns: u64,
    /// The master's largest distance from the epoch's time, ns.
    pub error_ns: u64,
    /// The system's epoch.
    pub epoch: u64,
    /// The sender's term, which contains its rank.
    pub term: Term,
    /// The term in which this timeline of the sender began: samples of different ones must not be mixed.
    pub began: Term,
    /// Whether slaves answer this master.
    pub followed: bool,
    /// A backup master sends it in place of the master of this term: the cycle lives. Its times are not used.
    pub replacement: bool,
}

/// A slave's request; with id 0 it only says that the sender hears no master.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Request {
    /// Of the [`Sync`]; 0: hears no master.
    pub id: u64,
    /// The time of a sender in time slots that has system time and hears no master; else 0.
    pub sent_ns: u64,
    /// The sender's error bound, ns.
    pub error_ns: u64,
    /// The epoch of the sender's page.
    pub epoch: u64,
    /// The term that the sender follows, or followed last.
    pub term: Term,
    /// The sender has too few samples, and wants the next soon.
    pub eager: bool,
    /// The sender is too far off to slew: it needs a new epoch.
    pub far: bool,
    /// The sender has system time.
    pub timed: bool,
}

/// Both ends of the exchange, as the master saw them.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Reply {
    /// Of the [`Sync`] and the [`Request`].
    pub id: u64,
    /// When the [`Sync`] left, system ns.
    pub sync_ns: u64,
    /// When the [`Request`] came, system ns.
    pub request_ns: u64,
    /// Just before this was handed to the kernel, system ns.
    pub sent_ns: u64,
    /// The master's largest distance from the epoch's time, ns.
    pub error_ns: u64,
    /// The system's epoch.
    pub epoch: u64,
    /// The master's term.
    pub term: Term,
    /// See [`Sync::began`].
    pub began: Term,
    /// Largest error of each of the first two, ns.
    pub doubt_ns: u32,
    /// The kernel stamped the [`Sync`] when it left; else it is when it was handed over.
    pub sync_by_kernel: bool,
    /// The kernel stamped the [`Request`] when it came; else it is when it was read.
    pub request_by_kernel: bool,
}

impl TimeMessage {
    /// The kind of frame that carries it.
    pub fn kind(&self) -> FrameKind {
        match self {
            Self::Sync(_) => FrameKind::Sync,
            Self::WarmUp => FrameKind::WarmUp,
            Self::Request(_) => FrameKind::Request,
            Self::Reply(_) => FrameKind::Reply,
        }
    }

    /// The bytes behind the frame's head.
    pub fn to_bytes(&self) -> [u8; MESSAGE_BYTES] {
        let mut fields = MessageFields::default();
        match *self {
            Self::WarmUp => {}
            Self::Sync(m) => {
                fields.words = [m.id, m.cycle, m.nominal_ns, m.sent_ns, m.error_ns, m.epoch, m.term.0, m.began.0];
                fields.flags = flag(m.followed, FOLLOWED) | flag(m.replacement, REPLACEMENT);
            }
            Self::Request(m) => {
                fields.words = [m.id, 0, 0, m.sent_ns, m.error_ns, m.epoch, m.term.0, 0];
                fields.flags = flag(m.eager, EAGER) | flag(m.far, FAR) | flag(m.timed, TIMED);
            }
            Self::Reply(m) => {
                fields.words = [m.id, m.sync_ns, m.request_ns, m.sent_ns, m.error_ns, m.epoch, m.term.0, m.began.0];
                fields.flags = flag(m.sync_by_kernel, SYNC_BY_KERNEL) | flag(m.request_by_kernel, REQUEST_BY_KERNEL);
                fields.doubt_ns = m.doubt_ns;
            }
        }
        fields.to_bytes()
    }

    /// Reads the rest of a frame of time. A message is valid: it needs no further check.
    ///
    /// # Errors
    /// [`BadFrame::Damaged`]
    pub fn parse(kind: FrameKind, rest: &[u8]) -> Result<Self, BadFrame> {
        let fields = MessageFields::parse(rest)?;
        let [id, a, b, c, error_ns, epoch, term, began] = fields.words;
        let has = |flag: u8| fields.flags & flag != 0;
        let (term, began) = (Term(term), Term(began));
        let message = match kind {
            FrameKind::WarmUp => Self::WarmUp,
            FrameKind::Sync => {
                let (cycle, nominal_ns, sent_ns) = (a, b, c);
                let (followed, replacement) = (has(FOLLOWED), has(REPLACEMENT));
                Self::Sync(Sync { id, cycle, nominal_ns, sent_ns, error_ns, epoch, term, began, followed, replacement })
            }
            FrameKind::Request => {
                let (eager, far, timed) = (has(EAGER), has(FAR), has(TIMED));
                Self::Request(Request { id, sent_ns: c, error_ns, epoch, term, eager, far, timed })
            }
            FrameKind::Reply => Self::Reply(Reply {
                id,
                sync_ns: a,
                request_ns: b,
                sent_ns: c,
                error_ns,
                epoch,
                term,
                began,
                doubt_ns: fields.doubt_ns,
                sync_by_kernel: has(SYNC_BY_KERNEL),
                request_by_kernel: has(REQUEST_BY_KERNEL),
            }),
            FrameKind::Packages
            | FrameKind::Fragment
            | FrameKind::Alive
            | FrameKind::Refusal
            | FrameKind::Hello
            | FrameKind::RecordPart
            | FrameKind::Description
            | FrameKind::PartRequest => return Err(BadFrame::Damaged("no frame of time")),
        };
        // Unused bytes must be 0: another version can use them.
        if message.to_bytes() != *rest {
            return Err(BadFrame::Damaged("a frame of time says what its kind does not"));
        }
        message.check().map(|()| message)
    }

    fn check(&self) -> Result<(), BadFrame> {
        let (id, epoch, term, times) = match self {
            Self::WarmUp => return Ok(()),
            Self::Request(m) if m.sent_ns > TIME_MAX_NS => return Err(BadFrame::Damaged("a time after the year 2262")),
            Self::Request(_) => return Ok(()),
            Self::Sync(m) => (m.id, m.epoch, m.term, [m.nominal_ns, m.sent_ns, 0]),
            Self::Reply(m) => (m.id, m.epoch, m.term, [m.sync_ns, m.request_ns, m.sent_ns]),
        };
        if id == 0 || epoch == 0 || term.is_none() {
            return Err(BadFrame::Damaged("a master without id, epoch or term"));
        }
        if times.into_iter().any(|ns| ns > TIME_MAX_NS) {
            return Err(BadFrame::Damaged("a time after the year 2262"));
        }
        Ok(())
    }
}

fn flag(is: bool, bit: u8) -> u8 {
    if is { bit } else { 0 }
}

/// The table above, without names.
#[derive(Default)]
struct MessageFields {
    words: [u64; 8],
    flags: u8,
    doubt_ns: u32,
}

impl MessageFields {
    fn to_bytes(&self) -> [u8; MESSAGE_BYTES] {
        let mut bytes = [0; MESSAGE_BYTES];
        for (place, word) in bytes.chunks_exact_mut(8).zip(self.words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        bytes[64] = self.flags;
        bytes[68..72].copy_from_slice(&self.doubt_ns.to_le_bytes());
        bytes
    }

    fn parse(rest: &[u8]) -> Result<Self, BadFrame> {
        let b: &[u8; MESSAGE_BYTES] = rest.try_into().map_err(|_| BadFrame::Damaged("a frame of time has 72 bytes"))?;
        let mut fields =
            Self { flags: b[64], doubt_ns: u32::from_le_bytes([b[68], b[69], b[70], b[71]]), ..Self::default() };
        for (word, place) in fields.words.iter_mut().zip(b.chunks_exact(8)) {
            *word = place.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte));
        }
        Ok(fields)
    }
}
