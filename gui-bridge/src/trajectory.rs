//! The trajectory of a robot: all of it, ever more coarsely, in bounded memory.
//!
//! ```text
//!   points    ────────●────────●────────●──▶   chunks are drawn as entities of their own,
//!   chunk     0        1        2       3       so that a new point redraws only the last of them
//! ```
//!
//! When [`POINTS_MAX`] are there every second one goes and the least step doubles. So a trajectory of n points costs
//! O(n) rows altogether, not O(n²).

/// Points that a trajectory keeps.
pub(crate) const POINTS_MAX: usize = 1024;
/// Points of a chunk, without the one it shares with the next.
pub(crate) const CHUNK: usize = 64;
/// Chunks of a full trajectory.
pub(crate) const CHUNKS_MAX: usize = POINTS_MAX.div_ceil(CHUNK);
/// The least step of a new trajectory, metres.
const STEP_M: f32 = 0.05;

const _: () = assert!(POINTS_MAX.is_multiple_of(2 * CHUNK), "a halved trajectory must end with a whole chunk");

/// A bounded polyline.
#[derive(Debug)]
pub(crate) struct Trajectory {
    points: Vec<[f32; 2]>,
    step_m: f32,
}

impl Default for Trajectory {
    fn default() -> Self {
        Self { points: Vec::new(), step_m: STEP_M }
    }
}

/// What has to be drawn anew.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Change {
    /// Nothing: the robot stands, or has hardly moved.
    None,
    /// One chunk.
    Chunk(usize),
    /// Every chunk of a full trajectory; those past the end are empty now.
    All,
}

impl Trajectory {
    /// Goes on to `point`. What is not finite is not a place and is left out.
    pub(crate) fn push(&mut self, point: [f32; 2]) -> Change {
        if !point.iter().all(|part| part.is_finite()) {
            return Change::None;
        }
        if let Some(last) = self.points.last()
            && (point[0] - last[0]).hypot(point[1] - last[1]) < self.step_m
        {
            return Change::None;
        }
        self.points.push(point);
        if self.points.len() < POINTS_MAX {
            return Change::Chunk((self.points.len() - 1).saturating_sub(1) / CHUNK);
        }
        let mut index = 0;
        self.points.retain(|_| {
            index += 1;
            index % 2 == 1
        });
        self.step_m *= 2.0;
        Change::All
    }

    /// The points of a chunk, with the first of the next one so that there is no gap; empty past the end.
    pub(crate) fn chunk(&self, chunk: usize) -> &[[f32; 2]] {
        let start = (chunk * CHUNK).min(self.points.len());
        let end = (start + CHUNK + 1).min(self.points.len());
        &self.points[start..end]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trail_stays_bounded_and_costs_a_bounded_number_of_points_per_step() {
        let mut trajectory = Trajectory::default();
        let (mut drawn, steps) = (0, 50_000);
        for step in 0..steps {
            match trajectory.push([step as f32 * 0.1, 0.0]) {
                Change::None => {}
                Change::Chunk(chunk) => drawn += trajectory.chunk(chunk).len(),
                Change::All => drawn += (0..CHUNKS_MAX).map(|chunk| trajectory.chunk(chunk).len()).sum::<usize>(),
            }
            assert!(trajectory.points.len() < POINTS_MAX);
        }
        assert!(drawn < steps * CHUNK, "{drawn} points drawn for {steps} steps");
        assert_eq!(trajectory.points[0], [0.0, 0.0], "the beginning is still there");
        let last = trajectory.points.last().unwrap()[0];
        assert!(last > steps as f32 * 0.1 - 2.0 * trajectory.step_m, "the end is where the robot is");
    }

    #[test]
    fn chunks_join_without_a_gap() {
        let mut trajectory = Trajectory::default();
        let changes: Vec<Change> = (0..3 * CHUNK).map(|step| trajectory.push([step as f32, 0.0])).collect();
        assert_eq!(changes[CHUNK], Change::Chunk(0), "the point that closes a chunk belongs to it, too");
        assert_eq!(changes[CHUNK + 1], Change::Chunk(1));
        for chunk in 0..2 {
            assert_eq!(trajectory.chunk(chunk).last(), trajectory.chunk(chunk + 1).first(), "chunk {chunk}");
        }
        assert_eq!(trajectory.chunk(7), &[] as &[[f32; 2]]);
    }

    #[test]
    fn a_robot_that_stands_or_is_nowhere_adds_nothing() {
        let mut trajectory = Trajectory::default();
        trajectory.push([1.0, 1.0]);
        for point in [[1.0, 1.0], [1.01, 1.0], [f32::NAN, 0.0], [f32::INFINITY, 0.0]] {
            assert_eq!(trajectory.push(point), Change::None, "{point:?}");
        }
    }
}
