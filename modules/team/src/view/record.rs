//! Records: what one observer says of one object, and the ledger of all that an observer says.

use crate::ids::{Position, RobotId, Version};
use std::collections::BTreeMap;

/// Records that an observer has at one time, ended ones included.
pub const RECORDS_MAX: usize = 32;
/// Records of others that one record names.
pub const NAMES_MAX: usize = 8;

/// An object of one observer: the observer, and the version of its first sighting there.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct ObjectId {
    /// The robot that saw it first, or the station that made it.
    pub observer: RobotId,
    /// Version at which the observer first said so.
    pub number: Version,
}

/// What kind of thing a record is about.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Kind {
    /// Something that moves and is no robot of the team.
    Intruder,
    /// An intruder that a station made up: only the station ends it.
    Fake,
}

/// What the observer says.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum State {
    /// It is there.
    Seen,
    /// It was there; nobody is certain that it still is.
    Uncertain,
    /// The observer sees an empty place where the named records say that something is.
    Empty,
    /// It, and what the named records say, has ended.
    Gone,
}

/// Another observer's record, at the version that was known, and at all earlier ones.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Named {
    /// Which record.
    pub object: ObjectId,
    /// Its newest version that is superseded.
    pub version: Version,
}

/// What an observer says of an object. Compared by version first; the rest makes the order total even if an observer
/// that lost its store uses a version twice.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Record {
    /// The observer's version of this record.
    pub version: Version,
    /// What it says.
    pub state: State,
    /// Of what kind of thing.
    pub kind: Kind,
    /// Where.
    pub position: Position,
    /// It may be this robot, which is silent: certain only once a second robot has seen it.
    pub may_be: Option<RobotId>,
    /// What it supersedes: at most [`NAMES_MAX`].
    pub names: Vec<Named>,
}

impl Record {
    /// Whether it says of no object that it exists.
    pub fn is_ended(&self) -> bool {
        matches!(self.state, State::Empty | State::Gone)
    }
}

/// A record with what is known of its age here, which others need not know.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Kept {
    /// The record.
    pub record: Record,
    /// When the thing was last seen, ns of this robot's clock; the time on the air is not taken off.
    pub seen_ns: u64,
}

/// All that one observer says, as far as it is known here.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Default)]
pub struct Ledger {
    /// The observer has forgotten each record below.
    pub floor: Version,
    /// By number.
    pub records: BTreeMap<Version, Kept>,
}

impl Ledger {
    /// Takes over what is newer in the other one: the least ledger that has both. True if anything was.
    ///
    /// An honest observer's ledgers never have more than [`RECORDS_MAX`] records together; what is beyond is refused.
    pub(crate) fn join(&mut self, other: &Self) -> bool {
        let mut has_changed = self.raise_floor(other.floor);
        for (number, kept) in &other.records {
            let is_room = self.records.len() < RECORDS_MAX;
            match self.records.get_mut(number) {
                // Ages leave out the time on the air: of two, the greater one is nearer to the truth.
                Some(known) if known.record == kept.record => known.seen_ns = known.seen_ns.min(kept.seen_ns),
                Some(known) if known.record > kept.record => {}
                None if !is_room || kept.record.version < self.floor => {}
                _ => {
                    self.records.insert(*number, kept.clone());
                    has_changed = true;
                }
            }
        }
        has_changed
    }

    /// Forgets all records below. True if the floor was lower.
    pub(crate) fn raise_floor(&mut self, floor: Version) -> bool {
        let is_higher = floor > self.floor;
        if is_higher {
            self.floor = floor;
            self.records.retain(|_, kept| kept.record.version >= floor);
        }
        is_higher
    }
}
