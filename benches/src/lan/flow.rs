//! Messages in one direction at the full rate, with losses allowed: received and lost messages are counted.

use crate::floors::ring::Bell;
use crate::one_way::{NUMBER_BYTES, Sink, number_at, put_number};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{Child, End, Gate, Placement, Scheduling, Shared, Zeroable, copy_whole, settle};
use rohrpost_mailbox::{monotonic_ns, sys};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// The receiving side.
pub trait Outlet {
    /// Receives the next message, of exactly this length; false when none came within [`LOOK`].
    ///
    /// # Errors
    /// When it cannot be received, or has another length.
    fn receive(&mut self, message: &mut [u8]) -> Result<bool, Failure>;
}

/// A message is its number, filler, and its number again.
pub const FILLER: u8 = 0x5a;
/// Every so many-th message is checked whole, the others at both ends: else checking would take most of the time.
const LOOK_EVERY: u64 = 61;
/// The sender looks at the clock after so many messages.
const CLOCK_EVERY: u64 = 16;
/// So often a receiver looks whether all was sent, while nothing comes.
pub const LOOK: Duration = Duration::from_millis(50);
/// After this silence nothing more is in flight, of what waits in programs: a large record takes a second on a slow
/// computer, and routers wait as long for lost parts.
pub const SILENCE: Duration = Duration::from_secs(10);
/// After this silence nothing more is in flight, of what waits in the kernel alone.
pub const KERNEL_SILENCE: Duration = Duration::from_millis(250);
/// A turn that exceeds its cap by so much hangs, and is killed: silent when its window is full, and at its end.
const GRACE: Duration = Duration::from_secs(60);
const _: () = assert!(GRACE.as_secs() > 3 * SILENCE.as_secs(), "a turn with losses must end by itself");

/// One turn of one contender.
#[derive(Clone, Copy, Debug)]
pub struct Flow {
    /// Of each message; at least 16.
    pub bytes: usize,
    /// Messages, at most.
    pub messages: u64,
    /// Messages in flight, at most; none: any number, as long as the contender takes them.
    pub window: Option<u64>,
    /// Where the sender runs.
    pub sender: End,
    /// Its SCHED_FIFO priority.
    pub sender_fifo: u8,
    /// Ends the sending.
    pub cap: Duration,
    /// When nothing came for so long, all that is on its way is lost.
    pub silence: Duration,
}

/// The result.
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
struct FlowTurn {
    gate: Gate,
    /// Not 0: this many were sent, and no more will be.
    sent: AtomicU64,
    received: AtomicU64,
    took_ns: AtomicU64,
    credit: Credit,
}

// SAFETY: atomics only.
unsafe impl Zeroable for FlowTurn {}

