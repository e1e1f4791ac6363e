//! What a wormhole is told of its robot.

use crate::settings::{self, Called, RefusedSetting};
use rohrpost_modules::interface::Interface;
use rohrpost_modules::interfaces::{LaserInterface, MotorInterface, WheelsInterface};
use rohrpost_supervision::{Limits, Mounting, Safety, Settings as Times, Walls};
use serde::Deserialize;
use std::time::Duration;

const MILLISECOND_NS: u64 = 1_000_000;

/// What safety rests on has no default: radius, brakes and lag of this robot. Limits have: commands are cut to them.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Settings {
    /// The real motor, that only the wormhole may command.
    #[serde(default = "motor")]
    pub(super) motor: String,
    #[serde(default = "laser")]
    pub(super) laser: String,
    /// The program that drives.
    #[serde(default = "program")]
    pub(super) program: String,
    radius_m: f64,
    #[serde(default = "speed_max_m_s")]
    speed_max_m_s: f64,
    #[serde(default = "turn_rate_max_rad_s")]
    turn_rate_max_rad_s: f64,
    /// The wheels brake at least so hard.
    braking_m_s2: f64,
    /// Turning ends at least so hard. Without it: as wheels inside the outline brake it.
    turn_braking_rad_s2: Option<f64>,
    /// From a command being sent until the motor obeys, at worst.
    lag_ms: u32,
    /// Kept free around the robot.
    #[serde(default = "margin_m")]
    margin_m: f64,
    /// Speed of what else moves.
    #[serde(default)]
    others_m_s: f64,
    #[serde(default)]
    laser_x_m: f64,
    #[serde(default)]
    laser_y_m: f64,
    #[serde(default)]
    laser_heading_rad: f64,
    #[serde(default = "scan_age_max_ms")]
    scan_age_max_ms: u32,
    /// From one look at the command in effect to the next.
    #[serde(default = "look_ms")]
    pub(super) look_ms: u32,
    /// A look may be so late: the wake-up of the process, at worst.
    #[serde(default = "late_ms")]
    late_ms: u32,
    /// Length of the promise that a `drive` is.
    #[serde(default = "promise_ms")]
    promise_ms: u32,
    /// Longest promise.
    #[serde(default = "horizon_ms")]
    horizon_ms: u32,
    /// After control was lost, the program has so long to promise again.
    #[serde(default = "wait_ms")]
    pub(super) wait_ms: u32,
    #[serde(default = "failures_before_restart")]
    failures_before_restart: u32,
    /// So many failures and restarts within `window-s` need a person.
    #[serde(default = "failures_max")]
    failures_max: u32,
    #[serde(default = "window_s")]
    window_s: u32,
    /// Whether the robot is held after a launch of its node, until a person lets it go.
    #[serde(default)]
    pub(super) starts_held: bool,
    /// What becomes of the robot when its program has missed a deadline.
    #[serde(default)]
    safety: SafetyKind,
    /// Longest drive of `greedy`, seconds.
    #[serde(default = "greedy_s")]
    greedy_s: f64,
    /// Tells where the robot is; `greedy` and `walls` need it.
    pub(super) odometry: Option<String>,
    /// Walls that stand still, whatever else moves.
    pub(super) walls: Option<KnownWalls>,
}

/// A map, and how well the robot knows its place on it. Nothing has a default: safety rests on it.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct KnownWalls {
    /// A text map, see `robot::world`. The odometry begins where it marks the robot's start.
    pub(super) map: String,
    /// Whether the odometry tells places on the map itself, as a localisation does; then the map marks no start.
    #[serde(default)]
    pub(super) absolute: bool,
    /// Map, pose and reading are together off by no more.
    pose_error_m: f64,
    pose_error_rad: f64,
    /// Radius of the thinnest thing that moves.
    others_radius_m: f64,
}

/// What becomes of the robot when its program has missed a deadline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum SafetyKind {
    /// The robot brakes.
    #[default]
    Halt,
    /// The robot drives straight to the program's last destination, for a while.
    Greedy,
}

fn motor() -> String {
    "motor.1".into()
}

fn laser() -> String {
    "laser.0".into()
}

fn program() -> String {
    "pilot.0".into()
}

fn speed_max_m_s() -> f64 {
    0.5
}

