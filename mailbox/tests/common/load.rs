//! Senders that do all that a sender can, at random, and receivers that wait in all ways there are.

use super::board::{BODY_BYTES_MIN, Board, KEYS, MAILBOXES, Mark, PRIORITIES, Seat, key};
use super::random::Random;
use rohrpost_mailbox::{
    Interest, Label, Options, OverflowPolicy, Participant, Receiver, SendError, Sender, Shape, Type, Waiting, Watches,
    wait_any,
};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::time::Duration;

/// Sends to the first mailboxes of [`MAILBOXES`] at random: priorities, sizes, copies and loans, loans never sent,
/// pauses.
pub(crate) struct Talker {
    board: Board,
    seat: &'static Seat,
    run: u32,
    full: OverflowPolicy,
    random: Random,
    senders: Vec<Sender>,
    numbers: [[u32; KEYS]; MAILBOXES.len()],
    buffer: Vec<u8>,
    weather: Weather,
}

/// What happens around a sender.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Weather {
    Calm,
    /// Receivers are killed. A mailbox may be gone between two owners of different shapes. And a state keeps its
    /// priority: what was in a dead receiver's hand cannot be replaced, so a more important one of the same state would
    /// pass it.
    Stormy,
}

impl Talker {
    pub(crate) fn new(
        board: Board,
        seat: usize,
        run: u32,
        full: OverflowPolicy,
        senders: Vec<Sender>,
        weather: Weather,
    ) -> Self {
        let (random, seat) = (Random::new(u64::from(run)), board.seat(seat));
        Self { board, seat, run, full, random, senders, numbers: Default::default(), buffer: Vec::new(), weather }
    }

    /// Until the board says that it ends.
    pub(crate) fn talk(&mut self) {
        self.seat.set_ready();
        while !self.board.is_ended() {
            self.once();
            self.board.hold_if_asked(self.seat);
            if self.random.one_in(30) {
                std::thread::sleep(Duration::from_micros(self.random.below(300)));
            }
        }
    }

    /// One package, or one loan that is not sent.
    pub(crate) fn once(&mut self) {
        let mailbox = self.random.below(self.senders.len() as u64) as usize;
        let [class, state] = [PRIORITIES.len(), KEYS].map(|end| self.random.below(end as u64) as u8);
        let state = if self.weather == Weather::Stormy && self.full == OverflowPolicy::Latest { class } else { state };
        let of = key(self.full, class, state);
        let number = self.numbers[mailbox][usize::from(of)] + 1;
        let mark = Mark { run: self.run, number, mailbox: mailbox as u8, key: of, class };
        let most = self.senders[mailbox].body_bytes_max();
        // Mostly small, sometimes as large as it may be.
        let most = if self.random.one_in(8) { most } else { most.min(200) };
        let len = BODY_BYTES_MIN + self.random.below((most - BODY_BYTES_MIN + 1) as u64) as usize;
        let label = Label {
            priority: PRIORITIES[usize::from(class)],
            id: state.into(),
            kind: Type::command(16),
            ..Label::default()
        };
        let way = self.random.below(16);
        let nap = Duration::from_micros(if self.random.one_in(20) { self.random.below(200) } else { 0 });
        let (sender, buffer, random) = (&mut self.senders[mailbox], &mut self.buffer, &mut self.random);
        let sent = self.seat.operate(|| match way {
            0 => sender.loan(label.priority).map(|mut loan| loan.body().fill(0)).map(|()| false),
            1..8 => {
                let mut loan = sender.loan(label.priority)?;
                pause(nap);
                // The mailbox may have been replaced by one with smaller slots since we asked.
                let len = len.min(loan.body().len());
                mark.write(&mut loan.body()[..len]);
                pause(nap);
                loan.send(&label, len).map(|()| true)
            }
            _ => {
                buffer.resize(len, 0);
                mark.write(buffer);
                let (first, second) = buffer.split_at(random.below(len as u64) as usize);
                sender.send(&label, &[first, second]).map(|()| true)
            }
        });
        self.note(&mark, sent);
    }

