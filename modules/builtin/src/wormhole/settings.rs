//! What a wormhole is told of its robot.

use crate::settings::{self, Called, RefusedSetting};
use rohrpost_modules::interface::Interface;
use rohrpost_modules::interfaces::{LaserInterface, MotorInterface};
use rohrpost_supervision::{Limits, Mounting, Settings as Times};
use serde::Deserialize;
use std::time::Duration;

const MILLISECOND_NS: u64 = 1_000_000;

/// What safety rests on has no default: radius, limits, brakes and lag of this robot.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Settings {
    /// The real motor, that only the wormhole may command.
    pub(super) motor: String,
    pub(super) laser: String,
    /// The program that drives.
    pub(super) program: String,
    radius_m: f64,
    speed_max_m_s: f64,
    turn_rate_max_rad_s: f64,
    /// The wheels brake at least so hard.
    braking_m_s2: f64,
    /// Turning ends at least so hard.
    turn_braking_rad_s2: f64,
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

impl Settings {
    pub(super) fn limits(&self) -> Limits {
        Limits {
            radius_m: self.radius_m,
            margin_m: self.margin_m,
            speed_max_m_s: self.speed_max_m_s,
            turn_rate_max_rad_s: self.turn_rate_max_rad_s,
            braking_m_s2: self.braking_m_s2,
            turn_braking_rad_s2: self.turn_braking_rad_s2,
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
            ("turn-braking-rad-s2", self.turn_braking_rad_s2, 0.01, 200.0),
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
        ] {
            if !(least..=most).contains(&value) {
                return Err(RefusedSetting { key, why: format!("is {value}; use {least} to {most}") });
            }
        }
        Ok(())
    }

    fn calls(&self) -> Vec<Called<'_>> {
        vec![
            Called { key: "motor", module: &self.motor, class: MotorInterface::CLASS },
            Called { key: "laser", module: &self.laser, class: LaserInterface::CLASS },
        ]
    }
}
