//! Messages in one direction as fast as they go, where some may be lost: what comes is counted, and what does not.

use crate::Failure;
use crate::harness::{Child, End, Gate, Placement, Scheduling, Shared, Zeroable, settle};
use nix::sched::sched_yield;
use rohrpost_mailbox::monotonic_ns;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Where messages go in.
pub trait Inlet {
    /// Sends a message; never waits for its receiver.
    ///
    /// # Errors
    /// When it cannot be sent.
    fn send(&mut self, message: &[u8]) -> Result<(), Failure>;
}

/// Where they come out.
pub trait Outlet {
    /// Receives the next message, of exactly this length; false when none came within [`SILENCE`].
    ///
    /// # Errors
    /// When it cannot be received, or has another length.
    fn receive(&mut self, message: &mut [u8]) -> Result<bool, Failure>;
}

/// A message is its number, filler, and its number again.
const NUMBER_BYTES: usize = 8;
const FILLER: u8 = 0x5a;
/// All of every so many-th message is looked at, of the others both ends: else looking would be what takes the time.
const LOOK_EVERY: u64 = 61;
/// The sender looks at the clock after so many.
const CLOCK_EVERY: u64 = 16;
/// After this silence nothing more is on its way.
pub const SILENCE: Duration = Duration::from_millis(60);
/// What is on its way for so long is held for lost, and its room in the window is given again.
const LOST_AFTER: Duration = Duration::from_millis(20);
/// A turn that takes so much longer than its cap hangs, and is killed.
const GRACE: Duration = Duration::from_secs(30);

/// One turn of one contender.
#[derive(Clone, Copy, Debug)]
pub struct Flow {
    /// Of each message; at least 16.
    pub bytes: usize,
    /// Messages, at most.
    pub messages: u64,
    /// How many may be on their way; none: any number, as long as the contender takes them.
    pub window: Option<u64>,
    /// Ends the sending.
    pub cap: Duration,
}

/// What came of it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Flown {
    /// Messages sent.
    pub sent: u64,
    /// Of these, received.
    pub received: u64,
    /// From the first one received to the last.
    pub took_ns: u64,
}

impl Flown {
    /// Messages received a second.
    pub fn rate(&self) -> f64 {
        self.received.saturating_sub(1) as f64 * 1e9 / self.took_ns.max(1) as f64
    }

    /// Of 100 that were sent.
    pub fn lost_percent(&self) -> f64 {
        (self.sent - self.received.min(self.sent)) as f64 * 100.0 / self.sent.max(1) as f64
    }
}

#[repr(C)]
struct Turn {
    gate: Gate,
    /// Not 0: this many were sent, and no more will be.
    sent: AtomicU64,
    received: AtomicU64,
    /// One more than the number of the newest that came.
    next: AtomicU64,
    took_ns: AtomicU64,
}

// SAFETY: atomics only.
unsafe impl Zeroable for Turn {}

/// Sends from one process to another. Each opens its own side; the receiving one first. What comes must be whole and in order,
/// nothing twice.
///
/// # Errors
/// What the receiver failed with, else the sender; also when nothing came.
pub fn flow<I: Inlet, O: Outlet>(
    flow: &Flow,
    inlet: impl Fn() -> Result<I, Failure>,
    outlet: impl Fn() -> Result<O, Failure>,
) -> Result<Flown, Failure> {
    let turn = Shared::<Turn>::new()?;
    let mut receiver = Child::start(|| {
        let mut outlet = outlet()?;
        settle(End::Pong, Placement::TwoCores, Scheduling::Fifo)?;
        turn.gate.meet(2)?;
        receive_all(&mut outlet, flow, &turn)
    })?;
    let sender = Child::start(|| {
        turn.gate.meet(2)?;
        let mut inlet = inlet()?;
        settle(End::Ping, Placement::TwoCores, Scheduling::Fifo)?;
        send_all(&mut inlet, flow, &turn)
    })?;
    let deadline = Instant::now() + flow.cap + GRACE;
    let sent = sender.finish(deadline);
    if sent.is_ok() || receiver.has_ended()? {
        receiver.finish(deadline)?;
    }
    sent?;
    let of = |count: &AtomicU64| count.load(Ordering::Acquire);
    let flown = Flown { sent: of(&turn.sent), received: of(&turn.received), took_ns: of(&turn.took_ns) };
    if flown.received < 2 {
        return Err(Failure::Failed(format!("of {} messages {} came", flown.sent, flown.received)));
    }
    Ok(flown)
}

fn send_all(inlet: &mut impl Inlet, flow: &Flow, turn: &Turn) -> Result<(), Failure> {
    let mut message = vec![FILLER; flow.bytes];
    let over = Instant::now() + flow.cap;
    let mut window = Window { size: flow.window.unwrap_or(u64::MAX), given_up: 0 };
    let mut sent = 0;
    while sent < flow.messages && (sent % CLOCK_EVERY != 0 || Instant::now() < over) {
        window.await_room(sent, &turn.next)?;
        put_number(&mut message, sent);
        inlet.send(&message)?;
        sent += 1;
    }
    turn.sent.store(sent, Ordering::Release);
    Ok(())
}

