//! Two groups that meet: how long until all robots have the same view, in virtual time.

use super::world::{BEAT_NS, GOOD, MS_NS, RANGE_MM, World, id, settings};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::Failure;
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use rohrpost_bench_local::statistics::Summary;
use rohrpost_team::Position;
use rohrpost_testbed::sim::link::Quality;
use std::cell::Cell;

const ROBOTS: u8 = 20;
const MERGES: u64 = 100;
/// For so long views have to stay equal, and at the latest then they are.
const WATCHED_NS: u64 = 20 * BEAT_NS;
/// Between two looks at the views.
const LOOK_NS: u64 = 10 * MS_NS;
/// ScaleCube's members, where 1 % of messages are lost: from their own tests, on another computer.
const SCALECUBE_MS: f64 = 2700.0;

pub(super) fn case() -> Case {
    Case::new("merge of 20, 10 % loss", None, "ms", |settings, subject| {
        let next_seed = Cell::new(0);
        let merges = if settings.quick { 2 } else { MERGES };
        // The same robots meet in each round, with other losses.
        let turn = || {
            let first = next_seed.replace(next_seed.get() + merges);
            (first..first + merges).map(equal_after_ms).collect()
        };
        let contenders = [
            Contender::sampled("rohrpost", turn),
            Contender::fixed("1.5 s", Summary { p99: Some(1500.0), ..Summary::single(1500.0) })
                .beside(None, at_most(1.0)),
            Contender::fixed("ScaleCube, 1 % loss", Summary::single(SCALECUBE_MS)),
        ];
        Ok(compare(settings, subject, &contenders))
    })
}

/// From the moment at which two groups of ten come into range until all views are equal for good, ms.
fn equal_after_ms(seed: u64) -> Result<f64, Failure> {
    let mut world = World::new(seed, Quality { loss_ppm: 100_000, ..GOOD }, settings(75));
    for system in 1..=ROBOTS {
        world.add(id(system), i32::from(system % 2) * 2 * RANGE_MM as i32);
    }
    world.run_beats(5);
    // Each group sees an intruder.
    for system in [1, 2] {
        world.see(id(system), Position { x_mm: i32::from(system) * 1000, y_mm: 50_000 });
    }
    // No beat of any robot is a beat of the merge.
    let rest_ns = world.chance.below(BEAT_NS);
    world.run_until(world.now_ns + 10 * BEAT_NS + rest_ns);
    (1..=ROBOTS).for_each(|system| world.move_to(id(system), 0));
    let merged_ns = world.now_ns;
    let mut equal_ns = None;
    while world.now_ns < merged_ns + WATCHED_NS {
        equal_ns = if views_are_equal(&world) { equal_ns.or(Some(world.now_ns)) } else { None };
        world.run_until(world.now_ns + LOOK_NS);
    }
    let equal_ns = equal_ns.ok_or_else(|| Failure::Failed(format!("views of seed {seed} do not become equal")))?;
    Ok((equal_ns - merged_ns) as f64 / MS_NS as f64)
}

/// All are in range of each other.
fn views_are_equal(world: &World) -> bool {
    let digests = world.team(id(1)).view().digests();
    (2..=ROBOTS).all(|system| world.team(id(system)).view().digests() == digests)
}
