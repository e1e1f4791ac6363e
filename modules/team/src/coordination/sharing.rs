//! Which robot holds which exit of an intruder, and where the others close up. A function of what all robots know, so
//! each computes the same.
//!
//! - **Which exits.** All that robots can reach. If robots are too few, those that matter most: through which an
//!   intruder reaches most paths. Of equal ones the intruders get one each in turn, first those that a robot holds
//!   already, then the nearest, then in the order of the file.
//! - **Which robot.** The least longest way, then the least sum of ways, then the least sum of their squares, then ids:
//!   the robot with the least id gets the first exit in the order of intruders and of the file.
//! - **Hysteresis.** A robot keeps its post as long as the exit is there, and the longest way of all is at most
//!   [`KEPT_STEPS`] longer than without. The post is a side of the intruder, which the robot announces. So an intruder
//!   that moves is followed, and a robot that joins late computes the same as the others.
//! - **The rest** closes up: it takes the paths nearest behind the exits that are held.

use super::assignment::{Way, assign};
use super::exits::{Exit, behind, exits};
use super::matching::Matching;
use super::post::{OpenExit, Post, Target, WhyOpen};
use crate::grid::{Cell, Grid, Obstacle, ObstacleKind, Wave};
use crate::ids::RobotId;
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// How much longer the longest way may be so that robots keep their posts, steps.
pub const KEPT_STEPS: u32 = 4;

/// A fresh robot, this one included.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Participant {
    /// Which robot.
    pub robot: RobotId,
    /// Digest of its map.
    pub map: u64,
    /// Where it is; `None` if it is lost, or has no place, as a station.
    pub cell: Option<Cell>,
    /// The post that it announces.
    pub post: Option<Post>,
}

/// What a robot has to do.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Duty {
    /// Hold an exit.
    Hold {
        /// What the robot announces from now on.
        post: Post,
        /// The exit.
        cell: Cell,
        /// Steps to there, if no robot moves.
        steps: u32,
    },
    /// Wait behind an exit that another robot holds.
    CloseUp {
        /// Where.
        cell: Cell,
        /// Steps to there, if no robot moves.
        steps: u32,
    },
    /// Nothing.
    Idle(WhyIdle),
}

impl Duty {
    /// Where the robot has to go; `None` if nowhere.
    pub fn cell(&self) -> Option<Cell> {
        match self {
            Self::Hold { cell, .. } | Self::CloseUp { cell, .. } => Some(*cell),
            Self::Idle(_) => None,
        }
    }
}

/// Why a robot takes no part.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum WhyIdle {
    /// Cells of its map are not those of this one.
    #[error("it has another map; give all robots the same")]
    OtherMap,
    /// Nobody knows its cell.
    #[error("it does not know its cell")]
    NoCell,
    /// No exit, and no path behind one, is free and in reach.
    #[error("walls, intruders or robots that stand keep it from every place that is free")]
    NoPlace,
}

/// Duties of all robots, and exits that are left.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Sharing {
    /// Of each robot.
    pub duties: BTreeMap<RobotId, Duty>,
    /// Exits that nobody holds, in the order of intruders and of the file.
    pub open: Vec<OpenExit>,
}

/// A robot that takes part.
#[derive(Clone, Copy)]
struct Able {
    robot: RobotId,
    cell: Cell,
    post: Option<Post>,
}

/// Shares the exits of intruders out among the robots with this map. Cells of robots that cannot move, or do not take
/// part, are `stopped`. Equal arguments, in whatever order, give equal answers on every robot.
pub fn share_out(
    wave: &mut Wave,
    grid: &Grid,
    map: u64,
    robots: &[Participant],
    intruders: &[Target],
    stopped: &[Cell],
) -> Sharing {
    let (able, mut duties) = those_able(grid, map, robots);
    let mut intruders: Vec<&Target> = intruders.iter().collect();
    intruders.sort_unstable_by_key(|intruder| intruder.id);
    let bodies = intruders.iter().flat_map(|intruder| &intruder.cells);
    let bodies: Vec<Obstacle> = bodies.map(|cell| Obstacle { cell: *cell, kind: ObstacleKind::Intruder }).collect();
    let standing = stopped.iter().map(|cell| Obstacle { cell: *cell, kind: ObstacleKind::Stopped });
    let blocked: Vec<Obstacle> = bodies.iter().copied().chain(standing).collect();
    let all = exits(wave, grid, &intruders, &bodies, &blocked, able.iter().map(|robot| robot.cell));
    let (held, open): (Vec<_>, Vec<_>) = {
        let worthiest = worthiest(&all, &able);
        all.iter().enumerate().partition(|(at, _)| worthiest.contains(at))
    };
    let held: Vec<&Exit> = held.into_iter().map(|(_, exit)| exit).collect();
    let mut rest = Vec::new();
    for (robot, exit) in able.iter().zip(holders(&held, &able)) {
        match exit.map(|(at, steps)| (held[at], steps)) {
            Some((exit, steps)) => {
                duties.insert(robot.robot, Duty::Hold { post: exit.post, cell: exit.cell, steps });
            }
            None => rest.push(*robot),
        }
    }
    let held: Vec<Cell> = held.iter().map(|exit| exit.cell).collect();
    duties.extend(closing_up(wave, grid, &held, &blocked, &rest));
    Sharing { duties, open: open.into_iter().map(|(_, exit)| why_open(exit, &blocked)).collect() }
}

