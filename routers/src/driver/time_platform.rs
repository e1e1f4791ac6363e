//! What the driver of a clock has of the system, and what it tells of itself.

use crate::frame::FrameHead;
use crate::frame::NodeIndex;
use crate::security::{Rejection, TAG_BYTES};
use crate::time::{Clock, Ignored, Looked, SentId, Stamp, TIME_BYTES, Unsteady};
use rohrpost_mailbox::{TimeRecord, Watched};
use std::net::IpAddr;

/// Room for a datagram of time, and its seal.
pub const TIME_DATAGRAM_BYTES: usize = TIME_BYTES + TAG_BYTES;

/// A datagram of time that came.
#[derive(Clone, Copy, Debug)]
pub struct TimeArrival {
    /// Length.
    pub bytes: usize,
    /// The address that it came from.
    pub source: IpAddr,
    /// When it came.
    pub stamp: Stamp,
}

/// What came of a look at the socket.
#[derive(Clone, Copy, Debug)]
pub enum TimeInput {
    /// A datagram.
    Datagram(TimeArrival),
    /// A datagram that an impairment keeps for now.
    Kept,
    /// Nothing.
    Nothing,
}

/// Clocks, socket and page of a node.
pub trait TimePlatform {
    /// The clock that is measured and corrected, ns.
    fn local_ns(&self) -> u64;
    /// The clock by which work is counted, ns.
    fn monotonic_ns(&self) -> u64;
    /// All clocks of this computer.
    fn looked(&self) -> Looked;
    /// The next datagram that left, and when.
    fn next_left(&mut self) -> Option<(SentId, Stamp)>;
    /// The next datagram that came. Reads the socket once at most: the driver bounds how often.
    fn receive(&mut self, datagram: &mut [u8; TIME_DATAGRAM_BYTES]) -> TimeInput;
    /// When an impairment has more, local ns.
    fn held_ns(&self) -> u64 {
        u64::MAX
    }
    /// Hands over a datagram. One that is not taken is lost, as on the wire.
    fn send(&mut self, to: NodeIndex, datagram: &[u8]);
    /// Writes the node's page. False: too late; time continues from what the page says.
    fn write(&mut self, record: &TimeRecord) -> bool;
    /// What the page says.
    fn page(&self) -> Option<TimeRecord>;
    /// Notes in the page what was seen last of the clocks.
    fn note_watched(&mut self, watched: &Watched);
    /// Lets others see how it stands; the page is written. `ignored`: datagrams that were not taken.
    fn publish(&mut self, clock: &Clock, ignored: u64);
    /// Whether a new epoch is asked for since the last look: the computer's clock at which it is to begin, ns since
    /// 1970.
    fn take_new_epoch(&mut self) -> Option<u64> {
        None
    }
    /// Something happened that is told, or that a simulation watches.
    fn happened(&mut self, clock: &Clock, event: TimeEvent<'_>);
}

/// How a frame of time is validated.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum TimeSource {
    /// From an incarnation that is known to live.
    Proven,
    /// From an incarnation that may be over.
    Unproven,
    /// From a node with another configuration.
    OtherTable,
    /// From an address that is not that of its node.
    WrongAddress,
}

/// What the driver of a clock does.
#[derive(Clone, Copy, Debug)]
pub enum TimeEvent<'a> {
    /// The local clock is not one to measure by.
    Unsteady {
        /// Why.
        why: Unsteady,
        /// It was steady before.
        is_new: bool,
    },
    /// A datagram was not opened. `why`: and how many of that sort, if that is to be told.
    NotOpened {
        /// The address that it came from.
        source: IpAddr,
        /// The cause, and datagrams that were not opened by it.
        why: Option<(Rejection, u64)>,
    },
    /// A datagram was none of time.
    NoFrame,
    /// A frame is about to be handled.
    Hears,
    /// A frame was handled.
    Heard {
        /// How it is validated.
        source: TimeSource,
        /// Its head.
        head: &'a FrameHead,
        /// What is behind it.
        rest: &'a [u8],
        /// What became of it; none: it was dropped.
        taken: Option<Result<(), Ignored>>,
    },
    /// A datagram is about to be sealed and sent.
    Sends(&'a [u8; TIME_BYTES]),
    /// Its receiver has no session: it is told later what time it is.
    NoSession,
    /// The clock was asked what is due.
    Polled,
}
