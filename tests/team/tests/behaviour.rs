//! What robots do when something happens to them.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_payload::{LostCause, Mode, News, RequestKind, Settings};
use rohrpost_team::RobotId;
use rohrpost_team::grid::{Cell, Direction};
use rohrpost_virtual_team::scene::{drawn, entrances_held};
use rohrpost_virtual_team::world::World;

const CORRIDOR: &str = "rohrpost-map 1\ncell_m 1\nmap\n##############\n#            #\n##############\n";

/// An intruder that nobody sees at the start.
const RING: &str = "
****************
*              *
* ............ *
* .          . *
* . ******** R *
* . ******** . *
* I ******** R *
* . ******** . *
* . ******** . *
* .          R *
* ............ *
*              *
****************
";

fn id(system: u8) -> RobotId {
    RobotId::new(system).unwrap()
}

fn corridor(settings: Settings) -> World {
    let mut world = World::new(CORRIDOR, 1.0, settings, 7);
    world.add_robot(id(1), Cell { column: 2, row: 1 }, Direction::East);
    world
}

fn place_m(world: &World, robot: u8) -> (f64, f64) {
    let pose = world.arena.moment(id(robot)).unwrap().pose;
    (pose.x_m, pose.y_m)
}

#[test]
fn a_robot_without_a_pose_stands_says_so_and_goes_on_when_it_comes_again() {
    for settings in [Settings { coordination: None, ..Settings::default() }, Settings::default()] {
        let mut world = corridor(settings);
        let start_m = place_m(&world, 1);
        world.run_s(9);
        assert_ne!(place_m(&world, 1), start_m, "it wanders");
        world.set_pose_comes(id(1), false);
        world.run_s(3);
        let lost_m = place_m(&world, 1);
        let told: Vec<&News> = world.news(id(1)).iter().map(|(_, news)| news).collect();
        assert!(matches!(told.last(), Some(News::Lost(LostCause::Old(1000..=1600)))), "{told:?}");
        assert!(matches!(world.payload(id(1)).unwrap().lost(), Some(LostCause::Old(_))));
        world.run_s(5);
        assert_eq!(place_m(&world, 1), lost_m, "it stands");
        world.set_pose_comes(id(1), true);
        world.run_s(9);
        assert!(matches!(world.news(id(1)).last(), Some((_, News::Found(_)))), "{:?}", world.news(id(1)));
        assert_ne!(place_m(&world, 1), lost_m, "it goes on");
        assert_eq!(world.control(id(1)).len(), 1, "it has kept its promises: {:?}", world.control(id(1)));
    }
}

#[test]
fn a_station_gets_reports_and_ends_all_and_a_stranger_does_not() {
    let mut settings = Settings::default();
    settings.stations.insert(id(9));
    let mut world = corridor(settings);
    for (robot, column) in [(3, 6), (9, 10)] {
        world.add_robot(id(robot), Cell { column, row: 1 }, Direction::East);
    }
    world.run_s(3);
    world.ask(id(9), RequestKind::Info);
    world.ask(id(3), RequestKind::Quit);
    world.run_s(1);
    let reports = world.news(id(9)).iter().filter_map(|(_, news)| match news {
        News::Report { from, report } => Some((*from, report.text.starts_with("wandering at "))),
        _ => None,
    });
    let mut reports: Vec<(RobotId, bool)> = reports.collect();
    reports.sort_unstable();
    assert_eq!(reports, [(id(1), true), (id(3), true)]);
    for robot in [1, 9] {
        assert!(world.news(id(robot)).iter().any(|(_, news)| *news == News::Refused(id(3))), "robot {robot}");
        assert!(world.payload(id(robot)).is_some());
    }
    world.ask(id(9), RequestKind::Quit);
    world.run_s(5);
    for robot in [1, 3] {
        assert!(world.payload(id(robot)).is_none(), "robot {robot} has ended, and is not started again");
        assert_eq!(world.news(id(robot)).last().map(|(_, news)| news), Some(&News::Quit(id(9))));
    }
    assert!(world.payload(id(9)).is_some(), "the station goes on");
}

#[test]
fn robots_wander_until_one_finds_the_intruder_and_all_block_it() {
    for seed in 0..2 {
        let mut world = drawn(RING.trim_start(), Direction::North, Settings::default(), seed);
        let modes = |world: &World| world.alive().filter_map(|id| Some(world.payload(id)?.mode())).collect::<Vec<_>>();
        world.run_s(3);
        assert!(modes(&world).iter().all(|mode| *mode == Mode::Wandering), "seed {seed}: nobody sees it");
        let are_held = |world: &World| {
            let held = entrances_held(world);
            held.len() == 2 && held.values().all(Option::is_some) && modes(world).iter().all(|it| *it == Mode::Blocking)
        };
        let held = world.run_until_holds(400, are_held);
        assert!(held.is_some(), "seed {seed}: {:?}, {:?}", entrances_held(&world), modes(&world));
        world.run_s(20);
        assert!(are_held(&world), "seed {seed}: they stay");
        let referee = world.arena.referee();
        assert_eq!((referee.touches(), referee.two_in_cell()), (0, 0), "seed {seed}: {:?}", referee.incidents());
    }
}
