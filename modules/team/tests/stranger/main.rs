//! Robots of a team in Python, written from `docs/src/wire.md` alone (`tests/e2e/python/team.py`), beside ones in Rust:
//! they read and write the same bytes, refuse the same, and agree.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod robots;
mod world;

use robots::{Robot, Stranger, hex, unhex};
use rohrpost_team::group::Hello;
use rohrpost_team::view::Records;
use rohrpost_testbed::sim::chance::Chance;
use rohrpost_testbed::sim::radio::Place;
use world::{RANGE_MM, World, clock_ns, id};

#[test]
fn robots_in_python_and_in_rust_are_one_team_through_losses_deaths_and_merges() {
    for seed in 0..4 {
        let loss_ppm = [0, 100_000][seed as usize % 2];
        let mut world = World::new(seed, loss_ppm);
        // Two groups out of range of each other, each with both kinds; the greatest and the least id are in Python.
        for (system, x_mm) in [(9, 0), (12, 0), (200, 0)] {
            let robot = if system == 200 { Robot::python(id(system), 3) } else { Robot::rust(id(system)) };
            world.add(id(system), robot, x_mm);
        }
        for system in [5, 7, 100] {
            let robot = if system == 5 { Robot::python(id(system), 1) } else { Robot::rust(id(system)) };
            world.add(id(system), robot, 3 * RANGE_MM as i32);
        }
        world.run_beats(8);
        [200, 9, 5, 100].into_iter().for_each(|system| world.see(id(system), 50_000));
        world.run_beats(12);
        // Now they come together in a row: both in Python hear all but the other end.
        for (at, system) in [9, 12, 5, 200, 7, 100].into_iter().enumerate() {
            world.radio.put(id(system), Place { x_mm: at as i32 * RANGE_MM as i32 / 2, y_mm: 0 });
        }
        world.run_beats(if loss_ppm == 0 { 10 } else { 24 });
        world.assert_agreed((5, 200), 4, &format!("seed {seed}, merged"));
        let records = world.records;
        world.run_beats(10);
        assert!(loss_ppm > 0 || world.records == records, "seed {seed}: a team that agrees sends hellos alone");
        // The leader dies, and comes back without its store: teammates tell it its objects and its incarnation.
        world.kill(id(5));
        world.run_beats(16);
        world.assert_agreed((7, 200), 4, &format!("seed {seed}, without the leader"));
        world.add(id(5), Robot::python(id(5), 1), RANGE_MM as i32);
        world.run_beats(12);
        world.see(id(5), 90_000);
        world.run_beats(16);
        world.assert_agreed((5, 200), 5, &format!("seed {seed}, with a restarted leader"));
    }
}

/// A row, so that counters and records come over others, with a link that goes one way, losses, robots that start again
/// without their stores, and more records than a robot keeps and a synchro holds.
#[test]
fn a_robot_in_python_says_in_each_beat_what_one_in_rust_says_that_heard_the_same() {
    let (mut synchros, mut hellos) = (0, 0);
    for seed in 0..2 {
        let mut world = World::new(seed, [0, 300_000][seed as usize % 2]);
        let row: Vec<u8> = (0..10).map(|at| 11 + at * 23).collect();
        let twin = row[world.chance.below(10) as usize];
        let start = |world: &mut World, at: usize| {
            let robot = if row[at] == twin { Robot::twins(id(twin)) } else { Robot::rust(id(row[at])) };
            world.add(id(row[at]), robot, at as i32 * RANGE_MM as i32 / 3);
        };
        (0..row.len()).for_each(|at| start(&mut world, at));
        world.radio.shade(id(row[2]), id(row[4]));
        for round in 0..15 {
            for _ in 0..world.chance.below(40) {
                let seer = row[world.chance.below(10) as usize];
                // A twin keeps fewer than it may: which ones it forgets is its own affair.
                if seer != twin || world.chance.below(2) == 0 {
                    world.number += 1000;
                    world.see(id(seer), world.number);
                }
            }
            if round % 5 == 4 {
                let at = world.chance.below(10) as usize;
                world.kill(id(row[at]));
                let down = world.chance.below(24);
                world.run_beats(down);
                start(&mut world, at);
            }
            world.run_beats(3);
            world.robots.get_mut(&id(twin)).unwrap().known(clock_ns(id(twin), world.now_ns));
        }
        synchros += world.records;
        hellos += world.hellos;
    }
    assert!(synchros > 200 && hellos > 1000, "{synchros} messages of records, {hellos} hellos");
}

/// The bytes of a block of the page.
fn block(name: &str) -> Vec<u8> {
    let page = include_str!("../../../../docs/src/wire.md");
    let text = page.split(&format!("\n```hex {name}\n")).nth(1).unwrap().split("\n```").next().unwrap();
    unhex(&text.lines().map(|line| line.split("  ").next().unwrap().replace(' ', "")).collect::<String>())
}

/// What Rust writes again of a message, if it is one.
fn again(bytes: &[u8]) -> Option<Vec<u8>> {
    if bytes.first() == Some(&b'H') {
        Hello::decode(bytes).ok().map(|hello| hello.encode())
    } else {
        Records::decode(bytes).ok().map(|records| records.encode())
    }
}

#[test]
fn python_reads_and_refuses_what_rust_does() {
    let (mut stranger, mut chance) = (Stranger::new(), Chance::new(1));
    let examples = [block("team-hello"), block("team-records")];
    let (mut read, mut refused) = (0, 0);
    for case in 0..4000 {
        let mut bytes = examples[case % 2].clone();
        // The first two are as they stand.
        for _ in 0..case / 2 % 4 {
            match chance.below(8) {
                0 => bytes.truncate(chance.below(bytes.len() as u64) as usize),
                1 => bytes.push(chance.bits() as u8),
                _ if bytes.is_empty() => {}
                _ => {
                    let at = chance.below(bytes.len() as u64) as usize;
                    bytes[at] = [0, 1, 2, 4, 8, 33, 254, 255, chance.bits() as u8][chance.below(9) as usize];
                }
            }
        }
        if bytes.is_empty() {
            continue;
        }
        let answer = stranger.ask(&format!("again {}", hex(&bytes)));
        match again(&bytes) {
            Some(again) => {
                assert_eq!(again, bytes, "what Rust reads it writes alike");
                assert_eq!(answer, hex(&again));
                read += 1;
            }
            None => {
                assert!(answer.starts_with("malformed"), "Python reads what Rust refuses: {}", hex(&bytes));
                refused += 1;
            }
        }
    }
    assert!(read > 1000 && refused > 1000, "{read} read, {refused} refused");
}
