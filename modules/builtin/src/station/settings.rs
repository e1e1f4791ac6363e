//! What a station is told of its team.

use crate::settings::{self, RefusedSetting};
use rohrpost_modules::ModuleError;
use rohrpost_payload::{Ground, Settings as Payload};
use rohrpost_team::TeamSettings;
use serde::Deserialize;
use std::path::Path;

const MILLISECOND_NS: u64 = 1_000_000;

/// As of the payloads of its team.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub(crate) struct Settings {
    /// A map of any format: the same file for all robots.
    pub(super) map: String,
    /// Side of a cell, of a map that does not say it.
    cell_m: Option<f64>,
    /// From one hello to the next.
    pub(super) beat_ms: u32,
    /// With a hello that is older, a robot is silent.
    max_age_ms: u32,
    /// File that keeps the incarnation through a restart of the computer.
    pub(super) store: Option<String>,
}

impl Default for Settings {
    fn default() -> Self {
        Self { map: String::new(), cell_m: None, beat_ms: 500, max_age_ms: 3750, store: None }
    }
}

impl Settings {
    /// Reads the map.
    ///
    /// # Errors
    /// The file cannot be read, or is no floor for a team.
    pub(super) fn ground(&self, path: &Path) -> Result<Ground, ModuleError> {
        let text = std::fs::read(path).map_err(|error| ModuleError::at(path.display(), error))?;
        let ground = Ground::read(&text, self.cell_m, Payload::default().margin_m);
        ground.map_err(|error| ModuleError::at(path.display(), error))
    }

    pub(super) fn team(&self) -> TeamSettings {
        let ns = |ms: u32| u64::from(ms) * MILLISECOND_NS;
        Payload::default().team(ns(self.beat_ms), ns(self.max_age_ms))
    }
}

impl settings::Settings for Settings {
    fn check(&self) -> Result<(), RefusedSetting> {
        let refused = |key, why| Err(RefusedSetting { key, why });
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
        Ok(())
    }
}
