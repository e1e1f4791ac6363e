//! Many sessions in one process: one thread with one epoll, like the TCP router at the other end.
//!
//! Each sends to the session that is half of the crowd further, all together so many packages a second, evenly. The
//! delay of a package counts from when it was due: a delay of this process is part of the figure.

use super::guest::{Guest, House};
use super::pace::{Pace, ticks};
use super::stalled::Stalled;
use super::systems::{Systems, guest};
use super::tally::Tally;
use nix::sys::epoll::{Epoll, EpollCreateFlags, EpollEvent, EpollFlags, EpollTimeout};
use nix::sys::resource::{Resource, getrlimit, setrlimit};
use nix::sys::timerfd::TimerFd;
use rohrpost_bench_local::harness::{Child, End, Failure, OrFail, Placement, Scheduling, Shared, look_for, settle};
use rohrpost_mailbox::monotonic_ns;
use std::time::{Duration, Instant};

/// Each session does its periodic work this often.
const POLLED_EACH_NS: u64 = 50_000_000;
/// Sessions that connect at the same time.
const JOINING: usize = 64;
/// A thousand handshakes take a second or two, on a busy computer longer.
const UP_WITHIN: Duration = Duration::from_secs(60);
/// Packages in flight arrive within this, or within one of the next spans: a computer may stall for that long.
const DRAIN_NS: u64 = 500_000_000;
const DRAINS_MAX: usize = 10;
const EVENTS: usize = 256;
const PIECE_BYTES: usize = 64 * 1024;
/// Descriptors besides those of sessions.
const DESCRIPTORS_BESIDE: u64 = 64;
const TIMER: u64 = u64::MAX;
/// Samples of a turn, at most.
const SAMPLES: u64 = 90_000;

/// What a crowd does.
#[derive(Clone, Copy, Debug)]
pub struct Habits {
    /// Sessions.
    pub guests: u16,
    /// Packages that all send together, a second; 0: they are idle.
    pub per_s: u64,
    /// Of each body.
    pub bytes: usize,
    /// One more session takes packages and reads none of them.
    pub one_stalls: bool,
    /// Traffic before what counts.
    pub warm_up: Duration,
    /// What counts.
    pub counted: Duration,
}

/// A crowd of sessions; ended when this is dropped.
pub struct Crowd {
    /// None once it has ended.
    child: Option<Child>,
    tally: Shared<Tally>,
    habits: Habits,
}

impl Crowd {
    /// Starts it, and waits until all sessions are registered.
    ///
    /// # Errors
    /// What it failed with.
    pub fn gather(systems: &Systems, habits: Habits) -> Result<Self, Failure> {
        let tally = Shared::<Tally>::new()?;
        let child = Child::start(|| {
            settle(End::Ping, Placement::TwoCores, Scheduling::Fifo)?;
            Work::new(systems, &tally, habits)?.run()
        })?;
        let mut crowd = Self { child: Some(child), tally, habits };
        crowd.await_until(UP_WITHIN, |tally| tally.up.get() >= u64::from(habits.guests))?;
        Ok(crowd)
    }

    /// Waits until measuring begins.
    ///
    /// # Errors
    /// Its failure meanwhile.
    pub fn await_begin(&mut self) -> Result<(), Failure> {
        self.await_until(self.habits.warm_up + UP_WITHIN, |tally| tally.phase.get() >= 1)
    }

    /// Waits until measuring is over.
    ///
    /// # Errors
    /// Its failure meanwhile.
    pub fn await_end(&mut self) -> Result<(), Failure> {
        self.await_until(self.habits.counted + UP_WITHIN, |tally| tally.phase.get() >= 2)
    }

    /// Waits until packages in flight have arrived, and the crowd has ended.
    ///
    /// # Errors
    /// Its failure.
    pub fn finish(self) -> Result<Shared<Tally>, Failure> {
        self.child.map_or(Ok(()), |child| child.finish(Instant::now() + UP_WITHIN))?;
        Ok(self.tally)
    }

    /// Whether it still runs; false after it has done all.
    ///
    /// # Errors
    /// Its failure.
    pub fn is_there(&mut self) -> Result<bool, Failure> {
        match self.child.take_if(|child| child.has_ended() != Ok(false)) {
            Some(ended) => ended.finish(Instant::now()).map(|()| false),
            None => Ok(self.child.is_some()),
        }
    }

    /// Its counts.
    pub fn tally(&self) -> &Tally {
        &self.tally
    }

    fn await_until(&mut self, patience: Duration, is_so: impl Fn(&Tally) -> bool) -> Result<(), Failure> {
        let look = || Ok((is_so(&self.tally) || !self.is_there()?).then_some(()));
        let so = look_for(patience, Duration::from_millis(5), look)?;
        let up = self.tally.up.get();
        so.ok_or_else(|| Failure::Failed(format!("{up} of {} sessions are there", self.habits.guests)))
    }
}

/// What the crowd's process has.
struct Work<'a> {
    house: House<'a>,
    guests: Vec<Guest>,
    stalled: Option<Stalled>,
    habits: Habits,
    timer: TimerFd,
    piece: Vec<u8>,
    body: Vec<u8>,
    polls: Pace,
    packages: Pace,
}

