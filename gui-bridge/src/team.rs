//! Teams in space, of any number of systems, below `space`; lanes below `modes` and `groups`.
//!
//! ```text
//!   walls, paths     the map that the robots share
//!   robot/N          body in its group's colour, heading, outline by mode, ring of a leader, cage if its program does
//!                    not drive, label
//!   belief/N         where it believes to be, if it is elsewhere
//!   way/N            what it plans
//!   links            which robots hear each other
//!   intruders        where robots believe them: certain, or with age; bodies: where they are
//!   exits, holders   paths beside an intruder, and lines to the robots that are to hold them; open exits: with why
//!   marks            what robots must not do; marks stay
//! ```
//!
//! A robot is drawn once, whatever systems tell of it ([`known`]). The flat world has a transform that turns y up. That
//! would mirror what has three dimensions; so this is beside it, with z up.

mod floor;
mod intruders;
pub(crate) mod known;
mod lanes;
pub(crate) mod look;
mod robots;
mod shapes;

use crate::blueprint::Tab;
use crate::error::DrawError;
use crate::scene::{Scene, entity};
use crate::view::{Datum, View, Wish, is};
pub(crate) use floor::Floor;
use rerun::TextDocument;
use rerun::blueprint::{StateTimelineView, TextDocumentView};
use rohrpost::interfaces::{ArenaIncident, ArenaState, ControlState, PayloadState, TeamState};
use rohrpost::schema::{DataItem, Description};

/// What colours and shapes mean.
const KEY: &str = "\
| drawn | meaning |
| --- | --- |
| colour, thin lines | group; robots that hear each other; grey: silent |
| gold ring above | leader of the group |
| ring below | white: wanders, yellow: searches, red: blocks, violet: LOST |
| white cage | its program does not drive |
| line with a ring at its end | planned way |
| tile | exit of an intruder, in its holder's colour; red: open |
| red body, red cage | intruder as it is; as robots believe (thin: not certain, pink: made up) |
| red ball | touch |
";

/// Draws teams, their programs and their arena.
pub(crate) struct Teams {
    floor: Option<Floor>,
}

impl Teams {
    pub(crate) const fn on(floor: Option<Floor>) -> Self {
        Self { floor }
    }

    /// Draws what never changes, once.
    pub(crate) fn prepare(&self, scene: &mut Scene) {
        if scene.charts.is_first("team") {
            scene.log_static(entity(&["key"]), &TextDocument::from_markdown(KEY));
            self.floor.iter().for_each(|floor| scene.floor(floor));
        }
    }
}

impl View for Teams {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        is::<TeamState>(item) || is::<PayloadState>(item) || is::<ArenaState>(item)
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        self.prepare(scene);
        if is::<TeamState>(datum.item) {
            scene.team(datum.read()?);
        } else if is::<PayloadState>(datum.item) {
            scene.payload(datum.read()?);
        } else {
            scene.arena(datum.read()?);
        }
        Ok(())
    }

    fn tabs(&self) -> Vec<Tab> {
        let lanes = |name: &'static str, origin: &'static str| {
            Tab::own(name, move || StateTimelineView::new(name).with_origin(origin)).beside()
        };
        let eye_m = self.floor.as_ref().map(Floor::eye_m);
        vec![
            Tab::floor("Team", "/space", eye_m),
            lanes("Modes", "modes"),
            lanes("Groups and leaders", "groups"),
            Tab::own("Key", || TextDocumentView::new("Key").with_origin("key")).beside(),
        ]
    }
}

/// Marks incidents.
pub(crate) struct Incidents;

impl View for Incidents {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        is::<ArenaIncident>(item)
    }

    fn wish(&self) -> Wish {
        Wish::each()
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        scene.incident(datum.module, datum.read()?);
        Ok(())
    }
}

impl Scene {
    /// What a robot says of its team.
    pub fn team(&mut self, team: TeamState) {
        let told = self.team.take_team(self.time_ns, team);
        told.into_iter().for_each(|robot| self.robot_of_team(robot));
        self.team_links();
        self.team_objects();
    }

    /// What a robot's program does.
    pub fn payload(&mut self, payload: PayloadState) {
        let robot = payload.robot;
        self.team.take_payload(self.time_ns, payload);
        self.robot_of_team(robot);
        self.planned_way(robot);
        self.team_exits();
    }

    /// Which program drives the robot of a system.
    pub fn control(&mut self, robot: u8, control: ControlState) {
        self.team.take_control(robot, control);
        self.robot_of_team(robot);
    }

    /// Where robots and intruders really are.
    pub fn arena(&mut self, ArenaState { robots, intruders, .. }: ArenaState) {
        let ids: Vec<u8> = robots.iter().map(|body| body.robot).collect();
        self.team.take_bodies(robots, intruders);
        ids.into_iter().for_each(|robot| self.robot_of_team(robot));
        self.intruder_bodies();
    }

    /// The referee `module` has noted something: a mark that stays, and a line of output.
    pub fn incident(&mut self, module: &str, incident: ArenaIncident) {
        self.output_line(module, intruders::level(incident.mishap), &incident.text);
        self.team.take_incident(incident);
        self.incident_marks();
    }

    fn robot_of_team(&mut self, id: u8) {
        self.known_robot(id);
        let Some(robot) = self.team.robots.get(&id) else { return };
        let doing = robot.doing(self.time_ns).filter(|_| robot.payload.is_some());
        let group = robot.group_told(self.time_ns);
        if let Some(doing) = doing {
            self.robot_lane("modes", id, doing.word(), doing.colour());
        }
        if let Some((told, colour)) = group {
            self.robot_lane("groups", id, &told, colour);
        }
    }
}

#[cfg(test)]
mod tests;
