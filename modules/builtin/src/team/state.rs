//! What the module publishes of its team.

use rohrpost_modules::interfaces::{
    TeamClock, TeamCounts, TeamMember, TeamNotice, TeamNoticeKind, TeamObject, TeamObjectId, TeamState,
};
use rohrpost_modules::types;
use rohrpost_team::group::{Member, Notice, Pose};
use rohrpost_team::time::Offset;
use rohrpost_team::view::{Object, ObjectId};
use rohrpost_team::{Position, RobotId, Team, Version};
use std::collections::BTreeSet;

/// Bytes of objects that are published: with all members of the largest team they fit a package.
const OBJECTS_BYTES_MAX: usize = 16_384;
/// Most bytes of an object, besides its observers.
const OBJECT_BYTES: usize = 46;
/// Neighbours of members that are published.
const HEARS_MAX: usize = 16_384;
const MILLISECOND_NS: u64 = 1_000_000;

/// What was told last, to tell what is news.
#[derive(Default)]
pub(crate) struct TeamTold {
    /// Since when views differ, ns of the robot's clock.
    differs_since_ns: Option<u64>,
    fresh: BTreeSet<RobotId>,
    /// Numbers of the hellos with which that changed last, and equality of views.
    settled: u32,
    views_settled: u32,
    notices: BTreeSet<Notice>,
}

impl TeamTold {
    /// Notes since when it is as it is now, and writes what has changed to the log. Leader and group follow from the
    /// fresh robots.
    fn note(&mut self, team: &Team, now_ns: u64, fresh: &BTreeSet<RobotId>) {
        let (group, agrees) = (team.group(), team.agrees(now_ns));
        if agrees != self.differs_since_ns.is_none() {
            self.views_settled = group.version().counter;
        }
        self.differs_since_ns = if agrees { None } else { self.differs_since_ns.or(Some(now_ns)) };
        if self.fresh != *fresh {
            self.fresh.clone_from(fresh);
            self.settled = group.version().counter;
            let (leader, name) = (group.leader(now_ns), group.group(now_ns));
            tracing::info!("robot {leader} leads group {name} of {} robots", fresh.len() + 1);
        }
        for notice in group.notices().difference(&self.notices) {
            match notice {
                Notice::Duplicate(robot) => tracing::warn!("two robots have the number {robot}; change one's `id`"),
                Notice::OtherTree(robot) => {
                    tracing::warn!("robot {robot} has another tree of events; its events are refused");
                }
                Notice::OtherMap(robot) => {
                    tracing::warn!("robot {robot} has another map; what it sees is not taken over")
                }
                Notice::ClockOff(robot) => tracing::warn!("robot {robot}'s clock is far from this robot's"),
            }
        }
        if self.notices != *group.notices() {
            self.notices.clone_from(group.notices());
        }
    }
}

/// The team as a robot knows it now.
pub(crate) fn of(
    team: &Team,
    now_ns: u64,
    pose: Option<Pose>,
    beat_ms: u32,
    counts: TeamCounts,
    told: &mut TeamTold,
) -> TeamState {
    let (group, version) = (team.group(), team.group().version());
    let fresh: BTreeSet<RobotId> = group.fresh(now_ns).map(|(robot, _)| robot).collect();
    told.note(team, now_ns, &fresh);
    let heard: BTreeSet<RobotId> = group.heard(now_ns).map(|(robot, _)| robot).collect();
    let mut room = HEARS_MAX;
    let members = group.members().map(|(robot, member)| TeamMember {
        fresh: fresh.contains(&robot),
        direct: heard.contains(&robot),
        clock: team.neighbour_clock(now_ns, robot).map(clock),
        ..self::member(now_ns, robot, member, &mut room)
    });
    let objects = team.view().objects();
    let published = fitting(&objects);
    TeamState {
        robot: group.me().get(),
        incarnation: version.incarnation,
        counter: version.counter,
        beat_ms,
        pose: pose.map(metres),
        map: team.view().map(),
        leader: group.leader(now_ns).get(),
        group: group.group(now_ns).get(),
        differs_ms: told.differs_since_ns.map(|since_ns| ms(now_ns, since_ns)),
        settled: told.settled,
        views_settled: told.views_settled,
        digests: team.view().digests().to_vec(),
        team_clock: team.team_clock(now_ns).map(clock),
        members: members.collect(),
        notices: group.notices().iter().copied().map(notice).collect(),
        objects: published.iter().map(|it| object(team, now_ns, it)).collect(),
        more_objects: (objects.len() - published.len()) as u32,
        counts,
    }
}

