//! The seed's test 5.1.3 in virtual time: what waits for a robot's leaves, and that nothing of it is lost.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_arena::Conduct;
use rohrpost_payload::Settings;
use rohrpost_team::RobotId;
use rohrpost_team::events::Priority;
use rohrpost_team::grid::{Cell, Direction, Map};
use rohrpost_virtual_team::scene::CELL_M;
use rohrpost_virtual_team::world::World;

/// Tasks that wait at a time, in the seed's figure.
const QUEUED_MAX: usize = 8;

/// Robots in a hall, one in every second cell of every second row, and an intruder in a corner.
fn hall(side: usize, robots: u8) -> World {
    let (wall, floor) = ("*".repeat(side + 2), format!("*{}*\n", ".".repeat(side)));
    let text = format!("{wall}\n{}{wall}\n", floor.repeat(side));
    let map = Map::read(text.as_bytes()).unwrap();
    let mut world = World::new(&text, CELL_M, Settings::default(), 1);
    let free = map.grid.cells().map(|it| it.0).filter(|cell| map.grid.is_path(*cell));
    let apart = free.filter(|Cell { column, row }| column % 2 == 1 && row % 2 == 1);
    for (id, cell) in (1..=robots).zip(apart) {
        world.add_robot(RobotId::new(id).unwrap(), cell, Direction::East);
    }
    world.add_intruder(Cell { column: side as u32, row: side as u32 }, Conduct::Stands);
    world
}

fn check(world: &World, robots: usize) {
    let payloads: Vec<_> = world.alive().map(|id| (id, world.payload(id).unwrap())).collect();
    assert_eq!(payloads.len(), robots);
    for (id, payload) in payloads {
        assert_eq!(payload.events_lost(), 0, "robot {id} loses no event");
        for priority in Priority::ALL {
            let most = payload.queued_most(priority);
            assert!(most <= QUEUED_MAX, "robot {id}: {most} events of priority {priority:?} waited at a time");
        }
    }
}

/// Each robot has been alone, and its view differs from those of all others: each sends a synchro, one after the other.
#[test]
fn synchros_of_eight_robots_leave_at_most_eight_events_waiting() {
    let mut world = hall(7, 8);
    for turn in 0..6 {
        world.split((1..=8).filter(|id| (id + turn) % 2 == 0).map(|id| RobotId::new(id).unwrap()));
        world.run_s(8);
        world.split([]);
        world.run_s(5);
    }
    check(&world, 8);
}

/// Robots of which each hears all others; 100 by `ROHRPOST_TEAM_ROBOTS=100`. Tells how quick virtual time is.
#[test]
fn of_many_robots_none_loses_a_beat() {
    let robots = std::env::var("ROHRPOST_TEAM_ROBOTS").map_or(30, |text| text.parse().unwrap());
    let mut world = hall(21, robots);
    let began = std::time::Instant::now();
    world.run_s(10);
    println!("{robots} robots: {:.2} times real time", 10.0 / began.elapsed().as_secs_f64());
    check(&world, robots.into());
}
