//! Where the robot is on the team's map, and what it sees there.

use super::settings::Settings;
use super::state::position;
use crate::map::read_map;
use rohrpost_modules::ModuleError;
use rohrpost_modules::interfaces::{LaserInterface, WheelsInterface};
use rohrpost_modules::runtime::{Context, ModuleClock, Received, Stream, StreamSubscription};
use rohrpost_modules::types::{LaserScan, Odometry, Pose};
use rohrpost_robot::lookout::Lookout;
use rohrpost_robot::world::World;
use rohrpost_team::{Position, group};

/// Odometry and scans that are older say nothing of now.
const AGE_MAX_NS: u64 = 1_000_000_000;
/// Echoes so near a wall are the wall's, metres: squares of maps are larger.
const ERROR_M: f64 = 0.25;

pub(super) struct Surroundings {
    map: Option<(World, u64)>,
    start: Option<Pose>,
    odometry: Option<Stream<Odometry>>,
    /// The run of the odometry's module that began at the start.
    run: Option<u32>,
    has_lost_place: bool,
    laser: Option<StreamSubscription<LaserScan>>,
    seen: Option<PlacedScan>,
    gate_m: f64,
    clock: ModuleClock,
}

/// The newest scan, and the robot's place when it was taken.
struct PlacedScan {
    scan: LaserScan,
    pose: Pose,
    came_ns: u64,
}

impl Surroundings {
    /// # Errors
    /// The odometry's or the scanner's module is unknown, or on another node; the map cannot be read.
    pub(super) fn open(settings: &Settings, context: &mut Context) -> Result<Self, ModuleError> {
        let map = settings.map.as_ref().map(|map| read_map(&context.path(map))).transpose()?;
        let start = settings.start.map(Pose::from);
        let start =
            start.or_else(|| map.as_ref().filter(|_| settings.odometry.is_some()).map(|(world, _)| world.start()));
        let odometry = settings.odometry.as_ref().map(|module| context.stream(WheelsInterface::ODOMETRY, module));
        let laser = settings.laser.as_ref().map(|module| context.subscribe_stream(LaserInterface::SCAN, module));
        Ok(Self {
            map,
            start,
            odometry: odometry.transpose()?,
            run: None,
            has_lost_place: false,
            laser: laser.transpose()?,
            seen: None,
            gate_m: settings.gate_m(),
            clock: context.clock().clone(),
        })
    }

    /// Digest of the map; 0 without one.
    pub(super) fn map(&self) -> u64 {
        self.map.as_ref().map_or(0, |(_, digest)| *digest)
    }

    /// What does not work.
    pub(super) fn complaint(&self) -> Option<String> {
        self.has_lost_place.then(|| {
            "odometry began anew, so nobody knows where the robot is; put it on its start and restart this module"
                .into()
        })
    }

    /// Takes a scan; false of other data.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(super) fn take(&mut self, data: &Received<'_>) -> Result<bool, ModuleError> {
        let Some(laser) = &self.laser else { return Ok(false) };
        let Some(scan) = data.read(laser)? else { return Ok(false) };
        let then = match (&mut self.odometry, self.start) {
            (Some(odometry), Some(start)) => {
                odometry.at(data.moment()).ok().and_then(Result::ok).map(|it| on(start, it.pose))
            }
            (_, start) => start,
        };
        let came_ns = self.clock.monotonic_ns();
        if let Some(pose) = then.filter(|_| !self.has_lost_place) {
            self.seen = Some(PlacedScan { scan, pose, came_ns });
        }
        Ok(true)
    }

    /// Where the robot is now, if that is known.
    pub(super) fn pose(&mut self) -> Option<group::Pose> {
        let now_ns = self.clock.monotonic_ns();
        let start = self.start?;
        let Some(odometry) = &mut self.odometry else { return told(start, 0.0) };
        let newest = odometry.newest().ok()??;
        let info = newest.info();
        self.has_lost_place = *self.run.get_or_insert(info.incarnation) != info.incarnation;
        let Odometry { pose, twist } = newest.read().ok()?;
        let is_known = !self.has_lost_place && now_ns.saturating_sub(info.written_ns) <= AGE_MAX_NS;
        if is_known { told(on(start, pose), twist.speed_m_s) } else { None }
    }

    /// Looks at the newest scan, if there was one since the last look.
    pub(super) fn look(&mut self, look: impl FnOnce(&[Position], &dyn Fn(Position) -> bool)) {
        let now_ns = self.clock.monotonic_ns();
        let (Some(seen), Some((world, _))) = (self.seen.take(), &self.map) else { return };
        if now_ns.saturating_sub(seen.came_ns) > AGE_MAX_NS {
            return;
        }
        let lookout = Lookout { world, pose: seen.pose, scan: &seen.scan, error_m: ERROR_M };
        let obstacles = lookout.obstacles(self.gate_m).into_iter().filter_map(|(x_m, y_m)| position(x_m, y_m));
        let obstacles: Vec<Position> = obstacles.collect();
        look(&obstacles, &|Position { x_mm, y_mm }| {
            lookout.can_see(f64::from(x_mm) / 1000.0, f64::from(y_mm) / 1000.0, self.gate_m)
        });
    }
}

/// A place of the odometry's frame, on the map.
fn on(start: Pose, pose: Pose) -> Pose {
    Pose::from(start.isometry() * pose.isometry())
}

/// A place as hellos tell it; `None` of what is no place.
fn told(pose: Pose, speed_m_s: f64) -> Option<group::Pose> {
    let Pose { x_m, y_m, heading_rad } = pose;
    let turned = heading_rad.sin().atan2(heading_rad.cos());
    // A cast of what is not finite is 0 or the limit.
    Some(group::Pose {
        position: position(x_m, y_m)?,
        heading_mrad: (turned * 1000.0).round() as i16,
        speed_mm_s: (speed_m_s * 1000.0).round() as i16,
    })
}