/// The first objects, as many as are published.
fn fitting(objects: &[Object]) -> &[Object] {
    let mut bytes = 0;
    let fits = |object: &&Object| {
        bytes += OBJECT_BYTES + object.observers.len();
        bytes <= OBJECTS_BYTES_MAX
    };
    &objects[..objects.iter().take_while(fits).count()]
}

fn member(now_ns: u64, robot: RobotId, member: &Member, room: &mut usize) -> TeamMember {
    let direct = member.direct.as_ref();
    let hears = direct.map(|direct| &direct.hears[..]).filter(|hears| hears.len() <= *room).unwrap_or_default();
    *room -= hears.len();
    TeamMember {
        robot: robot.get(),
        incarnation: member.version.incarnation,
        counter: member.version.counter,
        silent_ms: ms(now_ns, member.sent_ns),
        hops: member.hops,
        agrees: member.agrees,
        hears: hears.iter().map(|robot| robot.get()).collect(),
        pose: member.last_pose.map(|(pose, _)| metres(pose)),
        pose_age_ms: member.last_pose.map_or(0, |(_, heard_ns)| ms(now_ns, heard_ns)),
        ..TeamMember::default()
    }
}

fn object(team: &Team, now_ns: u64, object: &Object) -> TeamObject {
    let Position { x_mm, y_mm } = object.position;
    TeamObject {
        id: object_id(object.id),
        x_m: f64::from(x_mm) / 1000.0,
        y_m: f64::from(y_mm) / 1000.0,
        certain: object.certain,
        fake: object.is_fake,
        may_be: team.suspicion(now_ns, object).map(|suspicion| suspicion.robot.get()),
        observers: object.observers.iter().map(|robot| robot.get()).collect(),
        seen_ms: ms(now_ns, object.seen_ns),
    }
}

fn ms(now_ns: u64, since_ns: u64) -> u64 {
    now_ns.saturating_sub(since_ns) / MILLISECOND_NS
}

fn clock(Offset { offset_ns, bound_ns }: Offset) -> TeamClock {
    TeamClock { offset_ns, bound_ns }
}

fn metres(pose: Pose) -> types::Pose {
    let Pose { position: Position { x_mm, y_mm }, heading_mrad, .. } = pose;
    types::Pose {
        x_m: f64::from(x_mm) / 1000.0,
        y_m: f64::from(y_mm) / 1000.0,
        heading_rad: f64::from(heading_mrad) / 1000.0,
    }
}

fn notice(notice: Notice) -> TeamNotice {
    let (robot, kind) = match notice {
        Notice::Duplicate(robot) => (robot, TeamNoticeKind::DuplicateId),
        Notice::OtherMap(robot) => (robot, TeamNoticeKind::OtherMap),
        Notice::OtherTree(robot) => (robot, TeamNoticeKind::OtherTree),
        Notice::ClockOff(robot) => (robot, TeamNoticeKind::ClockOff),
    };
    TeamNotice { robot: robot.get(), kind }
}

pub(crate) fn object_id(ObjectId { observer, number }: ObjectId) -> TeamObjectId {
    TeamObjectId { observer: observer.get(), incarnation: number.incarnation, number: number.counter }
}

/// `None` if its observer is no robot's number.
pub(crate) fn core_id(id: TeamObjectId) -> Option<ObjectId> {
    let number = Version { incarnation: id.incarnation, counter: id.number };
    RobotId::new(id.observer).map(|observer| ObjectId { observer, number })
}