    fn note(&mut self, mark: &Mark, sent: Result<bool, SendError>) {
        match sent {
            Ok(true) => {
                self.numbers[usize::from(mark.mailbox)][usize::from(mark.key)] = mark.number;
                self.board.accepted(mark);
            }
            Ok(false) => {}
            Err(SendError::Full(_)) => {
                self.board.refused(mark);
                std::thread::yield_now();
            }
            Err(SendError::NoMailbox(_) | SendError::TooLarge { .. }) if self.weather == Weather::Stormy => {
                std::thread::yield_now();
            }
            Err(error) => panic!("{error}"),
        }
    }
}

fn pause(time: Duration) {
    if !time.is_zero() {
        std::thread::sleep(time);
    }
}

/// How a receiver waits.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum WaitMode {
    /// Asleep, until it is woken.
    Asleep,
    /// Awake for a moment, then asleep.
    Spinning,
    /// Asleep, with timeouts.
    Timed,
    /// Asking again and again.
    Polling,
    /// Asleep in `poll`, on descriptors too.
    Watching,
}

impl WaitMode {
    pub(crate) const ALL: [Self; 5] = [Self::Asleep, Self::Spinning, Self::Timed, Self::Polling, Self::Watching];
}

/// Receives from several mailboxes.
pub(crate) struct Listener {
    board: Board,
    receivers: Vec<Receiver>,
    /// Packages so far.
    pub(crate) taken: u64,
    way: WaitMode,
    random: Random,
    watches: Option<(Watches, UnixStream)>,
}

impl Listener {
    pub(crate) fn new(board: Board, me: &Arc<Participant>, shapes: &[Shape], way: WaitMode) -> Self {
        let receivers = MAILBOXES.iter().zip(shapes).map(|(name, shape)| me.receiver(*name, *shape).unwrap()).collect();
        let watches = (way == WaitMode::Watching).then(|| {
            let mut watches = Watches::new(me).unwrap();
            let (far, near) = UnixStream::pair().unwrap();
            watches.add(&near, Interest::Read).unwrap();
            (watches, far)
        });
        Self { board, receivers, taken: 0, way, random: Random::new(me.incarnation().into()), watches }
    }

    /// Waits, then takes some of what is there.
    pub(crate) fn once(&mut self) {
        self.wait();
        for receiver in &mut self.receivers {
            for _ in 0..self.random.below(40) {
                let Some(package) = receiver.try_receive() else { break };
                self.board.received(&package);
                self.taken += 1;
                let again = package.head().options.has(Options::REDELIVERED);
                if self.random.one_in(if again { 2 } else { 100 }) {
                    // With a package in hand, which may be its end; the mailbox fills.
                    std::thread::sleep(Duration::from_micros(self.random.below(if again { 5_000 } else { 500 })));
                }
            }
        }
    }

    /// Also until the board says that it ends, if somebody rings then.
    fn wait(&mut self) {
        let ended = || self.board.is_ended();
        let mut all: Vec<&mut Receiver> = self.receivers.iter_mut().collect();
        let mut some_us = |end| Duration::from_micros(self.random.below(end));
        match (self.way, &mut self.watches) {
            (WaitMode::Polling, _) => std::thread::yield_now(),
            (WaitMode::Timed, _) => drop(wait_any(&mut all, some_us(3000), ended)),
            (WaitMode::Spinning, _) => drop(wait_any(&mut all, Waiting { spin: some_us(60), deadline: None }, ended)),
            (WaitMode::Watching, Some((watches, _))) => drop(watches.wait_any(&mut all, None, ended)),
            (WaitMode::Watching | WaitMode::Asleep, _) => drop(wait_any(&mut all, None, ended)),
        }
    }

    /// All that is there now.
    pub(crate) fn drain(&mut self) {
        for receiver in &mut self.receivers {
            while let Some(package) = receiver.try_receive() {
                self.board.received(&package);
            }
        }
    }
}
