//! The world and all bodies in it.

use crate::intruder::{Conduct, Intruder};
use crate::referee::{Referee, Thing};
use rohrpost_modules::types::{LaserScan, Pose, Twist};
use rohrpost_robot::simulator::{Moment, NoMotion, STEP_NS, Settings, Simulator};
use rohrpost_robot::surroundings::Disc;
use rohrpost_robot::world::{World, WorldError};
use rohrpost_team::RobotId;
use rohrpost_team::grid::{Cell, Direction, Map, Placement, Wave};
use std::collections::BTreeMap;

/// What all bodies of an arena have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArenaSettings {
    /// Side of a cell, metres.
    pub cell_m: f64,
    /// Of each robot; its seed is that of the arena, and robots draw from it by their ids.
    pub robot: Settings,
    /// Of an intruder, metres.
    pub intruder_radius_m: f64,
}

/// Why there is no such arena.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoArena {
    /// The size of a cell is none.
    #[error(transparent)]
    Cells(#[from] WorldError),
    /// The map has no path.
    #[error("the map has no path, so nothing can move there; mark paths")]
    NoPath,
}

/// A robot that cannot be there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoRobot {
    /// A wall or a blank.
    #[error("{0} is no path; a robot starts on a path")]
    NotAPath(Cell),
    /// One is there.
    #[error("robot {0} is there already; give each robot an id of its own")]
    Twice(RobotId),
}

/// A map with robots and intruders in it.
///
/// ```
/// use rohrpost_arena::{Arena, ArenaSettings, Conduct};
/// use rohrpost_modules::types::Twist;
/// use rohrpost_robot::simulator::Settings;
/// use rohrpost_team::RobotId;
/// use rohrpost_team::grid::{Cell, Direction, Map};
/// let map = Map::read(b"rohrpost-map 1\ncell_m 1\nmap\n########\n#      #\n########\n").unwrap();
/// let settings = ArenaSettings { cell_m: 1.0, robot: Settings::default(), intruder_radius_m: 0.25 };
/// let mut arena = Arena::new(&map, settings).unwrap();
/// let robot = RobotId::new(3).unwrap();
/// arena.add_robot(robot, Cell { column: 1, row: 1 }, Direction::East).unwrap();
/// arena.add_intruder(Cell { column: 3, row: 1 }, Conduct::Stands);
/// for tenth in 0..50 {
///     arena.step_to(tenth * 100_000_000);
///     arena.drive(robot, Twist { speed_m_s: 0.5, turn_rate_rad_s: 0.0 }).unwrap();
/// }
/// let touch = arena.referee().incidents()[0].to_string();
/// assert!(touch.ends_with("robot 3 touches intruder 0 at 0.50 m/s, moving towards it"), "{touch}");
/// ```
#[derive(Clone, Debug)]
pub struct Arena {
    map: Map,
    placement: Placement,
    world: World,
    settings: ArenaSettings,
    robots: BTreeMap<RobotId, Simulator>,
    intruders: Vec<Intruder>,
    referee: Referee,
    wave: Wave,
    now_ns: u64,
}

impl Arena {
    /// An arena without robots and intruders; those that are drawn in the map are for the caller to add.
    ///
    /// # Errors
    /// The map has no path, or the cell no size.
    pub fn new(map: &Map, settings: ArenaSettings) -> Result<Self, NoArena> {
        let first = map.grid.cells().map(|(cell, _)| cell).find(|cell| map.grid.is_path(*cell));
        let world = World::with_walls(map, settings.cell_m, first.ok_or(NoArena::NoPath)?, None)?;
        // A body off all paths belongs to the nearest one.
        let margin_m = settings.cell_m * f64::from(map.grid.columns().max(map.grid.rows()));
        let placement = Placement::new(settings.cell_m, margin_m).ok_or(WorldError::CellSize(settings.cell_m))?;
        let (robots, intruders) = (BTreeMap::new(), Vec::new());
        let (map, referee) = (map.clone(), Referee::default());
        Ok(Self { map, placement, world, settings, robots, intruders, referee, wave: Wave::default(), now_ns: 0 })
    }

    /// Time begins here; for an arena in which nobody is yet.
    pub fn begin_at(&mut self, now_ns: u64) {
        self.now_ns = now_ns;
    }

    /// Puts a robot in the middle of a cell.
    ///
    /// # Errors
    /// The cell is no path, or the robot is there already.
    pub fn add_robot(&mut self, robot: RobotId, cell: Cell, facing: Direction) -> Result<(), NoRobot> {
        if !self.map.grid.is_path(cell) {
            return Err(NoRobot::NotAPath(cell));
        }
        if self.robots.contains_key(&robot) {
            return Err(NoRobot::Twice(robot));
        }
        let seed = self.settings.robot.seed.wrapping_mul(256).wrapping_add(robot.get().into());
        let mut body = Simulator::new(self.world.clone(), Settings { seed, ..self.settings.robot });
        let (x_m, y_m) = self.placement.middle_m(&self.map.grid, cell);
        let pose = Pose { x_m, y_m, heading_rad: facing.heading_rad() };
        body.place(Moment { at_ns: self.now_ns, pose, odometry: body.odometry() });
        self.robots.insert(robot, body);
        self.referee.place(self.now_ns, robot, cell);
        Ok(())
    }

    /// Puts an intruder in the middle of a cell. Its number counts from 0.
    pub fn add_intruder(&mut self, cell: Cell, conduct: Conduct) -> usize {
        let (x_m, y_m) = self.placement.middle_m(&self.map.grid, cell);
        let disc = Disc { x_m, y_m, radius_m: self.settings.intruder_radius_m };
        self.intruders.push(Intruder::new(disc, conduct));
        self.intruders.len() - 1
    }

