//! Where the robot is, by its odometry, and what the wormhole does with that: it drives to the program's last
//! destination when the program has missed a deadline, and it knows the walls of a map.

use super::settings::Settings;
use crate::map::read_walls;
use rohrpost_modules::ModuleError;
use rohrpost_modules::interfaces::{Destination, WheelsInterface};
use rohrpost_modules::runtime::{Context, ModuleClock, Moment, Stream};
use rohrpost_modules::types::{Odometry, Pose};
use rohrpost_robot::world::World;
use rohrpost_supervision::{Command, Located, MapPose, Mounting, Order, Place, Safety, Scan, Walls, Wormhole};
use std::time::Duration;

pub(super) struct Navigation {
    odometry: Option<Stream<Odometry>>,
    clock: ModuleClock,
    age_max_ns: u64,
    /// What drives after a missed deadline; none: the robot halts.
    safety: Option<Safety>,
    map: Option<Map>,
    /// The run of the odometry's module by which walls are known, and since when, ns.
    frame: Option<(u32, u64)>,
}

/// Walls that are known.
struct Map {
    world: World,
    walls: Walls,
    /// Where the odometry begins.
    start: Pose,
}

impl Navigation {
    /// # Errors
    /// The odometry's module is unknown, or on another node; the map cannot be read.
    pub(super) fn open(settings: &Settings, context: &mut Context) -> Result<Self, ModuleError> {
        let age_max_ns = settings.scan_age_max_ns();
        let map = settings.walls.as_ref().map(|known| {
            let (world, start) = read_walls(&context.path(&known.map), known.absolute)?;
            Ok::<_, ModuleError>(Map { world, walls: settings.known_walls(known), start })
        });
        let open = |odometry: &String| context.stream(WheelsInterface::ODOMETRY, odometry);
        let odometry = settings.odometry.as_ref().map(open).transpose()?;
        Ok(Self {
            odometry: odometry.map(|stream| stream.with_gap(Duration::from_nanos(age_max_ns))),
            clock: context.clock().clone(),
            age_max_ns,
            safety: settings.safety(),
            map: map.transpose()?,
            frame: None,
        })
    }

    /// From where on something that moves may come, by beam of a scan that was taken then; empty without a map, and as
    /// long as there is no odometry from after the scan.
    pub(super) fn moving_m(&mut self, taken: Moment, scan: &Scan<'_>, mounting: Mounting) -> Vec<f32> {
        if !self.keeps_frame() {
            return Vec::new();
        }
        let (Some(Map { world, walls, start }), Some(odometry)) = (&self.map, &mut self.odometry) else {
            return Vec::new();
        };
        let Ok(Ok(Odometry { pose, .. })) = odometry.at(taken) else { return Vec::new() };
        let Pose { x_m, y_m, heading_rad } = Pose::from(start.isometry() * pose.isometry());
        // A robot in a wall is one of which the place is not known.
        if world.disc_is_blocked(x_m, y_m, 0.0) {
            return Vec::new();
        }
        let mut moving_m = vec![0.0; scan.ranges_m.len()];
        let is_wall = |x_m, y_m, radius_m| world.disc_is_blocked(x_m, y_m, radius_m);
        walls.moving_m(scan, mounting, MapPose { x_m, y_m, heading_rad }, is_wall, &mut moving_m);
        moving_m
    }

    /// Whether the odometry counts from where it counted first: another run of its module begins somewhere else.
    /// Records of the run before may be among the first ones, so these are not used.
    fn keeps_frame(&mut self) -> bool {
        let now_ns = self.clock.monotonic_ns();
        let Some(Ok(Some(newest))) = self.odometry.as_mut().map(Stream::newest) else { return false };
        let run = newest.info().incarnation;
        let (first, since_ns) = *self.frame.get_or_insert((run, now_ns));
        run == first && now_ns.saturating_sub(since_ns) > self.age_max_ns
    }

    /// A person has looked, and put the robot where the map has its start.
    pub(super) fn reset(&mut self) {
        self.frame = None;
    }

    /// What the wormhole itself would tell the motor, within the envelope; to be asked at each look.
    pub(super) fn command(&mut self, now_ns: u64, wormhole: &Wormhole) -> Option<Command> {
        let located = if self.safety.is_some() { self.located(now_ns) } else { None };
        self.safety.as_mut()?.command(now_ns, wormhole, located)
    }

    /// Another node's program begins with orders of its own.
    pub(super) fn forget(&mut self, settings: &Settings) {
        self.safety = settings.safety();
    }

    /// The program names its destination, or that it has none.
    ///
    /// # Errors
    /// Says what is wrong with it.
    pub(super) fn set_destination(&mut self, order: Order, destination: Option<Destination>) -> Result<(), String> {
        let located = self.located(self.clock.monotonic_ns());
        // A robot that halts has no use for it, and its program need not know that.
        let Some(safety) = &mut self.safety else { return Ok(()) };
        let place = match (destination, located) {
            (Some(Destination { x_m, y_m }), Some(Located { place, .. })) => Some(Place { x_m, y_m, ..place }),
            (Some(_), None) => return Err("the odometry tells no pose now, so the destination has no frame".into()),
            (None, _) => None,
        };
        safety.set_destination(order, place).map_err(|refusal| refusal.to_string())
    }

    /// Where the robot is now; none without a record that is new enough and can be read.
    fn located(&mut self, now_ns: u64) -> Option<Located> {
        let newest = self.odometry.as_mut()?.newest().ok()??;
        let info = newest.info();
        if now_ns.saturating_sub(info.written_ns) > self.age_max_ns {
            return None;
        }
        let pose = newest.read().ok()?.pose;
        // Each run of the odometry's module begins where the robot is then.
        let place = Place { frame: info.incarnation, x_m: pose.x_m, y_m: pose.y_m };
        Some(Located { place, heading_rad: pose.heading_rad })
    }
}
