//! The robots of these worlds, their times, and a good link.

use rohrpost_payload::Settings;
use rohrpost_robot::simulator::{Scanner, Settings as BodySettings};
use rohrpost_supervision::Limits;
use rohrpost_team::TeamSettings;
use rohrpost_testbed::sim::link::Quality;
use std::f64::consts::TAU;

/// A second.
pub const S_NS: u64 = 1_000_000_000;
/// From one beat to the next.
pub const BEAT_NS: u64 = S_NS / 2;

/// A good link: 1 to 20 ms.
pub const GOOD: Quality = Quality {
    delay_ns: 1_000_000,
    jitter_ns: 19_000_000,
    loss_ppm: 0,
    copy_ppm: 0,
    reorder_ppm: 0,
    damage_ppm: 0,
    rate_bytes_s: 0,
};

/// Distances and ages of a team in this world.
pub fn team_settings(settings: &Settings) -> TeamSettings {
    settings.team(BEAT_NS, 15 * BEAT_NS / 2)
}

/// A robot of 0.5 m across that sees all around.
pub(crate) fn body(seed: u64) -> BodySettings {
    let scanner = Scanner { beams: 72, field_of_view_rad: TAU, ..Scanner::default() };
    BodySettings { seed, scanner, ..BodySettings::default() }
}

/// What the envelope is told of the robot, its times, and of what else moves.
pub(crate) fn limits(body: &BodySettings, speed_m_s: f64) -> Limits {
    Limits {
        radius_m: body.radius_m,
        margin_m: 0.05,
        speed_max_m_s: speed_m_s,
        turn_rate_max_rad_s: body.turn_rate_max_rad_s,
        braking_m_s2: body.acceleration_max_m_s2,
        turn_braking_rad_s2: body.turn_acceleration_max_rad_s2,
        lag_s: 0.02,
        look_s: 0.11,
        others_m_s: speed_m_s,
    }
}
