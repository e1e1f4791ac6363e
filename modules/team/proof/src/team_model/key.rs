//! What the future of a state depends on, as one number: states of equal keys are the same to the checker.
//!
//! The states themselves are never reduced: each is one that the very core can reach. What a key leaves out has no
//! influence on what the robots do:
//!
//! - *The origin of each clock*: the core subtracts and compares times of one clock, and nothing else. Ages beyond the
//!   one at which a robot is not fresh any more are alike.
//! - *The counters of hellos*: those of one run of a robot are compared with each other, and a run begins at 0. So the
//!   order counts, and gaps up to [`GAP_MAX`]: a run that has lost its store meets its earlier counters before it has
//!   counted so far.
//! - *Offsets of clocks*: they are told to people, and change neither group nor view (`time` is not in the model).
//! - *Ages of records*: the model's objects do not age.
//! - *The observer with which the last synchro ended*: the next one begins behind it, which counts only where a synchro
//!   is cut; the model's have room for all.
//! - *Names*: robots without records do the same whatever their ids are: nothing that one sends or decides follows
//!   from an order of ids, and the promises about them name no id. They begin alike. So states are alike in which
//!   robots have only changed places, and their key is the least of those of all [`NAMINGS`].
//!
//! `walk.rs` tests that states of one key go on to states of one key, and that robots that have changed places go on as
//! the others do.

use super::super::{RobotId, Version};
use std::hash::{DefaultHasher, Hash, Hasher};

/// Robots of the model.
pub(crate) const ROBOTS: usize = 3;

/// Gaps between counters of one run that are told apart.
const GAP_MAX: u32 = 5;

#[derive(Hash)]
enum Item {
    Plain(u64),
    Version(RobotId, Version),
}

/// For each place the one of which its robot has the name.
pub(crate) type Naming = [usize; ROBOTS];

/// All ways to name robots; in the first one each has its own name.
pub(crate) const NAMINGS: [Naming; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// Collects what counts.
pub(crate) struct Key {
    items: Vec<Item>,
    naming: Naming,
}

impl Key {
    pub(crate) fn of(naming: Naming) -> Self {
        Self { items: Vec::new(), naming }
    }

    /// All robots, in the order of their names.
    pub(crate) fn robots(&self) -> impl Iterator<Item = RobotId> + use<> {
        let naming = self.naming;
        let mut places: [usize; ROBOTS] = std::array::from_fn(|place| place);
        places.sort_unstable_by_key(|place| naming[*place]);
        places.into_iter().map(id)
    }

    /// The name of a robot.
    pub(crate) fn name(&self, robot: RobotId) -> RobotId {
        id(self.naming[usize::from(robot.get()) - 1])
    }

    pub(crate) fn plain(&mut self, value: impl Into<u64>) {
        self.items.push(Item::Plain(value.into()));
    }

    /// What is compared for equality only, or is one of few.
    pub(crate) fn hash(&mut self, value: &(impl Hash + ?Sized)) {
        self.items.push(Item::Plain(hash_of(value)));
    }

    /// Incarnation and counter of a hello of this robot.
    pub(crate) fn version(&mut self, of: RobotId, version: Version) {
        self.items.push(Item::Version(self.name(of), version));
    }

    /// Of states with one past: their counters are of one count.
    pub(crate) fn exact(&self) -> u64 {
        hash_of(&self.items)
    }

    pub(crate) fn finish(&self) -> u64 {
        let numbers = self.renumbered();
        let mut hasher = DefaultHasher::new();
        for item in &self.items {
            match item {
                Item::Plain(value) => value.hash(&mut hasher),
                Item::Version(robot, version) => {
                    let found = numbers.binary_search_by_key(&(*robot, *version), |(robot, it, _)| (*robot, *it));
                    let number = found.map_or(0, |at| numbers[at].2);
                    (robot, version.incarnation, number).hash(&mut hasher);
                }
            }
        }
        hasher.finish()
    }

    /// Each version with a number in the place of its counter: in the same order, with smaller gaps; 0 stays.
    fn renumbered(&self) -> Vec<(RobotId, Version, u32)> {
        let version = |item: &Item| if let Item::Version(robot, it) = item { Some((*robot, *it, 0)) } else { None };
        let mut numbers: Vec<_> = self.items.iter().filter_map(version).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let mut last = None;
        for (robot, version, number) in &mut numbers {
            let run = (*robot, version.incarnation);
            let (counter, before) = match last {
                Some((last_run, counter, number)) if last_run == run => (counter, number),
                _ => (0, 0),
            };
            *number = before + (version.counter - counter).min(GAP_MAX);
            last = Some((run, version.counter, *number));
        }
        numbers
    }
}

/// The robot at a place.
pub(crate) fn id(place: usize) -> RobotId {
    RobotId::new(place as u8 + 1).expect("robots 1 to 3")
}

pub(crate) fn hash_of(value: &(impl Hash + ?Sized)) -> u64 {
    let mut hasher = DefaultHasher::new();
    value.hash(&mut hasher);
    hasher.finish()
}
