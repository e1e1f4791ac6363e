//! What is counted of replicas: records by what became of them, and parts that were not taken, by cause.

use crate::counts::Count;
use crate::frame::NodeIndex;
use crate::latencies::Latencies;
use std::sync::Arc;

rohrpost_mailbox::causes! {
    /// Why a record, or a part of one, is not in a replica.
    pub enum ReplicaLoss {
        /// Sender, records: left out, as configuration wants it.
        Sampled = "sampled",
        /// Sender, records: newer ones were written faster than the wire carries them.
        Passed = "passed",
        /// Sender, records: the node that has the replica was not there.
        Absent = "absent",
        /// Sender, requests: of a record that newer ones have overwritten.
        Overwritten = "overwritten",
        /// Sender, requests: of a record that was not sent to that node, or long ago.
        NotSent = "not-sent",
        /// Sender, requests: of parts that the record does not have.
        OutOfRange = "out-of-range",
        /// Sender, parts: asked for again and again.
        Exhausted = "exhausted",
        /// Sender, requests: that node asks faster than it is answered.
        Crowded = "crowded",
        /// Receiver, records: a part of it, or all, never came.
        Incomplete = "incomplete",
        /// Receiver, parts: of a record that came before, whole.
        Duplicate = "duplicate",
        /// Receiver, parts: of a record that is older than the newest and not waited for any more.
        Late = "late",
        /// Receiver, parts: from a node that does not write the stream.
        Foreign = "foreign",
        /// Receiver, parts: the description of the module is not known yet, or names no such stream.
        Undescribed = "undescribed",
        /// Receiver, parts: of a record larger than the stream's records.
        TooLarge = "too-large",
        /// Receiver, parts: not where a part of the record begins, of another length, or without a stamp, or of a
        /// sequence that no stream comes to.
        Unsound = "unsound",
        /// Receiver, parts: the replica cannot be written here.
        Unwritable = "unwritable",
    }
}

/// Losses by cause.
#[derive(Debug, Default)]
pub struct ReplicaLosses([Count; ReplicaLoss::ALL.len()]);

impl ReplicaLosses {
    /// How many for a cause.
    pub fn of(&self, cause: ReplicaLoss) -> u64 {
        self.0[cause as usize].get()
    }

    /// Each cause is counted by one thread alone.
    pub(super) fn add(&self, cause: ReplicaLoss, more: u64) {
        self.0[cause as usize].add(more);
    }
}

/// A replica that is sent to a node.
#[derive(Debug, Default)]
pub struct SentReplica {
    /// Its place in the configuration.
    pub place: u16,
    /// The node that has it.
    pub to: NodeIndex,
    /// Records of which all parts left.
    pub records: Count,
    /// Bytes of these records.
    pub bytes: Count,
    /// Parts that were sent again, since that node asked for them.
    pub again: Count,
    /// What did not leave.
    pub lost: ReplicaLosses,
}

impl SentReplica {
    pub(super) fn new(place: u16, to: NodeIndex) -> Self {
        Self { place, to, ..Self::default() }
    }
}

/// A replica that this node has.
#[derive(Debug, Default)]
pub struct ReceivedReplica {
    /// Its place in the configuration.
    pub place: u16,
    /// Records that came whole.
    pub records: Count,
    /// Bytes of these records.
    pub bytes: Count,
    /// Sequences that were passed over: with them the stream says to its readers what they lost. Causes of the sender
    /// and of the receiver are among them.
    pub gaps: Count,
    /// Parts that were asked for, as often as they were.
    pub asked: Count,
    /// Records that are whole since parts were asked for.
    pub completed: Count,
    /// From writing to arrival, by system time, where both ends know it.
    pub delay: Latencies,
    /// Records that came later than the delay alarm allows.
    pub delayed: Count,
    /// What did not become a record.
    pub lost: ReplicaLosses,
}

impl ReceivedReplica {
    pub(super) fn new(place: u16) -> Self {
        Self { place, ..Self::default() }
    }
}

/// Counters of all replicas of a node.
#[derive(Debug, Default)]
pub struct ReplicaCounts {
    /// Those that it sends, by node.
    pub sent: Vec<Arc<SentReplica>>,
    /// Those that it has.
    pub received: Vec<Arc<ReceivedReplica>>,
}
