//! Clocks in a world that knows the true time: each promise of the module's page, with many seeds.

mod scenes;
mod strangers;
mod world;

use scenes::SCENES;
use std::time::Duration;
use world::{Conditions, MS, SECOND, World};

/// How many seeds each scene is run with: `ROHRPOST_TIME_SEEDS`, else a few.
fn seeds() -> std::ops::Range<u64> {
    let asked = std::env::var("ROHRPOST_TIME_SEEDS").ok().and_then(|seeds| seeds.parse().ok());
    0..asked.unwrap_or(6)
}

#[test]
fn nodes_agree_soon_and_are_as_exact_as_their_network() {
    // Interval, network; true error of 99 of 100 readings and bound of the median, µs.
    for (interval_ms, ways, off_us, bound_us) in [
        (1, Conditions::LAN, 6, 30),
        (100, Conditions::LAN, 6, 30),
        (1_000, Conditions::LAN, 5, 30),
        (1_000, Conditions { kernel_stamps: false, ..Conditions::LAN }, 40, 80),
        (1_000, Conditions::BAD, 300, 3_000),
        (10_000, Conditions::LAN, 20, 60),
    ] {
        for seed in seeds() {
            let interval_ns = interval_ms * MS;
            let mut world = World::new(seed, 4, &[0, 1, 2], Duration::from_millis(interval_ms), ways);
            world.start_all();
            world.run_until(6 * interval_ns + 3 * SECOND, "agreement", |world| world.agrees(5 * MS));
            world.run((8 * interval_ns).max(SECOND));
            world.errors.clear();
            world.run((8 * interval_ns).max(SECOND));
            let (mut off, mut bound): (Vec<u64>, Vec<u64>) = world.errors.iter().copied().unzip();
            off.sort_unstable();
            bound.sort_unstable();
            let (off, bound) = (off[off.len() * 99 / 100], bound[bound.len() / 2]);
            assert!(off < off_us * 1000 && bound < bound_us * 1000, "off {off}, bound {bound} ns; {}", world.replay);
        }
    }
}

#[test]
fn promises_hold_in_every_scene() {
    for (name, scene) in SCENES {
        for seed in seeds() {
            let mut world = scenes::begin(name, seed);
            scene(&mut world);
        }
    }
}
