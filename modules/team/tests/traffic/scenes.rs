//! What users of fleets report: robots head on, a crossing of four, two that exchange places, one that stands.

use crate::world::{MAP, S_NS, SETTINGS, World, cell, grid, id};
use rohrpost_team::Version;
use rohrpost_team::coordination::{Claim, NoWays, Planner, Stance, Target, Traffic, TrafficMessage};
use rohrpost_team::grid::Cell;
use rohrpost_team::view::ObjectId;
use std::collections::BTreeMap;

/// Robots 1, 2 and so on, with their ways.
fn world(text: &str, ways: &[(&str, &str)]) -> (World, BTreeMap<rohrpost_team::RobotId, Cell>) {
    let mut world = World::new(1, grid(text));
    let mut goals = BTreeMap::new();
    for (system, (from, to)) in (1..).zip(ways) {
        world.add(system, cell(from), Some(cell(to)));
        goals.insert(id(system), cell(to));
    }
    (world, goals)
}

const CORRIDOR: &str = "........\n****.***\n";

#[test]
fn two_head_on_in_a_corridor_pass_each_other_at_the_next_place() {
    let (mut world, goals) = world(CORRIDOR, &[("0,0", "7,0"), ("7,0", "0,0")]);
    world.run_until(60 * S_NS, "head on", |world| world.are_at(&goals));
}

#[test]
fn four_at_a_crossing_pass_one_after_the_other() {
    let text = "**.**\n**.**\n.....\n**.**\n**.**\n";
    let ways = [("0,2", "4,2"), ("4,2", "0,2"), ("2,0", "2,4"), ("2,4", "2,0")];
    let (mut world, goals) = world(text, &ways);
    world.run_until(90 * S_NS, "a crossing of four", |world| world.are_at(&goals));
}

#[test]
fn two_exchange_places_again_and_again() {
    let (mut world, goals) = world(CORRIDOR, &[("0,0", "7,0"), ("7,0", "0,0")]);
    let mut goals: Vec<Cell> = goals.into_values().collect();
    for turn in 0..4 {
        let now = BTreeMap::from([(id(1), goals[0]), (id(2), goals[1])]);
        (1..=2).for_each(|system| world.body(system).traffic.set_goal(Some(now[&id(system)])));
        world.run_until(60 * S_NS, &format!("exchange {turn}"), |world| world.are_at(&now));
        goals.reverse();
    }
}

#[test]
fn a_robot_that_is_halted_is_passed_or_it_is_told_that_nothing_leads_past_it() {
    let around = "......\n.****.\n......\n";
    let (mut world, mut goals) = self::world(around, &[("0,0", "5,0"), ("2,0", "2,0")]);
    goals.remove(&id(2));
    world.body(2).traffic.set_frozen(true);
    world.run_until(60 * S_NS, "around it", |world| world.are_at(&goals));
    let (mut world, _) = self::world("......\n", &[("0,0", "5,0"), ("2,0", "2,0")]);
    world.body(2).traffic.set_frozen(true);
    world.run(30 * S_NS);
    let expected = [(id(1), NoWays::Parted { from: cell("0,0"), to: cell("5,0") })];
    assert_eq!(world.body(1).traffic.given_up(), expected);
    // It is let go again.
    world.body(2).traffic.set_frozen(false);
    world.body(2).traffic.set_goal(Some(cell("5,0")));
    world.body(1).traffic.set_goal(Some(cell("4,0")));
    let goals = BTreeMap::from([(id(1), cell("4,0")), (id(2), cell("5,0"))]);
    world.run_until(60 * S_NS, "let go", |world| world.are_at(&goals));
}

#[test]
fn a_dead_robot_is_gone_around_and_its_claim_holds_nobody() {
    let around = "......\n.****.\n......\n";
    let (mut world, mut goals) = world(around, &[("0,0", "5,0"), ("5,0", "0,0")]);
    let began = cell("5,0");
    world.run_until(60 * S_NS, "it begins", |world| world.bodies[&id(2)].cell != began);
    world.body(2).is_alive = false;
    goals.remove(&id(2));
    world.run_until(90 * S_NS, "around the dead one", |world| world.are_at(&goals));
}

#[test]
fn a_robot_that_is_pushed_or_lost_is_told_and_the_others_go_on() {
    let (mut world, mut goals) = world("......\n......\n", &[("0,0", "5,0"), ("0,1", "5,1")]);
    world.run(8 * S_NS);
    goals.remove(&id(2));
    world.lose(2);
    world.run_until(60 * S_NS, "beside a lost one", |world| world.are_at(&goals));
    assert_eq!(world.body(2).traffic.next_cell(), None);
    let body = world.body(2);
    body.cell = cell("0,0");
    body.traffic.set_place(Some(cell("0,0")));
    assert_eq!(world.body(2).traffic.pushed(), 1);
    let goals = BTreeMap::from([(id(2), cell("5,1"))]);
    world.run_until(60 * S_NS, "found again", |world| world.are_at(&goals));
}

/// A teammate that stands below the corridor claims its middle, again and again, and never goes.
#[test]
fn a_claim_that_is_not_used_ends() {
    let mut planner = Planner::new(grid("...\n*.*\n"));
    let mut traffic = Traffic::new(id(2), 1, MAP, SETTINGS, 0);
    traffic.set_place(Some(cell("0,0")));
    traffic.set_goal(Some(cell("2,0")));
    let stance = Stance { cell: cell("1,1"), goal: None, post: None, is_frozen: true };
    let claim = Some(Claim { number: 1, cell: cell("1,0") });
    let (mut counter, mut place) = (0, cell("0,0"));
    for tick in 0..300 {
        let now_ns = tick * S_NS / 10;
        if let Some(TrafficMessage { round, digest, claim: wanted, .. }) = traffic.poll(now_ns, &mut planner) {
            counter += 1;
            let (from, held, moment) = (id(1), vec![stance.cell], 0);
            let version = Version { incarnation: 1, counter };
            let echoes = wanted.map(|claim| (id(2), claim.number)).into_iter().collect();
            let stance = Some(stance);
            let idle = TrafficMessage { from, version, map: MAP, held, claim, echoes, round, stance, digest, moment };
            traffic.hear(now_ns, &idle);
        }
        if let Some(next) = traffic.next_cell() {
            place = next;
            traffic.set_place(Some(next));
        }
    }
    assert_eq!(place, cell("2,0"), "a claim that is not used ends");
}

#[test]
fn robots_with_unequal_views_stand_until_they_are_equal() {
    let (mut world, goals) = world(CORRIDOR, &[("0,0", "7,0"), ("7,0", "0,0")]);
    let id = ObjectId { observer: id(1), number: Version { incarnation: 1, counter: 1 } };
    world.body(1).traffic.set_intruders(vec![Target { id, cells: vec![cell("4,1")] }]);
    world.run(SETTINGS.max_age_ns + SETTINGS.agree_ns / 2);
    let stands = [1, 2].map(|system| world.body(system).cell);
    assert_eq!(stands, ["0,0", "7,0"].map(cell), "robots that know different things do not plan");
    world.body(1).traffic.set_intruders(Vec::new());
    world.run_until(60 * S_NS, "equal views", |world| world.are_at(&goals));
}
