//! The publishing side of continuous data: subscribers, their rates and leases. Uses no clock and no mailbox.

use crate::common::Subscribe;
use crate::places::Places;
use crate::runtime::schedule::{ClockStep, WorkMoment};
use rohrpost_config::Principal;
use rohrpost_mailbox::{Name, Priority};

/// Subscriptions to one module's data at a time, besides those of principals that always find a place.
const SUBSCRIPTIONS_MAX: usize = 64;
/// Each of those always finds so many.
const OWN_SUBSCRIPTIONS: usize = 8;
/// A subscriber that wants data for longer has to say so again, however long a lease it asked for, ms.
const LEASE_MAX_MS: u32 = 60_000;
/// A subscriber that wants data more often gets it so often: the period is its word, the work is ours.
const PERIOD_MIN_US: u32 = 100;

/// What a subscriber's request asks for.
#[derive(Clone, Copy)]
pub(crate) struct RequestOrigin {
    /// Reply mailbox of the subscriber.
    pub(crate) by: Name,
    /// The principal that is charged for its place.
    pub(crate) principal: Principal,
    /// The subscriber's incarnation, from the call's envelope.
    pub(crate) incarnation: u32,
    /// Mailbox that the data go to.
    pub(crate) to: Name,
    /// Its priority; the data carry the same.
    pub(crate) priority: Priority,
    /// Only the newest of the data counts, and their options say so.
    pub(crate) newest: bool,
}

/// One subscription.
pub(crate) struct SubscriptionEntry {
    pub(crate) endpoint: usize,
    pub(crate) wish: Subscribe,
    /// The request that began or last renewed it; the data carry its priority and incarnation.
    pub(crate) asked: RequestOrigin,
    pub(crate) sequence: u32,
    pub(crate) missed: u32,
    /// When its lease ends, by the monotonic clock.
    ends_ns: u64,
    /// Next time a periodic one is due, by the clock of periods.
    due_ns: u64,
    /// Whether a value has come since the last was sent.
    fresh: bool,
    /// It was said that its mailbox is too small; once is enough.
    pub(crate) told: bool,
}

/// Tells what became of one delivery.
pub(crate) enum Delivery {
    /// Accepted.
    Sent,
    /// The subscriber's mailbox was full.
    Full,
    /// The subscriber's mailbox takes no value of this size, and this was said.
    TooLarge,
    /// The subscriber is gone.
    Gone,
}

/// All subscriptions to a module's data.
pub(crate) struct Subscriptions {
    list: Vec<SubscriptionEntry>,
    places: Places,
    /// Misses of subscriptions that have ended.
    missed_before: u64,
}

impl Subscriptions {
    /// None yet. These principals always find [`OWN_SUBSCRIPTIONS`] places.
    pub(crate) fn new(named: &[Principal]) -> Self {
        let places = Places::new(named, OWN_SUBSCRIPTIONS, SUBSCRIPTIONS_MAX);
        Self { list: Vec::new(), places, missed_before: 0 }
    }

    /// Begins or renews; false when there is no place.
    pub(crate) fn subscribe(
        &mut self,
        endpoint: usize,
        asked: RequestOrigin,
        mut wish: Subscribe,
        now: WorkMoment,
    ) -> bool {
        wish.period_us = if wish.period_us == 0 { 0 } else { wish.period_us.max(PERIOD_MIN_US) };
        let (now_ns, due_ns) = (now.monotonic_ns, now.work_ns);
        let ends_ns = now_ns.saturating_add(u64::from(wish.lease_ms.min(LEASE_MAX_MS)) * 1_000_000);
        // A new incarnation of the subscriber: nobody takes what its earlier incarnation asked for.
        self.retain(|s| s.asked.by != asked.by || s.asked.incarnation == asked.incarnation);
        if let Some(known) = self.list.iter_mut().find(|s| s.asked.to == asked.to && s.wish.id == wish.id) {
            known.ends_ns = ends_ns;
            let changed =
                (known.wish.number, known.wish.period_us, known.endpoint) != (wish.number, wish.period_us, endpoint);
            if changed {
                // What was fresh was another's.
                (known.due_ns, known.fresh, known.told) = (due_ns, false, false);
            }
            (known.endpoint, known.wish, known.asked) = (endpoint, wish, asked);
            return true;
        }
        // One with an ended lease holds no place, whether or not it was dropped by now.
        let held = self.list.iter().filter(|s| s.ends_ns > now_ns).map(|s| s.asked.principal);
        if !self.places.allows(asked.principal, held) {
            return false;
        }
        self.list.push(SubscriptionEntry {
            endpoint,
            wish,
            asked,
            sequence: 0,
            missed: 0,
            ends_ns,
            due_ns,
            fresh: false,
            told: false,
        });
        true
    }

