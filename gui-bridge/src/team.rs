//! A team, as each of its robots knows it: below `world/team/MODULE`, and curves below `team/MODULE`.
//!
//! ```text
//!   robots    places; the colour is the group's, grey is out of contact
//!   links     which robot hears which itself
//!   leader    a ring around it
//!   objects   intruders: red is certain
//! ```

use crate::blueprint::Tab;
use crate::error::DrawError;
use crate::palette::{self, Rgb};
use crate::scene::{Scene, entity};
use crate::view::{Datum, View, is};
use rerun::{LineStrips2D, Points2D, Radius, Scalars};
use rohrpost::interfaces::{TeamMember, TeamObject, TeamState};
use rohrpost::schema::{DataItem, Description};
use rohrpost::types::Pose;
use std::collections::BTreeMap;
use std::f32::consts::TAU;

/// Corners of the ring around a leader, and its radius, metres.
const RING_CORNERS: u8 = 24;
const RING_M: f32 = 0.6;
/// Radius of a robot's and of an intruder's dot, points of the screen.
const ROBOT_POINTS: f32 = 7.0;
const OBJECT_POINTS: f32 = 5.0;
const ORDER: f32 = 40.0;

/// Draws teams, whatever module tells of one.
pub(crate) struct Teams;

impl View for Teams {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        is::<TeamState>(item)
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        scene.team(datum.module, &datum.read()?);
        Ok(())
    }

    fn tabs(&self) -> Vec<Tab> {
        vec![Tab::plane("Team", &["/world/team/**", "/world/map/**"]), Tab::curves("Leaders", "team")]
    }
}

/// A robot as it is drawn.
struct Dot {
    at: [f32; 2],
    colour: Rgb,
    label: String,
}

impl Scene {
    /// The team that `module` tells of.
    pub fn team(&mut self, module: &str, team: &TeamState) {
        let dots = dots(team);
        dots.values().for_each(|dot| self.world.extent.include(dot.at));
        let place = |part| entity(&["world", "team", module, part]);
        let robots = Points2D::new(dots.values().map(|dot| dot.at))
            .with_radii([Radius::new_ui_points(ROBOT_POINTS)])
            .with_colors(dots.values().map(|dot| dot.colour))
            .with_labels(dots.values().map(|dot| dot.label.clone()))
            .with_draw_order(ORDER);
        self.log(place("robots"), &robots);
        let colour = palette::series(team.group.into());
        let links = LineStrips2D::new(links(team, &dots))
            .with_radii([Radius::new_ui_points(1.0)])
            .with_colors([palette::muted(colour)])
            .with_draw_order(ORDER - 1.0);
        self.log(place("links"), &links);
        let ring = LineStrips2D::new(dots.get(&team.leader).map(|dot| ring(dot.at)))
            .with_radii([Radius::new_ui_points(2.0)])
            .with_colors([colour])
            .with_draw_order(ORDER);
        self.log(place("leader"), &ring);
        let objects: Vec<&TeamObject> = team.objects.iter().filter(|object| is_place(object.x_m, object.y_m)).collect();
        let shade = |object: &&TeamObject| if object.certain { palette::SCAN } else { palette::muted(palette::SCAN) };
        let points = Points2D::new(objects.iter().map(|object| [object.x_m as f32, object.y_m as f32]))
            .with_radii([Radius::new_ui_points(OBJECT_POINTS)])
            .with_colors(objects.iter().map(shade))
            .with_labels(objects.iter().map(|object| object_label(object)))
            .with_draw_order(ORDER);
        self.log(place("objects"), &points);
        let fresh = team.members.iter().filter(|member| member.fresh).count() + 1;
        for (curve, value) in [("leader", team.leader.into()), ("group", team.group.into()), ("robots", fresh as f64)] {
            self.log(entity(&["team", module, curve]), &Scalars::single(value));
        }
        self.frame();
    }
}

fn is_place(x_m: f64, y_m: f64) -> bool {
    x_m.is_finite() && y_m.is_finite()
}

