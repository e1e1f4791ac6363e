//! What a team's module is told of its robot and its team.

use crate::settings::{self, Called, RefusedSetting};
use rohrpost_modules::interface::Interface;
use rohrpost_modules::interfaces::{LaserInterface, WheelsInterface};
use rohrpost_modules::types::Pose;
use rohrpost_team::TeamSettings;
use rohrpost_team::group::GroupSettings;
use rohrpost_team::view::ViewSettings;
use serde::Deserialize;

const MILLISECOND_NS: u64 = 1_000_000;
const SECOND_NS: f64 = 1e9;

/// Times and distances are to be the same for all robots of a team.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub(crate) struct Settings {
    /// A text map, see `robot::world`: the same file for all robots.
    pub(super) map: Option<String>,
    /// Tells how the robot has moved from its start.
    pub(super) odometry: Option<String>,
    /// Sees what is no wall of the map.
    pub(super) laser: Option<String>,
    /// Where odometry begins; without odometry, where the robot stands.
    pub(super) start: Option<Start>,
    /// File that keeps the incarnation through a restart of the computer.
    pub(super) store: Option<String>,
    /// From one hello to the next.
    pub(super) beat_ms: u32,
    max_age_ms: u32,
    gate_m: f64,
    sightings: u32,
    certainty_max_age_s: f64,
    intruder_max_age_s: f64,
    friend_max_age_s: f64,
    friend_radius_m: f64,
    speed_max_m_s: f64,
    drift_ppm: u32,
    clock_off_s: f64,
}

/// A place on the team's map.
#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct Start {
    x_m: f64,
    y_m: f64,
    #[serde(default)]
    heading_rad: f64,
}

impl From<Start> for Pose {
    fn from(start: Start) -> Self {
        Self { x_m: start.x_m, y_m: start.y_m, heading_rad: start.heading_rad }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            map: None,
            odometry: None,
            laser: None,
            start: None,
            store: None,
            beat_ms: 500,
            max_age_ms: 3750,
            gate_m: 0.5,
            sightings: 3,
            certainty_max_age_s: 10.0,
            intruder_max_age_s: 120.0,
            friend_max_age_s: 30.0,
            friend_radius_m: 0.5,
            speed_max_m_s: 1.5,
            drift_ppm: 100,
            clock_off_s: 60.0,
        }
    }
}

impl Settings {
    /// Echoes so near to each other are one obstacle, metres.
    pub(super) fn gate_m(&self) -> f64 {
        self.gate_m
    }

    pub(super) fn team(&self) -> TeamSettings {
        let ns = |seconds: f64| (seconds * SECOND_NS) as u64;
        let mm = |metres: f64| (metres * 1000.0) as u64;
        let view = ViewSettings {
            gate_mm: mm(self.gate_m),
            sightings: self.sightings,
            certainty_max_age_ns: ns(self.certainty_max_age_s),
            intruder_max_age_ns: ns(self.intruder_max_age_s),
            friend_max_age_ns: ns(self.friend_max_age_s),
            friend_radius_mm: mm(self.friend_radius_m),
            speed_max_mm_s: mm(self.speed_max_m_s),
        };
        let beat_ns = u64::from(self.beat_ms) * MILLISECOND_NS;
        let group = GroupSettings { beat_ns, max_age_ns: u64::from(self.max_age_ms) * MILLISECOND_NS };
        TeamSettings { group, view, drift_ppb: self.drift_ppm.saturating_mul(1000), clock_off_ns: ns(self.clock_off_s) }
    }
}

fn refused(key: &'static str, why: String) -> Result<(), RefusedSetting> {
    Err(RefusedSetting { key, why })
}

