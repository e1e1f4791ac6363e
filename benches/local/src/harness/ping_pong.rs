//! Ping-pong: one end sends and waits for the echo. Half of the round trip is what one way takes.

use super::{Child, End, Failure, Gate, Placement, Samples, Scheduling, Shared, Zeroable, interrupted, settle};
use rohrpost_mailbox::monotonic_ns;
use std::time::{Duration, Instant};

/// A finished turn with fewer samples goes on: on busy processors without real-time scheduling, a round trip can
/// take milliseconds.
pub const SAMPLES_MIN: usize = 50;

/// Bytes at the head of each message: its number. All other bytes follow from it.
const NUMBER_BYTES: usize = 8;

/// The number that tells the far end to stop.
const STOP: u64 = u64::MAX;

/// After this the far end waits for the first message.
const HEAD_START: Duration = Duration::from_millis(10);

/// A turn that exceeds its cap by so much hangs, and is killed.
pub const GRACE: Duration = Duration::from_secs(30);
/// Time for the second end after the first has ended: the last message to it may be lost, which it must notice itself.
pub const SECOND_ENDS: Duration = Duration::from_secs(8);

/// One end of a connection in both directions.
pub trait Link {
    /// Sends a message.
    ///
    /// # Errors
    /// When it cannot be sent.
    fn send(&mut self, message: &[u8]) -> Result<(), Failure>;

    /// Receives the next message, of exactly this length; waits as the contender waits.
    ///
    /// # Errors
    /// When it cannot be received, or has another length.
    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure>;
}

/// What the near end does before each message.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Pause {
    /// Nothing: one message follows the other.
    None,
    /// It looks at the clock for so long.
    Awake(Duration),
    /// It sleeps for so long.
    Asleep(Duration),
}

impl Pause {
    /// Each message finds the far end asleep, and the processor of the near end awake. Without it, two ends that are
    /// quick enough meet each other on the way to sleep, and stay awake for a whole turn, or do not: as it happens.
    pub const UNTIL_ASLEEP: Self = Self::Awake(Duration::from_micros(20));

    /// Takes it.
    pub fn take(self) {
        match self {
            Self::None => {}
            Self::Awake(pause) => {
                let began = Instant::now();
                while began.elapsed() < pause {
                    std::hint::spin_loop();
                }
            }
            Self::Asleep(pause) => std::thread::sleep(pause),
        }
    }
}

/// One turn of one contender.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Cell {
    /// Of each message; at least 16.
    pub bytes: usize,
    /// Round trips that count.
    pub messages: usize,
    /// Round trips before them that do not.
    pub warm_up: usize,
    /// Where.
    pub placement: Placement,
    /// How.
    pub scheduling: Scheduling,
    /// What the near end does before each message.
    pub pause: Pause,
    /// Ends the turn with the samples so far; a quarter of it ends the warm-up. Below 0.9 s for spinning contenders:
    /// the kernel's fair server stops a real-time process that keeps others from running for 50 ms in each second.
    pub cap: Duration,
}

impl Cell {
    /// Round trips of a turn over a network.
    pub const HOP_MESSAGES: usize = 10_000;

    /// Over a network: a core for each end, real-time scheduling, one message after the other. All sleep, so the
    /// kernel's fair server stays out.
    pub fn hop(bytes: usize, messages: usize) -> Self {
        Self {
            bytes,
            messages,
            warm_up: (Self::HOP_MESSAGES / 10).min(messages / 10),
            placement: Placement::TwoCores,
            scheduling: Scheduling::Fifo,
            pause: Pause::None,
            cap: Duration::from_secs(2),
        }
    }
}

/// What the ends of a turn share.
#[repr(C)]
struct PingPongTurn {
    gate: Gate,
    /// One way, µs.
    samples: Samples,
}

// SAFETY: atomics only.
unsafe impl Zeroable for PingPongTurn {}

impl PingPongTurn {
    /// Of round trips, ns.
    fn record(&self, round_trips: &[u64]) {
        round_trips.iter().for_each(|ns| self.samples.push(*ns as f64 / 2000.0));
    }
}

/// Fills a message: its number, then bytes that follow from it.
pub fn fill(message: &mut [u8], number: u64) {
    let (head, body) = message.split_at_mut(NUMBER_BYTES);
    head.copy_from_slice(&number.to_le_bytes());
    body.fill(number as u8);
}

/// Copies what came, which must be as long as what is expected.
///
/// # Errors
/// When it is not.
pub fn copy_whole(came: &[u8], message: &mut [u8]) -> Result<(), Failure> {
    if came.len() != message.len() {
        return Err(Failure::Failed(format!("{} bytes came, not {}", came.len(), message.len())));
    }
    message.copy_from_slice(came);
    Ok(())
}

