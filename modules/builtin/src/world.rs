//! `arena`: the process that moves all robots and intruders of a simulated team, and referees them. What it computes is
//! in [`rohrpost_arena`]; here are its socket, its clock, and what it publishes.
//!
//! The arena belongs to no robot: nothing that becomes of their processes stops it. A robot without commands brakes.

mod check;
mod settings;
pub(crate) mod wire;

use super::payload::cell as told_cell;
use super::settings::Settings as _;
use super::sim::remove;
pub(super) use check::{NAME, problems};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use rohrpost_arena::{Arena, Conduct, Incident, Mishap, Thing};
use rohrpost_mailbox::{Interest, Ready};
use rohrpost_modules::interfaces::{
    Arena as ArenaServer, ArenaConduct, ArenaCounts, ArenaIncident, ArenaInterface, ArenaIntruder, ArenaMishap,
    ArenaRefusal, ArenaRobot, ArenaState, TeamCell, TeamPlace,
};
use rohrpost_modules::runtime::{Context, ModuleClock};
use rohrpost_modules::types::{Odometry, Pose};
use rohrpost_modules::wire::{append, from_bytes};
use rohrpost_modules::{Module, ModuleError};
use rohrpost_payload::Ground;
use rohrpost_robot::simulator::STEP_NS;
use rohrpost_team::RobotId;
use rohrpost_team::grid::{Cell, Map};
use settings::Settings;
use std::os::unix::net::UnixDatagram;
use std::path::PathBuf;
use std::time::Duration;
use wire::{DRIVE_BYTES_MAX, Drive, Sensing, body_path};

/// True places are published so often.
const STATE_NS: u64 = 200_000_000;

pub(super) struct ArenaModule {
    arena: Arena,
    map: u64,
    settings: Settings,
    /// Takes commands, and tells what is sensed without waiting for its reader.
    socket: UnixDatagram,
    path: PathBuf,
    clock: ModuleClock,
    bodies: Vec<Senses>,
    random: ChaCha8Rng,
    /// Incidents that are told.
    told: usize,
    state_due_ns: u64,
}

/// When the sensors of a robot look next, ns of the monotonic clock.
struct Senses {
    robot: RobotId,
    located_due_ns: u64,
    scan_due_ns: u64,
}

impl Module for ArenaModule {
    type Settings = Settings;
    type Interfaces = ArenaInterface;

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        settings.check()?;
        let file = context.path(&settings.map);
        let text = std::fs::read(&file).map_err(|error| ModuleError::at(file.display(), error))?;
        let ground = Ground::read(&text, settings.cell_m, 0.0);
        let ground = ground.map_err(|error| ModuleError::at(file.display(), error))?;
        let map = Map::read(&text).map_err(|error| ModuleError::at(file.display(), error))?;
        let mut arena = Arena::new(&map, settings.arena(ground.cell_m()))?;
        let clock = context.clock().clone();
        let bodies = populate(&mut arena, &settings, clock.monotonic_ns())?;
        let path = context.path(&settings.socket);
        let socket = context.open_outside(|| {
            remove(&path)?;
            let socket = UnixDatagram::bind(&path)?;
            socket.set_nonblocking(true)?;
            Ok(socket)
        });
        let socket = socket.map_err(|error| ModuleError::at(path.display(), error))?;
        context.watch(&socket, Interest::Read)?;
        context.use_computer_clock();
        context.set_period(Duration::from_nanos(STEP_NS));
        tracing::info!("moves {} robots on {}", bodies.len(), settings.map);
        let random = ChaCha8Rng::seed_from_u64(settings.seed);
        let (map, told, state_due_ns) = (ground.digest(), 0, 0);
        Ok(Self { arena, map, settings, socket, path, clock, bodies, random, told, state_due_ns })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let now_ns = self.clock.monotonic_ns();
        self.arena.step_to(now_ns);
        self.sense(now_ns);
        self.tell_incidents(context)?;
        if now_ns >= self.state_due_ns {
            self.state_due_ns = now_ns + STATE_NS;
            context.publish_now(ArenaInterface::STATE, &self.state())?;
        }
        Ok(())
    }

    fn ready(&mut self, context: &mut Context, _: Ready) -> Result<(), ModuleError> {
        let mut bytes = [0; DRIVE_BYTES_MAX];
        // One a call: it is called again as long as there is another. What is no command, or no motion, moves nothing.
        let Ok(count) = context.take_in_to(&mut bytes, |room| self.socket.recv(room)) else { return Ok(()) };
        let drive = bytes.get(..count).and_then(|bytes| from_bytes::<Drive>(bytes).ok());
        if let Some((robot, twist)) = drive.and_then(|drive| Some((RobotId::new(drive.robot)?, drive.twist))) {
            self.arena.step_to(self.clock.monotonic_ns());
            let _ = self.arena.drive(robot, twist);
        }
        Ok(())
    }
}

