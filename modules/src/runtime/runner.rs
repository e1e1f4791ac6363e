//! The loop of a module's one thread.

use super::context::Context;
use super::endpoint::Endpoint;
use super::hosted::Hosted;
use super::incarnation::Incarnation;
use super::received::Received;
use super::refusals::Cause;
use super::stream::{self, FollowedStream, Step};
use super::subscribed::Origin;
use crate::common::DataHead;
use crate::journal::JournalEvent;
use crate::made::MadeModule;
use crate::output;
use rohrpost_mailbox::{
    Kind, ModuleState, OverflowPolicy, Ready, Receiver, Source, Waiting, Watches, monotonic_ns, wait_any,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Packages of one mailbox handled before the others' turn, and the time after which no further one is begun: neither a
/// flood nor slow handlers must keep ticks, renewals, other mailboxes and the end waiting.
const BURST: usize = 32;
const BURST_TIME: Duration = Duration::from_millis(2);
/// A loop that has not slept for so long is made to, for this short time: the kernel ends a real-time process that
/// works without pause (RLIMIT_RTTIME), and a flood, or a period too short for its work, is no reason to be ended.
const AWAKE_MAX: Duration = Duration::from_millis(250);
const PAUSE: Duration = Duration::from_micros(50);
/// What a module takes in that takes all at its end.
const LAST_MAX: Duration = Duration::from_secs(5);

/// A module that runs.
pub(crate) struct Running<M> {
    pub(crate) life: Incarnation<M>,
    pub(crate) endpoints: Vec<Endpoint<M>>,
    pub(crate) data: Receiver,
    pub(crate) context: Context,
    pub(crate) stop: Arc<AtomicBool>,
    pub(crate) turn_on: bool,
    /// Nobody else removes its mailboxes.
    pub(crate) by_hand: bool,
    /// See [`Waiting::spin`].
    pub(crate) spin: Duration,
    /// Empty; kept for its memory, so that going to sleep allocates nothing.
    pub(crate) sources: Vec<&'static mut (dyn Source + 'static)>,
}

impl<M: MadeModule> Running<M> {
    pub(super) fn turn_on_if_wanted(&mut self) {
        // It may have been told to end while it was being made.
        if self.turn_on && !self.stop.load(Ordering::Acquire) {
            // A failure is in the module's state and output.
            let _ = self.life.turn_on(&mut self.context);
        }
    }

    pub(super) fn go(&mut self) {
        let mut awake_since = Instant::now();
        while !self.stop.load(Ordering::Acquire) {
            let mut busy = self.commands();
            busy |= self.take_data();
            busy |= self.take_records(|_| true);
            self.periodic();
            self.context.journal.pass_on();
            output::drain();
            let slept = if busy { self.look() } else { self.sleep() };
            self.ready();
            if slept >= PAUSE {
                awake_since = Instant::now();
            } else if awake_since.elapsed() >= AWAKE_MAX {
                std::thread::sleep(PAUSE);
                awake_since = Instant::now();
            }
        }
    }

    /// A handler panicked; the process is about to end, and launch to start it again.
    pub(super) fn panicked(&mut self, text: &str) {
        self.life.panicked(text, &mut self.context);
        self.context.journal.end();
        output::flush();
    }

    fn commands(&mut self) -> bool {
        let mut any = false;
        for (index, endpoint) in self.endpoints.iter_mut().enumerate() {
            let Endpoint { command_server, offer, .. } = endpoint;
            let mut hosted = Hosted { index, offer, life: &mut self.life, context: &mut self.context };
            any |= burst(|| command_server.handle(&mut hosted));
        }
        any
    }

    /// Hands out what came to the data mailbox and to the module's own; while the module is off it is dropped.
    fn take_data(&mut self) -> bool {
        let mut any = take(&mut self.data, &mut self.life, &mut self.context);
        // Taken out meanwhile, since the module is given the context that they belong to.
        let mut own = std::mem::take(&mut self.context.own);
        for mailbox in &mut own {
            any |= take(mailbox, &mut self.life, &mut self.context);
        }
        own.append(&mut self.context.own);
        self.context.own = own;
        any
    }

