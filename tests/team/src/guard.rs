//! What stands between a payload and its motor: the cores of the module `wormhole`, driven as that drives them.

use rohrpost_modules::types::{LaserScan, Pose};
use rohrpost_payload::Ground;
use rohrpost_supervision::{
    Change, Command, Driver, Envelope, Limits, Located, MapPose, Motion, Mounting, NoSight, Place, Promise, Safety,
    Scan, Settings, Sight, Walls, Wormhole,
};
use std::sync::Arc;

/// A scan that is older is none, ns.
const SCAN_AGE_MAX_NS: u64 = 300_000_000;
/// The wormhole drives for so long after a missed deadline, ns.
const SAFETY_NS: u64 = 20_000_000_000;
/// Error of pose, map and reading together, metres.
const WALL_ERROR_M: f64 = 0.08;
/// Error of the heading, radians.
const WALL_ERROR_RAD: f64 = 0.01;

/// A scan that is believed, with from where on something may come.
struct SeenScan {
    taken_ns: u64,
    scan: LaserScan,
    moving_m: Vec<f32>,
}

/// See the module's head. Times are ns of the robot's clock.
pub(crate) struct Guard {
    wormhole: Wormhole,
    envelope: Envelope,
    motion: Motion,
    sight: Sight,
    safety: Safety,
    walls: Walls,
    ground: Arc<Ground>,
    seen: Option<SeenScan>,
    located: Option<Located>,
    has_driven: bool,
}

impl Guard {
    pub(crate) fn new(limits: Limits, ground: Arc<Ground>) -> Self {
        let walls =
            Walls { error_m: WALL_ERROR_M, error_rad: WALL_ERROR_RAD, depth_m: Walls::depth_min_m(WALL_ERROR_M) };
        Self {
            wormhole: Wormhole::new(Settings::default()),
            envelope: Envelope::new(limits, Mounting::default()),
            motion: limits.motion(),
            sight: Sight::new(SCAN_AGE_MAX_NS),
            safety: Safety::new(&limits, SAFETY_NS),
            walls,
            ground,
            seen: None,
            located: None,
            has_driven: false,
        }
    }

    /// A scan came, and the pose from which it was taken, if that is known.
    pub(crate) fn see(&mut self, now_ns: u64, taken_ns: u64, scan: &LaserScan, pose: Option<Pose>) -> Change {
        let since_ns = self.sight.last_taken_ns().unwrap_or(taken_ns);
        let moved = self.has_driven && self.motion.from(since_ns) != Default::default();
        self.located =
            pose.map(|Pose { x_m, y_m, heading_rad }| Located { place: Place { frame: 0, x_m, y_m }, heading_rad });
        match self.sight.look(now_ns, &readings(taken_ns, scan, &[]), moved) {
            Ok(()) => {
                let moving_m = self.moving_m(taken_ns, scan, pose);
                self.seen = Some(SeenScan { taken_ns, scan: scan.clone(), moving_m });
            }
            Err(NoSight::Repeated | NoSight::Old) => {}
            Err(NoSight::Blind | NoSight::Frozen | NoSight::Malformed) => self.seen = None,
        }
        let sees = self.seen.as_ref().is_some_and(|seen| !self.sight.is_old(now_ns, seen.taken_ns));
        self.wormhole.set_sight(now_ns, sees)
    }

    fn moving_m(&self, taken_ns: u64, scan: &LaserScan, pose: Option<Pose>) -> Vec<f32> {
        let Some(Pose { x_m, y_m, heading_rad }) = pose else { return Vec::new() };
        let mut moving_m = vec![0.0; scan.ranges_m.len()];
        let is_wall = |x_m, y_m, radius_m| self.ground.world().disc_is_blocked(x_m, y_m, radius_m);
        let pose = MapPose { x_m, y_m, heading_rad };
        self.walls.moving_m(&readings(taken_ns, scan, &[]), Mounting::default(), pose, is_wall, &mut moving_m);
        moving_m
    }

    /// A promise of the payload, with the place to which its way leads. A refused one changes nothing.
    pub(crate) fn promise(&mut self, now_ns: u64, promise: Promise, destination_m: Option<(f64, f64)>) -> Change {
        let place = destination_m.map(|(x_m, y_m)| Place { frame: 0, x_m, y_m });
        let _ = self.safety.set_destination(promise.order, place);
        self.wormhole.promise(now_ns, 0, Driver::Program, promise).0
    }

    /// What the motor is told now, and what changed.
    pub(crate) fn look(&mut self, now_ns: u64) -> (Command, Change) {
        let change = self.wormhole.look(now_ns);
        let own = self.safety.command(now_ns, &self.wormhole, self.located);
        let command = match (self.wormhole.in_effect(now_ns).or(own), &self.seen) {
            (Some(wanted), Some(seen)) if !self.sight.is_old(now_ns, seen.taken_ns) => {
                let scan = readings(seen.taken_ns, &seen.scan, &seen.moving_m);
                self.envelope.check(now_ns, wanted, &scan, &self.motion).command()
            }
            _ => Command::STOP,
        };
        self.motion.tell(now_ns, command);
        self.has_driven |= command != Command::STOP;
        (command, change)
    }

    /// When to look again at the latest, ns.
    pub(crate) fn due_ns(&self) -> Option<u64> {
        self.wormhole.due_ns()
    }
}

fn readings<'a>(taken_ns: u64, scan: &'a LaserScan, moving_m: &'a [f32]) -> Scan<'a> {
    Scan {
        taken_ns,
        start_rad: scan.start_rad.into(),
        step_rad: scan.step_rad.into(),
        range_max_m: scan.range_max_m.into(),
        ranges_m: &scan.ranges_m,
        moving_m,
    }
}
