//! 64 robots on maps of 32 x 32 cells.

use crate::drawn::Crossing;
use crate::valid::check;
use rohrpost_team::coordination::plan_ways;

const ROBOTS: usize = 64;
const LOOKS_MAX: u32 = 500;

#[test]
fn sixty_four_robots_find_ways_that_are_not_much_longer_than_if_they_were_alone() {
    let maps = std::env::var("ROHRPOST_WAYS").map_or(10, |maps| maps.parse().expect("a number of maps"));
    let (mut steps, mut alone) = (0, 0);
    for seed in 0..maps {
        let Crossing { grid, trips, .. } = Crossing::new(seed, 32, 20, ROBOTS);
        let what = format!("map {seed}");
        let ways = plan_ways(&grid, &[], &trips, LOOKS_MAX).unwrap_or_else(|error| panic!("{what}: {error}"));
        check(&grid, &[], &trips, &ways, &what);
        steps += ways.steps();
        alone += Crossing::new(seed, 32, 20, ROBOTS).alone();
    }
    eprintln!("{maps} maps: {steps} steps, {alone} alone");
    assert!(steps * 10 <= alone * 13, "{steps} steps, {alone} alone");
}