impl<'a> Work<'a> {
    fn new(systems: &Systems, tally: &'a Tally, habits: Habits) -> Result<Self, Failure> {
        raise_descriptors(u64::from(habits.guests) + DESCRIPTORS_BESIDE);
        let epoll = Epoll::new(EpollCreateFlags::EPOLL_CLOEXEC).or_fail("epoll")?;
        let timer = ticks().or_fail("timer")?;
        let watched = epoll.add(&timer, EpollEvent::new(EpollFlags::EPOLLIN, TIMER));
        watched.or_fail("epoll")?;
        let (address, common, seal) = (systems.address(), systems.common(), systems.seal()?);
        let counted = habits.per_s * habits.counted.as_millis() as u64 / 1000;
        let sampled_each = counted.div_ceil(SAMPLES).max(1);
        let house = House { address, common, seal, epoll, tally, counted_ns: (u64::MAX, u64::MAX), sampled_each };
        let all = u64::from(habits.guests).max(1);
        Ok(Self {
            house,
            guests: Vec::new(),
            stalled: None,
            habits,
            timer,
            piece: vec![0; PIECE_BYTES],
            body: vec![0; habits.bytes],
            polls: Pace::new(monotonic_ns(), POLLED_EACH_NS / all),
            packages: Pace::new(u64::MAX, 0),
        })
    }

    fn run(mut self) -> Result<(), Failure> {
        self.gather()?;
        if self.habits.per_s == 0 {
            return self.turn(u64::MAX);
        }
        let began_ns = monotonic_ns();
        let counted_ns = began_ns + self.habits.warm_up.as_nanos() as u64;
        let over_ns = counted_ns + self.habits.counted.as_nanos() as u64;
        self.house.counted_ns = (counted_ns, over_ns);
        self.packages = Pace::new(began_ns, 1_000_000_000 / self.habits.per_s);
        self.turn(counted_ns)?;
        self.house.tally.phase.set(1);
        self.turn(over_ns)?;
        self.house.tally.phase.set(2);
        self.packages = Pace::new(u64::MAX, 0);
        for _ in 0..DRAINS_MAX {
            self.turn(monotonic_ns() + DRAIN_NS)?;
            if self.house.tally.came.get() >= self.house.tally.sent.get() {
                break;
            }
        }
        self.stalled.map_or(Ok(()), Stalled::check)
    }

    /// Until all sessions are registered, a few at a time.
    fn gather(&mut self) -> Result<(), Failure> {
        let all = self.habits.guests + u16::from(self.habits.one_stalls);
        for index in 0..all {
            while self.guests.len() >= JOINING + self.house.tally.up.get() as usize {
                self.wait()?;
            }
            let now_ns = monotonic_ns();
            let mut guest = Guest::new(index, self.house.common, now_ns);
            guest.act(&self.house, now_ns)?;
            self.guests.push(guest);
        }
        while self.house.tally.up.get() < all.into() {
            self.wait()?;
        }
        if self.habits.one_stalls {
            let last = self.guests.pop().and_then(|last| last.into_stream(&self.house));
            let stream = last.ok_or_else(|| Failure::Failed("the stalling session has no connection".into()))?;
            self.stalled = Some(Stalled::new(stream, monotonic_ns())?);
        }
        Ok(())
    }

    /// Sends and receives until a time.
    fn turn(&mut self, until_ns: u64) -> Result<(), Failure> {
        while monotonic_ns() < until_ns {
            self.wait()?;
        }
        Ok(())
    }

    /// Sleeps until something arrives, or the next tick; then does what is due.
    fn wait(&mut self) -> Result<(), Failure> {
        let mut events = [EpollEvent::empty(); EVENTS];
        // Interrupted by a signal, it checks again.
        let count = self.house.epoll.wait(&mut events, EpollTimeout::NONE).unwrap_or(0);
        for event in &events[..count] {
            if event.data() == TIMER {
                self.timer.wait().or_fail("timer")?;
            } else if let Some(guest) = self.guests.get_mut(event.data() as usize) {
                guest.happened(&self.house, event.events(), &mut self.piece)?;
            }
        }
        self.send()?;
        let now_ns = monotonic_ns();
        while let Some((number, _)) = self.polls.next_due(now_ns) {
            let at = number as usize % usize::from(self.habits.guests);
            if let Some(guest) = self.guests.get_mut(at) {
                guest.act(&self.house, now_ns)?;
            }
        }
        Ok(())
    }

    /// Sends what is due: each guest in turn to the one that is half of the crowd further, and some of them to the
    /// stalled session.
    fn send(&mut self) -> Result<(), Failure> {
        let all = self.guests.len();
        while let Some((number, due_ns)) = self.packages.next_due(monotonic_ns()) {
            let from = number as usize % all;
            let to = guest(((from + all / 2) % all) as u16);
            self.guests[from].send(&self.house, to, &mut self.body, due_ns)?;
        }
        let Some(stalled) = &mut self.stalled else { return Ok(()) };
        while let Some(number) = stalled.next_due(monotonic_ns())? {
            let from = number as usize % all;
            self.guests[from].send(&self.house, guest(self.habits.guests), stalled.body(), 0)?;
        }
        Ok(())
    }
}

/// Each session takes a descriptor. If the system does not grant so many, connecting fails.
fn raise_descriptors(wanted: u64) {
    if let Ok((soft, hard)) = getrlimit(Resource::RLIMIT_NOFILE)
        && soft < wanted
    {
        let _ = setrlimit(Resource::RLIMIT_NOFILE, wanted.min(hard), hard);
    }
}
