//! Exits shared out among robots: the seed's example, too few and too many robots, and an intruder that moves.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_team::coordination::{Duty, Participant, Sharing, Target, share_out};
use rohrpost_team::grid::{Cell, Grid, Map, Wave};
use rohrpost_team::view::ObjectId;
use rohrpost_team::{RobotId, Version};
use rohrpost_testbed::sim::chance::Chance;

const MAP: u64 = 7;

fn id(system: u8) -> RobotId {
    RobotId::new(system).unwrap()
}

fn grid(text: &str) -> Grid {
    Map::read(text.as_bytes()).unwrap().grid
}

fn target(number: u32, cells: &[&str]) -> Target {
    let id = ObjectId { observer: id(1), number: Version { incarnation: 1, counter: number } };
    Target { id, cells: cells.iter().map(|cell| cell.parse().unwrap()).collect() }
}

fn robot(system: u8, cell: &str) -> Participant {
    Participant { robot: id(system), map: MAP, cell: Some(cell.parse().unwrap()), post: None }
}

fn share(grid: &Grid, robots: &[Participant], intruders: &[Target], stopped: &[Cell]) -> Sharing {
    share_out(&mut Wave::default(), grid, MAP, robots, intruders, stopped)
}

/// What robots do, in a line each.
fn told(sharing: &Sharing) -> Vec<String> {
    let duty = |(robot, duty): (&RobotId, &Duty)| match duty {
        Duty::Hold { cell, steps, .. } => format!("{robot} holds {cell} in {steps}"),
        Duty::CloseUp { cell, steps } => format!("{robot} closes up to {cell} in {steps}"),
        Duty::Idle(why) => format!("{robot} waits: {why}"),
    };
    sharing.duties.iter().map(duty).chain(sharing.open.iter().map(ToString::to_string)).collect()
}

/// Robots say which posts they have been given, and stand where they were.
fn announced(robots: &[Participant], sharing: &Sharing) -> Vec<Participant> {
    let post = |robot: &Participant| match sharing.duties[&robot.robot] {
        Duty::Hold { post, .. } => Some(post),
        _ => None,
    };
    robots.iter().map(|robot| Participant { post: post(robot), ..*robot }).collect()
}

/// Seed 000, 5.1.1: a ring of one-cell ways, five robots. One holds the south; the others come from the north in line.
const RING: &str = "........\n.******.\n.******.\n.******.\n.******.\n........\n";

#[test]
fn the_seed_s_five_close_up_from_both_sides() {
    let robots = [robot(1, "0,4"), robot(2, "4,0"), robot(3, "5,0"), robot(4, "6,0"), robot(5, "7,0")];
    let sharing = share(&grid(RING), &robots, &[target(1, &["0,3"])], &[]);
    let expected = [
        "1 holds 0,4 in 0",
        "2 holds 0,2 in 6",
        "3 closes up to 0,1 in 6",
        "4 closes up to 0,0 in 6",
        "5 closes up to 0,5 in 12",
    ];
    assert_eq!(told(&sharing), expected, "ring distances 2, 3, 2");
}

#[test]
fn too_few_robots_hold_what_matters_most_and_why_is_told() {
    // West of the intruder is a dead end of two paths, south of it a hall.
    let text = "....*\n**.**\n.....\n.....\n";
    let intruder = [target(1, &["2,0"])];
    let few = share(&grid(text), &[robot(9, "3,0")], &intruder, &[]);
    let expected = [
        "9 holds 3,0 in 0",
        "exit 1,0 to 2 paths is open: no robot can reach it",
        "exit 2,1 to 11 paths is open: no robot can reach it",
    ];
    assert_eq!(told(&few), expected);
    let text = "...\n.*.\n...\n.*.\n...\n";
    let one = share(&grid(text), &[robot(9, "0,0")], &[target(1, &["1,2"])], &[]);
    assert_eq!(
        told(&one),
        [
            "9 holds 0,2 in 2",
            "exit 2,2 to 12 paths is open: robots are too few, and exits that reach as many paths or more are held",
        ]
    );
    let barred = share(&grid(text), &[robot(9, "0,0")], &[target(1, &["1,2"])], &["2,2".parse().unwrap()]);
    let text = "exit 2,2 to 12 paths is open: a robot that stands is in it";
    assert_eq!(told(&barred), ["9 holds 0,2 in 2", text]);
}

