//! Whether two robots have to exchange places in a corridor, and can: the technique that LaCAM* adds to a step
//! ("Improving LaCAM", its section on swaps). In thought one robot pushes the other one along the corridor until a
//! junction lets them pass. Without that the search finds such an exchange only by chance.

use super::graph::{Graph, NONE};

/// Robots before a step.
pub(super) struct Occupancy<'a> {
    pub(super) graph: &'a Graph,
    /// By robot: steps from each path to its goal.
    pub(super) distances: &'a [Vec<u32>],
    /// By path.
    pub(super) occupant: &'a [u32],
}

/// Two neighbouring paths: a corridor and the direction along it.
#[derive(Clone, Copy)]
struct Pair {
    behind: u32,
    ahead: u32,
}

/// What is at the head of a corridor.
enum Head {
    Junction,
    End,
    Goes(Pair),
}

impl Occupancy<'_> {
    /// The robot that one in `here` has to exchange places with, if it wants to go to `to`: one that is there, or one
    /// beside it that has to pass where the robot stands.
    pub(super) fn partner(&self, robot: u32, here: u32, to: u32, is_free: impl Fn(u32) -> bool) -> Option<u32> {
        if to == here {
            return None;
        }
        let ahead = self.occupant[to as usize];
        if ahead != NONE
            && is_free(ahead)
            && self.is_required(robot, ahead, Pair { behind: here, ahead: to })
            && self.is_possible(Pair { behind: to, ahead: here })
        {
            return Some(ahead);
        }
        let others = self.graph.next(here).filter(|path| *path != to).map(|path| self.occupant[path as usize]);
        let mut others = others.filter(|other| *other != NONE);
        others.find(|other| {
            self.is_required(*other, robot, Pair { behind: here, ahead: to })
                && self.is_possible(Pair { behind: to, ahead: here })
        })
    }

    fn distance(&self, robot: u32, path: u32) -> u32 {
        self.distances[robot as usize][path as usize]
    }

    /// Whether the robot ahead wants to go back where the pusher comes from, all along the corridor.
    fn is_required(&self, pusher: u32, puller: u32, mut pair: Pair) -> bool {
        while self.distance(pusher, pair.ahead) < self.distance(pusher, pair.behind) {
            match self.head(pair) {
                Head::Junction => return false,
                Head::End => break,
                Head::Goes(next) => pair = next,
            }
        }
        let Pair { behind, ahead } = pair;
        let wants = |robot: u32, from: u32, to: u32| self.distance(robot, to) < self.distance(robot, from);
        wants(puller, ahead, behind) && (self.distance(pusher, behind) == 0 || wants(pusher, behind, ahead))
    }

    /// Whether there is a junction at the other end.
    fn is_possible(&self, mut pair: Pair) -> bool {
        let first = pair.behind;
        while pair.ahead != first {
            match self.head(pair) {
                Head::Junction => return true,
                Head::End => return false,
                Head::Goes(next) => pair = next,
            }
        }
        false
    }

    /// Paths beside the one ahead, but for the one behind and dead ends of robots that are at their goals.
    fn head(&self, Pair { behind, ahead }: Pair) -> Head {
        let is_at_rest = |path: u32| {
            let robot = self.occupant[path as usize];
            robot != NONE && self.distance(robot, path) == 0 && self.graph.next(path).count() == 1
        };
        let mut ways = self.graph.next(ahead).filter(|path| *path != behind && !is_at_rest(*path));
        match (ways.next(), ways.next()) {
            (None, _) => Head::End,
            (Some(next), None) => Head::Goes(Pair { behind: ahead, ahead: next }),
            _ => Head::Junction,
        }
    }
}