/// Sends from one process to another; `inlet` never waits for its receiver. Each opens its own side; the receiver
/// first. Messages must be whole and in order, without duplicates.
///
/// # Errors
/// What the receiver failed with, else the sender; also when nothing arrived.
pub fn flow<I: Sink, O: Outlet>(
    flow: &Flow,
    inlet: impl Fn() -> Result<I, Failure>,
    outlet: impl Fn() -> Result<O, Failure>,
) -> Result<Flown, Failure> {
    let turn = Shared::<FlowTurn>::new()?;
    let mut receiver = Child::start(|| {
        let mut outlet = outlet()?;
        settle(End::Pong, Placement::TwoCores, Scheduling::Fifo)?;
        turn.gate.meet(2)?;
        receive_all(&mut outlet, flow, &turn)
    })?;
    let sender = Child::start(|| {
        turn.gate.meet(2)?;
        let mut inlet = inlet()?;
        settle(flow.sender, Placement::TwoCores, Scheduling::Fifo)?;
        // If the kernel refuses, the environment line says so.
        let _ = sys::schedule(sys::Scheduling::Fifo(flow.sender_fifo));
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

fn send_all(inlet: &mut impl Sink, flow: &Flow, turn: &FlowTurn) -> Result<(), Failure> {
    let mut message = vec![FILLER; flow.bytes];
    let over = Instant::now() + flow.cap;
    let mut window = Window { size: flow.window.unwrap_or(u64::MAX), lost_before: 0 };
    let mut sent = 0;
    while sent < flow.messages && (sent % CLOCK_EVERY != 0 || Instant::now() < over) {
        window.await_room(sent, &turn.credit);
        put_number(&mut message, sent);
        inlet.send(&message)?;
        sent += 1;
    }
    turn.sent.store(sent, Ordering::Release);
    Ok(())
}

/// What the receiver tells a sender that keeps to a window.
#[repr(C)]
struct Credit {
    /// One more than the number of the newest received message.
    next: AtomicU64,
    /// The value of it at which the sender is woken.
    wanted: AtomicU64,
    /// How often nothing arrived for long.
    silences: AtomicU64,
    bell: Bell,
}

impl Credit {
    fn arrived(&self, next: u64) {
        // ORDERING: SeqCst, as the bell needs it for its sleeper's condition.
        self.next.store(next, Ordering::SeqCst);
        if next >= self.wanted.load(Ordering::SeqCst) {
            self.bell.ring();
        }
    }

    fn silent(&self) {
        self.silences.fetch_add(1, Ordering::SeqCst);
        self.bell.ring();
    }
}

/// The window of messages in flight.
struct Window {
    size: u64,
    /// Messages before this one are lost, if they were not received.
    lost_before: u64,
}

impl Window {
    /// If the window is full, sleeps until half of it is free, or until nothing arrives any more.
    fn await_room(&mut self, sent: u64, credit: &Credit) {
        let arrived = || credit.next.load(Ordering::SeqCst);
        let silences = credit.silences.load(Ordering::SeqCst);
        if sent - arrived().max(self.lost_before) < self.size {
            return;
        }
        let wanted = sent - self.size / 2;
        credit.wanted.store(wanted, Ordering::SeqCst);
        let is_silent = || credit.silences.load(Ordering::SeqCst) != silences;
        while arrived() < wanted && !is_silent() {
            credit.bell.sleep_unless(|| arrived() >= wanted || is_silent());
        }
        credit.wanted.store(u64::MAX, Ordering::SeqCst);
        if arrived() < wanted {
            self.lost_before = sent;
        }
    }
}

fn receive_all(outlet: &mut impl Outlet, flow: &Flow, turn: &FlowTurn) -> Result<(), Failure> {
    let mut message = vec![0; flow.bytes];
    let (mut next, mut received) = (0, 0);
    let (mut first_ns, mut last_ns) = (0, 0);
    let mut silent_since_ns = monotonic_ns();
    loop {
        // Loaded before: all sent messages are in flight when this is stored.
        let sent = turn.sent.load(Ordering::Acquire);
        if !outlet.receive(&mut message)? {
            let is_silent = u128::from(monotonic_ns() - silent_since_ns) >= flow.silence.as_nanos();
            if sent != 0 && (next == sent || is_silent) {
                break;
            }
            if is_silent {
                turn.credit.silent();
                silent_since_ns = monotonic_ns();
            }
            continue;
        }
        last_ns = monotonic_ns();
        silent_since_ns = last_ns;
        if received == 0 {
            first_ns = last_ns;
        }
        let number = checked(&message)?;
        if number < next {
            return Err(Failure::Failed(format!("message {number} came when {next} was due, or came twice")));
        }
        next = number + 1;
        received += 1;
        turn.credit.arrived(next);
    }
    turn.took_ns.store(last_ns - first_ns, Ordering::Release);
    turn.received.store(received, Ordering::Release);
    Ok(())
}

/// Copies what [`flow`] looks at of a message that is read in place: both of its ends, or all of it.
///
/// # Errors
/// When it has another length.
pub(super) fn look_at(body: &[u8], message: &mut [u8]) -> Result<(), Failure> {
    if body.len() != message.len() || number_at(body, 0).is_multiple_of(LOOK_EVERY) {
        return copy_whole(body, message);
    }
    put_ends(body, message);
    Ok(())
}

/// Copies both ends of a message, which are its number.
pub(super) fn put_ends(from: &[u8], to: &mut [u8]) {
    let tail = to.len() - NUMBER_BYTES;
    to[..NUMBER_BYTES].copy_from_slice(&from[..NUMBER_BYTES]);
    to[tail..].copy_from_slice(&from[tail..]);
}

/// The number of a message, which must be whole.
///
/// # Errors
/// When it is not.
pub fn checked(message: &[u8]) -> Result<u64, Failure> {
    let tail = message.len() - NUMBER_BYTES;
    let number = number_at(message, 0);
    let torn = number != number_at(message, tail)
        || number.is_multiple_of(LOOK_EVERY) && message[NUMBER_BYTES..tail].iter().any(|byte| *byte != FILLER);
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
        let flow = Flow {
            bytes: 32,
            messages: 10,
            window: None,
            sender: End::Ping,
            sender_fifo: 50,
            cap: Duration::ZERO,
            silence: Duration::ZERO,
        };
        let turn = Shared::<FlowTurn>::new()?;
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
    fn of_a_message_in_place_both_ends_are_looked_at_and_now_and_then_all_of_it() {
        let mut damaged = [message(LOOK_EVERY), message(1)];
        damaged.iter_mut().for_each(|message| message[20] ^= 1);
        let mut seen = message(0);
        assert!(look_at(&damaged[0], &mut seen).is_ok() && checked(&seen).is_err(), "all of it");
        let mut seen = message(0);
        assert!(look_at(&damaged[1], &mut seen).is_ok());
        assert_eq!(checked(&seen), Ok(1), "its ends");
        damaged[1][31] ^= 1;
        assert!(look_at(&damaged[1], &mut seen).is_ok() && checked(&seen).is_err(), "the end of it");
        assert!(look_at(&damaged[1][1..], &mut seen).is_err(), "another length");
    }

    #[test]
    fn figures_of_a_turn() {
        let flown = Flown { sent: 200, received: 101, took_ns: 50_000_000 };
        assert!((flown.rate() - 2_000.0).abs() < 1e-9);
        assert!((flown.lost_percent() - 49.5).abs() < 1e-9);
    }

    #[test]
    fn a_window_opens_when_half_of_it_came_and_when_nothing_comes() {
        let turn = Shared::<FlowTurn>::new().unwrap();
        turn.credit.arrived(3);
        let mut window = Window { size: 4, lost_before: 0 };
        window.await_room(6, &turn.credit);
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| window.await_room(7, &turn.credit));
            (4..=5).for_each(|next| turn.credit.arrived(next));
            waiting.join().unwrap();
        });
        assert_eq!(window.lost_before, 0);
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| window.await_room(9, &turn.credit));
            while !waiting.is_finished() {
                turn.credit.silent();
                std::thread::yield_now();
            }
        });
        assert_eq!(window.lost_before, 9, "none of those on their way will come");
    }
}