fn turn_rate_max_rad_s() -> f64 {
    1.5
}

fn margin_m() -> f64 {
    0.05
}

fn scan_age_max_ms() -> u32 {
    300
}

fn look_ms() -> u32 {
    50
}

fn late_ms() -> u32 {
    20
}

fn promise_ms() -> u32 {
    300
}

fn horizon_ms() -> u32 {
    1000
}

fn wait_ms() -> u32 {
    3000
}

fn failures_before_restart() -> u32 {
    Times::default().failures_before_restart
}

fn failures_max() -> u32 {
    Times::default().failures_max
}

fn window_s() -> u32 {
    (Times::default().window_ns / (1000 * MILLISECOND_NS)) as u32
}

fn greedy_s() -> f64 {
    10.0
}

impl Settings {
    /// What drives after a missed deadline; none: the robot halts.
    pub(super) fn safety(&self) -> Option<Safety> {
        let for_ns = (self.greedy_s * 1e9) as u64;
        (self.safety == SafetyKind::Greedy).then(|| Safety::new(&self.limits(), for_ns))
    }

    /// How walls of the map are told from what may move.
    pub(super) fn known_walls(&self, known: &KnownWalls) -> Walls {
        let KnownWalls { pose_error_m: error_m, pose_error_rad: error_rad, others_radius_m, .. } = *known;
        Walls { error_m, error_rad, depth_m: others_radius_m.min(self.radius_m) }
    }

    fn check_walls(&self) -> Result<(), RefusedSetting> {
        let Some(known) = &self.walls else { return Ok(()) };
        let refuse = |why| Err(RefusedSetting { key: "walls", why });
        if self.odometry.is_none() {
            return refuse("goes by odometry; name its module in `odometry`".into());
        }
        for (key, value, least, most) in [
            ("pose-error-m", known.pose_error_m, 0.001, 1.0),
            ("pose-error-rad", known.pose_error_rad, 0.0, 0.5),
            ("others-radius-m", known.others_radius_m, 0.01, 10.0),
        ] {
            if !(least..=most).contains(&value) {
                return refuse(format!("has `{key}` {value}; use {least} to {most}"));
            }
        }
        let (depth_m, least_m) = (self.known_walls(known).depth_m, Walls::depth_min_m(known.pose_error_m));
        if depth_m < least_m {
            return refuse(format!(
                "tells no wall: with `pose-error-m` {}, `others-radius-m` and `radius-m` have to be {least_m} or more",
                known.pose_error_m
            ));
        }
        Ok(())
    }

    /// A wheel that the outline holds, and that brakes as hard as the robot, ends a turn at least so hard.
    fn turn_braking_rad_s2(&self) -> f64 {
        self.turn_braking_rad_s2.unwrap_or(self.braking_m_s2 / self.radius_m)
    }

    /// What the envelope counts on, in words.
    pub(super) fn counts_on(&self) -> String {
        let Limits { speed_max_m_s, turn_rate_max_rad_s, braking_m_s2, turn_braking_rad_s2, others_m_s, .. } =
            self.limits();
        let Self { radius_m, margin_m, lag_ms, look_ms, late_ms, scan_age_max_ms, .. } = self;
        let others = if others_m_s > 0.0 { "" } else { ": only what stands is promised" };
        format!(
            "counts on radius-m = {radius_m}, margin-m = {margin_m}, speed-max-m-s = {speed_max_m_s}, \
             turn-rate-max-rad-s = {turn_rate_max_rad_s}, braking-m-s2 = {braking_m_s2}, \
             turn-braking-rad-s2 = {turn_braking_rad_s2}, lag-ms = {lag_ms}, look-ms = {look_ms}, late-ms = {late_ms}, \
             scan-age-max-ms = {scan_age_max_ms}, others-m-s = {others_m_s}{others}"
        )
    }

    pub(super) fn limits(&self) -> Limits {
        Limits {
            radius_m: self.radius_m,
            margin_m: self.margin_m,
            speed_max_m_s: self.speed_max_m_s,
            turn_rate_max_rad_s: self.turn_rate_max_rad_s,
            braking_m_s2: self.braking_m_s2,
            turn_braking_rad_s2: self.turn_braking_rad_s2(),
            lag_s: f64::from(self.lag_ms) * 1e-3,
            look_s: f64::from(self.look_ms + self.late_ms) * 1e-3,
            others_m_s: self.others_m_s,
        }
    }