    /// Ends one.
    pub(crate) fn unsubscribe(&mut self, to: Name, id: u16) {
        self.retain(|subscription| subscription.asked.to != to || subscription.wish.id != id);
    }

    fn retain(&mut self, keep: impl Fn(&SubscriptionEntry) -> bool) {
        let gone = self.list.iter().filter(|s| !keep(s)).map(|s| u64::from(s.missed));
        self.missed_before += gone.sum::<u64>();
        self.list.retain(keep);
    }

    pub(crate) fn len(&self) -> usize {
        self.list.len()
    }

    /// Periods and packages missed so far, by all.
    pub(crate) fn missed(&self) -> u64 {
        self.missed_before + self.list.iter().map(|s| u64::from(s.missed)).sum::<u64>()
    }

    /// A new value of this kind of data: `deliver` it to subscribers of each.
    pub(crate) fn published(
        &mut self,
        endpoint: usize,
        number: u16,
        mut deliver: impl FnMut(&SubscriptionEntry) -> Delivery,
    ) {
        let mut gone = false;
        for subscription in &mut self.list {
            if (subscription.endpoint, subscription.wish.number) != (endpoint, number) {
                continue;
            }
            if subscription.wish.period_us == 0 {
                gone |= !subscription.settle(deliver(subscription));
            } else {
                subscription.fresh = true;
            }
        }
        if gone {
            self.retain(|subscription| subscription.ends_ns != 0);
        }
    }

    /// Delivers what is due and drops those with an ended lease.
    pub(crate) fn tick(&mut self, now: WorkMoment, mut deliver: impl FnMut(&SubscriptionEntry) -> Delivery) {
        let WorkMoment { monotonic_ns: now_ns, work_ns } = now;
        if self.list.iter().any(|subscription| subscription.ends_ns <= now_ns) {
            self.retain(|subscription| subscription.ends_ns > now_ns);
        }
        let mut gone = false;
        for subscription in self.list.iter_mut().filter(|s| s.is_periodic() && s.due_ns <= work_ns) {
            let period_ns = subscription.period_ns();
            // Periods that passed while nobody looked are missed too, but only the newest value is sent.
            let passed = (work_ns - subscription.due_ns) / period_ns;
            let after_ns = (passed + 1).saturating_mul(period_ns);
            subscription.due_ns = subscription.due_ns.saturating_add(after_ns);
            subscription.missed = subscription.missed.saturating_add(u32::try_from(passed).unwrap_or(u32::MAX));
            if std::mem::take(&mut subscription.fresh) {
                gone |= !subscription.settle(deliver(subscription));
            } else {
                subscription.missed = subscription.missed.saturating_add(1);
            }
        }
        if gone {
            self.retain(|subscription| subscription.ends_ns != 0);
        }
    }

    /// The clock of periods has stepped.
    pub(crate) fn step(&mut self, step: ClockStep) {
        for subscription in &mut self.list {
            subscription.due_ns = step.moved(subscription.due_ns, subscription.period_ns());
        }
    }

    /// When a lease ends next, by the monotonic clock.
    pub(crate) fn lease_ns(&self) -> Option<u64> {
        self.list.iter().map(|s| s.ends_ns).min()
    }

    /// When a periodic one is due next, by the clock of periods.
    pub(crate) fn due_ns(&self) -> Option<u64> {
        self.list.iter().filter(|s| s.is_periodic()).map(|s| s.due_ns).min()
    }
}

impl SubscriptionEntry {
    /// Whether it wants the newest once a period, and not each value.
    fn is_periodic(&self) -> bool {
        self.wish.period_us != 0
    }

    fn period_ns(&self) -> u64 {
        u64::from(self.wish.period_us) * 1000
    }

    /// Notes a delivery; false when the subscriber is gone.
    fn settle(&mut self, delivery: Delivery) -> bool {
        match delivery {
            Delivery::Sent => self.sequence = self.sequence.wrapping_add(1),
            Delivery::Full | Delivery::TooLarge => {
                self.told |= matches!(delivery, Delivery::TooLarge);
                // The number is used up, so that the subscriber sees the gap.
                self.sequence = self.sequence.wrapping_add(1);
                self.missed = self.missed.saturating_add(1);
            }
            Delivery::Gone => {
                self.ends_ns = 0;
                return false;
            }
        }
        true
    }
}

#[cfg(test)]
#[path = "publish_tests.rs"]
mod tests;
