//! A stamped record, and why a stream does not take one.

use thiserror::Error;

/// When something was true, in system time. Times of two epochs cannot be subtracted; a later epoch has the larger
/// number.
///
/// ```
/// use rohrpost_fusion::Stamp;
/// assert_eq!(Stamp::new(1, 70).since(Stamp::new(1, 20)), Some(50));
/// assert_eq!(Stamp::new(2, 70).since(Stamp::new(1, 20)), None);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Stamp {
    /// Which stretch of system time between two steps of it.
    pub epoch: u64,
    /// Nanoseconds since 1970, as that epoch counts them.
    pub ns: u64,
}

impl Stamp {
    /// A time of an epoch.
    pub const fn new(epoch: u64, ns: u64) -> Self {
        Self { epoch, ns }
    }

    /// Nanoseconds from an earlier time to this one; none if that is a later one, or of another epoch.
    pub fn since(self, earlier: Self) -> Option<u64> {
        if self.epoch == earlier.epoch { self.ns.checked_sub(earlier.ns) } else { None }
    }
}

/// A value, when it was true, and its number in its stream. Records of one stamp are ordered by their numbers, which
/// the writer gives: one more for each record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record<V> {
    /// When the value was true.
    pub stamp: Stamp,
    /// Which of its stream.
    pub sequence: u64,
    /// What was true.
    pub value: V,
}

/// Why a stream does not take a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Refused {
    /// Behind the newest record by the lateness bound or more: answers were given as if it did not exist.
    #[error("{by_ns} ns behind the newest record; a lateness bound above that would take it (it is {lateness_ns} ns)")]
    Late {
        /// From it to the newest record.
        by_ns: u64,
        /// The bound.
        lateness_ns: u64,
    },
    /// The stream has gone on to a later epoch.
    #[error("it is of epoch {epoch}, and the stream has gone on to epoch {newest}")]
    EarlierEpoch {
        /// That of the record.
        epoch: u64,
        /// That of the newest record.
        newest: u64,
    },
    /// The stamp is taken by a record with this number, or by a later one that answered already.
    #[error("record {sequence} comes after record {known} with the same stamp; a writer numbers its records upwards")]
    Repeated {
        /// That of the record.
        sequence: u64,
        /// That of the one that is known.
        known: u64,
    },
}
