//! Packages that a module or launch does not take: counted by cause, and told seldom, so that nobody fills the log with
//! them.

use crate::common::Refused;
use rohrpost_mailbox::{Name, Throttle, monotonic_ns};

/// They are told at most so often.
const TELL_EVERY_NS: u64 = 10_000_000_000;

/// Why a package is not taken.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Cause {
    /// `[access]` does not let the sender's class command this one.
    NotAllowed,
    /// The sender holds its share of places, or all are taken.
    NoPlace,
    /// It is no command, or no data.
    Malformed,
    /// There is no such subscription.
    Unasked,
    /// The subscription follows another module.
    OtherPublisher,
    /// The subscription is to data of another number.
    OtherNumber,
    /// An earlier incarnation of the module asked for it.
    PreviousIncarnation,
    /// It is of an earlier incarnation of its sender than one that is remembered. Told, and not counted: it passes by
    /// itself.
    EarlierIncarnation,
}

impl Cause {
    /// What is told of it. Nothing where it happens to all: after a restart, what the incarnation before asked for
    /// still comes for a while.
    fn words(self) -> Option<&'static str> {
        match self {
            Self::NotAllowed => Some("[access] does not let that class command this one"),
            Self::NoPlace => Some("there is no place for more callers or subscriptions of it"),
            Self::Malformed => Some("it is not what that mailbox takes"),
            Self::Unasked => Some("nobody subscribed to it"),
            Self::OtherPublisher => Some("the subscription follows another module"),
            Self::OtherNumber => Some("the subscription is to other data of that module"),
            Self::EarlierIncarnation => Some(
                "a later incarnation of it has called before. If this goes on, either two programs have that name: \
                end one of them. Or its \
                 computer's clock was set back before its node was launched: set the clock right, and launch that \
                 node again",
            ),
            Self::PreviousIncarnation => None,
        }
    }
}

/// All refusals of one incarnation.
#[derive(Default)]
pub struct Refusals {
    pub(crate) counts: Refused,
    throttle: Throttle,
}

impl Refusals {
    /// Counts one.
    pub fn note(&mut self, cause: Cause, from: Name) {
        let count = self.count(cause).map(|count| *count += 1);
        let Some(words) = cause.words() else { return };
        if let Some(packages) = self.throttle.note(monotonic_ns(), TELL_EVERY_NS) {
            let counted = if count.is_some() { " (`rohrpost status --json` counts them by cause)" } else { "" };
            tracing::warn!("took nothing of {packages} packages, the last of them from {from}: {words}{counted}");
        }
    }

    fn count(&mut self, cause: Cause) -> Option<&mut u64> {
        let counts = &mut self.counts;
        match cause {
            Cause::NotAllowed => Some(&mut counts.not_allowed),
            Cause::NoPlace => Some(&mut counts.no_place),
            Cause::Malformed => Some(&mut counts.malformed),
            Cause::Unasked => Some(&mut counts.unasked),
            Cause::OtherPublisher => Some(&mut counts.other_publisher),
            Cause::OtherNumber => Some(&mut counts.other_number),
            Cause::PreviousIncarnation => Some(&mut counts.earlier_incarnation),
            Cause::EarlierIncarnation => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_cause_has_a_count_of_its_own() {
        let causes = [
            Cause::NotAllowed,
            Cause::NoPlace,
            Cause::Malformed,
            Cause::Unasked,
            Cause::OtherPublisher,
            Cause::OtherNumber,
            Cause::PreviousIncarnation,
        ];
        let mut refusals = Refusals::default();
        for (times, cause) in (1..).zip(causes) {
            (0..times).for_each(|_| refusals.note(cause, Name::new(1, 9, 0, 0)));
        }
        let expected = Refused {
            not_allowed: 1,
            no_place: 2,
            malformed: 3,
            unasked: 4,
            other_publisher: 5,
            other_number: 6,
            earlier_incarnation: 7,
        };
        assert_eq!(refusals.counts, expected);
    }
}
