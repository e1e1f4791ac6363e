//! Where something was at a time: a short ring of stamped poses, asked in between.
//!
//! It answers only for the time it knows: between the oldest and the newest pose. What lies outside is said to, and
//! how far; a caller may wait, give up, or take an end on its own account.

use super::wrap_rad;
use crate::types::Pose;
use std::collections::VecDeque;
use thiserror::Error;

/// Why there is no pose for a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum NoPose {
    /// Nothing was put in yet.
    #[error("no pose is known yet")]
    Empty,
    /// The ring has forgotten it, or never knew: the asker is too late.
    #[error("{by_ns} ns before the oldest pose that is kept")]
    Before {
        /// From the time asked for to the oldest pose.
        by_ns: u64,
    },
    /// Not known yet: ask again after the next pose.
    #[error("{by_ns} ns after the newest pose")]
    After {
        /// From the newest pose to the time asked for.
        by_ns: u64,
    },
}

/// A pose that is older than the newest one; it was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the pose is {by_ns} ns older than the newest one")]
pub struct OutOfOrder {
    /// How much older.
    pub by_ns: u64,
}

/// A ring of stamped poses.
///
/// ```
/// use rohrpost_modules::{robot::track::{NoPose, Track}, types::Pose};
/// let mut track = Track::new(100);
/// track.push(1_000, Pose::default()).unwrap();
/// track.push(2_000, Pose { x_m: 1.0, ..Pose::default() }).unwrap();
/// assert_eq!(track.at(1_500).unwrap().x_m, 0.5);
/// assert_eq!(track.at(2_001), Err(NoPose::After { by_ns: 1 }));
/// ```
#[derive(Clone, Debug)]
pub struct Track {
    poses: VecDeque<(u64, Pose)>,
    capacity: usize,
}

impl Track {
    /// Keeps this many poses, two at least; all memory is taken now.
    pub fn new(capacity: usize) -> Self {
        let capacity = capacity.max(2);
        Self { poses: VecDeque::with_capacity(capacity), capacity }
    }

    /// Adds the newest pose; the oldest goes when the ring is full. One with the same stamp replaces the newest.
    pub fn push(&mut self, stamp_ns: u64, pose: Pose) -> Result<(), OutOfOrder> {
        if let Some((newest_ns, newest)) = self.poses.back_mut() {
            if stamp_ns < *newest_ns {
                return Err(OutOfOrder { by_ns: *newest_ns - stamp_ns });
            }
            if stamp_ns == *newest_ns {
                *newest = pose;
                return Ok(());
            }
        }
        if self.poses.len() == self.capacity {
            self.poses.pop_front();
        }
        self.poses.push_back((stamp_ns, pose));
        Ok(())
    }

    /// The pose at a time: on the straight line and the shorter turn between the two poses around it.
    pub fn at(&self, stamp_ns: u64) -> Result<Pose, NoPose> {
        let (Some((oldest_ns, _)), Some((newest_ns, newest))) = (self.poses.front(), self.poses.back()) else {
            return Err(NoPose::Empty);
        };
        if stamp_ns < *oldest_ns {
            return Err(NoPose::Before { by_ns: oldest_ns - stamp_ns });
        }
        if stamp_ns > *newest_ns {
            return Err(NoPose::After { by_ns: stamp_ns - newest_ns });
        }
        let after = self.poses.partition_point(|(known_ns, _)| *known_ns <= stamp_ns);
        let Some((after_ns, after_pose)) = self.poses.get(after) else {
            return Ok(*newest);
        };
        let (before_ns, before_pose) = self.poses[after - 1];
        Ok(between(before_pose, *after_pose, (stamp_ns - before_ns) as f64 / (after_ns - before_ns) as f64))
    }

    /// The newest pose and its stamp.
    pub fn newest(&self) -> Option<(u64, Pose)> {
        self.poses.back().copied()
    }

    /// Forgets all, as after a step of time.
    pub fn clear(&mut self) {
        self.poses.clear();
    }
}

fn between(from: Pose, to: Pose, share: f64) -> Pose {
    Pose {
        x_m: from.x_m + share * (to.x_m - from.x_m),
        y_m: from.y_m + share * (to.y_m - from.y_m),
        heading_rad: wrap_rad(from.heading_rad + share * wrap_rad(to.heading_rad - from.heading_rad)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn pose(x_m: f64, heading_rad: f64) -> Pose {
        Pose { x_m, y_m: -x_m, heading_rad }
    }

    #[test]
    fn answers_only_for_the_time_it_knows() {
        let mut track = Track::new(3);
        assert_eq!(track.at(5), Err(NoPose::Empty));
        for stamp_ns in [10, 20, 30, 40] {
            track.push(stamp_ns, pose(stamp_ns as f64, 0.0)).unwrap();
        }
        for (stamp_ns, answer) in [
            (10, Err(NoPose::Before { by_ns: 10 })),
            (20, Ok(20.0)),
            (25, Ok(25.0)),
            (40, Ok(40.0)),
            (41, Err(NoPose::After { by_ns: 1 })),
        ] {
            assert_eq!(track.at(stamp_ns).map(|pose| pose.x_m), answer, "at {stamp_ns}");
        }
        track.clear();
        assert_eq!(track.at(30), Err(NoPose::Empty));
    }

    #[test]
    fn order_is_kept() {
        let mut track = Track::new(3);
        track.push(10, pose(1.0, 0.0)).unwrap();
        assert_eq!(track.push(7, pose(2.0, 0.0)), Err(OutOfOrder { by_ns: 3 }));
        track.push(10, pose(3.0, 0.0)).unwrap();
        assert_eq!(track.newest(), Some((10, pose(3.0, 0.0))), "the same stamp replaces");
    }

    #[test]
    fn turns_the_short_way_round() {
        let mut track = Track::new(3);
        track.push(0, pose(0.0, PI - 0.1)).unwrap();
        track.push(100, pose(0.0, 0.3 - PI)).unwrap();
        assert!((track.at(50).unwrap().heading_rad - (0.1 - PI)).abs() < 1e-12);
        assert!((track.at(25).unwrap().heading_rad - PI).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn between_two_poses_lies_between(
            steps in prop::collection::vec((1u64..1_000_000, -3.0..3.0), 2..40),
            share in 0.0..1.0,
        ) {
            let mut track = Track::new(16);
            let mut stamps = vec![0];
            for (step_ns, heading_rad) in &steps {
                let stamp_ns = stamps[stamps.len() - 1] + step_ns;
                stamps.push(stamp_ns);
                track.push(stamp_ns, pose(stamp_ns as f64, *heading_rad)).unwrap();
            }
            let oldest_ns = stamps[(stamps.len() - steps.len().min(16))..][0];
            let newest_ns = stamps[stamps.len() - 1];
            let asked_ns = oldest_ns + ((newest_ns - oldest_ns) as f64 * share) as u64;
            let found = track.at(asked_ns).unwrap();
            prop_assert!((found.x_m - asked_ns as f64).abs() < 1e-3);
            let wraps = steps.windows(2).any(|two| (two[0].1 - two[1].1).abs() > PI);
            prop_assert!(found.heading_rad.abs() <= 3.0 + 1e-9 || wraps);
        }
    }
}