impl Drop for ArenaModule {
    fn drop(&mut self) {
        let _ = remove(&self.path);
    }
}

/// Puts all robots and intruders in their cells. Sensors of robots look one after the other.
fn populate(arena: &mut Arena, settings: &Settings, now_ns: u64) -> Result<Vec<Senses>, ModuleError> {
    arena.begin_at(now_ns);
    let mut bodies = Vec::new();
    let scan_ns = (1e9 / settings.laser_rate_hz) as u64;
    for (at, robot) in settings.robots.iter().enumerate() {
        let id = RobotId::new(robot.id).ok_or_else(|| ModuleError::configuration("a robot has no number"))?;
        arena
            .add_robot(id, robot.cell, robot.facing.into())
            .map_err(|no| ModuleError::configuration(no.to_string()))?;
        let due_ns = now_ns + scan_ns * at as u64 / settings.robots.len() as u64;
        bodies.push(Senses { robot: id, located_due_ns: due_ns, scan_due_ns: due_ns });
    }
    for intruder in &settings.intruders {
        arena.add_intruder(intruder.cell, intruder.conduct());
    }
    Ok(bodies)
}

impl ArenaModule {
    /// Tells bodies what their sensors say, if it is time. A body that is dead or stopped misses it.
    fn sense(&mut self, now_ns: u64) {
        let Self { arena, settings, bodies, random, socket, path, .. } = self;
        let [located_ns, scan_ns] = [settings.odometry_rate_hz, settings.laser_rate_hz].map(|hz| (1e9 / hz) as u64);
        let mut off = |most: f64| most * (random.next_u32() as f64 / f64::from(u32::MAX) * 2.0 - 1.0);
        for body in bodies.iter_mut().filter(|body| now_ns >= body.located_due_ns.min(body.scan_due_ns)) {
            let Some(moment) = arena.moment(body.robot) else { continue };
            let looks = now_ns >= body.scan_due_ns;
            let next = |due_ns: u64, every_ns: u64| (due_ns + every_ns).max(now_ns);
            body.located_due_ns = next(body.located_due_ns, located_ns);
            if looks {
                body.scan_due_ns = next(body.scan_due_ns, scan_ns);
            }
            let (Pose { x_m, y_m, heading_rad }, twist) = (moment.pose, moment.odometry.twist);
            let pose = Pose {
                x_m: x_m + off(settings.pose_error_m),
                y_m: y_m + off(settings.pose_error_m),
                heading_rad: heading_rad + off(settings.pose_error_rad),
            };
            let scan = if looks { arena.scan(body.robot) } else { None };
            let sensing = Sensing { at_ns: arena.now_ns(), located: Odometry { pose, twist }, scan };
            let mut bytes = Vec::new();
            if append(&mut bytes, &sensing).is_ok() {
                let _ = socket.send_to(&bytes, body_path(path, body.robot.get()));
            }
        }
    }

