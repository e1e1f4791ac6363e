//! What must hold of one robot's view: no friend that was heard lately is an intruder.

use rohrpost_arena::Arena;
use rohrpost_team::view::{Kind, State};
use rohrpost_team::{Position, RobotId, Team, Version};
use std::collections::BTreeMap;
use std::fmt;

/// A record so near to an intruder is of that, metres: the gate of the view, and how far it moves meanwhile.
const INTRUDER_M: f64 = 1.2;
/// A record so near to a robot is of that, metres.
const ROBOT_M: f64 = 0.5;

/// A friend that a robot has taken for an intruder.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mistake {
    pub(crate) friend: RobotId,
    at: Position,
    heard_ago_ns: u64,
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { friend, at: Position { x_mm, y_mm }, heard_ago_ns } = self;
        write!(f, "robot {friend} at {x_mm} mm, {y_mm} mm, heard {} ms before", heard_ago_ns / 1_000_000)
    }
}

/// Looks at each own record once.
#[derive(Clone, Debug, Default)]
pub(crate) struct Watch {
    newest: Version,
    /// Friends that had told their places at the last look, and when: what was seen since, was seen with them known.
    known: BTreeMap<RobotId, u64>,
}

impl Watch {
    /// A friend that a new record of this robot calls an intruder, though it was heard within `max_age_ns`.
    pub(crate) fn look(&mut self, arena: &Arena, team: &Team, now_ns: u64, max_age_ns: u64) -> Option<Mistake> {
        let me = team.group().me();
        let own = team.view().ledgers().get(&me)?;
        let records = own.records.values().map(|kept| &kept.record).filter(|record| record.version > self.newest);
        let seen = records.clone().filter(|record| record.state == State::Seen && record.kind == Kind::Intruder);
        let mistake = seen.map(|record| record.position).find_map(|at| {
            let apart_m = |x_m: f64, y_m: f64| (f64::from(at.x_mm) * 1e-3 - x_m).hypot(f64::from(at.y_mm) * 1e-3 - y_m);
            if arena.intruders().any(|disc| apart_m(disc.x_m, disc.y_m) < INTRUDER_M) {
                return None;
            }
            self.known.iter().find_map(|(friend, heard_ns)| {
                let (friend, pose) = (*friend, arena.moment(*friend)?.pose);
                let heard_ago_ns = now_ns.saturating_sub(*heard_ns);
                let is_it = apart_m(pose.x_m, pose.y_m) < ROBOT_M && heard_ago_ns < max_age_ns;
                is_it.then_some(Mistake { friend, at, heard_ago_ns })
            })
        });
        let told = team.group().members().filter_map(|(friend, member)| Some((friend, member.last_pose?.1)));
        self.known = told.collect();
        self.newest = records.map(|record| record.version).fold(self.newest, Version::max);
        mistake
    }
}
