//! Places covered by robots, one place after the other: augmenting paths (Kuhn, 1955).

/// Which robot covers which place. What is covered stays covered, maybe by another robot.
#[derive(Debug)]
pub(super) struct Matching {
    place_of: Vec<Option<usize>>,
}

impl Matching {
    pub(super) fn new(robots: usize) -> Self {
        Self { place_of: vec![None; robots] }
    }

    /// Covers one more place; false, and nothing changes, if that is impossible. `can` says whether a robot can cover
    /// a place.
    ///
    /// Sets of places that can be covered are a matroid (Edmonds and Fulkerson, 1965). So trying places by their worth
    /// covers as many as possible, and of those the worthiest.
    pub(super) fn cover(&mut self, place: usize, can: &impl Fn(usize, usize) -> bool) -> bool {
        self.reroute(place, can, &mut vec![false; self.place_of.len()])
    }

    fn reroute(&mut self, place: usize, can: &impl Fn(usize, usize) -> bool, tried: &mut [bool]) -> bool {
        for robot in 0..self.place_of.len() {
            if tried[robot] || !can(robot, place) {
                continue;
            }
            tried[robot] = true;
            if self.place_of[robot].is_none_or(|other| self.reroute(other, can, tried)) {
                self.place_of[robot] = Some(place);
                return true;
            }
        }
        false
    }
}