/// Those that can take an exit, by rising id, and what the others are told.
fn those_able(grid: &Grid, map: u64, robots: &[Participant]) -> (Vec<Able>, BTreeMap<RobotId, Duty>) {
    let (mut able, mut idle) = (BTreeMap::new(), BTreeMap::new());
    for Participant { robot, map: own, cell, post } in robots.iter().copied() {
        match cell.filter(|cell| grid.is_path(*cell)) {
            Some(cell) if own == map => {
                able.insert(robot, Able { robot, cell, post });
            }
            _ => {
                let why = if own == map { WhyIdle::NoCell } else { WhyIdle::OtherMap };
                idle.insert(robot, Duty::Idle(why));
            }
        }
    }
    (able.into_values().collect(), idle)
}

/// The exits to hold: as many as robots can reach, and the worthiest of them.
fn worthiest(all: &[Exit], able: &[Able]) -> Vec<usize> {
    let worth = |at: usize| {
        let exit = &all[at];
        let is_kept = able.iter().any(|robot| robot.post == Some(exit.post));
        (Reverse(exit.reaches), !is_kept, exit.ways.iter().flatten().min(), at)
    };
    // Each intruder's exits by worth; then one of each in turn, among those of equal reach.
    let rank = |at: usize| {
        let of_same = |other: &usize| all[*other].post.intruder == all[at].post.intruder;
        let before = (0..all.len()).filter(of_same).filter(|other| worth(*other) < worth(at)).count();
        (Reverse(all[at].reaches), before, worth(at))
    };
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by_cached_key(|at| rank(*at));
    let mut matching = Matching::new(able.len());
    order.retain(|at| matching.cover(*at, &|robot, exit| all[exit].ways[robot].is_some()));
    order
}

/// For each robot the exit that it holds, if it holds one, and its way to there, steps.
fn holders(held: &[&Exit], able: &[Able]) -> Vec<Option<(usize, u32)>> {
    let ways: Vec<Vec<Way>> = (0..able.len()).map(|robot| held.iter().map(|exit| exit.ways[robot]).collect()).collect();
    let way = |(robot, exit): (usize, &Option<usize>)| exit.and_then(|exit| Some((exit, ways[robot][exit]?)));
    let with_ways = |exits: &[Option<usize>]| exits.iter().enumerate().map(way).collect::<Vec<_>>();
    let longest = |exits: &[Option<usize>]| with_ways(exits).iter().flatten().map(|(_, steps)| *steps).max();
    // The exits were chosen such that robots can hold all of them.
    let best = assign(&ways, held.len()).unwrap_or_else(|| vec![None; able.len()]);
    let bound = longest(&best).map_or(0, |steps| steps.saturating_add(KEPT_STEPS));
    let kept = assign(&keeping(held, able, &ways), held.len());
    with_ways(&kept.filter(|exits| longest(exits).is_some_and(|steps| steps <= bound)).unwrap_or(best))
}

/// The ways that are left if robots keep their posts: of several that announce the same one, the nearest.
fn keeping(held: &[&Exit], able: &[Able], ways: &[Vec<Way>]) -> Vec<Vec<Way>> {
    let mut ways = ways.to_vec();
    for (place, exit) in held.iter().enumerate() {
        let keeps = |robot: &usize| able[*robot].post == Some(exit.post) && exit.ways[*robot].is_some();
        let Some(keeper) = (0..able.len()).filter(keeps).min_by_key(|robot| exit.ways[*robot]) else { continue };
        for (robot, row) in ways.iter_mut().enumerate() {
            for (other, way) in row.iter_mut().enumerate() {
                if (robot == keeper) != (other == place) {
                    *way = None;
                }
            }
        }
    }
    ways
}

/// The robots that hold no exit take the paths nearest behind those that are held.
fn closing_up(
    wave: &mut Wave,
    grid: &Grid,
    held: &[Cell],
    blocked: &[Obstacle],
    rest: &[Able],
) -> Vec<(RobotId, Duty)> {
    if rest.is_empty() {
        return Vec::new();
    }
    let near = behind(wave, grid, held, blocked, rest.iter().map(|robot| robot.cell));
    let mut matching = Matching::new(rest.len());
    let mut places: Vec<usize> = (0..near.len()).collect();
    places.sort_by_key(|place| (near[*place].steps, near[*place].ways.iter().flatten().min(), *place));
    places.retain(|place| matching.cover(*place, &|robot, place| near[place].ways[robot].is_some()));
    places.sort_unstable();
    let ways: Vec<Vec<Way>> =
        (0..rest.len()).map(|robot| places.iter().map(|place| near[*place].ways[robot]).collect()).collect();
    let place_of = assign(&ways, places.len()).unwrap_or_else(|| vec![None; rest.len()]);
    let duty = |(robot, place): (usize, Option<usize>)| {
        let close_up =
            |place: usize| Some(Duty::CloseUp { cell: near[places[place]].cell, steps: ways[robot][place]? });
        let duty = place.and_then(close_up).unwrap_or(Duty::Idle(WhyIdle::NoPlace));
        (rest[robot].robot, duty)
    };
    place_of.into_iter().enumerate().map(duty).collect()
}

fn why_open(exit: &Exit, blocked: &[Obstacle]) -> OpenExit {
    let why = if exit.ways.iter().any(Option::is_some) {
        WhyOpen::TooFewRobots
    } else if blocked.iter().any(|obstacle| obstacle.cell == exit.cell) {
        WhyOpen::Barred
    } else {
        WhyOpen::OutOfReach
    };
    OpenExit { post: exit.post, cell: exit.cell, reaches: exit.reaches, why }
}
