//! What records say together: which stand, and which objects they are. A function of the records alone, so all robots
//! that have the same records have the same objects, in the same order.

use super::record::{Kept, Kind, Ledger, ObjectId, Record, State};
use crate::ids::{Position, RobotId, Version};
use std::collections::{BTreeMap, BTreeSet};

/// An intruder, as all records together tell of it.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Object {
    /// The least of its records.
    pub id: ObjectId,
    /// Where it is: of the record that none of the others supersedes; of several, the least observer's.
    pub position: Position,
    /// Whether it is there now, as far as anybody can know. A team blocks it then, and searches it else.
    pub certain: bool,
    /// A silent robot that it may be, as long as nobody else has seen it.
    pub may_be: Option<RobotId>,
    /// Whether a station has made it up.
    pub is_fake: bool,
    /// Robots that have records of it.
    pub observers: BTreeSet<RobotId>,
    /// When anybody saw it last, ns of this robot's clock, without the time on the air: an age is at least so great.
    pub seen_ns: u64,
}

/// Newest version of each record that others name, by what those say of it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Standing {
    ended: BTreeMap<ObjectId, Version>,
    empty: BTreeMap<ObjectId, Version>,
    followed: BTreeMap<ObjectId, Version>,
}

impl Standing {
    /// From all ledgers.
    pub(crate) fn of(ledgers: &BTreeMap<RobotId, Ledger>) -> Self {
        let mut standing = Self::default();
        for record in ledgers.values().flat_map(|ledger| ledger.records.values()).map(|kept| &kept.record) {
            let names = match record.state {
                State::Gone => &mut standing.ended,
                State::Empty => &mut standing.empty,
                State::Seen | State::Uncertain => &mut standing.followed,
            };
            for named in &record.names {
                let version = names.entry(named.object).or_default();
                *version = named.version.max(*version);
            }
        }
        standing
    }

    /// What a record says, after what others say of it. A made-up intruder is its station's affair alone.
    pub(crate) fn state(&self, id: ObjectId, record: &Record) -> State {
        let covers = |names: &BTreeMap<ObjectId, Version>| names.get(&id).is_some_and(|named| *named >= record.version);
        match (record.kind, record.state) {
            (Kind::Fake, state) | (_, state @ (State::Empty | State::Gone)) => state,
            _ if covers(&self.ended) => State::Gone,
            _ if covers(&self.empty) => State::Uncertain,
            (_, state) => state,
        }
    }

    /// Records of what exists, by id.
    pub(crate) fn live<'a>(&self, ledgers: &'a BTreeMap<RobotId, Ledger>) -> Vec<Live<'a>> {
        let each = ledgers.iter().flat_map(|(observer, ledger)| {
            ledger.records.iter().map(|(number, kept)| (ObjectId { observer: *observer, number: *number }, kept))
        });
        let live = each.map(|(id, kept)| Live { id, kept, is_certain: self.state(id, &kept.record) == State::Seen });
        live.filter(|live| !matches!(self.state(live.id, &live.kept.record), State::Empty | State::Gone)).collect()
    }

    /// The intruders: records nearer to each other than the gate are one, and so are chains of such.
    pub(crate) fn objects(&self, ledgers: &BTreeMap<RobotId, Ledger>, gate_mm: u64) -> Vec<Object> {
        let mut live = self.live(ledgers);
        live.sort_by_key(|live| live.kept.record.position);
        let mut roots: Vec<usize> = (0..live.len()).collect();
        for (index, first) in live.iter().enumerate() {
            let position = first.kept.record.position;
            let is_near_x =
                |other: &&Live<'_>| u64::from(other.kept.record.position.x_mm.abs_diff(position.x_mm)) <= gate_mm;
            let later = live[index + 1..].iter().take_while(is_near_x).enumerate();
            for (ahead, _) in later.filter(|(_, other)| position.is_within(other.kept.record.position, gate_mm)) {
                let (a, b) = (root(&mut roots, index), root(&mut roots, index + 1 + ahead));
                roots[a.max(b)] = a.min(b);
            }
        }
        let mut parts: BTreeMap<usize, Vec<Live<'_>>> = BTreeMap::new();
        for (index, live) in live.into_iter().enumerate() {
            parts.entry(root(&mut roots, index)).or_default().push(live);
        }
        let mut objects: Vec<Object> = parts.into_values().filter_map(|part| self.object(&part)).collect();
        objects.sort_by_key(|object| object.id);
        objects
    }

    fn object(&self, part: &[Live<'_>]) -> Option<Object> {
        let is_followed =
            |live: &Live<'_>| self.followed.get(&live.id).is_some_and(|version| *version >= live.kept.record.version);
        // Hostile records may follow each other in a circle: then all are followed, and the least one is taken.
        let newest = part.iter().min_by_key(|live| (is_followed(live), !live.is_certain, live.id))?;
        let certain: Vec<&Live<'_>> = part.iter().filter(|live| live.is_certain).collect();
        let seers: BTreeSet<RobotId> = certain.iter().map(|live| live.id.observer).collect();
        let is_stranger = part.iter().any(|live| live.kept.record.may_be.is_none());
        let may_be = part.iter().find_map(|live| live.kept.record.may_be);
        Some(Object {
            id: part.iter().map(|live| live.id).min()?,
            position: newest.kept.record.position,
            certain: seers.len() > 1 || certain.iter().any(|live| live.kept.record.may_be.is_none()),
            may_be: may_be.filter(|_| !is_stranger && seers.len() < 2),
            is_fake: newest.kept.record.kind == Kind::Fake,
            observers: part.iter().map(|live| live.id.observer).collect(),
            seen_ns: part.iter().map(|live| live.kept.seen_ns).max()?,
        })
    }
}

/// A record of what exists.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Live<'a> {
    pub(crate) id: ObjectId,
    pub(crate) kept: &'a Kept,
    pub(crate) is_certain: bool,
}

fn root(roots: &mut [usize], mut at: usize) -> usize {
    while roots[at] != at {
        roots[at] = roots[roots[at]];
        at = roots[at];
    }
    at
}
