//! Speeds, times and distances of a robot's program.

use rohrpost_team::coordination::TrafficSettings;
use rohrpost_team::group::GroupSettings;
use rohrpost_team::view::ViewSettings;
use rohrpost_team::{RobotId, TeamSettings};
use std::collections::BTreeSet;

/// Fits cells of 1 m, a beat of 500 ms and these speeds.
const TRAFFIC: TrafficSettings = TrafficSettings {
    beat_ns: 500_000_000,
    max_age_ns: 4_000_000_000,
    forget_ns: 60_000_000_000,
    delay_max_ns: 600_000_000,
    step_min_ns: 1_500_000_000,
    claim_ns: 3_000_000_000,
    stall_ns: 5_000_000_000,
    agree_ns: 3_000_000_000,
    extend_ns: 2_000_000_000,
    looks_max: 2000,
};

/// Speeds of the three modes, metres a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Speeds {
    /// WANDERING_SPEED: nothing is known of an intruder.
    pub wandering_m_s: f64,
    /// SEARCHING_SPEED: one is somewhere.
    pub searching_m_s: f64,
    /// BLOCKING_SPEED: its place is known.
    pub blocking_m_s: f64,
}

/// What a payload is told of its robot and its team.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Of the modes.
    pub speeds: Speeds,
    /// Turning, radians a second.
    pub turn_rate_max_rad_s: f64,
    /// How long a promise holds, ns.
    pub promise_ns: u64,
    /// With a newest pose that is older, a robot is lost, ns: POSITION_MAX_AGE.
    pub position_max_age_ns: u64,
    /// A robot is lost that is further from all paths, metres.
    pub margin_m: f64,
    /// From the rim of an intruder to its middle, metres.
    pub intruder_radius_m: f64,
    /// Before an obstacle with its middle nearer than this, the robot freezes, metres.
    pub near_m: f64,
    /// Echoes so near to each other are one obstacle, metres; the gate of the view.
    pub gate_m: f64,
    /// Error of pose and scan together; echoes so near a wall are the wall's, metres.
    pub error_m: f64,
    /// Places to search are at most so many steps from where the intruder was.
    pub search_steps: u32,
    /// Whether robots act together; else each plans for itself, as the seed's do.
    pub coordination: Option<TrafficSettings>,
    /// Stations that this robot obeys.
    pub stations: BTreeSet<RobotId>,
    /// Whether this is a station: it obeys none.
    pub is_station: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            speeds: Speeds { wandering_m_s: 0.3, searching_m_s: 0.4, blocking_m_s: 0.5 },
            turn_rate_max_rad_s: 1.2,
            promise_ns: 500_000_000,
            position_max_age_ns: 1_000_000_000,
            margin_m: 0.25,
            intruder_radius_m: 0.25,
            near_m: 0.7,
            gate_m: 0.75,
            error_m: 0.2,
            search_steps: 4,
            coordination: Some(TRAFFIC),
            stations: BTreeSet::new(),
            is_station: false,
        }
    }
}

/// A setting with which no team works.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RefusedSettings {
    /// Speeds do not rise from mode to mode.
    #[error(
        "speeds are {wandering_m_s}, {searching_m_s} and {blocking_m_s} m/s; expected 0 < wandering < searching < \
         blocking"
    )]
    Speeds {
        /// As given.
        wandering_m_s: f64,
        /// As given.
        searching_m_s: f64,
        /// As given.
        blocking_m_s: f64,
    },
    /// A length or rate that is none.
    #[error("`{key}` is {value}; expected a positive number")]
    NotPositive {
        /// Name of the setting.
        key: &'static str,
        /// As given.
        value: f64,
    },
    /// A promise that holds for no time.
    #[error("`promise_ns` is 0; expected the time until the next promise, such as 500 ms")]
    NoPromise,
}

impl Settings {
    /// Distances and ages of a team of such robots. `beat_ns`: from one hello to the next; `max_age_ns`: with a hello
    /// that is older, a robot is silent.
    pub fn team(&self, beat_ns: u64, max_age_ns: u64) -> TeamSettings {
        const S_NS: u64 = 1_000_000_000;
        let view = ViewSettings {
            gate_mm: (self.gate_m * 1000.0) as u64,
            sightings: 5,
            certainty_max_age_ns: 10 * S_NS,
            intruder_max_age_ns: 120 * S_NS,
            friend_max_age_ns: 30 * S_NS,
            friend_radius_mm: 450,
            speed_max_mm_s: 600,
        };
        let group = GroupSettings { beat_ns, max_age_ns };
        TeamSettings { group, view, drift_ppb: 60_000, clock_off_ns: 60 * S_NS }
    }

    /// Checks all.
    ///
    /// # Errors
    /// The first mistake.
    pub fn check(&self) -> Result<(), RefusedSettings> {
        let Speeds { wandering_m_s, searching_m_s, blocking_m_s } = self.speeds;
        let rises = 0.0 < wandering_m_s && wandering_m_s < searching_m_s && searching_m_s < blocking_m_s;
        if !rises || !blocking_m_s.is_finite() {
            return Err(RefusedSettings::Speeds { wandering_m_s, searching_m_s, blocking_m_s });
        }
        for (key, value) in [
            ("turn_rate_max_rad_s", self.turn_rate_max_rad_s),
            ("margin_m", self.margin_m),
            ("intruder_radius_m", self.intruder_radius_m),
            ("near_m", self.near_m),
            ("gate_m", self.gate_m),
            ("error_m", self.error_m),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(RefusedSettings::NotPositive { key, value });
            }
        }
        if self.promise_ns == 0 { Err(RefusedSettings::NoPromise) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_rise_from_wandering_to_blocking() {
        let speeds = |wandering_m_s, searching_m_s, blocking_m_s| Speeds { wandering_m_s, searching_m_s, blocking_m_s };
        for (speeds, is_right) in [
            (speeds(0.3, 0.4, 0.5), true),
            (speeds(0.4, 0.4, 0.5), false),
            (speeds(0.3, 0.6, 0.5), false),
            (speeds(0.0, 0.4, 0.5), false),
            (speeds(0.3, f64::NAN, 0.5), false),
            (speeds(0.3, 0.4, f64::INFINITY), false),
        ] {
            assert_eq!(Settings { speeds, ..Settings::default() }.check().is_ok(), is_right, "{speeds:?}");
        }
        let refused = Settings { near_m: -1.0, ..Settings::default() }.check().unwrap_err().to_string();
        assert_eq!(refused, "`near_m` is -1; expected a positive number");
    }
}
