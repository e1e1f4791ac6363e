//! Waiting for mailboxes and streams: how long, and whether awake for a moment before asleep.

use crate::name::Priority;
use crate::node::participant::Participant;
use crate::receiver::{Package, Receiver};
use crate::step::step;
use crate::wake::doorbell::Slept;
use crate::wake::watch::Watches;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Reading the clock takes as long as so many looks at a mailbox.
const LOOKS_A_CLOCK: usize = 16;

/// A receiver that was rung on its way to sleep looks for so long before it goes that way again: its sender is about as
/// quick as it is, and would pay for a wake-up with each package, it for a sleep. The first real sleep ends it.
/// Measured with packages of 4 KiB sent as fast as they go, against a ring with a futex (`rohrpost-bench local --only
/// rate-blocking`): 0.8 times as many without, 2.5 times as many with it.
const EAGER: Duration = Duration::from_micros(2);

/// What [`wait_any`] waits for: mailboxes ([`Receiver`]) and streams ([`StreamReader`](crate::StreamReader)). Both at
/// once are `&mut dyn Source`.
pub trait Source: steps::Steps {}

impl<S: steps::Steps> Source for S {}

/// Nobody outside adds a kind of source.
pub(crate) mod steps {
    use super::{Arc, Participant};

    /// The steps of waiting, in their order.
    pub trait Steps {
        /// The participant with the bell that wakes.
        fn participant(&self) -> &Arc<Participant>;
        /// Works off what keeps it awake for nothing.
        fn settle(&mut self);
        /// Whether something may be there.
        fn may_have(&self) -> bool;
        /// Has the line that is looked at come here, and stay.
        fn expect(&self);
        /// Says that it is about to sleep.
        fn drowsy(&self);
        /// Says that it does not sleep.
        fn awake(&self);
        /// Whether the last thing came on the way to sleep.
        fn is_eager(&self) -> bool;
        /// Says so.
        fn set_eager(&mut self, eager: bool);
    }
}

impl steps::Steps for Receiver {
    fn participant(&self) -> &Arc<Participant> {
        self.participant()
    }

    fn settle(&mut self) {
        self.settle();
    }

    fn may_have(&self) -> bool {
        self.may_have()
    }

    fn expect(&self) {
        self.expect();
    }

    fn drowsy(&self) {
        self.drowsy();
    }

    fn awake(&self) {
        self.awake();
    }

    fn is_eager(&self) -> bool {
        self.eager
    }

    fn set_eager(&mut self, eager: bool) {
        self.eager = eager;
    }
}

/// How to wait. By default: asleep, for ever (after two microseconds awake when the last package came on the way to
/// sleep). A [`Duration`] is a timeout from now on, an `Option<Instant>` a deadline.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Waiting {
    /// Before sleeping, look again and again for so long. A sender that finds its receiver awake makes no system call,
    /// and the receiver has the package sooner by the time that waking takes (some microseconds, more from a deep sleep
    /// of the processor). It costs a whole processor meanwhile, so give it some ten microseconds, where a package is
    /// mostly about to come; with one processor, or more threads that spin than processors, it only keeps others from
    /// working. A real-time thread (SCHED_FIFO) must not spin for long: it keeps everything below it out, and the
    /// kernel, which gives ordinary threads their share by its fair server (or by throttling, before Linux 6.12), then
    /// stops it when it matters.
    pub spin: Duration,
    /// When to give up; none: never.
    pub deadline: Option<Instant>,
}

impl From<Duration> for Waiting {
    /// A time too long to be told is for ever.
    fn from(timeout: Duration) -> Self {
        Self { deadline: Instant::now().checked_add(timeout), ..Self::default() }
    }
}

impl From<Option<Instant>> for Waiting {
    fn from(deadline: Option<Instant>) -> Self {
        Self { deadline, ..Self::default() }
    }
}

impl Waiting {
    /// Time left to sleep; none: for ever.
    fn left(&self) -> Option<Duration> {
        self.deadline.map(|deadline| deadline.saturating_duration_since(Instant::now()))
    }

    pub(crate) fn is_over(&self) -> bool {
        self.left() == Some(Duration::ZERO)
    }

