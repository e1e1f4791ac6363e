//! Distances and ages of a view, and what a robot gives it.

use crate::ids::{Position, RobotId, Version};

/// Distances and ages; the same for all robots of a team.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct ViewSettings {
    /// Sightings at most so far apart are one intruder, mm.
    pub gate_mm: u64,
    /// Looks that must see an obstacle before it is an intruder.
    pub sightings: u32,
    /// An intruder that its observer saw longer ago is not certain, ns: CERTAINTY_MAX_AGE.
    pub certainty_max_age_ns: u64,
    /// An intruder that its observer saw longer ago is forgotten, ns: INTRUDER_MAX_AGE.
    pub intruder_max_age_ns: u64,
    /// For so long a silent teammate may have driven on, ns: FRIEND_MAX_AGE.
    pub friend_max_age_ns: u64,
    /// From a teammate's position to its rim, with the error of both positions, mm.
    pub friend_radius_mm: u64,
    /// Greatest speed of a teammate, mm/s.
    pub speed_max_mm_s: u64,
}

/// A teammate, where it was last.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Friend {
    /// The teammate.
    pub robot: RobotId,
    /// Where it was.
    pub position: Position,
    /// How long ago, ns.
    pub age_ns: u64,
}

impl Friend {
    /// Whether the teammate can be at a place.
    pub(crate) fn can_be_at(&self, place: Position, settings: &ViewSettings) -> bool {
        let age_ms = self.age_ns.min(settings.friend_max_age_ns) / 1_000_000;
        let driven_mm = settings.speed_max_mm_s.saturating_mul(age_ms) / 1000;
        place.is_within(self.position, settings.friend_radius_mm.saturating_add(driven_mm))
    }
}

/// An obstacle that is no intruder yet.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub(crate) struct Track {
    pub(crate) position: Position,
    pub(crate) sightings: u32,
    pub(crate) seen_ns: u64,
}

/// Numbers that a view gives its own records.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub(crate) struct Numbers {
    /// Of the newest own record.
    pub(crate) version: Version,
    /// Own records that were written since they were last sent.
    pub(crate) unsent: std::collections::BTreeSet<Version>,
}
