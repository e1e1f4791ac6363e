//! Teams of the very core, as they begin.

use super::super::group::{GroupSettings, Hello};
use super::super::view::{Records, ViewSettings};
use super::super::{Position, Team, TeamSettings};
use super::bounds::{Bounds, Story};
use super::key::{ROBOTS, id};
use super::world::{BEAT_NS, State};

/// ROBOT_MAX_AGE: a single lost hello is enough to be taken for dead.
pub(crate) const MAX_AGE_BEATS: u64 = 1;
/// Of a robot's first run: two stores are older.
const INCARNATION: u32 = 2;
pub(super) const MAP: u64 = 7;
/// Lonely beats before robots meet: more than gaps between counters that the key tells apart.
const ALONE: u64 = 7;
/// Where intruders are.
const FIRST: Position = Position { x_mm: 0, y_mm: 0 };
const LATER: Position = Position { x_mm: 9000, y_mm: 0 };

pub(super) fn settings() -> TeamSettings {
    let never_ns = u64::MAX;
    let view = ViewSettings {
        gate_mm: 500,
        sightings: 1,
        certainty_max_age_ns: never_ns,
        intruder_max_age_ns: never_ns,
        friend_max_age_ns: never_ns,
        friend_radius_mm: 300,
        speed_max_mm_s: 0,
    };
    let group = GroupSettings { beat_ns: BEAT_NS, max_age_ns: MAX_AGE_BEATS * BEAT_NS };
    TeamSettings { group, view, drift_ppb: 0, clock_off_ns: never_ns }
}

/// What a robot sends.
#[derive(Clone, Debug)]
pub(crate) enum Message {
    Hello(Hello),
    Records(Records),
}

/// Robots that have each been alone for a while, `alone` beats and those that the key asks for, and hear each other
/// now.
pub(crate) fn begun(left: Bounds, epoch_ns: u64, alone: u64) -> State<Team> {
    let now_ns = |place: usize, round: u64| epoch_ns * (place as u64 + 1) + round * BEAT_NS;
    let mut robots: [Team; ROBOTS] = std::array::from_fn(|place| Team::new(id(place), INCARNATION, MAP, settings()));
    let made_up = match left.story {
        Story::Nothing => None,
        Story::Ended => Some(robots[2].add_fake(now_ns(2, 0), FIRST)),
        Story::Unheard | Story::Refuted => {
            robots[2].look(now_ns(2, 0), &[FIRST], |_| false);
            None
        }
    };
    let told = robots[2].beat(now_ns(2, 0), None).objects;
    if let Some(told) = told.filter(|_| left.story != Story::Unheard) {
        (0..2).for_each(|place| robots[place].hear_records(now_ns(place, 0), told.clone()));
    }
    if left.story == Story::Refuted {
        robots[0].look(now_ns(0, 0), &[], |place| place == FIRST);
    }
    if let Some(made_up) = made_up {
        robots[2].end_fake(now_ns(2, 0), made_up);
    }
    let begin = ALONE + alone;
    for (place, robot) in robots.iter_mut().enumerate() {
        (1..begin).for_each(|round| drop(robot.beat(now_ns(place, round), None)));
    }
    if left.story == Story::Unheard {
        robots[2].look(now_ns(2, begin), &[LATER], |_| false);
    }
    State::new(robots, epoch_ns, begin, left)
}

/// Whether a robot is certain of the first intruder.
pub(crate) fn is_certain(team: &Team) -> bool {
    team.view().objects().iter().any(|object| object.position == FIRST && object.certain)
}

/// Whether it knows that the first intruder's observer has ended it, or another robot has seen it gone.
pub(crate) fn knows_its_end(team: &Team) -> bool {
    team.view().ledgers().values().flat_map(|ledger| ledger.records.values()).any(|kept| kept.record.is_ended())
}
