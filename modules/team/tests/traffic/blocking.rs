//! The seed's blocking test in traffic, and an intruder that moves.

use crate::world::{S_NS, World, cell, grid, id};
use rohrpost_team::Version;
use rohrpost_team::coordination::{Duty, Participant, Post, Target, share_out};
use rohrpost_team::grid::{Cell, Wave};
use rohrpost_team::view::ObjectId;

const RING: &str = "........\n.******.\n.******.\n.******.\n.******.\n........\n";
const HALL: &str = ".......\n.......\n.......\n.......\n.......\n";
/// Robots around the middle of the hall.
const AROUND: [&str; 4] = ["3,3", "2,4", "1,1", "4,1"];

fn target(at: Cell) -> Target {
    Target { id: ObjectId { observer: id(1), number: Version { incarnation: 1, counter: 1 } }, cells: vec![at] }
}

#[test]
fn five_close_an_intruder_in_from_both_sides_and_close_up() {
    let mut world = World::new(1, grid(RING));
    for (system, at) in (1..).zip(["0,4", "4,0", "5,0", "6,0", "7,0"]) {
        world.add(system, cell(at), None);
    }
    world.see(&[target(cell("0,3"))]);
    let goals = (1..).zip(["0,4", "0,2", "0,1", "0,0", "0,5"]).map(|(system, at)| (id(system), cell(at)));
    let goals = goals.collect();
    world.run_until(120 * S_NS, "ring distances 2, 3 and 2", |world| world.are_at(&goals));
}

/// An intruder goes to and fro between two cells of a hall. For each of them other robots are nearer to the exits.
#[test]
fn an_intruder_that_moves_is_followed_and_nobody_changes_posts() {
    let grid = grid(HALL);
    let robot = |system: u8, at: &str| Participant { robot: id(system), map: 7, cell: Some(cell(at)), post: None };
    let mut robots: Vec<Participant> = (1..).zip(AROUND).map(|(system, at)| robot(system, at)).collect();
    let mut before: Option<Vec<Option<Post>>> = None;
    for at in ["3,2", "4,2", "3,2", "4,2"] {
        let sharing = share_out(&mut Wave::default(), &grid, 7, &robots, &[target(cell(at))], &[]);
        for robot in &mut robots {
            let Duty::Hold { post, .. } = sharing.duties[&robot.robot] else { panic!("four hold four exits") };
            robot.post = Some(post);
        }
        let posts: Vec<Option<Post>> = robots.iter().map(|robot| robot.post).collect();
        assert!(before.is_none_or(|before| before == posts), "nobody changes posts: {posts:?} at {at}");
        before = Some(posts);
    }
}

#[test]
fn an_intruder_that_moves_is_closed_in_where_it_stops() {
    let mut world = World::new(2, grid(HALL));
    for (system, at) in (1..).zip(AROUND) {
        world.add(system, cell(at), None);
    }
    for at in ["3,2", "4,2", "3,2"] {
        world.see(&[target(cell(at))]);
        world.run(5 * S_NS);
    }
    let exits = ["3,1", "2,2", "4,2", "3,3"].map(cell);
    let held = |world: &World| exits.iter().all(|exit| world.bodies.values().any(|body| body.cell == *exit));
    world.run_until(60 * S_NS, "closed in", held);
}
