//! Robots of a team in space: bodies, headings, rings, labels and ways.

use super::known::{Doing, KnownRobot, TeamWorld};
use super::look::{Look, RADIUS_M};
use super::shapes::{at, ring};
use crate::palette::{self, Rgb};
use crate::scene::{Scene, entity};
use crate::world::placed;
use rerun::{Arrows3D, Boxes3D, Cylinders3D, EntityPath, FillMode, LineStrips3D, Points3D, Radius};
use rohrpost::types::Pose;

/// Height of a body, m.
const HEIGHT_M: f32 = 0.35;
/// Above the floor, m: of what lies on it, of a leader's ring, of labels.
const FLAT_M: f32 = 0.05;
const LEADER_M: f32 = 0.7;
const LABEL_M: f32 = 1.0;
/// Half of a line's width, m.
const LINE_M: f32 = 0.04;

/// The entity of a robot, or of what belongs to it.
fn place(id: u8, part: &str) -> EntityPath {
    entity(&["space", "robot", &id.to_string(), part])
}

fn space(kind: &str, id: u8) -> EntityPath {
    entity(&["space", kind, &id.to_string()])
}

impl Scene {
    /// Draws a robot as it is known now, if its place is.
    pub(super) fn known_robot(&mut self, id: u8) {
        let Some(robot) = self.team.robots.get(&id) else { return };
        let Some(pose) = robot.pose() else { return };
        let (look, mistaken, colour) =
            (Look::of(id, robot, self.time_ns), robot.mistaken(), robot.colour(self.time_ns));
        self.log(space("robot", id), &placed(&pose, 1.0));
        let has_changed = self.looks.get(&id) != Some(&look);
        if has_changed {
            self.look(id, &look);
            self.looks.insert(id, look);
        }
        if has_changed || mistaken.is_some() {
            let strips = mistaken.map(|belief| belief_strips(&pose, &belief)).unwrap_or_default();
            let belief = LineStrips3D::new(strips).with_radii([LINE_M / 2.0]).with_colors([colour]);
            self.log(space("belief", id), &belief);
        }
    }

    fn look(&mut self, id: u8, look: &Look) {
        let Look { radius_m, colour, doing, is_leader, label, .. } = look;
        let body = Cylinders3D::from_lengths_and_radii([HEIGHT_M], [*radius_m])
            .with_centers([[0.0, 0.0, HEIGHT_M / 2.0]])
            .with_colors([*colour])
            .with_fill_mode(FillMode::Solid);
        let heading = Arrows3D::from_vectors([[2.0 * radius_m, 0.0, 0.0]])
            .with_origins([[0.0, 0.0, HEIGHT_M]])
            .with_radii([LINE_M])
            .with_colors([palette::HEADING]);
        let outline = LineStrips3D::new(doing.map(|_| ring([0.0; 2], radius_m * 1.5, FLAT_M)))
            .with_radii([1.5 * LINE_M])
            .with_colors(doing.map(Doing::colour));
        let leader = LineStrips3D::new(is_leader.then(|| ring([0.0; 2], *radius_m, LEADER_M)))
            .with_radii([LINE_M])
            .with_colors([palette::LEADER]);
        let is_caged = matches!(doing, Some(Doing::WormholeDrives | Doing::NobodyDrives));
        let half_m = radius_m * 1.3;
        let cage = Boxes3D::from_half_sizes(is_caged.then_some([half_m, half_m, HEIGHT_M]))
            .with_centers(is_caged.then_some([0.0, 0.0, HEIGHT_M]))
            .with_radii([LINE_M / 2.0])
            .with_colors([palette::NOT_ITS_PROGRAM])
            .with_fill_mode(FillMode::MajorWireframe);
        let text = Points3D::new([[0.0, 0.0, LABEL_M]])
            .with_radii([Radius::new_ui_points(0.0)])
            .with_colors([palette::HEADING])
            .with_labels([label.as_str()])
            .with_show_labels(true);
        self.log(place(id, "body"), &body);
        self.log(place(id, "heading"), &heading);
        self.log(place(id, "mode"), &outline);
        self.log(place(id, "leader"), &leader);
        self.log(place(id, "driver"), &cage);
        self.log(place(id, "label"), &text);
    }

    /// The way that a robot plans, and its end.
    pub(super) fn planned_way(&mut self, id: u8) {
        let Some(robot) = self.team.robots.get(&id) else { return };
        let colour = robot.colour(self.time_ns);
        let way = LineStrips3D::new(way_strips(robot, self.time_ns)).with_radii([LINE_M]).with_colors([colour]);
        self.log(space("way", id), &way);
    }

    /// Which robots hear each other.
    pub(super) fn team_links(&mut self) {
        let (lines, colours): (Vec<_>, Vec<Rgb>) = link_lines(&self.team, self.time_ns).into_iter().unzip();
        let links = LineStrips3D::new(lines).with_radii([Radius::new_ui_points(0.75)]).with_colors(colours);
        self.log(entity(&["space", "links"]), &links);
    }
}

fn belief_strips(truth: &Pose, belief: &Pose) -> Vec<Vec<[f32; 3]>> {
    let middle = [belief.x_m as f32, belief.y_m as f32];
    vec![vec![at(truth, FLAT_M), at(belief, FLAT_M)], ring(middle, RADIUS_M, FLAT_M)]
}

/// From the robot along its way as far as that is planned, and a ring where it ends.
fn way_strips(robot: &KnownRobot, now_ns: u64) -> Vec<Vec<[f32; 3]>> {
    let Some((payload, pose)) = robot.payload_now(now_ns).zip(robot.pose()) else { return Vec::new() };
    let is_place = |place: &[f32; 3]| place.iter().all(|part| part.is_finite());
    let places = payload.way.iter().map(|place| [place.x_m as f32, place.y_m as f32, FLAT_M]);
    let mut strip = vec![at(&pose, FLAT_M)];
    strip.extend(places.filter(is_place));
    let strip = (strip.len() > 1).then_some(strip);
    let end = payload.destination.map(|place| ring([place.x_m as f32, place.y_m as f32], 0.6 * RADIUS_M, FLAT_M));
    strip.into_iter().chain(end.filter(|ring| ring.iter().all(is_place))).collect()
}

fn link_lines(team: &TeamWorld, now_ns: u64) -> Vec<(Vec<[f32; 3]>, Rgb)> {
    let end = |id: u8| team.robots.get(&id).and_then(KnownRobot::pose).map(|pose| at(&pose, HEIGHT_M));
    let line = |(from, to): (u8, u8)| {
        let colour = team.robots.get(&to).map_or(palette::AID, |robot| robot.colour(now_ns));
        Some((vec![end(from)?, end(to)?], palette::muted(colour)))
    };
    team.links(now_ns).into_iter().filter_map(line).collect()
}