    /// Hands out records of those streams that the module follows, while it is on.
    fn take_records(&mut self, of: impl Fn(&FollowedStream) -> bool) -> bool {
        let mut any = false;
        // Taken out meanwhile, as own mailboxes are.
        let mut followed = std::mem::take(&mut self.context.followed_streams.list);
        for stream in followed.iter_mut().filter(|stream| of(stream)) {
            any |= burst(|| {
                if self.life.state != ModuleState::On || self.context.followed_streams.is_rewound() {
                    return false;
                }
                match stream.step() {
                    Step::Record(record) => {
                        let received = record.received();
                        let part = |module: &mut M, context: &mut Context| module.received(context, &received);
                        let event = received.event(&self.context.journal);
                        self.life.attempt(event, &mut self.context, part);
                        true
                    }
                    Step::Again => true,
                    Step::Nothing => false,
                }
            });
        }
        self.context.followed_streams.put_back(followed);
        any
    }

    fn periodic(&mut self) {
        // Also while it is off: late answers must not wait for ever in front of its sleep.
        self.context.link.unseen().borrow_mut().collect();
        if self.life.state == ModuleState::On {
            self.context.followings.renew(&mut self.context.link.unseen().borrow_mut(), Instant::now());
            let Context { followings, followed_streams, complaint, .. } = &self.context;
            let of_others = followings.complaint().or_else(|| followed_streams.complaint());
            self.life.complains(of_others.or(Some(complaint.as_str())));
        }
        let moment = self.context.deliver_due();
        if self.life.state == ModuleState::On && self.context.schedule.take_tick(moment) {
            self.life.attempt(JournalEvent::Tick, &mut self.context, M::tick);
        }
    }

    fn is_on(&self) -> bool {
        self.life.state == ModuleState::On
    }

    /// Descriptors have their turn also when packages leave no time to sleep.
    fn look(&mut self) -> Duration {
        let on = self.is_on();
        self.context.watches.iter_mut().filter(|_| on).for_each(Watches::look);
        Duration::ZERO
    }

    /// Each descriptor that was ready, once.
    fn ready(&mut self) {
        while self.is_on()
            && let Some(ready) = self.context.watches.as_mut().and_then(Watches::next_ready)
        {
            let Ready { watch, readable, writable } = ready;
            let event = JournalEvent::Ready { watch: watch.number(), readable, writable };
            let part = |module: &mut M, context: &mut Context| module.ready(context, ready);
            self.life.attempt(event, &mut self.context, part);
        }
    }

    /// When there is a tick, a delivery or the end of a lease next, or entries of a journal have waited.
    fn next_periodic(&self) -> Option<Instant> {
        let (now_ns, context) = (monotonic_ns(), &self.context);
        let (lease, delivery) = (context.subscriptions.lease_ns(), context.subscriptions.due_ns());
        let tick = context.schedule.tick_ns().filter(|_| self.is_on());
        let due = tick.into_iter().chain(delivery).min();
        let wake_up = context.schedule.wake_up_ns().filter(|_| self.is_on());
        let other = [lease, context.journal.due_ns(), wake_up].into_iter().flatten().min();
        let waits = [due.map(|ns| context.schedule.wait_ns(now_ns, ns)), other.map(|ns| ns.saturating_sub(now_ns))];
        waits.into_iter().flatten().min().map(|ns| Instant::now() + Duration::from_nanos(ns))
    }

