//! What a payload is told of its robot and its team.

use crate::settings::{self, Called, RefusedSetting};
use rohrpost_modules::ModuleError;
use rohrpost_modules::interface::Interface;
use rohrpost_modules::interfaces::{LaserInterface, SupervisorInterface, WheelsInterface};
use rohrpost_payload::{Ground, Settings as Core, Speeds};
use rohrpost_team::{RobotId, TeamSettings};
use serde::Deserialize;
use std::path::Path;

const MILLISECOND_NS: u64 = 1_000_000;

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub(crate) struct Settings {
    /// A map of any format: the same file for all robots.
    pub(super) map: String,
    /// Side of a cell, of a map that does not say it.
    cell_m: Option<f64>,
    /// Tells where the robot is on the map.
    pub(super) odometry: String,
    /// Sees what is no wall of the map.
    pub(super) laser: String,
    /// Takes the promises.
    pub(super) wormhole: String,
    wandering_m_s: f64,
    searching_m_s: f64,
    blocking_m_s: f64,
    /// Whether robots act together; else each plans for itself.
    coordination: bool,
    /// Systems of the stations that the robot obeys.
    stations: Vec<u8>,
    /// From one hello to the next: the same for all robots.
    pub(super) beat_ms: u32,
    /// With a hello that is older, a robot is silent: the same for all robots.
    max_age_ms: u32,
    /// Of what it decides by chance.
    seed: u64,
    /// File that keeps the incarnation through a restart of the computer.
    pub(super) store: Option<String>,
}

impl Default for Settings {
    fn default() -> Self {
        let Speeds { wandering_m_s, searching_m_s, blocking_m_s } = Core::default().speeds;
        Self {
            map: String::new(),
            cell_m: None,
            odometry: "odometry.0".into(),
            laser: "laser.0".into(),
            wormhole: "wormhole.0".into(),
            wandering_m_s,
            searching_m_s,
            blocking_m_s,
            coordination: true,
            stations: Vec::new(),
            beat_ms: 500,
            max_age_ms: 3750,
            seed: 1,
            store: None,
        }
    }
}

impl Settings {
    /// Reads the map.
    ///
    /// # Errors
    /// The file cannot be read, or is no floor for a team.
    pub(super) fn ground(&self, path: &Path) -> Result<Ground, ModuleError> {
        let text = std::fs::read(path).map_err(|error| ModuleError::at(path.display(), error))?;
        let ground = Ground::read(&text, self.cell_m, Core::default().margin_m);
        ground.map_err(|error| ModuleError::at(path.display(), error))
    }

    pub(super) fn payload(&self) -> Core {
        let Self { wandering_m_s, searching_m_s, blocking_m_s, .. } = *self;
        let default = Core::default();
        Core {
            speeds: Speeds { wandering_m_s, searching_m_s, blocking_m_s },
            coordination: default.coordination.filter(|_| self.coordination),
            stations: self.stations.iter().copied().filter_map(RobotId::new).collect(),
            ..default
        }
    }

    pub(super) fn team(&self, payload: &Core) -> TeamSettings {
        payload.team(u64::from(self.beat_ms) * MILLISECOND_NS, u64::from(self.max_age_ms) * MILLISECOND_NS)
    }

    /// A seed that no other robot with the same settings has.
    pub(super) fn seed(&self, system: u8) -> u64 {
        self.seed.wrapping_mul(256).wrapping_add(system.into())
    }
}

fn refused(key: &'static str, why: String) -> Result<(), RefusedSetting> {
    Err(RefusedSetting { key, why })
}

impl settings::Settings for Settings {
    fn check(&self) -> Result<(), RefusedSetting> {
        if self.map.is_empty() {
            return refused("map", "is missing; name the team's map".into());
        }
        for (key, value, least, most) in [
            ("beat-ms", self.beat_ms, 20, 10_000),
            ("max-age-ms", self.max_age_ms, self.beat_ms.saturating_mul(2), 30_000),
        ] {
            if !(least..=most).contains(&value) {
                return refused(key, format!("is {value}; use {least} to {most}"));
            }
        }
        if let Some(station) = self.stations.iter().find(|station| RobotId::new(**station).is_none()) {
            return refused("stations", format!("has {station}, which is no system; use 1 to 254"));
        }
        self.payload()
            .check()
            .map_err(|error| RefusedSetting { key: "wandering-m-s", why: format!("and others: {error}") })
    }

    fn calls(&self) -> Vec<Called<'_>> {
        vec![
            Called { key: "odometry", module: &self.odometry, class: WheelsInterface::CLASS },
            Called { key: "laser", module: &self.laser, class: LaserInterface::CLASS },
            Called { key: "wormhole", module: &self.wormhole, class: SupervisorInterface::CLASS },
        ]
    }
}
