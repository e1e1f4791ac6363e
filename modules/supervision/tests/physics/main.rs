//! The envelope against the physics of the simulated robot: whatever is commanded, nothing is touched; without it, the
//! same commands touch.
//!
//! `ROHRPOST_ENVELOPE_WORLDS=100000 cargo test --release -p rohrpost-supervision --test physics` is the full run.

mod greedy;
mod people;
mod trial;
mod walls;

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rohrpost_robot::world::World;
use rohrpost_supervision::{Command, Limits};
use trial::{Drive, Outcome, Supervision, Trial};

/// Steps of one world.
const STEPS: u64 = 1500;

fn world(random: &mut ChaCha8Rng) -> World {
    const SIDE: usize = 30;
    let blocks = random.random_range(0.01..0.06);
    let mut text = "rohrpost-map 1\ncell_m 0.3\nmap\n".to_owned();
    for row in 0..SIDE {
        for column in 0..SIDE {
            let from_start = row.abs_diff(SIDE / 2).max(column.abs_diff(SIDE / 2));
            let is_rim = row.min(column) == 0 || row.max(column) == SIDE - 1;
            let is_block = is_rim || (from_start > 2 && random.random_bool(blocks));
            text.push(if from_start == 0 {
                '>'
            } else if is_block {
                '#'
            } else {
                ' '
            });
        }
        text.push('\n');
    }
    World::parse(&text).expect("it is a map")
}

/// Has another idea now and then: on the spot, mostly straight ahead and fast, or anything.
fn whim() -> Drive {
    Box::new(|random, limits: &Limits, _, _| {
        if !random.random_bool(0.02) {
            return None;
        }
        let (speed, turn) = (limits.speed_max_m_s, limits.turn_rate_max_rad_s);
        let (speed_m_s, turn_rate_rad_s) = match random.random_range(0..10) {
            0..4 => (0.0, random.random_range(-turn..turn)),
            4..8 => (speed, random.random_range(-0.2 * turn..0.2 * turn)),
            _ => (random.random_range(-1.2 * speed..1.2 * speed), random.random_range(-turn..turn)),
        };
        Some(Command { speed_m_s, turn_rate_rad_s })
    })
}

fn worlds() -> u64 {
    std::env::var("ROHRPOST_ENVELOPE_WORLDS").ok().and_then(|count| count.parse().ok()).unwrap_or(100)
}

#[test]
fn nothing_is_touched_whatever_is_commanded_and_without_the_envelope_it_is() {
    let mut sum = Outcome::default();
    for seed in 0..worlds() {
        let mut trial = Trial::new(seed, world, whim(), Supervision::Envelope);
        let outcome = trial.run(STEPS);
        assert_eq!(outcome.bumps, 0, "seed {seed}: {outcome:?}");
        sum.checked += outcome.checked;
        sum.changed += outcome.changed;
        sum.way_m += outcome.way_m;
    }
    let is_touched = |seed: &u64| Trial::new(*seed, world, whim(), Supervision::Nothing).run(STEPS).bumps > 0;
    let bare = (0..worlds().min(100)).filter(is_touched).count() as u64;
    assert!(bare * 2 > worlds().min(100), "without the envelope only {bare} worlds were touched");
    assert!(sum.changed * 5 > sum.checked, "the envelope had too little to do: {sum:?}");
    assert!(sum.way_m > worlds() as f64, "the robot hardly drives: {sum:?}");
}
