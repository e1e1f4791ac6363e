//! What launch sees of a module that runs: the part of its code that does not come back, and why it is in error. Knows
//! no process and asks nobody; what there is to know comes as an argument.

use crate::survey::Working;
use rohrpost_mailbox::{InHand, Name, Node, monotonic_ns};
use std::time::{Duration, Instant};

/// Shortest time between two looks whether a part of a module's code has come back.
const LOOK_MIN: Duration = Duration::from_millis(50);

/// How a module does, while it runs.
pub(super) struct Health {
    busy_after: Duration,
    look_at: Instant,
    /// What has not come back since then was told, ns of the monotonic clock.
    told_ns: Option<u64>,
    /// The last that went wrong.
    error: String,
    /// That is why it is in error now, which is the one of this number.
    present: Option<u32>,
    /// The module is on all the same, and only says what does not work: that is no error any more when it is over.
    is_complaint: bool,
}

/// A part of a module's code that has not come back for long.
pub(super) struct Stuck {
    in_hand: InHand,
    lasts: Duration,
}

impl Stuck {
    /// In words; the name of a function is in what the module noted of itself under one of these names.
    pub(super) fn told(&self, node: &Node, names: &[Name]) -> String {
        Working::new(self.in_hand.work, self.lasts, node, names.iter().copied()).to_string()
    }
}

impl Health {
    pub(super) fn new(busy_after: Duration, now: Instant) -> Self {
        Self { busy_after, look_at: now, told_ns: None, error: String::new(), present: None, is_complaint: false }
    }

    /// When to look again. A part that begins after a look is not long before `busy_after` is over once more.
    pub(super) fn look_at(&self) -> Instant {
        self.look_at
    }

    /// Takes what the module has in hand; what is to be told of it, once.
    pub(super) fn look(&mut self, in_hand: Option<InHand>, now: Instant) -> Option<Stuck> {
        let lasts = in_hand.map_or(Duration::ZERO, |in_hand| in_hand.lasts(monotonic_ns()));
        let left = self.busy_after.checked_sub(lasts).filter(|left| !left.is_zero());
        self.look_at = now + left.unwrap_or(self.busy_after).max(LOOK_MIN);
        let in_hand = in_hand.filter(|_| left.is_none())?;
        let is_new = self.told_ns.replace(in_hand.since_ns) != Some(in_hand.since_ns);
        is_new.then_some(Stuck { in_hand, lasts })
    }

    /// Takes the number of the error that the module says it is in, and gives it back if why is not known yet. Between
    /// two looks it may have been switched on again, and failed anew.
    pub(super) fn asks_why(&mut self, in_error: Option<u32>) -> Option<u32> {
        self.present = self.present.filter(|present| in_error == Some(*present));
        self.end_complaint();
        in_error.filter(|_| self.present.is_none())
    }

    /// Why it went into error, and into which one, if that is known.
    pub(super) fn went_into_error(&mut self, number: Option<u32>, why: String) {
        (self.error, self.present, self.is_complaint) = (why, number, false);
    }

    /// What does not work although it is on, and which of its complaints that is.
    pub(super) fn complained(&mut self, number: u32, why: String) {
        (self.error, self.present, self.is_complaint) = (why, Some(number), true);
    }

    fn end_complaint(&mut self) {
        if self.is_complaint && self.present.is_none() {
            self.error.clear();
            self.is_complaint = false;
        }
    }

    /// The module's process has ended; if it failed, so.
    pub(super) fn ended(&mut self, failure: Option<&String>) {
        self.present = None;
        self.end_complaint();
        if let Some(failure) = failure {
            self.error.clone_from(failure);
        }
    }

    /// The last that went wrong; empty if nothing did.
    pub(super) fn error(&self) -> &str {
        &self.error
    }

    /// Why it is in error now, if it is.
    pub(super) fn present_error(&self) -> Option<&str> {
        self.present.map(|_| self.error.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_mailbox::Work;

    #[test]
    fn what_does_not_come_back_is_told_once_and_looked_for_in_time() {
        let (second, start) = (Duration::from_secs(1), Instant::now());
        let mut health = Health::new(second, start);
        let since = |ago: Duration| monotonic_ns().saturating_sub(ago.as_nanos() as u64);
        let in_hand = |since_ns| Some(InHand { work: Work::Tick, since_ns });
        assert!(health.look(None, start).is_none());
        assert_eq!(health.look_at(), start + second, "what begins now is long in a second");
        let began_ns = since(second * 3 / 4);
        assert!(health.look(in_hand(began_ns), start).is_none(), "not long yet");
        let (look_at, quarter) = (health.look_at(), second / 4);
        assert!(look_at > start && look_at <= start + quarter, "when it is long");
        let began_ns = since(second * 2);
        assert!(health.look(in_hand(began_ns), start).is_some());
        assert!(health.look(in_hand(began_ns), start + second).is_none(), "told once");
        assert!(health.look_at() > start + second, "launch sleeps");
        assert!(health.look(in_hand(began_ns + 5), start + second).is_some(), "the next is another one");
    }

    #[test]
    fn an_error_is_asked_for_once_and_stays_the_last_when_it_is_over() {
        let mut health = Health::new(Duration::from_secs(1), Instant::now());
        let asked = [None, Some(1), Some(1)].map(|in_error| health.asks_why(in_error));
        assert_eq!(asked, [None, Some(1), Some(1)]);
        health.went_into_error(Some(1), "no port".into());
        assert_eq!(health.asks_why(Some(1)), None);
        assert_eq!(health.present_error(), Some("no port"));
        assert_eq!(health.asks_why(None), None);
        assert_eq!((health.present_error(), health.error()), (None, "no port"));
        assert_eq!(health.asks_why(Some(2)), Some(2));
        health.went_into_error(Some(2), "no power".into());
        assert_eq!(health.asks_why(Some(3)), Some(3), "no look came between the two");
        assert_eq!((health.present_error(), health.error()), (None, "no power"));
        health.went_into_error(None, "no brakes".into());
        assert_eq!((health.present_error(), health.error()), (None, "no brakes"));
        assert_eq!(health.asks_why(Some(5)), Some(5), "that may be another one");
        health.ended(Some(&"ended with 1".into()));
        assert_eq!((health.present_error(), health.error()), (None, "ended with 1"));
    }

    #[test]
    fn a_complaint_is_forgotten_when_it_is_over() {
        let mut health = Health::new(Duration::from_secs(1), Instant::now());
        let ends: [fn(&mut Health); 2] = [|health| _ = health.asks_why(None), |health| health.ended(None)];
        for end in ends {
            assert_eq!(health.asks_why(Some(1)), Some(1));
            health.complained(1, "records nothing".into());
            assert_eq!((health.asks_why(Some(1)), health.error()), (None, "records nothing"));
            end(&mut health);
            assert_eq!((health.present_error(), health.error()), (None, ""));
        }
        health.went_into_error(Some(2), "no port".into());
        health.ended(None);
        assert_eq!(health.error(), "no port", "an error is the last one for good");
    }
}