impl settings::Settings for Settings {
    fn check(&self) -> Result<(), RefusedSetting> {
        for (key, value, least, most) in [
            ("beat-ms", f64::from(self.beat_ms), 20.0, 10_000.0),
            ("max-age-ms", f64::from(self.max_age_ms), 40.0, 30_000.0),
            ("gate-m", self.gate_m, 0.01, 100.0),
            ("sightings", f64::from(self.sightings), 1.0, 1000.0),
            ("certainty-max-age-s", self.certainty_max_age_s, 0.1, 86_400.0),
            ("intruder-max-age-s", self.intruder_max_age_s, 0.1, 86_400.0),
            ("friend-max-age-s", self.friend_max_age_s, 0.1, 86_400.0),
            ("friend-radius-m", self.friend_radius_m, 0.0, 100.0),
            ("speed-max-m-s", self.speed_max_m_s, 0.0, 100.0),
            ("drift-ppm", f64::from(self.drift_ppm), 0.0, 10_000.0),
            ("clock-off-s", self.clock_off_s, 0.001, 1e9),
        ] {
            if !(least..=most).contains(&value) {
                return refused(key, format!("is {value}; use {least} to {most}"));
            }
        }
        if self.max_age_ms < 2 * self.beat_ms {
            let least = 2 * self.beat_ms;
            return refused("max-age-ms", format!("is {}, less than two beats; use {least} or more", self.max_age_ms));
        }
        if self.intruder_max_age_s < self.certainty_max_age_s {
            let least = self.certainty_max_age_s;
            return refused("intruder-max-age-s", format!("is less than `certainty-max-age-s`; use {least} or more"));
        }
        let is_far = |place: f64| !(-1e6..=1e6).contains(&place);
        if self.start.is_some_and(|start| is_far(start.x_m) || is_far(start.y_m) || is_far(start.heading_rad)) {
            return refused("start", "is no place; use numbers from -1000000 to 1000000".into());
        }
        if self.odometry.is_some() && self.map.is_none() && self.start.is_none() {
            return refused("odometry", "begins nowhere; say where in `start`, or name a `map` that marks it".into());
        }
        if self.laser.is_some() && (self.odometry.is_none() && self.start.is_none() || self.map.is_none()) {
            return refused(
                "laser",
                "tells walls from intruders by `map`, and the robot's place by `odometry`; name both".into(),
            );
        }
        Ok(())
    }

    fn calls(&self) -> Vec<Called<'_>> {
        let odometry = self.odometry.as_deref().map(|module| ("odometry", module, WheelsInterface::CLASS));
        let laser = self.laser.as_deref().map(|module| ("laser", module, LaserInterface::CLASS));
        let called = |(key, module, class)| Called { key, module, class };
        odometry.into_iter().chain(laser).map(called).collect()
    }
}

#[cfg(test)]
mod tests {
    use rohrpost_config::Installation;

    const WAY: &str = "[team]\ngroup = \"239.77.0.1:21121\"\naddress = \"10.0.0.1\"\nsecurity = \"none\"\n";

    /// What is told of a robot with this section and these settings.
    fn told(way: &str, settings: &str) -> Vec<String> {
        let text = format!(
            "installation = \"test\"\n[system]\nname = \"robot\"\nid = 1\n[nodes.main]\n{way}[classes]\nodometry = {{ \
             id = 160 }}\nteam-router = {{ id = 100 }}\nlaser = {{ id = 150 }}\nteam = {{ id = 120 }}\ntool = {{ id = \
             16 }}\n[[module]]\nname = \"odometry.0\"\naliases = [\"laser.0\"]\nbuiltin = \"sim\"\nsettings = {{ map = \
             \"building.map\" }}\n[[module]]\nname = \"team.0\"\nbuiltin = \"team\"\ncalls = [\"odometry.0\", \
             \"laser.0\"]\nsettings = {{ {settings} }}\n"
        );
        let installation =
            Installation::parse(&text, "../../config/robot.toml".as_ref()).unwrap_or_else(|errors| panic!("{errors}"));
        crate::check(&installation).into_iter().map(|problem| problem.message).collect()
    }

    #[test]
    fn settings_that_make_no_team_are_told_with_what_would_be_right() {
        for right in [
            "",
            "start = { x-m = 1, y-m = -2.5 }",
            "map = \"building.map\", odometry = \"odometry.0\", laser = \"laser.0\", beat-ms = 100, max-age-ms = 750",
        ] {
            assert_eq!(told(WAY, right), [""; 0], "{right}");
        }
        for (wrong, words) in [
            ("beat-ms = 5", "`beat-ms` is 5; use 20 to 10000"),
            ("max-age-ms = 900", "`max-age-ms` is 900, less than two beats; use 1000 or more"),
            ("gate-m = nan", "`gate-m` is NaN; use 0.01 to 100"),
            ("intruder-max-age-s = 5", "`intruder-max-age-s` is less than `certainty-max-age-s`; use 10 or more"),
            ("odometry = \"odometry.0\"", "`odometry` begins nowhere; say where in `start`"),
            ("laser = \"laser.0\", start = { x-m = 1, y-m = 1 }", "`laser` tells walls from intruders by `map`"),
            ("start = { x-m = inf, y-m = 0 }", "`start` is no place"),
            ("odometry = \"laser.0\", map = \"a.map\"", "but this module calls functions of class `odometry`"),
            ("beat = 5", "beat"),
            ("map = \"no.map\"", "`map` cannot be used: ../../config/no.map: No such file"),
        ] {
            let problems = told(WAY, wrong);
            assert!(problems.iter().any(|problem| problem.contains(words)), "{wrong}: {problems:#?}");
        }
        assert!(told("", "").iter().any(|problem| problem.contains("no other robot hears it; add [team], or [tcp]")));
    }
}
