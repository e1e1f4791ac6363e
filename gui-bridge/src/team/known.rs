//! What is known of all robots of a team, whatever module of whatever system told it. Nothing here draws.

use crate::palette::{self, Rgb};
use rohrpost::interfaces::{
    ArenaIncident, ArenaIntruder, ArenaRobot, ControlMode, ControlState, PayloadExit, PayloadMode, PayloadState,
    TeamMember, TeamObject, TeamObjectId, TeamState,
};
use rohrpost::types::Pose;
use std::collections::BTreeMap;

/// A report that is older says nothing of now, ns: six beats of half a second.
const REPORT_MAX_AGE_NS: u64 = 3_000_000_000;
/// A robot is believed so near to its true place, m.
const BELIEF_M: f64 = 0.3;
/// Marks of incidents that stay; later ones are lines of text only.
const MARKS_MAX: usize = 1000;

/// A report, and when it came.
pub(crate) struct Report<T> {
    at_ns: u64,
    pub(crate) of: T,
}

/// What teammates say of a robot.
struct Heard {
    /// When that was said.
    at_ns: u64,
    /// When its newest hello came to any of them.
    hello_ns: u64,
    fresh: bool,
    pose: Option<Pose>,
    group: u8,
    leader: u8,
}

/// What a robot does.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Doing {
    Mode(PayloadMode),
    Lost,
    /// The program has missed a deadline, and the wormhole drives in its place.
    WormholeDrives,
    /// The program does not drive, and nothing else does.
    NobodyDrives,
    Silent,
}

/// A robot, by all that was told of it.
#[derive(Default)]
pub(crate) struct KnownRobot {
    pub(crate) team: Option<Report<TeamState>>,
    pub(crate) payload: Option<Report<PayloadState>>,
    control: Option<ControlState>,
    /// As it really is.
    pub(crate) body: Option<ArenaRobot>,
    heard: Option<Heard>,
}

/// All robots of all teams, and what is told of the floor on which they drive.
#[derive(Default)]
pub(crate) struct TeamWorld {
    pub(crate) robots: BTreeMap<u8, KnownRobot>,
    pub(crate) bodies: Vec<ArenaIntruder>,
    pub(crate) marks: Vec<ArenaIncident>,
}

impl<T> Report<T> {
    fn is_current(&self, now_ns: u64) -> bool {
        now_ns.saturating_sub(self.at_ns) <= REPORT_MAX_AGE_NS
    }
}

fn current<T>(report: Option<&Report<T>>, now_ns: u64) -> Option<&T> {
    report.filter(|report| report.is_current(now_ns)).map(|report| &report.of)
}

fn is_place(x_m: f64, y_m: f64) -> bool {
    x_m.is_finite() && y_m.is_finite()
}

fn placed(pose: &Pose) -> bool {
    is_place(pose.x_m, pose.y_m) && pose.heading_rad.is_finite()
}

impl Doing {
    pub(crate) const fn word(self) -> &'static str {
        match self {
            Self::Mode(PayloadMode::Wandering) => "wandering",
            Self::Mode(PayloadMode::Searching) => "searching",
            Self::Mode(PayloadMode::Blocking) => "blocking",
            Self::Lost => "LOST",
            Self::WormholeDrives => "wormhole drives",
            Self::NobodyDrives => "nobody drives",
            Self::Silent => "silent",
        }
    }

    pub(crate) const fn colour(self) -> Rgb {
        match self {
            Self::Mode(PayloadMode::Wandering) => palette::WANDERING,
            Self::Mode(PayloadMode::Searching) => palette::SEARCHING,
            Self::Mode(PayloadMode::Blocking) => palette::BLOCKING,
            Self::Lost => palette::LOST,
            Self::WormholeDrives | Self::NobodyDrives => palette::NOT_ITS_PROGRAM,
            Self::Silent => palette::AID,
        }
    }
}

impl KnownRobot {
    /// What it says of its team, if that is of now.
    pub(crate) fn team_now(&self, now_ns: u64) -> Option<&TeamState> {
        current(self.team.as_ref(), now_ns)
    }