#[test]
fn several_intruders_get_one_robot_each_before_any_gets_two() {
    let text = ".......\n.*.*.*.\n.......\n";
    let intruders = [target(1, &["0,1"]), target(2, &["6,1"])];
    let robots = [robot(1, "1,0"), robot(2, "2,0"), robot(3, "1,2")];
    let expected = [
        "1 holds 0,0 in 1",
        "2 holds 6,0 in 4",
        "3 holds 0,2 in 1",
        "exit 6,2 to 16 paths is open: robots are too few, and exits that reach as many paths or more are held",
    ];
    assert_eq!(told(&share(&grid(text), &robots, &intruders, &[])), expected);
    let held: Vec<_> = told(&share(&grid(text), &robots[..2], &intruders, &[]));
    assert!(held[0].contains(" holds ") && held[1].contains(" holds "), "{held:?}");
    let of = |line: &str| line.contains("holds 0,");
    assert_ne!(of(&held[0]), of(&held[1]), "one for each: {held:?}");
}

#[test]
fn robots_that_take_no_part_are_told_why() {
    let grid = grid("...\n");
    let stranger = Participant { map: 8, ..robot(2, "0,0") };
    let lost = Participant { cell: None, ..robot(3, "0,0") };
    let behind = robot(4, "2,0");
    let sharing = share(&grid, &[robot(1, "0,0"), stranger, lost, behind], &[target(1, &["1,0"])], &[]);
    let expected = [
        "1 holds 0,0 in 0",
        "2 waits: it has another map; give all robots the same",
        "3 waits: it does not know its cell",
        "4 holds 2,0 in 0",
    ];
    assert_eq!(told(&sharing), expected);
    let alone = share(&grid, &[robot(1, "0,0"), robot(4, "0,0")], &[target(1, &["1,0"])], &[]);
    assert_eq!(told(&alone)[1], "4 waits: walls, intruders or robots that stand keep it from every place that is free");
}

#[test]
fn a_post_is_given_up_when_that_saves_more_than_a_few_steps() {
    let grid = grid(RING);
    let intruder = [target(1, &["3,0"])];
    let robots = [robot(1, "1,0"), robot(2, "5,0")];
    let west = |sharing: &Sharing| matches!(sharing.duties[&id(1)], Duty::Hold { cell: Cell { column: 2, .. }, .. });
    let sharing = share(&grid, &robots, &intruder, &[]);
    assert!(west(&sharing));
    let posts = announced(&robots, &sharing);
    // They say that they hold the sides that are far from them.
    let crossed = [Participant { post: posts[1].post, ..robots[0] }, Participant { post: posts[0].post, ..robots[1] }];
    assert!(west(&share(&grid, &crossed, &intruder, &[])), "around the ring are 16 steps, not 1");
    // Each is as near to both: what they say counts.
    let hall = self::grid(".....\n.....\n.....\n");
    let robots = [robot(1, "2,0"), robot(2, "2,0")];
    let intruder = [target(1, &["2,2"])];
    let sharing = share(&hall, &robots, &intruder, &[]);
    let posts = announced(&robots, &sharing);
    let crossed = [Participant { post: posts[1].post, ..robots[0] }, Participant { post: posts[0].post, ..robots[1] }];
    let kept = announced(&robots, &share(&hall, &crossed, &intruder, &[]));
    assert_eq!(kept, crossed);
}

#[test]
fn all_robots_compute_the_same_in_whatever_order_they_know_it() {
    let mut chance = Chance::new(3);
    let grid = grid("..........\n.**.**.**.\n..........\n.**.**.**.\n..........\n");
    let paths: Vec<Cell> = grid.cells().map(|(cell, _)| cell).filter(|cell| grid.is_path(*cell)).collect();
    for number in 0..200 {
        let mut robots: Vec<Participant> = (1..=chance.between(1, 9) as u8)
            .map(|system| Participant { robot: id(system), map: MAP, cell: Some(chance.pick(&paths)), post: None })
            .collect();
        let cell = |chance: &mut Chance| chance.pick(&paths).to_string();
        let intruders = [target(1, &[&cell(&mut chance)]), target(2, &[&cell(&mut chance)])];
        let first = share(&grid, &robots, &intruders, &[]);
        robots.reverse();
        let [a, b] = intruders;
        assert_eq!(share(&grid, &robots, &[b, a], &[]), first, "drawn {number}");
        let mut cells: Vec<Cell> = first
            .duties
            .values()
            .filter_map(|duty| match duty {
                Duty::Hold { cell, .. } | Duty::CloseUp { cell, .. } => Some(*cell),
                Duty::Idle(_) => None,
            })
            .collect();
        let count = cells.len();
        cells.sort_unstable();
        cells.dedup();
        assert_eq!(cells.len(), count, "drawn {number}: each robot has its own place");
    }
}
