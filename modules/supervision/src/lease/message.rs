//! What candidates and fences ask the witness, and what it answers.

/// Number of a lease. Data and commands of its holder carry it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Number {
    /// Run of the witness that gave it. No two runs have the same; they have no order.
    pub witness: u32,
    /// Rises with each lease that this run gives to another candidate or run of one; 0: none yet.
    pub count: u32,
}

/// What is wanted of the witness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Wish {
    /// The candidate is ready, and holds the lease if it may.
    Hold,
    /// The candidate is off, and not ready to hold anything.
    Release,
    /// A fence wants to know which number is the newest.
    Look,
}

/// A question to the witness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Ask {
    /// The candidate's place in the order of choice, 0 for the first; without meaning for [`Wish::Look`].
    pub place: u8,
    /// Run of the asking program. No two runs of it have the same.
    pub run: u32,
    /// When it was asked, ns on the asking computer's monotonic clock; differs for each question of a run.
    pub asked_ns: u64,
    /// `asked_ns` of the newest question of this run that was answered.
    pub answered_ns: Option<u64>,
    /// What is wanted.
    pub wish: Wish,
}

/// Bytes of a question.
pub const ASK_BYTES: usize = 22;
/// Bytes of an answer.
pub const ANSWER_BYTES: usize = 29;

/// Not a time: none was.
const NONE: u64 = u64::MAX;

impl Ask {
    /// The question as bytes: place, wish, run, when it was asked, which was answered; numbers in little-endian order.
    pub fn to_bytes(&self) -> [u8; ASK_BYTES] {
        let mut bytes = [0; ASK_BYTES];
        let wish = match self.wish {
            Wish::Hold => 1,
            Wish::Release => 2,
            Wish::Look => 3,
        };
        bytes[..2].copy_from_slice(&[self.place, wish]);
        bytes[2..6].copy_from_slice(&self.run.to_le_bytes());
        bytes[6..14].copy_from_slice(&self.asked_ns.to_le_bytes());
        bytes[14..22].copy_from_slice(&self.answered_ns.unwrap_or(NONE).to_le_bytes());
        bytes
    }

    /// Reads a question; none if these bytes are none.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; ASK_BYTES] = bytes.try_into().ok()?;
        let wish = match bytes[1] {
            1 => Wish::Hold,
            2 => Wish::Release,
            3 => Wish::Look,
            _ => return None,
        };
        let answered_ns = Some(number(&bytes[14..22])).filter(|ns| *ns != NONE);
        Some(Self {
            place: bytes[0],
            run: number(&bytes[2..6]) as u32,
            asked_ns: number(&bytes[6..14]),
            answered_ns,
            wish,
        })
    }

    /// Whether answers have reached the asking program within the last `lease_ns`. A candidate that can be heard but
    /// hears nothing would keep a lease that it does not know of.
    pub(super) fn is_answered(&self, lease_ns: u64) -> bool {
        self.answered_ns.is_some_and(|answered_ns| self.asked_ns.saturating_sub(answered_ns) < lease_ns)
    }
}

/// The answer of the witness to one question.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Answer {
    /// `run` of the question.
    pub run: u32,
    /// `asked_ns` of the question.
    pub asked_ns: u64,
    /// The newest number that this run of the witness has given; that of the holder, if there is one.
    pub newest: Number,
    /// Place of the holder, if there is one.
    pub holder: Option<u8>,
    /// The asking candidate holds the lease, so long from its question on, ns on the witness's clock.
    pub granted_ns: Option<u64>,
}

impl Answer {
    /// The answer as bytes: run, when it was asked, newest number (witness, count), holder (255: none), for how long it
    /// is granted (0: not); numbers in little-endian order.
    pub fn to_bytes(&self) -> [u8; ANSWER_BYTES] {
        let mut bytes = [0; ANSWER_BYTES];
        bytes[..4].copy_from_slice(&self.run.to_le_bytes());
        bytes[4..12].copy_from_slice(&self.asked_ns.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.newest.witness.to_le_bytes());
        bytes[16..20].copy_from_slice(&self.newest.count.to_le_bytes());
        bytes[20] = self.holder.unwrap_or(u8::MAX);
        bytes[21..].copy_from_slice(&self.granted_ns.unwrap_or(0).to_le_bytes());
        bytes
    }

    /// Reads an answer; none if these bytes are none.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; ANSWER_BYTES] = bytes.try_into().ok()?;
        Some(Self {
            run: number(&bytes[..4]) as u32,
            asked_ns: number(&bytes[4..12]),
            newest: Number { witness: number(&bytes[12..16]) as u32, count: number(&bytes[16..20]) as u32 },
            holder: Some(bytes[20]).filter(|place| *place != u8::MAX),
            granted_ns: Some(number(&bytes[21..])).filter(|ns| *ns != 0),
        })
    }
}

/// A number of up to eight bytes.
fn number(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}
