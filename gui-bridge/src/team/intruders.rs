//! Intruders and their exits in space, and marks of what robots must not do.

use super::shapes::{at, ring};
use crate::palette::{self, Rgb};
use crate::scene::{Scene, entity};
use crate::states::Level;
use rerun::{Boxes3D, Capsules3D, Color, Cylinders3D, FillMode, LineStrips3D, Points3D, Radius};
use rohrpost::interfaces::{ArenaIncident, ArenaMishap, PayloadExit, TeamObject};

/// Radius and height of the cage where robots believe an intruder, m.
const CAGE_M: f32 = 0.35;
const CAGE_HEIGHT_M: f32 = 0.9;
/// Length of an intruder's body between its round ends, m.
const BODY_M: f32 = 0.3;
/// Half the side of an exit's tile, and its height, m.
const TILE_M: f32 = 0.3;
const TILE_HEIGHT_M: f32 = 0.03;
/// Radius of a mark, points of the screen, and its height, m.
const MARK_POINTS: f32 = 8.0;
const MARK_M: f32 = 0.6;

impl Scene {
    /// Intruders as robots believe.
    pub(super) fn team_objects(&mut self) {
        let objects = self.team.objects(self.time_ns);
        let place = |object: &TeamObject| [object.x_m as f32, object.y_m as f32];
        let lines = objects.iter().map(|object| if object.certain { 0.035 } else { 0.012 });
        // A radius without a length would be a cylinder at the origin.
        let (heights, radii) = objects.iter().map(|_| (CAGE_HEIGHT_M, CAGE_M)).unzip::<_, _, Vec<_>, Vec<_>>();
        let cages = Cylinders3D::from_lengths_and_radii(heights, radii)
            .with_centers(objects.iter().map(place).map(|[x, y]| [x, y, CAGE_HEIGHT_M / 2.0]))
            .with_line_radii(lines)
            .with_colors(objects.iter().map(object_colour))
            .with_fill_mode(FillMode::MajorWireframe)
            .with_labels(objects.iter().map(object_label))
            .with_show_labels(true);
        self.log(entity(&["space", "intruders"]), &cages);
    }

    /// Intruders where they really are.
    pub(super) fn intruder_bodies(&mut self) {
        let bodies = self.team.bodies.iter().map(|body| (body.place, body.radius_m as f32));
        let bodies = bodies.filter(|(place, radius)| (place.x_m + place.y_m).is_finite() && radius.is_finite());
        let (places, radii): (Vec<_>, Vec<f32>) = bodies.unzip();
        let lengths = radii.iter().map(|_| BODY_M);
        let capsules = Capsules3D::from_lengths_and_radii(lengths, radii.iter().copied())
            .with_translations(
                places.iter().zip(&radii).map(|(place, radius)| [place.x_m as f32, place.y_m as f32, *radius]),
            )
            .with_colors([palette::INTRUDER])
            .with_fill_mode(FillMode::Solid);
        self.log(entity(&["space", "bodies"]), &capsules);
    }

    /// Exits of intruders, in the colour of the robot that is to hold each, and a line to that robot.
    pub(super) fn team_exits(&mut self) {
        let exits = self.team.exits(self.time_ns);
        let (held, open): (Vec<_>, Vec<_>) = exits.into_iter().partition(|exit| exit.holder.is_some());
        let colours: Vec<Rgb> = held.iter().map(|exit| self.exit_colour(exit)).collect();
        self.log(entity(&["space", "exits"]), &tiles(&held).with_colors(colours.iter().copied()));
        let whys = open.iter().map(|exit| format!("open: {}", exit.why_open));
        let open = tiles(&open).with_colors([palette::SCAN]).with_labels(whys).with_show_labels(true);
        self.log(entity(&["space", "open exits"]), &open);
        let line = |exit: &PayloadExit| {
            let pose = self.team.robots.get(&exit.holder?)?.pose()?;
            let [x, y] = middle(exit);
            Some(vec![at(&pose, TILE_HEIGHT_M), [x, y, TILE_HEIGHT_M]])
        };
        let (lines, colours): (Vec<_>, Vec<Rgb>) =
            held.iter().zip(colours).filter_map(|(exit, colour)| Some((line(exit)?, colour))).unzip();
        let lines = LineStrips3D::new(lines).with_radii([Radius::new_ui_points(1.5)]).with_colors(colours);
        self.log(entity(&["space", "holders"]), &lines);
    }

    fn exit_colour(&self, exit: &PayloadExit) -> Rgb {
        let holder = exit.holder.and_then(|holder| self.team.robots.get(&holder));
        holder.map_or(palette::SCAN, |robot| robot.colour(self.time_ns))
    }

    /// Marks one more incident. All marks stay.
    pub(super) fn incident_marks(&mut self) {
        let marks = &self.team.marks;
        let middle = |mark: &ArenaIncident| [mark.place.x_m as f32, mark.place.y_m as f32];
        let points = Points3D::new(marks.iter().map(middle).map(|[x, y]| [x, y, MARK_M]))
            .with_radii([Radius::new_ui_points(MARK_POINTS)])
            .with_colors(marks.iter().map(|mark| mark_colour(mark.mishap)))
            .with_labels(marks.iter().map(|mark| mark.text.as_str()));
        let feet = LineStrips3D::new(marks.iter().map(middle).map(|place| ring(place, 0.3, TILE_HEIGHT_M)))
            .with_radii([0.03])
            .with_colors(marks.iter().map(|mark| mark_colour(mark.mishap)));
        self.log(entity(&["space", "marks"]), &points);
        self.log(entity(&["space", "marks", "feet"]), &feet);
    }
}

/// A line of output for an incident: a touch is an error.
pub(super) fn level(mishap: ArenaMishap) -> Level {
    match mishap {
        ArenaMishap::Touch => Level::Error,
        ArenaMishap::Contact | ArenaMishap::TwoInCell | ArenaMishap::Swap => Level::Warning,
    }
}

fn mark_colour(mishap: ArenaMishap) -> Rgb {
    match mishap {
        ArenaMishap::Touch => palette::TOUCH,
        ArenaMishap::Contact | ArenaMishap::TwoInCell | ArenaMishap::Swap => palette::SEARCHING,
    }
}

fn object_colour(object: &TeamObject) -> Color {
    let [red, green, blue] = if object.fake { palette::FAKE } else { palette::SCAN };
    Color::from_unmultiplied_rgba(red, green, blue, if object.certain { 255 } else { 120 })
}

fn object_label(object: &TeamObject) -> String {
    let what = match object.may_be {
        Some(robot) => format!("may be robot {robot}"),
        None if object.fake => "made up".into(),
        None if object.certain => "intruder".into(),
        None => "intruder?".into(),
    };
    // A station does not see what it made up.
    let is_aged = !object.certain && !object.fake;
    if is_aged { format!("{what} seen {} s ago", object.seen_ms / 1000) } else { what }
}

fn middle(exit: &PayloadExit) -> [f32; 2] {
    [exit.place.x_m as f32, exit.place.y_m as f32]
}

fn tiles(exits: &[PayloadExit]) -> Boxes3D {
    Boxes3D::from_half_sizes(exits.iter().map(|_| [TILE_M, TILE_M, TILE_HEIGHT_M / 2.0]))
        .with_centers(exits.iter().map(middle).map(|[x, y]| [x, y, TILE_HEIGHT_M / 2.0]))
        .with_fill_mode(FillMode::Solid)
}
