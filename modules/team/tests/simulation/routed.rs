//! Hellos and records in datagrams of the routers of a team, plain and sealed: cores of both, with nothing in between.

use crate::merges::right_from;
use crate::world::{BEAT_NS, GOOD, RANGE_MM, Way, World, id, seeds, settings};
use rohrpost_team::Position;
use rohrpost_testbed::sim::link::Quality;

/// Two groups of some robots, each with an intruder, that are at one place after ten seconds.
fn merged(seed: u64, is_sealed: bool, quality: Quality) -> World {
    let mut world = World::new(seed, quality, settings(75)).by(Way::Routed { is_sealed });
    let count = world.chance.between(2, 8) as u8;
    (1..=count).for_each(|system| world.add(id(system), i32::from(system % 2) * 3 * RANGE_MM as i32));
    world.run_beats(12);
    [1, 2].into_iter().for_each(|system| {
        world.see(id(system), Position { x_mm: i32::from(system) * 1000, y_mm: 50_000 });
    });
    world.run_beats(8);
    assert_eq!(world.wrong(), [], "seed {seed}: two groups");
    (1..=count).for_each(|system| world.move_to(id(system), 0));
    world
}

#[test]
fn plain_datagrams_merge_groups_as_soon_as_bare_messages_do() {
    for seed in seeds() {
        let mut world = merged(seed, false, GOOD);
        let (pair, view) = right_from(&mut world, 40);
        let pair = pair.unwrap_or_else(|| panic!("seed {seed}: {:?} are wrong", world.wrong()));
        let view = view.unwrap_or_else(|| panic!("seed {seed}: views differ"));
        assert!(pair <= 8, "seed {seed}: right after {pair} quarters of a beat");
        assert!(view <= pair + 12, "seed {seed}: views equal after {view} quarters, pairs after {pair}");
        assert_eq!(world.team(id(1)).view().objects().len(), 2, "seed {seed}");
    }
}

/// Sealed, a router believes another one when that has answered its challenge: a beat of routers comes within two
/// seconds, and answers soon after it.
#[test]
fn sealed_datagrams_merge_groups_three_seconds_later() {
    let (late_quarters, mut worst) = ((3_000_000_000 * 4 / BEAT_NS) as u32, 0);
    for seed in seeds() {
        let mut world = merged(seed, true, GOOD);
        let (pair, view) = right_from(&mut world, 80);
        let pair = pair.unwrap_or_else(|| panic!("seed {seed}: {:?} are wrong", world.wrong()));
        let view = view.unwrap_or_else(|| panic!("seed {seed}: views differ"));
        assert!(pair <= 8 + late_quarters, "seed {seed}: right after {pair} quarters of a beat");
        assert!(view <= pair + 12, "seed {seed}: views equal after {view} quarters, pairs after {pair}");
        worst = pair.max(worst);
    }
    println!("pairs right after {worst} quarters of a beat at most");
}

#[test]
fn lost_copied_and_reordered_datagrams_and_restarted_routers_do_no_harm() {
    let quality = Quality { loss_ppm: 100_000, copy_ppm: 100_000, reorder_ppm: 100_000, ..GOOD };
    for seed in seeds() {
        let mut world = merged(seed, seed % 2 == 0, quality);
        world.run_beats(40);
        assert_eq!(world.wrong(), [], "seed {seed}");
        assert!(world.views_are_equal(), "seed {seed}");
        world.kill(id(1));
        world.run_beats(10);
        assert_eq!(world.wrong(), [], "seed {seed}: without its leader");
        world.restart(id(1), true);
        world.run_beats(30);
        assert_eq!(world.wrong(), [], "seed {seed}: with it again");
        assert!(world.views_are_equal(), "seed {seed}");
    }
}