    /// Looks until there is something, but not for longer than it may; says whether there is.
    fn spin_until(&self, mailboxes: usize, found: impl Fn() -> bool) -> bool {
        if self.spin.is_zero() {
            return false;
        }
        let spin = self.left().map_or(self.spin, |left| left.min(self.spin));
        let began = Instant::now();
        while began.elapsed() < spin {
            for _ in 0..LOOKS_A_CLOCK.div_ceil(mailboxes.max(1)) {
                if found() {
                    return true;
                }
            }
            std::hint::spin_loop();
        }
        false
    }
}

/// Waits until one of these mailboxes has a package, one of these streams a record, `other` says that there is
/// something else to do, or the deadline has passed. May return early for no reason. Says how long it slept, that is,
/// left the processor to others. All must be of one participant: its bell wakes.
///
/// A thread that makes `other` true from outside calls [`Participant::ring`](crate::Participant::ring) afterwards.
///
/// Without a mailbox there is no bell to sleep on: then this returns at once, whatever `waiting` and `other` say, and a
/// loop around it would spin. A thread without a mailbox waits by other means.
///
/// # Panics
/// When the mailboxes are of different participants: their bells are different words.
pub fn wait_any<S: Source + ?Sized>(
    sources: &mut [&mut S],
    waiting: impl Into<Waiting>,
    other: impl Fn() -> bool,
) -> Duration {
    let mut slept = Duration::ZERO;
    wait(sources, None, waiting.into(), other, |sleep| slept = timed(sleep));
    slept
}

/// Waits until this mailbox has a package that is more important than `priority`, `other` says that there is something
/// else to do, or the deadline has passed. Less important ones may wait there all the while: for a receiver that cannot
/// use them yet. May return early for no reason. Says how long it slept.
///
/// What is not above `priority` rings no bell meanwhile: its sender makes no system call, and this thread sleeps on.
pub fn wait_above(
    receiver: &mut Receiver,
    priority: Priority,
    waiting: impl Into<Waiting>,
    other: impl Fn() -> bool,
) -> Duration {
    let (waiting, mut slept) = (waiting.into(), Duration::ZERO);
    let participant = receiver.participant().clone();
    let entry = participant.entry();
    loop {
        // In this order, as in `settled`: whatever is published after the look rings, and so changes what was seen.
        let seen = entry.bell().seen();
        receiver.drowsy_above(priority);
        receiver.settle();
        if other() || receiver.has_above(priority) || waiting.is_over() {
            break;
        }
        if !receiver.has_unseen() {
            slept += timed(|| _ = crate::wake::doorbell::sleep(&entry.bell, seen, waiting.left()));
        }
    }
    receiver.awake();
    slept
}

impl Participant {
    /// Waits until another thread [rings](Participant::ring) and `other` says that there is something to do, or the
    /// deadline has passed: for a thread that waits for no mailbox and no stream. May return early for no reason. Says
    /// how long it slept.
    ///
    /// ```
    /// use rohrpost_mailbox::{Name, Node, Participant};
    /// use std::sync::atomic::{AtomicBool, Ordering};
    /// use std::time::Duration;
    /// # let dir = tempfile::tempdir()?;
    /// let node = Node::create(&dir.path().join("node"), 0o700)?;
    /// let participant = Participant::join(&node, Name::NONE)?;
    /// let is_due = AtomicBool::new(false);
    /// std::thread::scope(|scope| {
    ///     scope.spawn(|| {
    ///         is_due.store(true, Ordering::Release);
    ///         participant.ring();
    ///     });
    ///     while !is_due.load(Ordering::Acquire) {
    ///         participant.wait(Duration::from_secs(60), || is_due.load(Ordering::Acquire));
    ///     }
    /// });
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn wait(&self, waiting: impl Into<Waiting>, other: impl Fn() -> bool) -> Duration {
        let waiting = waiting.into();
        // Before the look: a thread that makes `other` true rings afterwards, and so changes this value.
        let seen = self.entry().bell().seen();
        if other() || waiting.is_over() {
            return Duration::ZERO;
        }
        timed(|| _ = crate::wake::doorbell::sleep(&self.entry().bell, seen, waiting.left()))
    }
}