    pub(super) fn mounting(&self) -> Mounting {
        Mounting { x_m: self.laser_x_m, y_m: self.laser_y_m, heading_rad: self.laser_heading_rad }
    }

    pub(super) fn times(&self) -> Times {
        Times {
            horizon_ns: u64::from(self.horizon_ms) * MILLISECOND_NS,
            wait_ns: u64::from(self.wait_ms) * MILLISECOND_NS,
            failures_before_restart: self.failures_before_restart,
            failures_max: self.failures_max,
            window_ns: u64::from(self.window_s) * 1000 * MILLISECOND_NS,
        }
    }

    /// From a command being sent until the motor obeys.
    pub(super) fn lag(&self) -> Duration {
        Duration::from_millis(self.lag_ms.into())
    }

    pub(super) fn promise_ns(&self) -> u64 {
        u64::from(self.promise_ms) * MILLISECOND_NS
    }

    pub(super) fn scan_age_max_ns(&self) -> u64 {
        u64::from(self.scan_age_max_ms) * MILLISECOND_NS
    }

    pub(super) fn look_max(&self) -> Duration {
        Duration::from_nanos(self.look_max_ns())
    }

    pub(super) fn look_max_ns(&self) -> u64 {
        u64::from(self.look_ms + self.late_ms) * MILLISECOND_NS
    }
}

impl settings::Settings for Settings {
    fn check(&self) -> Result<(), RefusedSetting> {
        for (key, value, least, most) in [
            ("radius-m", self.radius_m, 0.01, 10.0),
            ("margin-m", self.margin_m, 0.01, 10.0),
            ("speed-max-m-s", self.speed_max_m_s, 0.01, 20.0),
            ("turn-rate-max-rad-s", self.turn_rate_max_rad_s, 0.01, 20.0),
            ("braking-m-s2", self.braking_m_s2, 0.01, 50.0),
            ("turn-braking-rad-s2", self.turn_braking_rad_s2(), 0.01, 200.0),
            ("others-m-s", self.others_m_s, 0.0, 20.0),
            ("laser-x-m", self.laser_x_m, -self.radius_m, self.radius_m),
            ("laser-y-m", self.laser_y_m, -self.radius_m, self.radius_m),
            ("laser-heading-rad", self.laser_heading_rad, -7.0, 7.0),
            ("lag-ms", self.lag_ms.into(), 5.0, 1000.0),
            ("scan-age-max-ms", self.scan_age_max_ms.into(), 10.0, 1000.0),
            ("look-ms", self.look_ms.into(), 1.0, 1000.0),
            ("late-ms", self.late_ms.into(), 0.0, 1000.0),
            ("horizon-ms", self.horizon_ms.into(), 10.0, 60_000.0),
            ("promise-ms", self.promise_ms.into(), 10.0, self.horizon_ms.into()),
            ("wait-ms", self.wait_ms.into(), 100.0, 600_000.0),
            ("failures-max", self.failures_max.into(), 1.0, 16.0),
            ("window-s", self.window_s.into(), 1.0, 86_400.0),
            ("greedy-s", self.greedy_s, 0.1, 600.0),
        ] {
            if !(least..=most).contains(&value) {
                return Err(RefusedSetting { key, why: format!("is {value}; use {least} to {most}") });
            }
        }
        if self.safety == SafetyKind::Greedy && self.odometry.is_none() {
            let why = "is \"greedy\", which goes by odometry; name its module in `odometry`, or use \"halt\"".into();
            return Err(RefusedSetting { key: "safety", why });
        }
        self.check_walls()
    }

    fn calls(&self) -> Vec<Called<'_>> {
        let always = [
            Called { key: "motor", module: &self.motor, class: MotorInterface::CLASS },
            Called { key: "laser", module: &self.laser, class: LaserInterface::CLASS },
        ];
        let odometry = self.odometry.iter();
        let odometry = odometry.map(|module| Called { key: "odometry", module, class: WheelsInterface::CLASS });
        always.into_iter().chain(odometry).collect()
    }
}
