//! Replicas of one end of sessions: what it needs for them, and what it shows.

use crate::counts::Count;
use crate::replication::{Describe, LineReplicas, LineSettings, MeasuredRoundTrip, OneWayClock, ReplicaCounts};
use rohrpost_mailbox::{Node, Participant};
use std::sync::Arc;

/// What an end needs for its replicas.
pub struct LineParts {
    /// Which.
    pub settings: LineSettings,
    /// Reads descriptions.
    pub describe: Arc<Describe>,
}

impl LineParts {
    /// For the thread of a participant. The clock of its node was measured by this round trip.
    pub(super) fn start(
        self,
        node: &Arc<Node>,
        participant: Arc<Participant>,
        round_trip: MeasuredRoundTrip,
    ) -> LineReplicas {
        let clock = OneWayClock::open(node, round_trip);
        LineReplicas::new(&self.settings, participant, self.describe, Box::new(move |ns| clock.at(ns)))
    }
}

/// Counters of the replicas of an end.
#[derive(Debug, Default)]
pub struct LineCounts {
    /// Those of each replica.
    pub replicas: ReplicaCounts,
    /// Parts that came of replicas that this end has not.
    pub unknown: Arc<Count>,
}

impl LineCounts {
    pub(super) fn of(replicas: Option<&LineReplicas>) -> Self {
        replicas.map_or_else(Self::default, |replicas| Self {
            replicas: replicas.counts(),
            unknown: replicas.unknown().clone(),
        })
    }
}