/// What may be on its way.
struct Window {
    size: u64,
    /// Messages before this one are held for lost, if they did not come.
    given_up: u64,
}

impl Window {
    /// Lets others have the processor until there is room.
    fn await_room(&mut self, sent: u64, next: &AtomicU64) -> Result<(), Failure> {
        let mut since: Option<(u64, Instant)> = None;
        loop {
            let arrived = next.load(Ordering::Acquire).max(self.given_up);
            if sent - arrived < self.size {
                return Ok(());
            }
            let (seen, began) = *since.get_or_insert_with(|| (arrived, Instant::now()));
            if seen != arrived {
                since = None;
            } else if began.elapsed() > LOST_AFTER {
                self.given_up = sent;
            }
            sched_yield().map_err(|error| Failure::of("sched_yield", error))?;
        }
    }
}

fn put_number(message: &mut [u8], number: u64) {
    let bytes = number.to_le_bytes();
    message[..NUMBER_BYTES].copy_from_slice(&bytes);
    let tail = message.len() - NUMBER_BYTES;
    message[tail..].copy_from_slice(&bytes);
}

fn receive_all(outlet: &mut impl Outlet, flow: &Flow, turn: &Turn) -> Result<(), Failure> {
    let mut message = vec![0; flow.bytes];
    let (mut next, mut received) = (0, 0);
    let (mut first_ns, mut last_ns) = (0, 0);
    loop {
        // Asked before: what is sent is on its way when this is said.
        let is_over = turn.sent.load(Ordering::Acquire) != 0;
        if !outlet.receive(&mut message)? {
            if is_over {
                break;
            }
            continue;
        }
        last_ns = monotonic_ns();
        if received == 0 {
            first_ns = last_ns;
        }
        let number = checked(&message)?;
        if number < next {
            return Err(Failure::Failed(format!("message {number} came when {next} was due, or came twice")));
        }
        next = number + 1;
        received += 1;
        turn.next.store(next, Ordering::Release);
    }
    turn.took_ns.store(last_ns - first_ns, Ordering::Release);
    turn.received.store(received, Ordering::Release);
    Ok(())
}

/// The number of a message, which must be whole.
fn checked(message: &[u8]) -> Result<u64, Failure> {
    let number_at = |at: usize| {
        let mut bytes = [0; NUMBER_BYTES];
        bytes.copy_from_slice(&message[at..at + NUMBER_BYTES]);
        u64::from_le_bytes(bytes)
    };
    let tail = message.len() - NUMBER_BYTES;
    let number = number_at(0);
    let torn = number != number_at(tail)
        || number % LOOK_EVERY == 0 && message[NUMBER_BYTES..tail].iter().any(|byte| *byte != FILLER);
    if torn { Err(Failure::Failed(format!("message {number} is damaged"))) } else { Ok(number) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::VecDeque;

    /// Gives what is in it, then nothing.
    struct Canned(VecDeque<Vec<u8>>);

    impl Outlet for Canned {
        fn receive(&mut self, message: &mut [u8]) -> Result<bool, Failure> {
            Ok(self.0.pop_front().map(|next| message.copy_from_slice(&next)).is_some())
        }
    }

    fn message(number: u64) -> Vec<u8> {
        let mut message = vec![FILLER; 32];
        put_number(&mut message, number);
        message
    }

    /// How many came of these, when 10 were sent.
    fn received(messages: impl IntoIterator<Item = Vec<u8>>) -> Result<u64, Failure> {
        let flow = Flow { bytes: 32, messages: 10, window: None, cap: Duration::ZERO };
        let turn = Shared::<Turn>::new()?;
        turn.sent.store(10, Ordering::Release);
        receive_all(&mut Canned(messages.into_iter().collect()), &flow, &turn)?;
        Ok(turn.received.load(Ordering::Acquire))
    }

    #[test]
    fn losses_are_counted_and_all_else_fails() {
        assert_eq!(received([0, 1, 2].map(message)), Ok(3));
        assert_eq!(received([0, 5, 9].map(message)), Ok(3), "losses");
        let damaged = |at: usize| {
            let mut message = message(0);
            message[at] ^= 1;
            [message]
        };
        for (messages, says) in [
            (vec![message(1), message(1)], "twice"),
            (vec![message(2), message(1)], "message 1 came when 3 was due"),
            (damaged(31).into(), "message 0 is damaged"),
            (damaged(20).into(), "message 0 is damaged"),
        ] {
            let error = received(messages).unwrap_err().to_string();
            assert!(error.contains(says), "{error}, not {says}");
        }
    }

    #[test]
    fn figures_of_a_turn() {
        let flown = Flown { sent: 200, received: 101, took_ns: 50_000_000 };
        assert!((flown.rate() - 2_000.0).abs() < 1e-9);
        assert!((flown.lost_percent() - 49.5).abs() < 1e-9);
    }

    #[test]
    fn a_window_opens_when_messages_come_and_when_they_are_lost() {
        let next = AtomicU64::new(3);
        let mut window = Window { size: 4, given_up: 0 };
        window.await_room(6, &next).unwrap();
        assert_eq!(window.given_up, 0);
        window.await_room(7, &next).unwrap();
        assert_eq!(window.given_up, 7, "none of those on their way ever came");
    }
}