    pub(crate) fn payload_now(&self, now_ns: u64) -> Option<&PayloadState> {
        current(self.payload.as_ref(), now_ns)
    }

    fn heard_now(&self, now_ns: u64) -> Option<&Heard> {
        self.heard.as_ref().filter(|heard| heard.fresh && now_ns.saturating_sub(heard.at_ns) <= REPORT_MAX_AGE_NS)
    }

    /// For how long nothing came of it, ns; `None` of a robot that is there.
    pub(crate) fn silent_ns(&self, now_ns: u64) -> Option<u64> {
        let is_there = self.team_now(now_ns).is_some() || self.heard_now(now_ns).is_some();
        let told = self.team.as_ref().map(|report| report.at_ns);
        let last = told.max(self.heard.as_ref().map(|heard| heard.hello_ns))?;
        (!is_there).then(|| now_ns.saturating_sub(last))
    }

    /// Where it is: truly, if that is told, else as it believes, else as teammates heard it last.
    pub(crate) fn pose(&self) -> Option<Pose> {
        let body = self.body.map(|body| body.pose).filter(placed);
        body.or_else(|| self.believed()).or_else(|| self.heard.as_ref()?.pose.filter(placed))
    }

    fn believed(&self) -> Option<Pose> {
        let of_payload = self.payload.as_ref().and_then(|report| report.of.pose);
        of_payload.or_else(|| self.team.as_ref()?.of.pose).filter(placed)
    }

    /// Where it believes to be, if it is elsewhere.
    pub(crate) fn mistaken(&self) -> Option<Pose> {
        let (truth, belief) = (self.body?.pose, self.believed()?);
        ((truth.x_m - belief.x_m).hypot(truth.y_m - belief.y_m) > BELIEF_M).then_some(belief)
    }

    /// Group and leader: as the robot says itself, or as teammates that hear it say; none of a silent one.
    pub(crate) fn group(&self, now_ns: u64) -> Option<(u8, u8)> {
        let own = self.team_now(now_ns).map(|team| (team.group, team.leader));
        own.or_else(|| self.heard_now(now_ns).map(|heard| (heard.group, heard.leader)))
    }

    /// The colour of its group.
    pub(crate) fn colour(&self, now_ns: u64) -> Rgb {
        self.group(now_ns).map_or(palette::AID, |(group, _)| palette::series(group.into()))
    }

    /// The group in words, and their colour; none if nobody told of it ever.
    pub(crate) fn group_told(&self, now_ns: u64) -> Option<(String, Rgb)> {
        let Some((group, leader)) = self.group(now_ns) else {
            return self.silent_ns(now_ns).map(|_| (Doing::Silent.word().into(), Doing::Silent.colour()));
        };
        let colour = self.colour(now_ns);
        let differs = self.team_now(now_ns).is_some_and(|team| team.differs_ms.is_some());
        Some(match differs {
            true => (format!("{group}: views differ"), palette::muted(colour)),
            false => (format!("group {group}, leader {leader}"), colour),
        })
    }

    /// What it does, as far as that is told.
    pub(crate) fn doing(&self, now_ns: u64) -> Option<Doing> {
        let (payload, control) = (self.payload_now(now_ns), self.control.as_ref());
        if control.is_some_and(|control| control.drives_itself) {
            return Some(Doing::WormholeDrives);
        }
        if self.silent_ns(now_ns).is_some() {
            return Some(Doing::Silent);
        }
        if payload.is_some_and(|payload| !payload.lost.is_empty()) {
            return Some(Doing::Lost);
        }
        if control.is_some_and(|control| control.mode != ControlMode::Active) {
            return Some(Doing::NobodyDrives);
        }
        payload.map(|payload| Doing::Mode(payload.mode))
    }
}

impl TeamWorld {
    /// What a robot says of its team. The answer is which robots this tells of.
    pub(crate) fn take_team(&mut self, now_ns: u64, team: TeamState) -> Vec<u8> {
        for member in &team.members {
            self.hear(now_ns, &team, member);
        }
        let told = team.members.iter().map(|member| member.robot).chain([team.robot]).collect();
        let own = self.robots.entry(team.robot).or_default();
        own.team = Some(Report { at_ns: now_ns, of: team });
        told
    }

