//! Contenders of ping-pong beside ours.

use crate::floors::{HandOver, Lanes, Queues, SlotEnd, SlotPair, Wake};
use crate::harness::{Cell, Failure, Shared, time_two_processes};
#[cfg(feature = "peers")]
use crate::{
    harness::{Scratch, time_two_threads},
    peers::{Iceoryx, Waits, pair},
};

/// A floor or a peer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Rival {
    /// Bare shared memory, woken by a futex.
    Futex,
    /// Bare shared memory, polled.
    Spin,
    /// The same with [`SMALL`] bytes, whatever the size of the case: the floor of messages that are not copied.
    SpinSmall,
    /// The least that slots with priorities cost, polled.
    SlotCore,
    /// The kernel's priority queue.
    PosixQueue,
    #[cfg(feature = "peers")]
    IceoryxListener,
    #[cfg(feature = "peers")]
    IceoryxSpinning,
    #[cfg(feature = "peers")]
    IceoryxLoaned,
    /// Between threads of one process.
    #[cfg(feature = "peers")]
    Crossbeam,
}

/// Bytes of [`Rival::SpinSmall`].
const SMALL: usize = 64;

impl Rival {
    /// Name in the table.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Futex => "futex",
            Self::Spin => "spin",
            Self::SpinSmall => "spin 64 B",
            Self::SlotCore => "slot core",
            Self::PosixQueue => "posix-mq",
            #[cfg(feature = "peers")]
            Self::IceoryxListener => "iceoryx2 listener",
            #[cfg(feature = "peers")]
            Self::IceoryxSpinning => "iceoryx2 spinning",
            #[cfg(feature = "peers")]
            Self::IceoryxLoaned => "iceoryx2 loaned",
            #[cfg(feature = "peers")]
            Self::Crossbeam => "crossbeam, 1 process",
        }
    }

    /// One turn. Of a loaned message, this many bytes are touched.
    pub(super) fn turn(self, cell: &Cell, #[allow(unused_variables)] touched: usize) -> Result<Vec<f64>, Failure> {
        match self {
            Self::Futex => hand_over(cell, Wake::Futex),
            Self::Spin => hand_over(cell, Wake::Spin),
            Self::SpinSmall => hand_over(&Cell { bytes: SMALL, ..*cell }, Wake::Spin),
            Self::SlotCore => {
                let pair = Shared::<SlotPair>::new()?;
                time_two_processes(cell, |end, _| Ok(SlotEnd::new(&pair, end, cell.bytes)))
            }
            Self::PosixQueue => {
                let queues = Queues::new(cell.bytes)?;
                time_two_processes(cell, |end, _| Ok(queues.end(end)))
            }
            #[cfg(feature = "peers")]
            Self::IceoryxListener => iceoryx(cell, cell.bytes, Waits::Listener),
            #[cfg(feature = "peers")]
            Self::IceoryxSpinning => iceoryx(cell, cell.bytes, Waits::Spinning),
            #[cfg(feature = "peers")]
            Self::IceoryxLoaned => iceoryx(&Cell { bytes: touched, ..*cell }, cell.bytes, Waits::Loaned),
            #[cfg(feature = "peers")]
            Self::Crossbeam => match cell.bytes {
                64 => time_two_threads(cell, pair::<64>),
                1024 => time_two_threads(cell, pair::<1024>),
                16_384 => time_two_threads(cell, pair::<16_384>),
                bytes => Err(Failure::Skipped(format!("its messages are types; there is none of {bytes} B"))),
            },
        }
    }
}

fn hand_over(cell: &Cell, wake: Wake) -> Result<Vec<f64>, Failure> {
    let lanes = Shared::<Lanes>::new()?;
    time_two_processes(cell, |end, _| Ok(HandOver::new(&lanes, end, wake)))
}

#[cfg(feature = "peers")]
fn iceoryx(cell: &Cell, bytes: usize, waits: Waits) -> Result<Vec<f64>, Failure> {
    let scratch = Scratch::new()?;
    time_two_processes(cell, |end, meetings| Iceoryx::open(&scratch, end, bytes, waits, meetings))
}
