//! What a program promises: this command, and the next promise before its time is over.

use crate::Command;

/// A command with the time for which it is meant. The next promise is to come before that time is over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Promise {
    /// The run that promises, and its place in the order.
    pub order: Order,
    /// Time from when it was made until the next one, ns.
    pub duration_ns: u64,
    /// What the motor is to do until then.
    pub command: Command,
}

/// Numbers that tell an old promise from a new one. Both may wrap: of two numbers, the newer one is less than half of
/// all numbers ahead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Order {
    /// Run of the program: a restarted one has a higher one.
    pub incarnation: u32,
    /// Number in this run.
    pub sequence: u32,
}

impl Order {
    /// Why a promise with these numbers is not newer than one with `last`.
    pub(crate) fn against(self, last: Self) -> Result<(), Refusal> {
        if self.incarnation != last.incarnation {
            return if is_newer(self.incarnation, last.incarnation) { Ok(()) } else { Err(Refusal::OldIncarnation) };
        }
        if is_newer(self.sequence, last.sequence) { Ok(()) } else { Err(Refusal::OldSequence) }
    }
}

/// Serial number arithmetic (RFC 1982).
fn is_newer(number: u32, than: u32) -> bool {
    matches!(number.wrapping_sub(than), 1..0x8000_0000)
}

/// Why a promise was not taken. Nothing else follows from it: the deadline of the one before stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, thiserror::Error)]
pub enum Refusal {
    /// Speed or turn rate.
    #[error("speed and turn rate must be finite numbers")]
    NotFinite,
    /// A program of the same name that began later has promised already.
    #[error("a newer run of this program has control; this one is to end")]
    OldIncarnation,
    /// A repetition, or one that came behind a newer one.
    #[error("this promise is not newer than the last one")]
    OldSequence,
    /// Late: the promise's time was over when it came.
    #[error("the promise came after its own deadline")]
    Late,
    /// Without a scan that can be believed nobody drives.
    #[error("the robot does not see: its last scan is missing, old, blind or frozen")]
    Blind,
    /// A person has taken over, or has given back.
    #[error("another one drives: a person has taken over, or has given back")]
    OtherDriver,
    /// A person has to look first.
    #[error("failed too often; the robot stands until a person resets the wormhole")]
    Failed,
}

impl Refusal {
    /// All of them, to count each by its place here.
    pub const ALL: [Self; 7] = [
        Self::NotFinite,
        Self::OldIncarnation,
        Self::OldSequence,
        Self::Late,
        Self::Blind,
        Self::OtherDriver,
        Self::Failed,
    ];
}