    /// Of what several say of a robot, the newest hello counts.
    fn hear(&mut self, now_ns: u64, by: &TeamState, member: &TeamMember) {
        let robot = self.robots.entry(member.robot).or_default();
        let hello_ns = now_ns.saturating_sub(member.silent_ms.saturating_mul(1_000_000));
        let is_newer =
            |heard: &Heard| hello_ns >= heard.hello_ns || now_ns.saturating_sub(heard.at_ns) > REPORT_MAX_AGE_NS;
        if robot.heard.as_ref().is_none_or(is_newer) {
            let before = robot.heard.as_ref().and_then(|heard| heard.pose);
            robot.heard = Some(Heard {
                at_ns: now_ns,
                hello_ns,
                fresh: member.fresh,
                pose: member.pose.or(before),
                group: by.group,
                leader: by.leader,
            });
        }
    }

    pub(crate) fn take_payload(&mut self, now_ns: u64, payload: PayloadState) {
        let robot = self.robots.entry(payload.robot).or_default();
        robot.payload = Some(Report { at_ns: now_ns, of: payload });
    }

    pub(crate) fn take_control(&mut self, robot: u8, control: ControlState) {
        self.robots.entry(robot).or_default().control = Some(control);
    }

    /// True places.
    pub(crate) fn take_bodies(&mut self, robots: Vec<ArenaRobot>, intruders: Vec<ArenaIntruder>) {
        for body in robots {
            self.robots.entry(body.robot).or_default().body = Some(body);
        }
        self.bodies = intruders;
    }

    pub(crate) fn take_incident(&mut self, incident: ArenaIncident) {
        if self.marks.len() < MARKS_MAX && is_place(incident.place.x_m, incident.place.y_m) {
            self.marks.push(incident);
        }
    }

    /// Intruders as robots believe, by their names: certain if anybody is certain.
    pub(crate) fn objects(&self, now_ns: u64) -> Vec<TeamObject> {
        let name = |id: TeamObjectId| (id.observer, id.incarnation, id.number);
        let mut objects: BTreeMap<_, TeamObject> = BTreeMap::new();
        let told = self.robots.values().filter_map(|robot| robot.team_now(now_ns)).flat_map(|team| &team.objects);
        for object in told.filter(|object| is_place(object.x_m, object.y_m)) {
            let known = objects.entry(name(object.id)).or_insert_with(|| object.clone());
            if object.seen_ms < known.seen_ms {
                *known = TeamObject { certain: known.certain || object.certain, ..object.clone() };
            }
            known.certain |= object.certain;
        }
        objects.into_values().collect()
    }

    /// Exits as robots have shared them out, by cell. Where two say different things, the one that blocks as its holder
    /// is right, else the least.
    pub(crate) fn exits(&self, now_ns: u64) -> Vec<PayloadExit> {
        let mut exits: BTreeMap<_, PayloadExit> = BTreeMap::new();
        for payload in self.robots.values().filter_map(|robot| robot.payload_now(now_ns)) {
            for exit in payload.exits.iter().filter(|exit| is_place(exit.place.x_m, exit.place.y_m)) {
                let known = exits.entry(exit.cell).or_insert_with(|| exit.clone());
                if exit.holder == Some(payload.robot) {
                    known.clone_from(exit);
                }
            }
        }
        exits.into_values().collect()
    }