    fn tell_incidents(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        while let Some(incident) = self.arena.referee().incidents().get(self.told) {
            tracing::error!("{}", incident.mishap);
            let incident = self.incident(*incident);
            self.told += 1;
            context.publish_now(ArenaInterface::INCIDENT, &incident)?;
        }
        Ok(())
    }

    fn incident(&self, incident: Incident) -> ArenaIncident {
        let (mishap, robots) = match incident.mishap {
            Mishap::Touch { by, with, is_towards, .. } => {
                let with = match with {
                    Thing::Robot(robot) => Some(robot),
                    Thing::Wall | Thing::Intruder(_) => None,
                };
                let mishap = if is_towards { ArenaMishap::Touch } else { ArenaMishap::Contact };
                (mishap, [Some(by), with])
            }
            Mishap::TwoInCell { came, was, .. } => (ArenaMishap::TwoInCell, [Some(came), Some(was)]),
            Mishap::Swap { first, second, .. } => (ArenaMishap::Swap, [Some(first), Some(second)]),
        };
        let pose = robots[0].and_then(|robot| self.arena.moment(robot)).map(|moment| moment.pose).unwrap_or_default();
        ArenaIncident {
            number: self.told as u64,
            mishap,
            robots: robots.into_iter().flatten().map(RobotId::get).collect(),
            place: TeamPlace { x_m: pose.x_m, y_m: pose.y_m },
            text: incident.mishap.to_string(),
        }
    }

    fn state(&self) -> ArenaState {
        let (arena, radius_m) = (&self.arena, self.settings.arena(1.0).robot.radius_m);
        let robot = |id: RobotId| {
            let moment = arena.moment(id)?;
            let (pose, twist, cell) = (moment.pose, moment.odometry.twist, arena.cell(id).map(told_cell));
            Some(ArenaRobot { robot: id.get(), pose, twist, radius_m, cell })
        };
        let intruder = |(number, disc): (usize, rohrpost_robot::surroundings::Disc)| ArenaIntruder {
            number: number as u32,
            place: TeamPlace { x_m: disc.x_m, y_m: disc.y_m },
            radius_m: disc.radius_m,
            cell: arena.intruder_cell(number).map(told_cell),
            open: arena.open_entrances(number).into_iter().map(told_cell).collect(),
        };
        let referee = arena.referee();
        ArenaState {
            map: self.map,
            robots: arena.robots().filter_map(robot).collect(),
            intruders: arena.intruders().enumerate().map(intruder).collect(),
            counts: ArenaCounts {
                touches_towards: referee.touches_towards(),
                touches: referee.touches(),
                two_in_cell: referee.two_in_cell(),
                swaps: referee.swaps(),
            },
        }
    }
}

fn core_cell(TeamCell { column, row }: TeamCell) -> Cell {
    Cell { column, row }
}

impl ArenaServer for ArenaModule {
    fn add_intruder(&mut self, cell: TeamCell, conduct: ArenaConduct) -> Result<u32, ArenaRefusal> {
        let cell = core_cell(cell);
        if !self.arena.map().grid.is_path(cell) {
            return Err(ArenaRefusal(format!("{cell} is no path; an intruder stands on a path")));
        }
        let conduct = match conduct {
            ArenaConduct::Stands => Conduct::Stands,
            ArenaConduct::Script { speed_m_s, cells } => {
                Conduct::Script { speed_m_s, cells: cells.into_iter().map(core_cell).collect() }
            }
            ArenaConduct::Flees { speed_m_s, fears_m } => Conduct::Flees { speed_m_s, fears_m },
        };
        Ok(self.arena.add_intruder(cell, conduct) as u32)
    }

    fn push(&mut self, robot: u8, cell: TeamCell) -> Result<(), ArenaRefusal> {
        let id = RobotId::new(robot).filter(|id| self.arena.moment(*id).is_some());
        let id = id.ok_or_else(|| ArenaRefusal(format!("robot {robot} is not in this arena")))?;
        self.arena.push(id, core_cell(cell)).map_err(|error| ArenaRefusal(error.to_string()))
    }
}