    /// A person puts a robot elsewhere, in the middle of a path. Odometry does not notice it.
    ///
    /// # Errors
    /// The cell is no path.
    pub fn push(&mut self, robot: RobotId, cell: Cell) -> Result<(), NoRobot> {
        if !self.map.grid.is_path(cell) {
            return Err(NoRobot::NotAPath(cell));
        }
        let (x_m, y_m) = self.placement.middle_m(&self.map.grid, cell);
        if let Some(body) = self.robots.get_mut(&robot) {
            let moment = body.moment();
            body.place(Moment { pose: Pose { x_m, y_m, ..moment.pose }, ..moment });
            self.referee.except(robot);
        }
        Ok(())
    }

    /// The wheels of a robot are to reach this motion from now on. Without another command the robot brakes after its
    /// dead-man time. No effect on a robot that is not there.
    ///
    /// # Errors
    /// The motion holds something that is not a number.
    pub fn drive(&mut self, robot: RobotId, twist: Twist) -> Result<(), NoMotion> {
        let now_ns = self.now_ns;
        self.robots.get_mut(&robot).map_or(Ok(()), |body| body.command(twist, now_ns).map(drop))
    }

    /// Moves all bodies, in steps of 10 ms.
    pub fn step_to(&mut self, now_ns: u64) {
        while self.now_ns + STEP_NS <= now_ns {
            self.now_ns += STEP_NS;
            self.step();
        }
    }

    fn step(&mut self) {
        let mut discs: Vec<(Thing, Disc)> = self.robots.keys().map(|id| (Thing::Robot(*id), self.disc(*id))).collect();
        let robots: Vec<Disc> = discs.iter().map(|(_, disc)| *disc).collect();
        for (number, intruder) in self.intruders.iter_mut().enumerate() {
            intruder.step(STEP_NS as f64 * 1e-9, &self.map.grid, self.placement, &robots, &mut self.wave);
            discs.push((Thing::Intruder(number), intruder.disc));
        }
        // What is further away is not reached in a step.
        let near_m = 2.0 * (self.settings.robot.radius_m + self.settings.intruder_radius_m);
        for (at, (id, body)) in self.robots.iter_mut().enumerate() {
            let (x_m, y_m) = (discs[at].1.x_m, discs[at].1.y_m);
            let is_near = |disc: &Disc| (disc.x_m - x_m).abs() < near_m && (disc.y_m - y_m).abs() < near_m;
            let others = discs.iter().filter(|(thing, disc)| *thing != Thing::Robot(*id) && is_near(disc));
            body.set_others(others.map(|(_, disc)| *disc));
            let bumps = body.bumps();
            body.step_to(self.now_ns);
            let pose = body.true_pose();
            (discs[at].1.x_m, discs[at].1.y_m) = (pose.x_m, pose.y_m);
            if let Some(touch) = body.last_touch().filter(|_| body.bumps() > bumps) {
                let off_m = |disc: &Disc| ((disc.x_m - touch.x_m).hypot(disc.y_m - touch.y_m) - disc.radius_m).abs();
                let met = discs.iter().find(|(it, disc)| *it != Thing::Robot(*id) && off_m(disc) < 1e-6);
                let with = met.map_or(Thing::Wall, |(thing, _)| *thing);
                self.referee.touch(self.now_ns, *id, with, touch.is_towards, touch.speed_m_s);
            }
            if let Some(cell) = self.placement.cell(&self.map.grid, pose.x_m, pose.y_m) {
                self.referee.place(self.now_ns, *id, cell);
            }
        }
    }

    /// A robot's body.
    ///
    /// # Panics
    /// If the robot is not there.
    fn disc(&self, robot: RobotId) -> Disc {
        let Pose { x_m, y_m, .. } = self.robots[&robot].true_pose();
        Disc { x_m, y_m, radius_m: self.settings.robot.radius_m }
    }

    /// What a robot's scanner sees now; `None` of a robot that is not there.
    pub fn scan(&mut self, robot: RobotId) -> Option<LaserScan> {
        let range_m = self.settings.robot.scanner.range_max_m;
        let Pose { x_m, y_m, .. } = self.robots.get(&robot)?.true_pose();
        let others = self.robots.keys().filter(|other| **other != robot).map(|other| self.disc(*other));
        let all = others.chain(self.intruders.iter().map(|intruder| intruder.disc));
        let seen = all.filter(|disc| (disc.x_m - x_m).hypot(disc.y_m - y_m) - disc.radius_m <= range_m);
        let seen: Vec<Disc> = seen.collect();
        let body = self.robots.get_mut(&robot)?;
        body.set_others(seen);
        Some(body.scan())
    }

    /// A robot as it is now; `None` if it is not there.
    pub fn moment(&self, robot: RobotId) -> Option<Moment> {
        self.robots.get(&robot).map(Simulator::moment)
    }

    /// The cell in which a robot is.
    pub fn cell(&self, robot: RobotId) -> Option<Cell> {
        let Pose { x_m, y_m, .. } = self.robots.get(&robot)?.true_pose();
        self.placement.cell(&self.map.grid, x_m, y_m)
    }

    /// All robots, by id.
    pub fn robots(&self) -> impl Iterator<Item = RobotId> {
        self.robots.keys().copied()
    }

    /// Where the intruders are, by number.
    pub fn intruders(&self) -> impl Iterator<Item = Disc> {
        self.intruders.iter().map(|intruder| intruder.disc)
    }

    /// Up to when all bodies have moved, ns.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// The map.
    pub fn map(&self) -> &Map {
        &self.map
    }

    /// How cells lie in the world.
    pub fn placement(&self) -> Placement {
        self.placement
    }

    /// What was noted so far.
    pub fn referee(&self) -> &Referee {
        &self.referee
    }
}
