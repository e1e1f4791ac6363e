//! Deaths, restarts, splits, bursts of loss, and two robots of one name.

use crate::world::{BEAT_NS, GOOD, RANGE_MM, World, id, seeds, settings};
use rohrpost_team::group::Notice;
use rohrpost_team::{Position, RobotId};
use rohrpost_testbed::sim::link::Quality;
use rohrpost_testbed::sim::radio::Bursts;

fn team(seed: u64, quality: Quality) -> (World, Vec<RobotId>) {
    let mut world = World::new(seed, quality, settings(75));
    let count = world.chance.between(2, 8) as u8;
    let robots: Vec<RobotId> = (1..=count).map(|system| id(system * 7)).collect();
    robots.iter().for_each(|robot| world.add(*robot, 0));
    world.run_beats(10);
    (world, robots)
}

#[test]
fn a_dead_leader_or_greatest_id_is_replaced_after_max_age_and_two_beats() {
    for seed in seeds() {
        let loss_ppm = [0, 100_000, 300_000][seed as usize % 3];
        let (mut world, robots) = team(seed, Quality { loss_ppm, ..GOOD });
        world.kill(if seed % 2 == 0 { robots[0] } else { *robots.last().unwrap() });
        world.run_until(world.now_ns + BEAT_NS * 95 / 10);
        assert_eq!(world.wrong(), [], "seed {seed}");
    }
}

#[test]
fn a_restarted_robot_is_fresh_at_once_and_its_earlier_incarnation_never_again() {
    for seed in seeds() {
        let (mut world, robots) = team(seed, GOOD);
        let (first, has_store) = (robots[0], seed % 2 == 0);
        world.see(first, Position { x_mm: 0, y_mm: 50_000 });
        world.run_beats(4);
        world.kill(first);
        let down = world.chance.below(20);
        world.run_beats(down);
        let earlier = world.team(first).group().version();
        world.restart(first, has_store);
        // Without its store it hears of its earlier incarnation in the first hello of another one, and goes above.
        world.run_beats(if has_store { 2 } else { 3 });
        assert_eq!(world.wrong(), [], "seed {seed}, down for {down} beats");
        for robot in &robots[1..] {
            let version = world.team(*robot).group().member(first).unwrap().version;
            assert!(version.incarnation > earlier.incarnation, "seed {seed}: {version:?} after {earlier:?}");
        }
        world.run_beats(6);
        assert!(world.views_are_equal(), "seed {seed}");
        let objects = world.team(first).view().objects();
        assert_eq!(objects.len(), 1, "seed {seed}: teammates have kept what it saw before");
        // What it writes now is newer than all that it wrote before.
        world.see(first, Position { x_mm: 9000, y_mm: 50_000 });
        world.run_beats(6);
        assert!(world.views_are_equal() && world.team(robots[1]).view().objects().len() == 2, "seed {seed}");
        let is_duplicate = |robot: &RobotId| world.team(*robot).group().notices().contains(&Notice::Duplicate(first));
        assert!(!robots.iter().any(is_duplicate), "seed {seed}: a restart is no duplicate");
    }
}

#[test]
fn a_split_team_is_two_teams_and_one_again_with_all_that_both_saw() {
    for seed in seeds() {
        let (mut world, robots) = team(seed, Quality { loss_ppm: 100_000, ..GOOD });
        let far = robots.len() / 2;
        for robot in &robots[..far] {
            world.move_to(*robot, 3 * RANGE_MM as i32);
        }
        world.run_beats(12);
        assert_eq!(world.wrong(), [], "seed {seed}");
        let lost = world.team(robots[far]).group().member(robots[0]).unwrap();
        assert!(lost.last_pose.is_some(), "seed {seed}: its last place is known");
        world.see(robots[0], Position { x_mm: 0, y_mm: 50_000 });
        world.see(robots[far], Position { x_mm: 5000, y_mm: 50_000 });
        world.run_beats(5);
        robots.iter().for_each(|robot| world.move_to(*robot, 0));
        world.run_beats(20);
        assert_eq!(world.wrong(), [], "seed {seed}");
        assert!(world.views_are_equal(), "seed {seed}");
        assert_eq!(world.team(robots[0]).view().objects().len(), 2, "seed {seed}");
    }
}

#[test]
fn after_a_burst_without_any_radio_all_is_right_within_two_beats() {
    for seed in seeds() {
        let (mut world, robots) = team(seed, GOOD);
        world.radio.set_quality(Quality { loss_ppm: 1_000_000, ..GOOD });
        world.run_beats(9);
        assert!(robots.iter().all(|robot| world.pair(*robot) == (*robot, *robot)), "seed {seed}: each is alone");
        world.radio.set_quality(GOOD);
        world.run_beats(2);
        assert_eq!(world.wrong(), [], "seed {seed}");
    }
}

/// A hello comes between two bursts, and one after the longest is two beats and the burst younger than that before.
#[test]
fn bursts_that_are_two_beats_shorter_than_max_age_take_nobody_for_dead() {
    let bursts = Bursts { apart_ns: 8 * BEAT_NS, length_ns: BEAT_NS * 36 / 10 };
    assert!(bursts.length_ns_max() + 2 * BEAT_NS <= BEAT_NS * 75 / 10 && bursts.apart_ns_min() > 2 * BEAT_NS);
    for seed in seeds() {
        let (mut world, robots) = team(seed, GOOD);
        world.radio.set_bursts(Some(bursts));
        world.see(robots[0], Position { x_mm: 0, y_mm: 50_000 });
        for quarter in 0..200 {
            assert_eq!(world.wrong(), [], "seed {seed}, quarter {quarter}");
            world.run_until(world.now_ns + BEAT_NS / 4);
        }
        world.radio.set_bursts(None);
        world.run_beats(3);
        assert!(world.views_are_equal(), "seed {seed}");
    }
}