/// The message must be the very one that was sent.
///
/// # Errors
/// When it is another, or damaged.
pub fn check_echo(sent: &[u8], echo: &[u8]) -> Result<(), Failure> {
    match sent.iter().zip(echo).position(|(a, b)| a != b) {
        None => Ok(()),
        Some(at) if at < NUMBER_BYTES => {
            Err(Failure::Failed(format!("answer {echo:?} to {sent:?}", echo = &echo[..8], sent = &sent[..8])))
        }
        Some(at) => Err(Failure::Failed(format!("damaged: byte {at} is {}, not {}", echo[at], sent[at]))),
    }
}

/// The end that measures. Gives the round trips, ns, and stops the other end.
///
/// # Errors
/// When an answer is wrong or does not come.
pub fn ping(link: &mut impl Link, cell: &Cell) -> Result<Vec<u64>, Failure> {
    let mut message = vec![0; cell.bytes];
    let mut echo = vec![0; cell.bytes];
    let mut round_trips = Vec::with_capacity(cell.messages);
    let began = Instant::now();
    let mut is_warm = cell.warm_up == 0;
    for number in 0..(cell.warm_up + cell.messages) as u64 {
        fill(&mut message, number);
        cell.pause.take();
        let sent = monotonic_ns();
        link.send(&message)?;
        link.receive(&mut echo)?;
        let back = monotonic_ns();
        check_echo(&message, &echo)?;
        if is_warm {
            round_trips.push(back.saturating_sub(sent));
        }
        let spent = began.elapsed();
        is_warm |= number + 1 >= cell.warm_up as u64 || spent > cell.cap / 4;
        if spent > cell.cap && round_trips.len() >= SAMPLES_MIN.min(cell.messages) {
            break;
        }
    }
    fill(&mut message, STOP);
    link.send(&message)?;
    Ok(round_trips)
}

/// The end that echoes, until it is told to stop. Checks that no message is missing, doubled or out of order.
///
/// # Errors
/// When one is, or the link fails.
pub fn pong(link: &mut impl Link, cell: &Cell) -> Result<(), Failure> {
    let mut message = vec![0; cell.bytes];
    for expected in 0.. {
        link.receive(&mut message)?;
        let mut number = [0; NUMBER_BYTES];
        number.copy_from_slice(&message[..NUMBER_BYTES]);
        match u64::from_le_bytes(number) {
            STOP => break,
            number if number == expected => link.send(&message)?,
            number => return Err(Failure::Failed(format!("message {number} came when {expected} was due"))),
        }
    }
    Ok(())
}

/// Times a link between two processes. `make` is called in each of them, to open its end; it may meet the other at the
/// gate, each end as often as the other. Gives what one way takes, µs.
///
/// # Errors
/// What either end failed with, the one that echoes first.
pub fn time_two_processes<L: Link>(
    cell: &Cell,
    make: impl Fn(End, &mut Meetings) -> Result<L, Failure>,
) -> Result<Vec<f64>, Failure> {
    let turn = Shared::<PingPongTurn>::new()?;
    let open = |end| {
        let mut meetings = Meetings { gate: &turn.gate, met: 0 };
        let link = make(end, &mut meetings)?;
        settle(end, cell.placement, cell.scheduling)?;
        meetings.meet()?;
        Ok::<L, Failure>(link)
    };
    let mut echo = Child::start(|| pong(&mut open(End::Pong)?, cell))?;
    let mut measure = Child::start(|| {
        let mut link = open(End::Ping)?;
        std::thread::sleep(HEAD_START);
        turn.record(&ping(&mut link, cell)?);
        Ok(())
    })?;
    let deadline = Instant::now() + cell.cap + GRACE;
    while !echo.has_ended()? && !measure.has_ended()? && Instant::now() < deadline && !interrupted() {
        std::thread::sleep(Duration::from_millis(10));
    }
    // An end that fails leaves the other waiting for ever: what the first one says counts.
    let (first, second) = if echo.has_ended()? { (echo, measure) } else { (measure, echo) };
    first.finish(deadline)?;
    second.finish(deadline.min(Instant::now() + SECOND_ENDS))?;
    Ok(turn.samples.all())
}

/// The meetings of the two ends while they open a link.
pub struct Meetings<'a> {
    gate: &'a Gate,
    met: u32,
}

impl Meetings<'_> {
    /// Waits until the other end has come this far, too.
    ///
    /// # Errors
    /// When it does not come.
    pub fn meet(&mut self) -> Result<(), Failure> {
        self.met += 1;
        self.gate.meet(2 * self.met)
    }
}