    /// Pairs of robots of which one hears the other itself, each pair once.
    pub(crate) fn links(&self, now_ns: u64) -> Vec<(u8, u8)> {
        let mut pairs = std::collections::BTreeSet::new();
        for team in self.robots.values().filter_map(|robot| robot.team_now(now_ns)) {
            for member in team.members.iter().filter(|member| member.fresh) {
                let hears_itself = member.direct.then_some((member.robot, team.robot));
                let others = member.hears.iter().map(|heard| (*heard, member.robot));
                pairs.extend(others.chain(hears_itself).map(|(from, to)| (from.min(to), from.max(to))));
            }
        }
        pairs.into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S_NS: u64 = 1_000_000_000;

    fn team(robot: u8, members: Vec<TeamMember>) -> TeamState {
        TeamState { robot, leader: 1, group: 9, members, ..TeamState::default() }
    }

    fn member(robot: u8, silent_ms: u64) -> TeamMember {
        TeamMember { robot, silent_ms, fresh: silent_ms < 4000, ..TeamMember::default() }
    }

    #[test]
    fn a_robot_is_silent_when_neither_it_nor_its_teammates_tell_of_it() {
        let mut world = TeamWorld::default();
        world.take_team(10 * S_NS, team(1, vec![member(2, 500)]));
        world.take_team(10 * S_NS, team(2, vec![]));
        for (now_s, expected, why) in [(12, None, "it has told itself"), (14, Some(4), "its last word is too old")] {
            let silent = world.robots[&2].silent_ns(now_s * S_NS).map(|ns| ns / S_NS);
            assert_eq!(silent, expected, "{why}");
        }
        world.take_team(14 * S_NS, team(1, vec![member(2, 1000)]));
        assert_eq!(world.robots[&2].silent_ns(14 * S_NS), None, "a teammate hears it");
        world.take_team(20 * S_NS, team(1, vec![member(2, 7000)]));
        assert_eq!(world.robots[&2].silent_ns(20 * S_NS), Some(7 * S_NS), "and does not any more");
        assert_eq!(world.robots[&2].doing(20 * S_NS), Some(Doing::Silent));
    }

    #[test]
    fn of_two_teammates_the_one_that_heard_it_last_is_right() {
        let mut world = TeamWorld::default();
        world.take_team(10 * S_NS, team(1, vec![member(3, 100)]));
        world.take_team(10 * S_NS, team(2, vec![member(3, 9000)]));
        assert_eq!(world.robots[&3].silent_ns(10 * S_NS), None);
        assert_eq!(world.robots[&3].group(10 * S_NS), Some((9, 1)));
    }

    #[test]
    fn what_drives_comes_before_what_the_program_wants() {
        let mut world = TeamWorld::default();
        let payload = PayloadState { robot: 4, mode: PayloadMode::Blocking, ..PayloadState::default() };
        world.take_team(0, team(4, vec![]));
        world.take_payload(0, payload.clone());
        assert_eq!(world.robots[&4].doing(0), Some(Doing::Mode(PayloadMode::Blocking)));
        let control = ControlState::default();
        world.take_control(4, control.clone());
        assert_eq!(world.robots[&4].doing(0), Some(Doing::NobodyDrives));
        world.take_payload(0, PayloadState { lost: "no pose".into(), ..payload });
        assert_eq!(world.robots[&4].doing(0), Some(Doing::Lost));
        world.take_control(4, ControlState { drives_itself: true, ..control });
        assert_eq!(world.robots[&4].doing(0), Some(Doing::WormholeDrives));
    }

    #[test]
    fn an_intruder_of_several_robots_is_one_and_certain_if_one_is_certain() {
        let mut world = TeamWorld::default();
        for (robot, certain, seen_ms) in [(1, true, 5000), (2, false, 100)] {
            let object = TeamObject { certain, seen_ms, x_m: 3.0, ..TeamObject::default() };
            world.take_team(0, TeamState { objects: vec![object], ..team(robot, vec![]) });
        }
        let objects = world.objects(0);
        assert_eq!((objects.len(), objects[0].certain, objects[0].seen_ms), (1, true, 100));
        assert!(world.objects(60 * S_NS).is_empty(), "nobody tells of it any more");
    }

    #[test]
    fn a_link_is_one_line_whichever_robot_tells_of_it() {
        let mut world = TeamWorld::default();
        let direct = |robot, hears| TeamMember { direct: true, hears, ..member(robot, 0) };
        world.take_team(0, team(2, vec![direct(1, vec![2, 5]), TeamMember { direct: false, ..direct(5, vec![]) }]));
        world.take_team(0, team(1, vec![direct(2, vec![])]));
        assert_eq!(world.links(0), [(1, 2), (1, 5)]);
    }
}
