//! What an arena of many robots is told.

use crate::settings::{self, RefusedSetting};
use rohrpost_arena::{ArenaSettings, Conduct};
use rohrpost_robot::simulator::{Scanner, Settings as Robot};
use rohrpost_team::RobotId;
use rohrpost_team::grid::{Cell, Direction};
use serde::{Deserialize, Deserializer};
use std::f64::consts::TAU;

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub(crate) struct Settings {
    /// A map of any format.
    pub(super) map: String,
    /// Side of a cell, of a map that does not say it.
    pub(super) cell_m: Option<f64>,
    /// Where bodies find the arena.
    pub(super) socket: String,
    pub(super) robots: Vec<Robots>,
    pub(super) intruders: Vec<Intruder>,
    pub(super) seed: u64,
    /// Without a command for so long a motor brakes.
    dead_man_ms: u64,
    intruder_radius_m: f64,
    /// What tells a robot's place is off by no more.
    pub(super) pose_error_m: f64,
    pub(super) pose_error_rad: f64,
    pub(super) odometry_rate_hz: f64,
    pub(super) laser_rate_hz: f64,
    beams: usize,
    range_max_m: f64,
}

/// A robot, and where it begins.
#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct Robots {
    pub(super) id: u8,
    #[serde(deserialize_with = "cell")]
    pub(super) cell: Cell,
    #[serde(default)]
    pub(super) facing: Facing,
}

/// An intruder from the beginning on.
#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct Intruder {
    #[serde(deserialize_with = "cell")]
    pub(super) cell: Cell,
    /// Flees from robots at this speed; without: it stands.
    flees_m_s: Option<f64>,
    /// Stands while no robot is so near.
    #[serde(default = "fears_m")]
    fears_m: f64,
}

/// A side of the map.
#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Facing {
    North,
    #[default]
    East,
    South,
    West,
}

fn fears_m() -> f64 {
    3.0
}

fn cell<'de, D: Deserializer<'de>>(from: D) -> Result<Cell, D::Error> {
    String::deserialize(from)?.parse().map_err(serde::de::Error::custom)
}

impl From<Facing> for Direction {
    fn from(facing: Facing) -> Self {
        match facing {
            Facing::North => Self::North,
            Facing::East => Self::East,
            Facing::South => Self::South,
            Facing::West => Self::West,
        }
    }
}

impl Intruder {
    pub(super) fn conduct(self) -> Conduct {
        match self.flees_m_s {
            Some(speed_m_s) => Conduct::Flees { speed_m_s, fears_m: self.fears_m },
            None => Conduct::Stands,
        }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            map: String::new(),
            cell_m: None,
            socket: String::new(),
            robots: Vec::new(),
            intruders: Vec::new(),
            seed: 1,
            dead_man_ms: 100,
            intruder_radius_m: 0.25,
            pose_error_m: 0.02,
            pose_error_rad: 0.005,
            odometry_rate_hz: 10.0,
            laser_rate_hz: 5.0,
            beams: 72,
            range_max_m: 8.0,
        }
    }
}

impl Settings {
    pub(super) fn arena(&self, cell_m: f64) -> ArenaSettings {
        let Self { beams, range_max_m, intruder_radius_m, seed, .. } = *self;
        let scanner = Scanner { beams, range_max_m, field_of_view_rad: TAU, ..Scanner::default() };
        let robot = Robot { seed, scanner, dead_man_ns: self.dead_man_ms * 1_000_000, ..Robot::default() };
        ArenaSettings { cell_m, robot, intruder_radius_m }
    }
}

fn refused(key: &'static str, why: String) -> Result<(), RefusedSetting> {
    Err(RefusedSetting { key, why })
}

impl settings::Settings for Settings {
    fn check(&self) -> Result<(), RefusedSetting> {
        for (key, text) in [("map", &self.map), ("socket", &self.socket)] {
            if text.is_empty() {
                return refused(key, "is missing; name a file".into());
            }
        }
        for (key, value, least, most) in [
            ("dead-man-ms", self.dead_man_ms as f64, 10.0, 60_000.0),
            ("intruder-radius-m", self.intruder_radius_m, 0.01, 10.0),
            ("pose-error-m", self.pose_error_m, 0.0, 10.0),
            ("pose-error-rad", self.pose_error_rad, 0.0, 1.0),
            ("odometry-rate-hz", self.odometry_rate_hz, 0.1, 100.0),
            ("laser-rate-hz", self.laser_rate_hz, 0.1, 100.0),
            ("beams", self.beams as f64, 1.0, 10_000.0),
            ("range-max-m", self.range_max_m, 0.1, 1000.0),
        ] {
            if !(least..=most).contains(&value) {
                return refused(key, format!("is {value}; use {least} to {most}"));
            }
        }
        match self.robots.iter().find(|robot| RobotId::new(robot.id).is_none()) {
            Some(robot) => refused("robots", format!("has id {}, which is no system; use 1 to 254", robot.id)),
            None => Ok(()),
        }
    }
}