/// Times a link between two threads of one process. Gives what one way takes, µs.
///
/// # Errors
/// What either end failed with.
pub fn time_two_threads<L: Link + Send>(cell: &Cell, make: impl Fn() -> [L; 2]) -> Result<Vec<f64>, Failure> {
    let turn = Shared::<PingPongTurn>::new()?;
    let open = |end| {
        settle(end, cell.placement, cell.scheduling)?;
        turn.gate.meet(2)
    };
    let process = Child::start(|| {
        let [mut near, mut far] = make();
        std::thread::scope(|scope| {
            let echo = scope.spawn(|| open(End::Pong).and_then(|()| pong(&mut far, cell)));
            open(End::Ping)?;
            std::thread::sleep(HEAD_START);
            turn.record(&ping(&mut near, cell)?);
            echo.join().unwrap_or_else(|_| Err(Failure::Failed("panicked, see above".into())))
        })
    })?;
    process.finish(Instant::now() + cell.cap + GRACE)?;
    Ok(turn.samples.all())
}

#[cfg(test)]
mod tests {
    use super::super::OrFail;
    use super::*;
    use std::sync::mpsc::{Receiver, Sender, channel};

    /// What goes wrong on the way of a message to the far end.
    #[derive(Clone, Copy)]
    enum Mishap {
        None,
        Damage,
        Loss,
        Repetition,
        /// The far end answers with the message before.
        Stale,
    }

    struct Queue {
        out: Sender<Vec<u8>>,
        back: Receiver<Vec<u8>>,
        /// Before this message, counted from 0.
        mishap: (Mishap, u64),
        sent: u64,
        last: Vec<u8>,
    }

    impl Link for Queue {
        fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
            let mut message = message.to_vec();
            let mishap = if self.sent == self.mishap.1 { self.mishap.0 } else { Mishap::None };
            self.sent += 1;
            match mishap {
                Mishap::None => {}
                Mishap::Damage => message[40] ^= 1,
                Mishap::Loss => return Ok(()),
                Mishap::Repetition => drop(self.out.send(message.clone())),
                Mishap::Stale => message = self.last.clone(),
            }
            self.last = message.clone();
            self.out.send(message).or_fail("send")
        }

        fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
            // Longer than a busy computer halts a thread for; waited for in vain where a message is lost.
            let patience = Duration::from_secs(1);
            let received = self.back.recv_timeout(patience).or_fail("receive")?;
            message.copy_from_slice(&received);
            Ok(())
        }
    }

    /// What both ends say when the near or the far end's message 5 meets a mishap.
    fn play(near: Mishap, far: Mishap) -> [Result<(), Failure>; 2] {
        let (placement, scheduling) = (Placement::TwoCores, Scheduling::Normal);
        let cap = Duration::from_secs(5);
        let cell = Cell { bytes: 64, messages: 20, warm_up: 2, placement, scheduling, pause: Pause::None, cap };
        let ((out, far_back), (far_out, back)) = (channel(), channel());
        let mut near = Queue { out, back, mishap: (near, 5), sent: 0, last: Vec::new() };
        let mut far = Queue { out: far_out, back: far_back, mishap: (far, 5), sent: 0, last: Vec::new() };
        std::thread::scope(|scope| {
            let echo = scope.spawn(|| pong(&mut far, &cell));
            let round_trips = ping(&mut near, &cell);
            [round_trips.map(|round_trips| assert_eq!(round_trips.len(), 20)), echo.join().unwrap()]
        })
    }

    #[test]
    fn whatever_happens_to_a_message_is_seen() {
        assert_eq!(play(Mishap::None, Mishap::None), [Ok(()), Ok(())]);
        for (mishap, near_says, far_says) in [
            ((Mishap::Damage, Mishap::None), "damaged: byte 40 is 4, not 5", ""),
            ((Mishap::None, Mishap::Damage), "damaged: byte 40 is 4, not 5", ""),
            ((Mishap::Loss, Mishap::None), "receive", ""),
            ((Mishap::None, Mishap::Stale), "answer [4,", ""),
            ((Mishap::Repetition, Mishap::None), "", "message 5 came when 6 was due"),
            ((Mishap::Stale, Mishap::None), "", "message 4 came when 5 was due"),
        ] {
            let [near, far] = play(mishap.0, mishap.1);
            for (end, says) in [(near, near_says), (far, far_says)] {
                assert!(says.is_empty() || end.as_ref().unwrap_err().to_string().contains(says), "{end:?}, not {says}");
            }
        }
    }
}
