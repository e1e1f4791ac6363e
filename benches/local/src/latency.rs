//! How long a package is on its way, one at a time: to a receiver that sleeps, one that spins, one on the same core.
//!
//! All echo; one way is half of the round trip. Everything is copied in and out, except where it is loaned: there 16
//! bytes are written and read at each end, whatever the size.

use crate::case::Case;
use crate::hand_over::{HandOver, Lanes, Wake};
use crate::harness::{Cell, Failure, Pause, Placement, Scheduling, Scratch, Shared, time_two_processes};
use crate::ours::{How, Mailboxes};
use crate::rounds::{Contender, Target, at_most, compare};
use crate::settings::Settings;
use std::iter;
use std::time::Duration;

/// Bytes that are touched of what is sent and read in place.
pub const TOUCHED: usize = 16;

/// Round trips of a turn, and those before them that do not count.
const MESSAGES: usize = 20_000;
const WARM_UP: usize = 2_000;

/// Round trips of a turn of the self-test.
const MESSAGES_FEW: usize = 3_000;

/// A turn of a sleeping contender may be longer than one of a spinning contender: see [`Cell::cap`].
const CAP_ASLEEP: Duration = Duration::from_secs(2);
const CAP_AWAKE: Duration = Duration::from_millis(600);

/// A contender of ping-pong beside ours: a floor or a peer.
#[derive(Clone, Copy, Debug)]
pub struct Rival {
    /// Name in the table.
    pub name: &'static str,
    /// One turn.
    pub turn: fn(&Cell) -> Result<Vec<f64>, Failure>,
}

/// Bare shared memory, woken by a futex.
pub const FUTEX: Rival = Rival { name: "futex", turn: |cell| hand_over(cell, Wake::Futex) };
/// Bare shared memory, polled.
pub const SPIN: Rival = Rival { name: "spin", turn: |cell| hand_over(cell, Wake::Spin) };

/// One turn of bare shared memory.
///
/// # Errors
/// What either end failed with.
pub fn hand_over(cell: &Cell, wake: Wake) -> Result<Vec<f64>, Failure> {
    let lanes = Shared::<Lanes>::new()?;
    time_two_processes(cell, |end, _| Ok(HandOver::new(&lanes, end, wake)))
}

/// A case of one size.
pub struct Latency {
    name: &'static str,
    bytes: usize,
    how: How,
    /// Where both ends run.
    pub placement: Placement,
    /// How both ends are scheduled.
    pub scheduling: Scheduling,
    /// Before each message.
    pub pause: Pause,
    /// Round trips of a turn.
    pub messages: usize,
    rivals: Vec<(Rival, Option<Target>, Option<Target>)>,
}

impl Latency {
    /// Beside nothing: ours alone, one message after the other, on two processors of their own.
    pub fn new(name: &'static str, bytes: usize, how: How) -> Self {
        let (placement, scheduling, rivals) = (Placement::TwoCores, Scheduling::Fifo, Vec::new());
        Self { name, bytes, how, placement, scheduling, pause: Pause::None, messages: MESSAGES, rivals }
    }

    /// To a receiver that has gone to sleep.
    pub fn asleep(name: &'static str, bytes: usize) -> Self {
        Self { pause: Pause::UNTIL_ASLEEP, ..Self::new(name, bytes, How::Blocking) }
    }

    /// With one more contender, and the targets for the ratios of the medians and of the 99 % quantiles.
    pub fn beside(mut self, rival: Rival, p50: Option<Target>, p99: Option<Target>) -> Self {
        self.rivals.push((rival, p50, p99));
        self
    }

    /// To be measured.
    pub fn case(self) -> Case {
        Case::new(self.name, self.bytes, "us", move |settings, subject| {
            let cell = self.cell(settings);
            let ours = Contender::sampled("rohrpost", || ours(&cell, self.how));
            let rival = |&(rival, p50, p99): &(Rival, _, _)| {
                let turn = move || (rival.turn)(&cell);
                Contender::sampled(rival.name, turn).beside(p50, p99)
            };
            let contenders: Vec<Contender> = iter::once(ours).chain(self.rivals.iter().map(rival)).collect();
            Ok(compare(settings, subject, &contenders))
        })
    }

    fn cell(&self, settings: &Settings) -> Cell {
        Cell {
            bytes: self.bytes,
            messages: settings.count(self.messages),
            warm_up: settings.count(WARM_UP).min(self.messages / 10),
            placement: self.placement,
            scheduling: self.scheduling,
            pause: self.pause,
            cap: if self.how == How::Blocking { CAP_ASLEEP } else { CAP_AWAKE },
        }
    }
}

/// To a receiver that sleeps, beside bare shared memory with a futex.
pub fn blocking(bytes: usize) -> Latency {
    let (p50, p99) = if bytes <= 1024 { (at_most(1.10), at_most(1.15)) } else { (None, None) };
    Latency::asleep("blocking", bytes).beside(FUTEX, p50, p99)
}

/// To a receiver that spins, beside bare shared memory.
pub fn spinning(bytes: usize) -> Latency {
    let bound = match bytes {
        ..=64 => 1.4,
        65..=1024 => 1.15,
        _ => 1.0,
    };
    Latency::new("spinning", bytes, How::Spinning).beside(SPIN, at_most(bound), None)
}

/// The few cases that tell in seconds how this computer does: blocking and spinning beside the two floors.
pub fn self_test(scheduling: Scheduling) -> Vec<Case> {
    let few = |case: Latency| Latency { scheduling, messages: MESSAGES_FEW, ..case }.case();
    [blocking(64), blocking(1024), spinning(64), spinning(1024)].map(few).into()
}

/// One turn of ours.
///
/// # Errors
/// What either end failed with.
pub fn ours(cell: &Cell, how: How) -> Result<Vec<f64>, Failure> {
    let scratch = Scratch::new()?;
    let node = scratch.directory().join("node");
    // What is loaned is seen, from outside, by the bytes that are touched.
    let seen = Cell { bytes: if how == How::Loaned { TOUCHED } else { cell.bytes }, ..*cell };
    time_two_processes(&seen, |end, meetings| Mailboxes::open(&node, end, cell.bytes, how, meetings))
}
