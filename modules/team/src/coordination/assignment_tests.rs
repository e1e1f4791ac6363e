//! Assignments beside all permutations, and beside the least sum over all sets of places.

use super::{Way, assign};
use rohrpost_testbed::sim::chance::Chance;

const ROBOTS_MAX: u64 = 7;
/// Sets of places double with each.
const PLACES_MAX: u64 = 12;
/// Longest ways in turn: short ones give many equal sums.
const LENGTHS: [u64; 3] = [2, 6, 40];

fn drawn(chance: &mut Chance, robots: usize, places: usize, percent_out_of_reach: u64) -> Vec<Vec<Way>> {
    let longest = chance.pick(&LENGTHS);
    let mut way = || (!chance.percent(percent_out_of_reach)).then(|| chance.below(longest + 1) as u32);
    (0..robots).map(|_| (0..places).map(|_| way()).collect()).collect()
}

/// What counts, in this order: longest way, sum, sum of squares, and the place of each robot, none last.
type Rank = (u32, u32, u32, Vec<usize>);

fn rank(ways: &[Vec<Way>], place_of: &[Option<usize>]) -> Option<Rank> {
    let of = |(robot, place): (usize, &Option<usize>)| place.map(|place| ways[robot][place]);
    let lengths = place_of.iter().enumerate().filter_map(of).collect::<Option<Vec<u32>>>()?;
    let ids = place_of.iter().map(|place| place.unwrap_or(usize::MAX)).collect();
    let squares = lengths.iter().map(|way| way * way).sum();
    Some((lengths.iter().copied().max().unwrap_or(0), lengths.iter().sum(), squares, ids))
}

/// The least rank of all ways to give each place to another robot.
fn least(ways: &[Vec<Way>], places: usize, place_of: &mut Vec<Option<usize>>, best: &mut Option<Rank>) {
    let given = place_of.iter().flatten().count();
    if given == places {
        let found = rank(ways, place_of);
        *best = [best.take(), found].into_iter().flatten().min();
        return;
    }
    for robot in 0..place_of.len() {
        if place_of[robot].is_none() {
            place_of[robot] = Some(given);
            least(ways, places, place_of, best);
            place_of[robot] = None;
        }
    }
}

#[test]
fn an_assignment_is_the_least_of_all_permutations() {
    let mut chance = Chance::new(1);
    let (mut solved, mut unsolved) = (0, 0);
    for number in 0..2_000 {
        let robots = chance.between(0, ROBOTS_MAX) as usize;
        let places = chance.between(0, robots as u64) as usize;
        let out_of_reach = chance.pick(&[0, 0, 60]);
        let ways = drawn(&mut chance, robots, places, out_of_reach);
        let mut expected = None;
        least(&ways, places, &mut vec![None; robots], &mut expected);
        let found = assign(&ways, places).map(|place_of| rank(&ways, &place_of).unwrap());
        assert_eq!(found, expected, "drawn {number}: {ways:?}");
        if found.is_some() { solved += 1 } else { unsolved += 1 }
    }
    assert!(solved > 1_000 && unsolved > 50, "{solved} {unsolved}");
}

/// The least sum of ways of which none is longer than `longest`: robot by robot, for each set of places that is given.
fn least_sum(ways: &[Vec<Way>], places: usize, longest: u32) -> Option<u32> {
    let mut sums = vec![None; 1 << places];
    sums[0] = Some(0);
    for robot in ways {
        // From the fullest set on, so that each robot has one place at most.
        for given in (0..sums.len()).rev() {
            let Some(sum) = sums[given] else { continue };
            for (place, way) in robot.iter().enumerate().filter(|(place, _)| given & (1 << place) == 0) {
                let Some(way) = way.filter(|way| *way <= longest) else { continue };
                let more: &mut Option<u32> = &mut sums[given | (1 << place)];
                *more = Some(more.map_or(sum + way, |least| least.min(sum + way)));
            }
        }
    }
    sums[(1 << places) - 1]
}

#[test]
fn the_sum_under_the_longest_way_is_the_least_of_all_sets() {
    let mut chance = Chance::new(2);
    let mut solved = 0;
    for number in 0..100 {
        let robots = chance.between(1, 40) as usize;
        let places = chance.between(1, PLACES_MAX.min(robots as u64)) as usize;
        let ways = drawn(&mut chance, robots, places, 10);
        let Some(place_of) = assign(&ways, places) else { continue };
        let (longest, sum, ..) = rank(&ways, &place_of).unwrap();
        assert_eq!(Some(sum), least_sum(&ways, places, longest), "drawn {number}: {ways:?}");
        let shorter = longest.checked_sub(1).and_then(|longest| least_sum(&ways, places, longest));
        assert_eq!(shorter, None, "drawn {number}: a shorter longest way would do: {ways:?}");
        solved += 1;
    }
    assert!(solved > 50, "{solved}");
}
