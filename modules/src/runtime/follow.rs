//! The subscribing side of continuous data: asks, renews, and sees gaps.

use super::refusals::Cause;
use super::subscribed::{Origin, Subscribed, seal};
use super::wanted::WantedData;
use crate::call::append;
use crate::call::{CallError, Fault, Link, is_to};
use crate::common::{DataHead, SUBSCRIBE, Subscribe, UNSUBSCRIBE, Unsubscribe};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Head, Name, Node, Options};
use rohrpost_schema::Data;
use std::marker::PhantomData;
use std::sync::Arc;
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
///
/// ```
/// use rohrpost_modules::runtime::Rate;
/// use std::time::Duration;
///
/// assert_eq!(Rate::hz(20.0)?, Rate::Every(Duration::from_millis(50)));
/// assert_eq!(Rate::hz(0.0)?, Rate::Each);
/// assert!(Rate::hz(f64::NAN).is_err());
/// # Ok::<(), rohrpost_modules::runtime::BadRate>(())
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Rate {
    /// Each value.
    Each,
    /// The newest value once in this time.
    Every(Duration),
}

/// No rate at which data can be sent.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{0} is no rate; say how many values a second, or 0 for each")]
pub struct BadRate(f64);

impl Rate {
    /// The newest value at most `hz` times a second; each value for 0.
    ///
    /// # Errors
    /// It is below 0, infinite, or no number.
    pub fn hz(hz: f64) -> Result<Self, BadRate> {
        match hz {
            0.0 => Ok(Self::Each),
            // A period that is too long for a `Duration` is as long as that can be.
            _ if hz.is_finite() && hz > 0.0 => {
                Ok(Self::Every(Duration::try_from_secs_f64(1.0 / hz).unwrap_or(Duration::MAX)))
            }
            _ => Err(BadRate(hz)),
        }
    }
}

/// A subscription to data of type `T`, made by [`super::Context::subscribe`]; [`super::Received::read`] tells whether
/// data belong to it.
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

impl<T: Data> Subscribed for Subscription<T> {
    type Item = T;
}

impl<T> seal::Kind for Subscription<T> {
    fn brought(&self, origin: Origin) -> bool {
        matches!(origin, Origin::Package { mailbox, id } if (mailbox, id) == (self.mailbox, self.id))
    }
}

impl<T> Subscription<T> {
    pub(crate) fn new(id: u16, mailbox: u8) -> Self {
        Self { id, mailbox, data: PhantomData }
    }
}

/// One thing that is followed.
struct Followed {
    from: Name,
    /// None of data that are known by their number alone.
    wanted: Option<WantedData>,
    wish: Subscribe,
    /// Options of the request: whether only the newest counts.
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
    /// The same in the words of people, if it is one that does not pass by itself.
    complaint: Option<String>,
}

/// All that a module follows.
pub(crate) struct Followings {
    /// A subscription's id is its place here; none is used twice in an incarnation.
    list: Vec<Followed>,
    /// Incarnation of the module, as its requests carry it.
    incarnation: u32,
    installation: Arc<Installation>,
}

impl Followings {
    /// Subscriptions of a module with a link of this incarnation: none yet.
    pub(crate) fn of(incarnation: u32, installation: Arc<Installation>) -> Self {
        Self { list: Vec::new(), incarnation, installation }
    }

    /// The link has this incarnation from now on; nothing was subscribed before.
    pub(crate) fn begin(&mut self, incarnation: u32) {
        self.incarnation = incarnation;
    }

