//! Messages in one direction: from one sender or several to one receiver, as fast as it takes them.

mod ours;
mod peers;

pub use ours::{OurSink, OurSource, OwnNode, Retry};
pub use peers::{channel_rate, iceoryx_rate};

use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{Child, End, Gate, Link, Placement, Scheduling, Shared, Zeroable, settle};
use rohrpost_mailbox::monotonic_ns;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Sends; waits, as the contender waits, while there is no room.
pub trait Sink {
    /// Sends a message.
    ///
    /// # Errors
    /// When it cannot be sent.
    fn send(&mut self, message: &[u8]) -> Result<(), Failure>;
}

/// Receives; waits, as the contender waits, while there is nothing.
pub trait Source {
    /// Receives the next message, of exactly this length.
    ///
    /// # Errors
    /// When it cannot be received, or has another length.
    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure>;
}

/// One end of a ping-pong: the way out, and the way back.
pub struct Duplex<S, R>(pub S, pub R);

impl<S: Sink, R: Source> Link for Duplex<S, R> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.0.send(message)
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        self.1.receive(message)
    }
}

/// Most senders of a stream.
const SENDERS_MAX: usize = 8;
/// A message is its number, its sender, filler, and its number again.
pub(crate) const NUMBER_BYTES: usize = 8;
const FILLER: u8 = 0xa5;
/// Tells the receiver that this sender has sent all.
const LAST: u64 = u64::MAX;
/// All of every so many-th message is looked at, of the others both ends: else looking would be what takes the time.
const LOOK_EVERY: u64 = 61;
/// A sender looks at the clock after so many.
const CLOCK_EVERY: u64 = 256;

/// One turn of one contender.
#[derive(Clone, Copy, Debug)]
pub struct Stream {
    /// Of each message; at least 24.
    pub bytes: usize,
    /// Messages of each sender, at most.
    pub messages: u64,
    /// Senders, all on processor 0.
    pub senders: usize,
    /// How all are scheduled.
    pub scheduling: Scheduling,
    /// Ends the turn with what was sent by then; see [`rohrpost_bench_local::harness::Cell::cap`].
    pub cap: Duration,
}

impl Stream {
    /// A turn that has not ended by then never will.
    fn patience(&self) -> Duration {
        self.cap + Duration::from_secs(15)
    }
}

#[repr(C)]
struct StreamTurn {
    gate: Gate,
    received: AtomicU64,
    took_ns: AtomicU64,
}

// SAFETY: atomics only.
unsafe impl Zeroable for StreamTurn {}

impl StreamTurn {
    /// Messages a second.
    fn rate(&self) -> f64 {
        let (received, took_ns) = (self.received.load(Ordering::Acquire), self.took_ns.load(Ordering::Acquire));
        received as f64 * 1e9 / took_ns.max(1) as f64
    }
}

/// Sends from some processes to another, and gives messages a second, from the first one received to the last. Each
/// sender's messages must come whole, in order, and all of them.
///
/// `source` is called in the receiving process; when it has returned, `sink` is in each sending one, with its number.
///
/// # Errors
/// What the receiver failed with, else a sender.
pub fn rate<I: Sink, O: Source>(
    stream: &Stream,
    sink: impl Fn(usize) -> Result<I, Failure>,
    source: impl Fn() -> Result<O, Failure>,
) -> Result<f64, Failure> {
    let turn = Shared::<StreamTurn>::new()?;
    let all = stream.senders as u32 + 1;
    let receiver = Child::start(|| {
        let mut source = source()?;
        settle(End::Pong, Placement::TwoCores, stream.scheduling)?;
        turn.gate.meet(all)?;
        turn.gate.meet(2 * all)?;
        receive_all(&mut source, stream, &turn)?;
        turn.gate.meet(3 * all)
    })?;
    let sender = |number| {
        let (turn, sink) = (&turn, &sink);
        Child::start(move || {
            turn.gate.meet(all)?;
            let mut sink = sink(number)?;
            settle(End::Ping, Placement::TwoCores, stream.scheduling)?;
            turn.gate.meet(2 * all)?;
            // The receiver should be receiving by then: iceoryx2 drops what fills a subscriber that never did.
            std::thread::sleep(Duration::from_millis(10));
            send_all(&mut sink, stream, number as u8)?;
            // With iceoryx2's publisher goes what the other end has not taken yet.
            turn.gate.meet(3 * all)
        })
    };
    let senders: Vec<Child> = (0..stream.senders).map(sender).collect::<Result<_, _>>()?;
    let deadline = Instant::now() + stream.patience();
    receiver.finish(deadline)?;
    senders.into_iter().try_for_each(|sender| sender.finish(deadline))?;
    Ok(turn.rate())
}

fn send_all(sink: &mut impl Sink, stream: &Stream, sender: u8) -> Result<(), Failure> {
    let mut message = vec![FILLER; stream.bytes];
    message[NUMBER_BYTES] = sender;
    let over = Instant::now() + stream.cap;
    for number in 0..stream.messages {
        if number % CLOCK_EVERY == 0 && Instant::now() > over {
            break;
        }
        put_number(&mut message, number);
        sink.send(&message)?;
    }
    put_number(&mut message, LAST);
    sink.send(&message)
}

/// Puts its number at both ends of a message.
pub(crate) fn put_number(message: &mut [u8], number: u64) {
    let bytes = number.to_le_bytes();
    message[..NUMBER_BYTES].copy_from_slice(&bytes);
    let tail = message.len() - NUMBER_BYTES;
    message[tail..].copy_from_slice(&bytes);
}

fn receive_all(source: &mut impl Source, stream: &Stream, turn: &StreamTurn) -> Result<(), Failure> {
    let mut message = vec![0; stream.bytes];
    let mut expected = [0; SENDERS_MAX];
    let mut running = stream.senders;
    let (mut received, mut began_ns) = (0u64, 0);
    while running > 0 {
        source.receive(&mut message)?;
        if received == 0 {
            began_ns = monotonic_ns();
        }
        match checked(&message)? {
            (_, LAST) => running -= 1,
            (sender, number) => {
                let next = expected.get_mut(sender).ok_or_else(|| Failure::Failed(format!("sender {sender}?")))?;
                if number != *next {
                    return Err(Failure::Failed(format!("message {number} came when {next} was due")));
                }
                *next += 1;
                received += 1;
            }
        }
    }
    turn.took_ns.store(monotonic_ns() - began_ns, Ordering::Release);
    turn.received.store(received.saturating_sub(1), Ordering::Release);
    Ok(())
}

/// The number at this place of a message.
pub(crate) fn number_at(message: &[u8], at: usize) -> u64 {
    let mut bytes = [0; NUMBER_BYTES];
    bytes.copy_from_slice(&message[at..at + NUMBER_BYTES]);
    u64::from_le_bytes(bytes)
}

/// The sender and the number of a message, which must be whole.
fn checked(message: &[u8]) -> Result<(usize, u64), Failure> {
    let tail = message.len() - NUMBER_BYTES;
    let number = number_at(message, 0);
    let torn = number != number_at(message, tail)
        || number.is_multiple_of(LOOK_EVERY) && message[NUMBER_BYTES + 1..tail].iter().any(|byte| *byte != FILLER);
    if torn {
        return Err(Failure::Failed(format!("message {number} is damaged")));
    }
    Ok((usize::from(message[NUMBER_BYTES]), number))
}