    /// Until a package comes, a descriptor is ready, something is due, or it is told to stop. How long it slept.
    fn sleep(&mut self) -> Duration {
        let on = self.is_on();
        let renewal = self.context.followings.next().filter(|_| on);
        let periodic = self.next_periodic();
        let output = output::retry_at();
        let stream = self.context.followed_streams.retry().filter(|_| on);
        let deadline = [renewal, periodic, output, stream].into_iter().flatten().min();
        let mut link = self.context.link.unseen().borrow_mut();
        let mut sources = empty(std::mem::take(&mut self.sources));
        sources.extend(self.endpoints.iter_mut().map(|endpoint| source(&mut endpoint.command_server.commands)));
        sources.push(&mut self.data);
        sources.extend(self.context.own.iter_mut().map(source));
        sources.push(link.replies());
        // Records that are written while it is off are passed over, and wake nobody.
        sources.extend(self.context.followed_streams.sources().filter(|_| on));
        let waiting = Waiting { spin: self.spin, deadline };
        let stop = || self.stop.load(Ordering::Acquire);
        // What comes for a module that is off waits where it is: it would end every sleep.
        let slept = match self.context.watches.as_mut().filter(|_| on) {
            Some(watches) => watches.wait_any(&mut sources, waiting, stop),
            None => wait_any(&mut sources, waiting, stop),
        };
        self.sources = empty(sources);
        slept
    }

    pub(super) fn end(mut self) {
        // What modules did that have ended by now waits for nobody else.
        let (is_all, began) = (self.context.takes_all_at_end, Instant::now());
        while (is_all && self.take_data()) | self.take_records(|stream| is_all || stream.is_whole()) {
            // Others may go on, and faster.
            if is_all && began.elapsed() >= LAST_MAX {
                break;
            }
        }
        if self.life.state == ModuleState::On {
            self.life.work(JournalEvent::Off, &mut self.context, M::off);
        }
        self.context.followings.end(&mut self.context.link.unseen().borrow_mut());
        self.context.journal.end();
        self.life.enter(ModuleState::Stopping);
        tracing::debug!("ends");
        output::flush();
        self.life.participant.leave();
        if !self.by_hand {
            return;
        }
        stream::remove(&self.life.participant, std::mem::take(&mut self.context.streams));
        // With it go its proxies, which hold the link.
        drop(self.life);
        let commands = self.endpoints.into_iter().map(|endpoint| endpoint.command_server.commands);
        for mailbox in commands.chain([self.data]).chain(self.context.own) {
            mailbox.close();
        }
        if let Some(link) = self.context.link.into_link() {
            link.close();
        }
    }
}

/// Hands out a burst of packages of one mailbox; false when there was none.
fn take<M: MadeModule>(mailbox: &mut Receiver, life: &mut Incarnation<M>, context: &mut Context) -> bool {
    let (local, latest) = (mailbox.name().local(), mailbox.shape().full == OverflowPolicy::Latest);
    burst(|| {
        let Some(package) = mailbox.try_receive() else { return false };
        let head = package.head();
        let (Kind::Data(number), Some((data, value))) = (head.kind.kind(), DataHead::split(package.body())) else {
            context.refusals.note(Cause::Malformed, head.from);
            return true;
        };
        if context.admits((local, latest), head, number, &data) && life.state == ModuleState::On {
            let origin = Origin::Package { mailbox: local, id: head.id };
            let received = Received::new(head.from, number, origin, data, value);
            let part = |module: &mut M, context: &mut Context| module.received(context, &received);
            life.attempt(received.event(&context.journal), context, part);
        }
        true
    })
}

/// Does one thing after the other until there is none, or it is others' turn; false when there was none.
fn burst(mut handle: impl FnMut() -> bool) -> bool {
    let began = Instant::now();
    for handled in 0..BURST {
        if !handle() {
            return handled > 0;
        }
        if began.elapsed() >= BURST_TIME {
            break;
        }
    }
    true
}

/// The same memory without what was in it, for things that live for another time. Collecting in place is how the
/// standard library does this; were it not, it would allocate, and `tests/hot_path.rs` would tell.
fn empty<'a>(mut sources: Vec<&mut (dyn Source + 'static)>) -> Vec<&'a mut (dyn Source + 'static)> {
    sources.clear();
    sources.into_iter().map(|_| -> &'a mut (dyn Source + 'static) { unreachable!("it is empty") }).collect()
}

/// A mailbox, as one of the things that are waited for.
fn source(mailbox: &mut Receiver) -> &mut (dyn Source + 'static) {
    mailbox
}