/// Robots with a known place, by number; this one included.
fn dots(team: &TeamState) -> BTreeMap<u8, Dot> {
    let colour = palette::series(team.group.into());
    let dot = |pose: Pose, colour, label| {
        let at = [pose.x_m as f32, pose.y_m as f32];
        is_place(pose.x_m, pose.y_m).then_some(Dot { at, colour, label })
    };
    let other = |member: &TeamMember| {
        let (colour, label) = if member.fresh {
            (colour, member.robot.to_string())
        } else {
            (palette::AID, format!("{}, silent for {} s", member.robot, member.silent_ms / 1000))
        };
        Some((member.robot, dot(member.pose?, colour, label)?))
    };
    let own = team.pose.and_then(|pose| Some((team.robot, dot(pose, colour, team.robot.to_string())?)));
    team.members.iter().filter_map(other).chain(own).collect()
}

/// A line from each robot that is heard to the one that hears it.
fn links(team: &TeamState, dots: &BTreeMap<u8, Dot>) -> Vec<[[f32; 2]; 2]> {
    let fresh = || team.members.iter().filter(|member| member.fresh);
    let own = fresh().filter(|member| member.direct).map(|member| (member.robot, team.robot));
    let others = fresh().flat_map(|member| member.hears.iter().map(|heard| (*heard, member.robot)));
    let line = |(from, to): (u8, u8)| Some([dots.get(&from)?.at, dots.get(&to)?.at]);
    own.chain(others).filter_map(line).collect()
}

fn ring([x, y]: [f32; 2]) -> Vec<[f32; 2]> {
    let corner = |corner: u8| (f32::from(corner) * TAU / f32::from(RING_CORNERS)).sin_cos();
    (0..=RING_CORNERS).map(corner).map(|(sin, cos)| [x + RING_M * cos, y + RING_M * sin]).collect()
}

fn object_label(object: &TeamObject) -> String {
    match object.may_be {
        Some(robot) => format!("may be robot {robot}"),
        None if object.fake => "made up".into(),
        None => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestScene;

    fn at(x_m: f64) -> Option<Pose> {
        Some(Pose { x_m, ..Pose::default() })
    }

    fn team() -> TeamState {
        let member = |robot, pose| TeamMember { robot, pose, fresh: true, direct: true, ..TeamMember::default() };
        let members = vec![
            TeamMember { hears: vec![2, 5], ..member(1, at(1.0)) },
            TeamMember { direct: false, ..member(5, at(5.0)) },
            TeamMember { fresh: false, silent_ms: 31_000, ..member(7, at(7.0)) },
            member(8, None),
            member(9, at(f64::NAN)),
        ];
        let object = TeamObject { x_m: 3.0, certain: true, ..TeamObject::default() };
        TeamState {
            robot: 2,
            leader: 1,
            group: 5,
            pose: at(2.0),
            members,
            objects: vec![object],
            ..TeamState::default()
        }
    }

    #[test]
    fn a_team_is_drawn_with_its_links_leader_and_objects() {
        let mut drawing = TestScene::new();
        drawing.components();
        drawing.scene.team("team.0", &team());
        let all = drawing.components();
        let of = |part: &str, component: &str| all[&format!("/world/team/team.0/{part}")].get(component).copied();
        assert_eq!(of("robots", "Points2D:positions"), Some(4 * 2), "1, 2, 5 and 7 have places");
        assert_eq!(of("links", "LineStrips2D:strips"), Some(3 * 2), "1 to 2, 2 to 1, 5 to 1");
        assert_eq!(of("leader", "LineStrips2D:strips"), Some(usize::from(RING_CORNERS) + 1));
        assert_eq!(of("objects", "Points2D:positions"), Some(2));
        assert!(["leader", "group", "robots"].iter().all(|curve| all.contains_key(&format!("/team/team.0/{curve}"))));
    }

    #[test]
    fn colours_tell_groups_and_robots_out_of_contact() {
        let dots = dots(&team());
        let colour = palette::series(5);
        let drawn: Vec<(u8, Rgb, &str)> = dots.iter().map(|(robot, dot)| (*robot, dot.colour, &*dot.label)).collect();
        let expected = [(1, colour, "1"), (2, colour, "2"), (5, colour, "5"), (7, palette::AID, "7, silent for 31 s")];
        assert_eq!(drawn, expected);
    }
}
