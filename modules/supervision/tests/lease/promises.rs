//! What is promised of all installations.

use crate::world::{Seen, World};
use std::ops::Range;

/// Installations of each run of the tests.
const SEEDS: u64 = 300;

fn number(variable: &str) -> Option<u64> {
    std::env::var(variable).ok().map(|text| text.parse().expect("a number"))
}

fn seeds() -> Range<u64> {
    match number("ROHRPOST_LEASE_SEED") {
        Some(seed) => seed..seed + 1,
        None => 0..number("ROHRPOST_LEASE_SEEDS").unwrap_or(SEEDS),
    }
}

#[test]
fn there_are_never_two_and_soon_one_again() {
    let mut seen = Seen::default();
    for seed in seeds() {
        let mut world = World::new(seed);
        world.suffer();
        let holder = world.recover();
        world.stay(holder);
        seen.add(world.seen);
    }
    // Rare cases must have been there, or nothing was shown about them.
    assert!(seeds().end - seeds().start < SEEDS || seen.has_all(), "{seen:?}");
}
