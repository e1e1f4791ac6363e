//! People walk, walls do not: what a map is good for.

use super::trial::{Drive, Knowledge, Outcome, Supervision, Trial, WALLS};
use super::{STEPS, whim, worlds};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rohrpost_robot::world::World;
use rohrpost_supervision::{Command, Walls};

const WALKING_M_S: f64 = 0.5;

const WITH_WALLS: Supervision = Supervision::WithWalls(Knowledge::By(WALLS));

/// 15 m long, and 0.9 m wide.
fn corridor() -> World {
    let rim = "#".repeat(60);
    let row = |start: char| format!("##### {start}{}#####", " ".repeat(48));
    let (free, start) = (row(' '), row('>'));
    let rows = [&[&*rim; 5][..], &[&*free, &*start, &*free], &[&*rim; 5]].concat();
    World::parse(&format!("rohrpost-map 1\ncell_m 0.3\nmap\n{}\n", rows.join("\n"))).expect("it is a map")
}

/// Corridors of 1.5 m through something solid, with corners and crossings.
fn maze(random: &mut ChaCha8Rng) -> World {
    const SIDE: i32 = 48;
    let mut squares = vec![vec!['#'; SIDE as usize]; SIDE as usize];
    let mut at = [SIDE / 2; 2];
    for bend in 0..24 {
        let step = if random.random() { 1 } else { -1 };
        for _ in 0..random.random_range(4..14) {
            for (row, column) in (-2..=2).flat_map(|row| (-2..=2).map(move |column| (row, column))) {
                squares[(at[0] + row) as usize][(at[1] + column) as usize] = ' ';
            }
            at[bend % 2] = (at[bend % 2] + step).clamp(7, SIDE - 8);
        }
    }
    squares[SIDE as usize / 2][SIDE as usize / 2] = '>';
    let rows: Vec<String> = squares.into_iter().map(String::from_iter).collect();
    World::parse(&format!("rohrpost-map 1\ncell_m 0.3\nmap\n{}\n", rows.join("\n"))).expect("it is a map")
}

/// Full speed ahead.
fn ahead() -> Drive {
    Box::new(|_, limits, _, _| Some(Command { speed_m_s: limits.speed_max_m_s, turn_rate_rad_s: 0.0 }))
}

#[test]
fn along_a_known_corridor_the_robot_drives_and_without_the_map_it_crawls() {
    for seed in 0..10 {
        let way_m = |supervision| {
            let trial = Trial::new(seed, |_| corridor(), ahead(), supervision);
            trial.with_people(0, WALKING_M_S).run(STEPS).way_m
        };
        let (without_m, with_m) = (way_m(Supervision::Envelope), way_m(WITH_WALLS));
        assert!(with_m > 3.0 && without_m < 0.2 * with_m, "seed {seed}: {without_m} m without, {with_m} m with");
    }
}

#[test]
fn nobody_that_walks_is_run_into_with_the_map_or_without_and_with_it_the_robot_gets_further() {
    let mut ways_m = [0.0; 2];
    let (mut pushed, worlds) = (0, worlds().div_ceil(5));
    for seed in 0..worlds {
        let trial = |supervision| Trial::new(seed, maze, whim(), supervision).with_people(20, WALKING_M_S);
        for (way_m, supervision) in ways_m.iter_mut().zip([Supervision::Envelope, WITH_WALLS]) {
            let mut trial = trial(supervision);
            let outcome = trial.run(STEPS);
            assert_eq!((outcome.bumps, outcome.pushes), (0, 0), "seed {seed}, {supervision:?}: {outcome:?}");
            *way_m += outcome.way_m;
        }
        pushed += u64::from(trial(Supervision::Nothing).run(STEPS).pushes > 0);
    }
    assert!(pushed * 4 > worlds, "without the envelope people were run into in {pushed} worlds only");
    assert!(ways_m[1] > 2.0 * ways_m[0], "{ways_m:?} m without and with the map");
}

/// The property above can fail: it does so for what is mistaken for a wall, and for a wall that is not believed.
#[test]
fn with_mistaken_walls_the_robot_runs_into_people_and_walls() {
    let fails = |knowledge, is_touched: &dyn Fn(&Outcome) -> bool| {
        let supervision = Supervision::WithWalls(knowledge);
        let touches = |seed: &u64| {
            let mut trial = Trial::new(*seed, maze, whim(), supervision).with_people(20, WALKING_M_S);
            is_touched(trial.run(STEPS))
        };
        assert!((0..worlds()).any(|seed| touches(&seed)), "{knowledge:?} does no harm: the property shows nothing");
    };
    fails(Knowledge::EachReading, &|outcome| outcome.pushes > 0);
    fails(Knowledge::LeftOut, &|outcome| outcome.bumps > 0);
}

/// Walls that grow, as if they could walk, are found by the way that the robot makes.
#[test]
fn along_a_corridor_of_which_no_wall_is_known_the_map_is_of_no_use() {
    let nothing_is_solid = Walls { depth_m: 0.0, ..WALLS };
    let way_m = |walls| {
        let trial = Trial::new(0, |_| corridor(), ahead(), Supervision::WithWalls(Knowledge::By(walls)));
        trial.with_people(0, WALKING_M_S).run(STEPS).way_m
    };
    assert!(way_m(nothing_is_solid) < 0.2 * way_m(WALLS));
}