    /// Follows data number `number` of a module, which come to `mailbox`; returns the subscription's id, if one is
    /// left. `latest`: there only the newest counts, and on the way as well. `wanted`: what is expected.
    pub(crate) fn follow(
        &mut self,
        (mailbox, latest): (u8, bool),
        from: Name,
        number: u16,
        interface: u32,
        rate: Rate,
        wanted: Option<WantedData>,
    ) -> Option<u16> {
        let id = u16::try_from(self.list.len()).ok()?;
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
            wanted,
            wish,
            options,
            interface,
            call: None,
            next,
            expected: None,
            came: 0,
            lost: 0,
            refusal: None,
            complaint: None,
        });
        Some(id)
    }

    /// A subscription that is refused for a reason that does not pass by itself.
    pub(crate) fn complaint(&self) -> Option<&str> {
        self.list.iter().find_map(|followed| followed.complaint.as_deref())
    }

    /// Packages that should have come and did not.
    pub(crate) fn lost(&self) -> u64 {
        self.list.iter().map(|followed| followed.lost).sum()
    }

    /// For each subscription the publisher, the number of the data, packages received and packages missed.
    pub(crate) fn tallies(&self) -> impl Iterator<Item = (Name, u16, u64, u64)> {
        self.list.iter().map(|followed| (followed.from, followed.wish.number, followed.came, followed.lost))
    }

    /// Asks for what is due, and looks at the answers. Never waits.
    pub(crate) fn renew(&mut self, link: &mut Link, now: Instant) {
        link.collect();
        let Self { list, installation, .. } = self;
        for followed in list {
            if let Some(call) = followed.call
                && let Some(answer) = link.poll(call)
            {
                followed.call = None;
                followed.answered(answer, now, (link.participant().node(), installation));
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
                    Err(error) => followed.answered(Err(error), now, (link.participant().node(), installation)),
                }
            }
        }
    }

    /// When [`Followings::renew`] has something to do next.
    pub(crate) fn next(&self) -> Option<Instant> {
        self.list.iter().map(|followed| followed.next).min()
    }

    /// Whether data that came to `mailbox` are what was subscribed to; if so, notes their number. `latest`: a gap there
    /// is what newer ones replaced, there or on the way, and no loss.
    ///
    /// A subscription is told by its id and by the incarnation of this incarnation, which nothing before it has had: so
    /// a publisher that still sends what an earlier incarnation asked for, in whatever order that subscribed, is not
    /// taken for another. The publisher and the number are compared besides, since both numbers are no secret; a router
    /// lets nobody send in the name of another node's module.
    pub(crate) fn admit(
        &mut self,
        (mailbox, latest): (u8, bool),
        head: &Head,
        number: u16,
        data: &DataHead,
    ) -> Result<(), Cause> {
        let its = |followed: &&mut Followed| followed.wish.mailbox == mailbox;
        let followed = self.list.get_mut(usize::from(head.id)).filter(its).ok_or(Cause::Unasked)?;
        if !is_to(followed.from, head.from) {
            return Err(Cause::OtherPublisher);
        }
        if number != followed.wish.number {
            return Err(Cause::OtherNumber);
        }
        if data.incarnation != self.incarnation {
            return Err(Cause::PreviousIncarnation);
        }
        followed.note(latest, data.sequence);
        Ok(())
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
    fn note(&mut self, latest: bool, sequence: u32) {
        self.came += 1;
        if let Some(expected) = self.expected {
            // A publisher that was restarted begins at 0 again; that is no gap.
            let gap = sequence.wrapping_sub(expected);
            if sequence != 0 && gap < u32::MAX / 2 && !latest {
                self.lost += u64::from(gap);
            }
        }
        self.expected = Some(sequence.wrapping_add(1));
    }

    fn answered(&mut self, answer: Result<(), CallError>, now: Instant, (node, installation): (&Node, &Installation)) {
        let Err(error) = answer else {
            if self.complaint.take().is_some() {
                tracing::info!("subscription to {}: it comes again", self.what(installation));
            }
            self.refusal = None;
            return;
        };
        self.next = now + RETRY;
        // A module or node that is not there yet is the usual case at the start, and not worth a warning.
        let passes = matches!(
            error,
            CallError::NotSent(_)
                | CallError::Timeout(..)
                | CallError::Fault(
                    _,
                    Fault::NoMailbox
                        | Fault::MailboxFull
                        | Fault::Expired
                        | Fault::Interrupted
                        | Fault::NodeSilent { .. }
                )
        );
        let text = error.to_string();
        if self.refusal.as_ref() == Some(&text) {
            return;
        }
        // The module is named before.
        let why = if let CallError::Fault(_, fault) = &error { fault.to_string() } else { text.clone() };
        let told = format!(
            "subscription to {}: {why}{}",
            self.what(installation),
            self.wanted
                .as_ref()
                .map_or_else(String::new, |wanted| { wanted.difference(&error, node, (self.from, self.wish.number)) })
        );
        if passes {
            // Whether what it was refused for still holds is not known any more.
            self.complaint = None;
            tracing::debug!("{told}");
        } else {
            tracing::warn!("{told}");
            self.complaint = Some(told);
        }
        self.refusal = Some(text);
    }

    /// The data, as people call them.
    fn what(&self, installation: &Installation) -> String {
        let module = installation.classes.format(self.from);
        match &self.wanted {
            Some(wanted) => format!("`{}` of {module}", wanted.name),
            None => format!("data {} of {module}", self.wish.number),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LASER: Name = Name::new(1, 150, 0, 0);
    const WHEELS: Name = Name::new(1, 160, 0, 0);
    const LIFE: u32 = 1_234_567_890;

    #[test]
    fn a_rate_is_a_number_from_0_up() {
        assert_eq!(Rate::hz(0.0), Ok(Rate::Each));
        assert_eq!(Rate::hz(4.0), Ok(Rate::Every(Duration::from_millis(250))));
        assert_eq!(Rate::hz(f64::MIN_POSITIVE), Ok(Rate::Every(Duration::MAX)));
        for bad in [-1.0, -f64::MIN_POSITIVE, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(Rate::hz(bad), Err(BadRate(bad)));
        }
        let told = Rate::hz(f64::NAN).unwrap_err().to_string();
        assert_eq!(told, "NaN is no rate; say how many values a second, or 0 for each");
    }

    #[test]
    fn only_what_was_asked_for_in_this_life_is_taken() {
        let mut followings = Followings::of(LIFE, {
            let text = "installation = \"one\"\nsystem = { name = \"robot\", id = 1 }\n[classes.tool]\nid = 16\n\
                        [classes.laser]\nid = 150\n[nodes.main]\n[[module]]\nname = \"laser.0\"\nprogram = \"laser\"\n";
            Arc::new(Installation::parse(text, std::path::Path::new("robot.toml")).unwrap())
        });
        for (mailbox, from, number) in [(2, LASER, 1), (3, LASER, 1), (2, WHEELS, 1), (2, LASER, 2)] {
            followings.follow((mailbox, false), from, number, 77, Rate::Each, None).unwrap();
        }
        let mut followed = 0;
        for (id, mailbox, from, number, incarnation, taken, why) in [
            (0, 2, LASER, 1, LIFE, Ok(()), "as asked for"),
            (0, 2, LASER.with_local(1), 1, LIFE, Ok(()), "whichever of the publisher's mailboxes stands in the head"),
            (1, 3, LASER, 1, LIFE, Ok(()), "the same data in another mailbox"),
            (0, 3, LASER, 1, LIFE, Err(Cause::Unasked), "that is another subscription's mailbox"),
            (4, 2, LASER, 1, LIFE, Err(Cause::Unasked), "no such id"),
            (u16::MAX, 2, LASER, 1, LIFE, Err(Cause::Unasked), "nor this one"),
            (0, 2, WHEELS, 1, LIFE, Err(Cause::OtherPublisher), "as if subscribed in another order"),
            (0, 2, Name::new(2, 150, 0, 0), 1, LIFE, Err(Cause::OtherPublisher), "a robot that visits"),
            (0, 2, Name::new(1, 150, 1, 0), 1, LIFE, Err(Cause::OtherPublisher), "another scanner"),
            (0, 2, LASER, 2, LIFE, Err(Cause::OtherNumber), "as if subscribed in another order"),
            (3, 2, LASER, 1, LIFE, Err(Cause::OtherNumber), "and the other way round"),
            (0, 2, LASER, 1, LIFE - 1, Err(Cause::PreviousIncarnation), "what the incarnation before asked for"),
            (0, 2, LASER, 1, 0, Err(Cause::PreviousIncarnation), "what nobody asked for"),
        ] {
            let head = Head { from, id, ..Head::default() };
            let data = DataHead { stamp_ns: 0, sequence: followed, missed: 0, incarnation };
            assert_eq!(followings.admit((mailbox, false), &head, number, &data), taken, "{why}");
            followed += u32::from(taken.is_ok());
        }
        // What was dropped counts nowhere.
        let came: Vec<u64> = followings.tallies().map(|(_, _, came, _)| came).collect();
        assert_eq!((came, followings.lost()), (vec![2, 1, 0, 0], 0));
    }
}
