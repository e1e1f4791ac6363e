//! Trips that are none, and what is said of them.

use rohrpost_team::coordination::{Trip, plan_ways};
use rohrpost_team::grid::{Map, Obstacle};

#[test]
fn trips_that_cannot_be_are_told() {
    let grid = Map::read(b"...*.\n* *..\n").unwrap().grid;
    let stopped = Obstacle::read(b"1,0 stopped", &grid).unwrap();
    let parted = "walls or what stands on paths part 0,0 from 2,0; no other robot matters";
    for (trips, obstacles, told) in [
        (&["0,0 1,1"][..], &[][..], "1,1 is no path; a robot starts and ends on a path of the map"),
        (&["9,9 1,0"], &[], "9,9 is no path; a robot starts and ends on a path of the map"),
        (&["0,0 1,0", "0,0 2,0"], &[], "two robots start, or end, at 0,0; give each its own path"),
        (&["0,0 2,0", "1,0 2,0"], &[], "two robots start, or end, at 2,0; give each its own path"),
        (&["0,0 4,0"], &[], "walls or what stands on paths part 0,0 from 4,0; no other robot matters"),
        (&["0,0 2,0"], &stopped, parted),
        (
            &["0,0 1,0", "1,0 0,0"],
            &[],
            "no order of steps leads all robots to their goals; give one of them another goal",
        ),
    ] {
        let trip = |text: &&str| {
            let (from, to) = text.split_once(' ').unwrap();
            Trip { from: from.parse().unwrap(), to: to.parse().unwrap() }
        };
        let trips: Vec<Trip> = trips.iter().map(trip).collect();
        assert_eq!(plan_ways(&grid, obstacles, &trips, 100_000).unwrap_err().to_string(), told);
    }
    let none = plan_ways(&grid, &[], &[], 100).unwrap();
    assert_eq!((none.moments().len(), none.steps()), (1, 0), "nobody has to go anywhere");
    let swap = [("0,0", "2,0"), ("2,0", "0,0")]
        .map(|(from, to)| Trip { from: from.parse().unwrap(), to: to.parse().unwrap() });
    let told = plan_ways(&grid, &[], &swap, 3).unwrap_err().to_string();
    assert_eq!(told, "no ways were found in 3 looks; allow more, or give some robots other goals");
}
