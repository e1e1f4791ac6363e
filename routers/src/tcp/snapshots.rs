//! State of a client and the server, as their threads last stored it, for the thread that publishes it.

use crate::session::server::{Crowded, MemberSnapshot};
use crate::session::{Cause, SessionCounts};
use rohrpost_mailbox::{Priority, TimeRecord};
use std::sync::{Mutex, PoisonError};

/// Interval between two snapshots.
pub(crate) const SAY_EVERY_NS: u64 = 200_000_000;

/// Members that are said one by one: with what else is said they must fit into a package.
pub const MEMBERS_MAX: usize = 300;

/// Counts of one class at one end.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Class {
    /// The class's priority.
    pub priority: Priority,
    /// Packages that came.
    pub packages: u64,
    /// Of these, handed on.
    pub passed: u64,
    /// Of these, replaced by newer ones while they waited.
    pub replaced: u64,
    /// Of these, lost, and why.
    pub lost: Vec<(Cause, u64)>,
}

impl Class {
    /// All classes that did something.
    pub fn all(counts: &SessionCounts) -> Vec<Self> {
        let class = |(priority, counts): (Priority, &crate::session::SessionClassCounts)| {
            let lost = Cause::ALL.into_iter().map(|cause| (cause, counts.lost(cause))).filter(|(_, count)| *count > 0);
            Self {
                priority,
                packages: counts.packages.get(),
                passed: counts.passed.get(),
                replaced: counts.replaced.get(),
                lost: lost.collect(),
            }
        };
        counts.classes().map(class).collect()
    }
}

/// Whether a client takes part.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub enum LinkState {
    /// It has no connection.
    #[default]
    Away,
    /// It has one, and is not registered.
    Joining,
    /// Packages go both ways.
    Up,
}

/// When a client that took part did not.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Outage {
    /// How often that was.
    pub count: u64,
    /// When the last one began, and when it ended if it is over, monotonic ns.
    pub last: Option<(u64, Option<u64>)>,
}

impl Outage {
    /// It takes part.
    pub(crate) fn ends(&mut self, now_ns: u64) {
        if let Some((_, ended @ None)) = &mut self.last {
            *ended = Some(now_ns);
        }
    }

    /// It takes no part any more.
    pub(crate) fn begins(&mut self, now_ns: u64) {
        if self.last.is_none_or(|(_, ended)| ended.is_some()) {
            (self.last, self.count) = (Some((now_ns, None)), self.count + 1);
        }
    }
}

/// A client's link to its server, as the client sees it.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct ClientLink {
    /// Whether it takes part.
    pub state: LinkState,
    /// Why not, as it was last told; empty if it does.
    pub why: String,
    /// Connections so far.
    pub connections: u64,
    /// Shortest recent round trip, ns.
    pub round_trip_ns: Option<u64>,
    /// How far off system time by the server is at most, ns; none if the server does not know it.
    pub time_error_ns: Option<u64>,
    /// Times that it took no part any more.
    pub outage: Outage,
    /// The node's system time, if the server tells it.
    pub time: Option<TimeRecord>,
    /// Bytes of memory that what waits takes up.
    pub waiting_bytes: u64,
    /// What went to the server.
    pub out: Vec<Class>,
    /// What came from it.
    pub inn: Vec<Class>,
}

/// All that the server has to say.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Members {
    /// Connections that are there; of many the first.
    pub members: Vec<MemberSnapshot>,
    /// Connections besides these.
    pub more: u64,
    /// Clients that took part and do not any more.
    pub left: u64,
    /// Connections that were told why they may not take part, or not any more.
    pub refused: u64,
    /// The last of them, and why; empty without one.
    pub refusal: String,
    /// What went beyond the part of one certificate, or one address.
    pub crowded: Crowded,
    /// Packages of those that were lost.
    pub crowded_packages: u64,
    /// Registrations that a later one of the same client took the place of before they were looked at.
    pub superseded: u64,
    /// Lines that were not said one by one, since there were too many of their cause.
    pub held: u64,
    /// What went through.
    pub classes: Vec<Class>,
}

/// A value that one thread replaces, and others read, a few times a second.
#[derive(Debug, Default)]
pub(crate) struct LatestValue<T>(Mutex<T>);

impl<T: Clone> LatestValue<T> {
    pub(crate) fn say(&self, value: T) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = value;
    }

    pub(crate) fn get(&self) -> T {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}