impl Receiver {
    /// The most important package; sleeps until there is one.
    pub fn receive(&mut self) -> Package<'_> {
        loop {
            if let Some(in_hand) = self.next() {
                return self.hand_out(in_hand);
            }
            self.wait(Waiting::default());
        }
    }

    /// The most important package; waits until there is one, at most for a timeout ([`Duration`](std::time::Duration))
    /// or as a [`Waiting`] says.
    pub fn receive_timeout(&mut self, waiting: impl Into<Waiting>) -> Option<Package<'_>> {
        let waiting = waiting.into();
        loop {
            if let Some(in_hand) = self.next() {
                return Some(self.hand_out(in_hand));
            }
            if waiting.is_over() {
                return None;
            }
            self.wait(waiting);
        }
    }

    fn wait(&mut self, waiting: Waiting) {
        wait(&mut [self], None, waiting, || false, |sleep| sleep());
    }
}

impl Watches {
    /// Sleeps as [`wait_any`](crate::wait_any) does, also until one of the descriptors is ready;
    /// [`Watches::next_ready`] tells which. They are looked at before this returns, also when it did not sleep.
    ///
    /// # Panics
    /// When a mailbox is not of the participant that watches.
    pub fn wait_any<S: Source + ?Sized>(
        &mut self,
        sources: &mut [&mut S],
        waiting: impl Into<Waiting>,
        other: impl Fn() -> bool,
    ) -> Duration {
        let mut slept = Duration::ZERO;
        wait(sources, Some(self), waiting.into(), other, |sleep| slept = timed(sleep));
        slept
    }
}

/// How long this takes.
fn timed(sleep: impl FnOnce()) -> Duration {
    let began = Instant::now();
    sleep();
    began.elapsed()
}

/// Waits. To sleep it calls `asleep`, which calls what it is given; a caller that wants to know how long that was reads
/// the clock.
pub(crate) fn wait<S: Source + ?Sized>(
    sources: &mut [&mut S],
    watches: Option<&mut Watches>,
    waiting: Waiting,
    other: impl Fn() -> bool,
    asleep: impl FnOnce(&mut dyn FnMut()),
) {
    sources.iter_mut().for_each(|source| source.settle());
    let eager = sources.iter().any(|source| source.is_eager());
    let waiting = Waiting { spin: if eager { waiting.spin.max(EAGER) } else { waiting.spin }, ..waiting };
    let came = settled(sources, watches, waiting, other, asleep);
    // Spun for nothing, or slept: the next package is not about to come.
    let eager = came == Came::TooSoonToSleep || eager && came == Came::WhileAwake;
    sources.iter_mut().for_each(|source| source.set_eager(eager));
}

/// How waiting ended.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Came {
    WhileAwake,
    /// When all had been made ready for sleep.
    TooSoonToSleep,
    /// Asleep, or it is not known.
    Later,
}

fn settled<S: Source + ?Sized>(
    sources: &[&mut S],
    watches: Option<&mut Watches>,
    waiting: Waiting,
    other: impl Fn() -> bool,
    asleep: impl FnOnce(&mut dyn FnMut()),
) -> Came {
    let of_watches = watches.as_ref().map(|watches| watches.participant().clone());
    let of_first = sources.first().map(|source| source.participant());
    let Some(participant) = of_watches.as_ref().or(of_first) else { return Came::Later };
    assert!(sources.iter().all(|receiver| Arc::ptr_eq(receiver.participant(), participant)));
    let watches = watches.filter(|watches| !watches.is_empty());
    let found = || other() || sources.iter().any(|source| source.may_have());
    let polled = || {
        sources.iter().for_each(|source| source.expect());
        found()
    };
    // Until here, and while it spins, nobody needs to ring.
    if waiting.spin_until(sources.len(), polled) {
        watches.into_iter().for_each(Watches::look);
        return Came::WhileAwake;
    }
    let entry = participant.entry();
    // Before `drowsy`: whatever is published after the looks below rings, and so changes this value.
    let seen = entry.bell().seen();
    sources.iter().for_each(|source| source.drowsy());
    step!("wait: drowsy");
    let idle = !found() && !waiting.is_over();
    let is_there = || sources.iter().any(|source| source.may_have());
    let mut came = if !idle && is_there() { Came::TooSoonToSleep } else { Came::Later };
    match watches {
        Some(watches) if idle => asleep(&mut || watches.sleep(entry.bell(), seen, waiting.left())),
        Some(watches) => watches.look(),
        None if idle => asleep(&mut || {
            if crate::wake::doorbell::sleep(&entry.bell, seen, waiting.left()) == Slept::NotAtAll {
                came = Came::TooSoonToSleep;
            }
        }),
        None => {}
    }
    sources.iter().for_each(|source| source.awake());
    came
}
