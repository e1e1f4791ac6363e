use super::*;
use crate::testing::TestScene;
use rohrpost::interfaces::{
    ArenaIntruder, ArenaMishap, ArenaRobot, PayloadExit, PayloadMode, TeamMember, TeamObject, TeamPlace,
};
use rohrpost::types::Pose;
use std::collections::BTreeMap;

type Components = BTreeMap<String, BTreeMap<String, usize>>;

fn at(x_m: f64) -> Option<Pose> {
    Some(Pose { x_m, ..Pose::default() })
}

/// Robot 2's team: 1 and 5 are with it, 7 is silent, of 8 and 9 no place is known.
fn team() -> TeamState {
    let member = |robot, pose| TeamMember { robot, pose, fresh: true, direct: true, ..TeamMember::default() };
    let members = vec![
        TeamMember { hears: vec![2, 5], ..member(1, at(1.0)) },
        TeamMember { direct: false, ..member(5, at(5.0)) },
        TeamMember { fresh: false, silent_ms: 31_000, ..member(7, at(7.0)) },
        member(8, None),
        member(9, at(f64::NAN)),
    ];
    let objects = vec![TeamObject { x_m: 3.0, certain: true, ..TeamObject::default() }];
    TeamState { robot: 2, leader: 1, group: 5, pose: at(2.0), members, objects, ..TeamState::default() }
}

fn drawn(draw: impl FnOnce(&mut Scene)) -> Components {
    let mut drawing = TestScene::new();
    drawing.at_s(100);
    drawing.components();
    draw(&mut drawing.scene);
    drawing.components()
}

/// How many numbers this entity has of a component.
fn count(all: &Components, entity: &str, component: &str) -> Option<usize> {
    all.get(&format!("/space/{entity}"))?.get(component).copied()
}

#[test]
fn one_robot_tells_of_all_its_team() {
    let all = drawn(|scene| scene.team(team()));
    let robots: Vec<&str> = all.keys().filter_map(|name| name.strip_prefix("/space/robot/")).collect();
    let whole: Vec<&str> = robots.iter().copied().filter(|name| !name.contains('/')).collect();
    assert_eq!(whole, ["1", "2", "5", "7"], "8 and 9 are nowhere");
    let links = count(&all, "links", "LineStrips3D:strips");
    assert_eq!(links, Some(2 * 2), "1 with 2, 1 with 5; 2 hears 8 and 9, but they are nowhere");
    for (robot, corners) in [(1, 25), (2, 0), (5, 0), (7, 0)] {
        let ring = count(&all, &format!("robot/{robot}/leader"), "LineStrips3D:strips");
        assert_eq!(ring, Some(corners), "robot {robot}");
    }
    assert_eq!(count(&all, "intruders", "Cylinders3D:lengths"), Some(1));
    for robot in [1, 2, 5, 7, 8] {
        assert!(all.contains_key(&format!("/groups/robot-{robot}")), "robot {robot} has a group, or is silent");
    }
}

#[test]
fn a_robot_is_drawn_anew_only_when_it_has_changed() {
    let mut drawing = TestScene::new();
    drawing.scene.team(team());
    drawing.rows();
    drawing.scene.team(team());
    let rows = drawing.rows();
    assert!(rows.contains_key("/space/robot/2") && !rows.contains_key("/space/robot/2/body"), "{rows:?}");
    drawing.scene.team(TeamState { leader: 2, ..team() });
    assert!(drawing.rows().contains_key("/space/robot/2/leader"));
}

#[test]
fn a_program_that_blocks_has_its_way_and_its_exits() {
    let place = |x_m| TeamPlace { x_m, y_m: 0.0 };
    let exit = |column, holder| {
        let cell = rohrpost::interfaces::TeamCell { column, row: 0 };
        PayloadExit { cell, place: place(column.into()), holder, ..PayloadExit::default() }
    };
    let payload = PayloadState {
        robot: 2,
        mode: PayloadMode::Blocking,
        pose: at(0.0),
        way: vec![place(1.0), place(2.0)],
        destination: Some(place(3.0)),
        exits: vec![exit(3, Some(2)), exit(5, None)],
        ..PayloadState::default()
    };
    let all = drawn(|scene| scene.payload(payload));
    assert_eq!(count(&all, "way/2", "LineStrips3D:strips"), Some(3 + 25), "a line of three points, and a ring");
    assert_eq!(count(&all, "exits", "Boxes3D:half_sizes"), Some(3));
    assert_eq!(count(&all, r"open\ exits", "Boxes3D:half_sizes"), Some(3));
    assert_eq!(count(&all, "holders", "LineStrips3D:strips"), Some(2), "one exit is open");
    assert!(all.contains_key("/modes/robot-2"));
}

#[test]
fn true_places_count_and_a_belief_elsewhere_is_shown() {
    let body =
        |x_m| ArenaRobot { robot: 2, pose: Pose { x_m, ..Pose::default() }, radius_m: 0.2, ..Default::default() };
    let intruders = vec![ArenaIntruder { radius_m: 0.25, ..ArenaIntruder::default() }];
    for (truth, points, why) in [(2.1, 0, "near enough"), (4.0, 2 + 25, "a line there, and a ring")] {
        let all = drawn(|scene| {
            scene.team(team());
            scene.arena(ArenaState { robots: vec![body(truth)], intruders: intruders.clone(), ..Default::default() });
        });
        assert_eq!(count(&all, "belief/2", "LineStrips3D:strips"), Some(points), "{why}");
        assert_eq!(count(&all, "bodies", "Capsules3D:lengths"), Some(1));
    }
}

#[test]
fn marks_stay_and_are_lines_of_output_too() {
    let incident = |number| ArenaIncident { number, mishap: ArenaMishap::Touch, ..ArenaIncident::default() };
    let all = drawn(|scene| (0..3).for_each(|number| scene.incident("arena.0", incident(number))));
    assert_eq!(count(&all, "marks", "Points3D:positions"), Some(3 * 3));
    assert!(all.contains_key("/output/arena.0"));
}

#[test]
fn a_lane_shows_changes_alone() {
    let mut drawing = TestScene::new();
    for (told, why) in [(team(), "first"), (team(), "again"), (TeamState { differs_ms: Some(1), ..team() }, "differs")]
    {
        drawing.scene.team(told);
        let rows = drawing.rows().get("/groups/robot-2").copied();
        assert_eq!(rows, if why == "again" { None } else { Some(2) }, "{why}: the colours and the state");
    }
}