/// A place in whole millimetres; `None` beyond 1000 km, and of what is no number.
pub(crate) fn position(x_m: f64, y_m: f64) -> Option<Position> {
    let mm = |metres: f64| (metres.abs() <= 1e6).then(|| (metres * 1000.0).round() as i32);
    Some(Position { x_mm: mm(x_m)?, y_mm: mm(y_m)? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_team::TeamSettings;
    use rohrpost_team::group::GroupSettings;
    use rohrpost_team::view::ViewSettings;

    const BEAT_NS: u64 = 500 * MILLISECOND_NS;

    fn team(system: u8) -> Team {
        let view = ViewSettings {
            gate_mm: 500,
            sightings: 1,
            certainty_max_age_ns: 10 * BEAT_NS,
            intruder_max_age_ns: 20 * BEAT_NS,
            friend_max_age_ns: 60 * BEAT_NS,
            friend_radius_mm: 300,
            speed_max_mm_s: 1000,
        };
        let group = GroupSettings { beat_ns: BEAT_NS, max_age_ns: 2 * BEAT_NS };
        let settings = TeamSettings { group, view, drift_ppb: 100_000, clock_off_ns: 1_000_000_000 };
        Team::new(RobotId::new(system).unwrap(), 1, 7, settings)
    }

    #[test]
    fn a_state_tells_since_when_it_is_as_it_is() {
        let (mut one, mut two, mut told) = (team(1), team(2), TeamTold::default());
        let mut beat = |now_ns, one: &mut Team, other: Option<&mut Team>| {
            let pose = Pose { position: Position { x_mm: 1500, y_mm: -20 }, ..Pose::default() };
            one.beat(now_ns, Some(pose));
            if let Some(other) = other {
                one.hear_hello(now_ns, &other.beat(now_ns, Some(pose)).hello);
            }
            of(one, now_ns, Some(pose), 500, TeamCounts::default(), &mut told)
        };
        let alone = beat(0, &mut one, None);
        assert_eq!((alone.leader, alone.group, alone.settled, alone.members.len()), (1, 1, 0, 0));
        two.add_fake(0, Position { x_mm: 4000, y_mm: 0 });
        let differs = beat(BEAT_NS, &mut one, Some(&mut two));
        assert_eq!((differs.leader, differs.group, differs.settled, differs.differs_ms), (1, 2, 2, Some(0)));
        assert_eq!(differs.members[0].pose.map(|pose| (pose.x_m, pose.y_m)), Some((1.5, -0.02)));
        let still = beat(2 * BEAT_NS, &mut one, Some(&mut two));
        assert_eq!((still.settled, still.views_settled, still.differs_ms), (2, 2, Some(500)));
        let gone = beat(5 * BEAT_NS, &mut one, None);
        assert_eq!(
            (gone.group, gone.settled, gone.differs_ms),
            (1, 4, None),
            "a robot that is gone differs from nobody"
        );
        assert_eq!((gone.members[0].fresh, gone.members[0].silent_ms), (false, 1500));
    }

    #[test]
    fn as_many_objects_are_told_as_fit_a_package() {
        let mut one = team(1);
        for number in 0..32 {
            one.add_fake(0, Position { x_mm: 10_000 * number, y_mm: 0 });
        }
        let objects = one.view().objects();
        assert_eq!((objects.len(), fitting(&objects).len()), (32, 32));
        let crowded: Vec<Object> = (0..20).flat_map(|_| objects.clone()).collect();
        assert_eq!(fitting(&crowded).len(), OBJECTS_BYTES_MAX / (OBJECT_BYTES + 1));
        assert_eq!((position(1e6, 0.0).is_some(), position(1.1e6, 0.0), position(f64::NAN, 0.0)), (true, None, None));
        let id = objects[3].id;
        assert_eq!(core_id(object_id(id)), Some(id));
        assert_eq!(core_id(TeamObjectId::default()), None, "0 is no robot");
    }
}
