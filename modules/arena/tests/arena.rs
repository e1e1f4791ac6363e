//! Bodies of an arena, and its referee.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_arena::{Arena, ArenaSettings, Conduct, Mishap, NoRobot, Thing};
use rohrpost_modules::types::Twist;
use rohrpost_robot::simulator::{Scanner, Settings};
use rohrpost_team::RobotId;
use rohrpost_team::grid::{Cell, Direction, Map};

const TENTH_NS: u64 = 100_000_000;
const AHEAD: Twist = Twist { speed_m_s: 0.5, turn_rate_rad_s: 0.0 };

fn id(system: u8) -> RobotId {
    RobotId::new(system).unwrap()
}

fn cell(column: u32, row: u32) -> Cell {
    Cell { column, row }
}

/// A hall of 10 by 3 cells, which robots of 0.2 m cross side by side.
fn arena() -> Arena {
    let hall = "rohrpost-map 1\ncell_m 1\nmap\n############\n#          #\n#          #\n#          #\n############\n";
    let scanner = Scanner { range_noise_m: 0.0, ..Scanner::default() };
    let robot = Settings { radius_m: 0.2, scanner, ..Settings::default() };
    let settings = ArenaSettings { cell_m: 1.0, robot, intruder_radius_m: 0.25 };
    Arena::new(&Map::read(hall.as_bytes()).unwrap(), settings).unwrap()
}

fn drive(arena: &mut Arena, seconds: u64, robots: &[RobotId]) {
    let start_ns = arena.now_ns();
    for tenth in 0..seconds * 10 {
        arena.step_to(start_ns + tenth * TENTH_NS);
        robots.iter().for_each(|robot| arena.drive(*robot, AHEAD).unwrap());
    }
    arena.step_to(start_ns + seconds * 10 * TENTH_NS);
}

#[test]
fn of_two_that_meet_each_one_that_moves_is_told_and_one_that_stands_is_not() {
    for (moving, touches) in [(vec![id(1)], vec![id(1)]), (vec![id(1), id(2)], vec![id(1), id(2)])] {
        let mut arena = arena();
        arena.add_robot(id(1), cell(2, 2), Direction::East).unwrap();
        arena.add_robot(id(2), cell(6, 2), Direction::West).unwrap();
        drive(&mut arena, 12, &moving);
        let told = arena.referee().incidents().iter().filter_map(|it| match it.mishap {
            Mishap::Touch { by, with: Thing::Robot(_), is_towards: true, .. } => Some(by),
            _ => None,
        });
        let mut told: Vec<RobotId> = told.collect();
        told.sort_unstable();
        assert_eq!(told, touches);
        assert_eq!(arena.referee().touches_towards(), touches.len() as u64);
    }
}

#[test]
fn a_wall_and_an_intruder_are_told_by_their_names() {
    let mut arena = arena();
    arena.add_robot(id(1), cell(8, 1), Direction::East).unwrap();
    arena.add_robot(id(2), cell(6, 3), Direction::East).unwrap();
    arena.add_intruder(cell(8, 3), Conduct::Stands);
    drive(&mut arena, 8, &[id(1), id(2)]);
    let told: Vec<String> = arena.referee().incidents().iter().map(|it| it.mishap.to_string()).collect();
    assert_eq!(
        told,
        [
            "robot 2 touches intruder 0 at 0.50 m/s, moving towards it",
            "robot 1 touches a wall at 0.50 m/s, moving towards it"
        ]
    );
}

#[test]
fn two_in_a_cell_are_told_once_but_not_of_a_robot_that_was_carried_there() {
    let mut arena = arena();
    arena.add_robot(id(1), cell(2, 2), Direction::East).unwrap();
    arena.add_robot(id(2), cell(5, 3), Direction::West).unwrap();
    arena.add_robot(id(3), cell(8, 1), Direction::South).unwrap();
    drive(&mut arena, 2, &[id(1), id(2)]);
    assert_eq!(arena.referee().two_in_cell(), 0, "they pass in rows of their own");
    arena.push(id(2), cell(8, 1)).unwrap();
    drive(&mut arena, 1, &[]);
    assert_eq!(arena.referee().two_in_cell(), 0, "a robot that was carried is excepted");
    arena.add_robot(id(4), cell(6, 2), Direction::North).unwrap();
    drive(&mut arena, 8, &[id(1)]);
    let two = arena.referee().incidents().iter().filter(|it| matches!(it.mishap, Mishap::TwoInCell { .. }));
    assert_eq!(two.map(|it| it.mishap.to_string()).collect::<Vec<_>>(), ["robot 1 comes into 6,2, where robot 4 is"]);
}

#[test]
fn a_scanner_sees_robots_and_intruders_before_the_wall() {
    let mut arena = arena();
    arena.add_robot(id(1), cell(1, 2), Direction::East).unwrap();
    let ahead_m = |arena: &mut Arena| {
        let scan = arena.scan(id(1)).unwrap();
        f64::from(scan.ranges_m[scan.ranges_m.len() / 2])
    };
    assert!((ahead_m(&mut arena) - 8.0).abs() < 1e-6, "nothing is within its range");
    arena.add_intruder(cell(7, 2), Conduct::Stands);
    assert!((ahead_m(&mut arena) - 5.75).abs() < 1e-6);
    arena.add_robot(id(9), cell(4, 2), Direction::North).unwrap();
    assert!((ahead_m(&mut arena) - 2.8).abs() < 1e-6);
    assert_eq!(arena.scan(id(5)), None);
}

#[test]
fn intruders_follow_their_script_flee_from_robots_and_run_into_none() {
    let mut arena = arena();
    arena.add_robot(id(1), cell(2, 2), Direction::East).unwrap();
    arena.add_intruder(cell(10, 1), Conduct::Script { speed_m_s: 0.5, cells: vec![cell(10, 3), cell(6, 3)] });
    arena.add_intruder(cell(4, 2), Conduct::Flees { speed_m_s: 0.4, fears_m: 3.0 });
    let place = |arena: &Arena, number: usize| {
        let disc = arena.intruders().nth(number).unwrap();
        (disc.x_m.floor() as u32, 4 - disc.y_m.floor() as u32)
    };
    arena.step_to(60 * TENTH_NS);
    assert_eq!(place(&arena, 0), (9, 3), "two rows down, then one column");
    arena.step_to(200 * TENTH_NS);
    assert_eq!(place(&arena, 0), (6, 3), "it stands at the end of its script");
    let (column, _) = place(&arena, 1);
    assert!(column >= 5, "it went away from the robot: {column}");
    assert_eq!(arena.referee().touches(), 0);
}

#[test]
fn robots_start_on_paths_each_once_and_equal_calls_give_equal_bits() {
    let mut arena = arena();
    assert_eq!(arena.add_robot(id(1), cell(0, 0), Direction::East), Err(NoRobot::NotAPath(cell(0, 0))));
    arena.add_robot(id(1), cell(1, 1), Direction::East).unwrap();
    assert_eq!(arena.add_robot(id(1), cell(2, 2), Direction::East), Err(NoRobot::Twice(id(1))));
    let mut other = arena.clone();
    drive(&mut arena, 3, &[id(1)]);
    drive(&mut other, 3, &[id(1)]);
    assert_eq!(arena.moment(id(1)), other.moment(id(1)));
    assert_eq!(arena.scan(id(1)), other.scan(id(1)));
}
