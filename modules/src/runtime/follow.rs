//! The subscribing side of continuous data: asks, renews, and sees gaps.

use crate::call::{CallError, Fault, Link};
use crate::common::{DataHead, SUBSCRIBE, Subscribe, UNSUBSCRIBE, Unsubscribe};
use crate::interface::append;
use rohrpost_mailbox::{Name, Options};
use std::marker::PhantomData;
use std::time::{Duration, Instant};

/// A subscription ends by itself so long after its last renewal.
const LEASE: Duration = Duration::from_secs(3);
/// It is renewed three times in a lease; one that is refused or unanswered is asked for again sooner.
const RENEW: Duration = Duration::from_secs(1);
/// The answer to a renewal has come by then, or is not waited for: before the next renewal.
const ANSWER: Duration = Duration::from_millis(600);
const _: () = assert!(ANSWER.as_millis() < RENEW.as_millis() && RENEW.as_millis() * 2 < LEASE.as_millis());
const RETRY: Duration = Duration::from_millis(100);

/// How often a subscriber wants data.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Rate {
    /// Each value.
    Each,
    /// The newest value once in this time.
    Every(Duration),
}

impl Rate {
    /// At most so often a second; each value for 0.
    pub fn hz(hz: f64) -> Self {
        if hz > 0.0 { Self::Every(Duration::try_from_secs_f64(1.0 / hz).unwrap_or(Duration::MAX)) } else { Self::Each }
    }
}

/// A subscription to data of type `T`; [`super::Received::read`] tells whether data belong to it.
pub struct Subscription<T> {
    pub(crate) id: u16,
    pub(crate) mailbox: u8,
    data: PhantomData<fn() -> T>,
}

impl<T> Clone for Subscription<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Subscription<T> {}

impl<T> Subscription<T> {
    pub(crate) fn new(id: u16, mailbox: u8) -> Self {
        Self { id, mailbox, data: PhantomData }
    }
}

/// One thing that is followed.
struct Followed {
    from: Name,
    wish: Subscribe,
    /// Of the request: whether only the newest counts.
    options: Options,
    interface: u32,
    /// A request under way.
    call: Option<u32>,
    next: Instant,
    /// Number that the next package should have; none before the first.
    expected: Option<u32>,
    /// Packages that came.
    came: u64,
    /// Packages that should have come and did not.
    lost: u64,
    /// What the last refusal said, so that it is told once.
    refusal: Option<String>,
}

/// All that a module follows.
#[derive(Default)]
pub(crate) struct Followings {
    list: Vec<Followed>,
}

impl Followings {
    /// Follows data number `number` of a module, which come to `mailbox`; returns the subscription's id. `latest`: there only the newest
    /// counts, and on the way as well.
    pub(crate) fn follow(
        &mut self,
        (mailbox, latest): (u8, bool),
        from: Name,
        number: u16,
        interface: u32,
        rate: Rate,
    ) -> u16 {
        let id = self.list.len() as u16;
        let period_us = match rate {
            Rate::Each => 0,
            Rate::Every(period) => crate::call::micros(period).max(1),
        };
        let wish = Subscribe { number, id, period_us, lease_ms: LEASE.as_millis() as u32, mailbox };
        let next = Instant::now();
        let from = from.module();
        let options = if latest { Options::NEWEST } else { Options::default() };
        self.list.push(Followed {
            from,
            wish,
            options,
            interface,
            call: None,
            next,
            expected: None,
            came: 0,
            lost: 0,
            refusal: None,
        });
        id
    }

    /// Packages that should have come and did not.
    pub(crate) fn lost(&self) -> u64 {
        self.list.iter().map(|followed| followed.lost).sum()
    }

    /// Of each: whose data, their number, packages that came, and packages that did not.
    pub(crate) fn tallies(&self) -> impl Iterator<Item = (Name, u16, u64, u64)> {
        self.list.iter().map(|followed| (followed.from, followed.wish.number, followed.came, followed.lost))
    }

    /// Asks for what is due, and looks at the answers. Never waits.
    pub(crate) fn renew(&mut self, link: &mut Link, now: Instant) {
        link.collect();
        for followed in &mut self.list {
            if let Some(call) = followed.call
                && let Some(answer) = link.poll(call)
            {
                followed.call = None;
                followed.answered(answer, now);
            }
            if followed.next <= now {
                followed.next = now + RENEW;
            } else {
                continue;
            }
            if followed.call.is_none() {
                let write = |body: &mut Vec<u8>| append(body, &followed.wish);
                let (to, options) = (followed.from, followed.options);
                match link.begin_with(options, to, SUBSCRIBE, followed.interface, ANSWER, write) {
                    Ok(call) => followed.call = Some(call),
                    Err(error) => followed.answered(Err(error), now),
                }
            }
        }
    }

    /// When [`Followings::renew`] has something to do next.
    pub(crate) fn next(&self) -> Option<Instant> {
        self.list.iter().map(|followed| followed.next).min()
    }

    /// Notes the number of a package that came to `mailbox`. `latest`: a gap there is what newer ones replaced, there or on the way, and no loss.
    pub(crate) fn note(&mut self, mailbox: u8, latest: bool, from: Name, id: u16, head: &DataHead) {
        let its = |followed: &&mut Followed| (followed.from, followed.wish.mailbox) == (from.module(), mailbox);
        let Some(followed) = self.list.get_mut(usize::from(id)).filter(its) else { return };
        followed.came += 1;
        if let Some(expected) = followed.expected {
            // A publisher that was restarted begins at 0 again; that is no gap.
            let gap = head.sequence.wrapping_sub(expected);
            if head.sequence != 0 && gap < u32::MAX / 2 && !latest {
                followed.lost += u64::from(gap);
            }
        }
        followed.expected = Some(head.sequence.wrapping_add(1));
    }

    /// Tells all publishers that nothing is wanted any more; does not wait for an answer.
    pub(crate) fn end(&mut self, link: &mut Link) {
        for followed in self.list.drain(..) {
            let Subscribe { id, mailbox, .. } = followed.wish;
            let write = |body: &mut Vec<u8>| append(body, &Unsubscribe { id, mailbox });
            if let Ok(call) = link.begin(followed.from, UNSUBSCRIBE, crate::common::HASH, RENEW, write) {
                link.forget(call);
            }
        }
    }
}

impl Followed {
    fn answered(&mut self, answer: Result<(), CallError>, now: Instant) {
        match answer {
            Ok(()) => self.refusal = None,
            Err(error) => {
                self.next = now + RETRY;
                let text = error.to_string();
                // A module or node that is not there yet is the usual case at the start, and not worth a warning.
                let early = matches!(
                    error,
                    CallError::NotSent(_)
                        | CallError::Timeout(..)
                        | CallError::Fault(_, Fault::NoMailbox | Fault::NodeSilent { .. })
                );
                if self.refusal.as_ref() != Some(&text) {
                    if early {
                        tracing::debug!("subscription to data {} of {}: {text}", self.wish.number, self.from);
                    } else {
                        tracing::warn!("subscription to data {} of {}: {text}", self.wish.number, self.from);
                    }
                    self.refusal = Some(text);
                }
            }
        }
    }
}
