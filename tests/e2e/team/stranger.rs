//! A robot in Python, which is no node, in a team with robots of real processes (`tests/e2e/python/team_member.py`,
//! written from `docs/src/wire.md` alone).

use super::{KEYS, ROBOTS, Robots, by_multicast, by_sealed_multicast, by_tcp, is_of};
use crate::harness::{repository, until};
use crate::process::Running;
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// The robot in Python: the greatest of the team.
const STRANGER: u64 = 9;

/// How the robot in Python is in the team, and these robots with it.
#[derive(Clone, Copy)]
enum Way {
    Tcp,
    Open,
    Sealed,
}

/// What it said last.
fn told(stranger: &Running) -> Value {
    let out = stranger.out();
    let whole = out.split_inclusive('\n').rfind(|line| line.ends_with('\n'));
    whole.map_or(Value::Null, |line| serde_json::from_str(line).unwrap())
}

impl Robots {
    /// Starts it on the second robot's computer.
    fn stranger(&self, way: Way) -> Running {
        let page = repository("tests/e2e/python/team_member.py");
        let mut digest = self.network.robot("r1").installation.digest();
        // Of a system that no file describes.
        digest.system = 1;
        let (name, digest) = (format!("{STRANGER}.120.0.0"), digest.to_string());
        let (group, keys) = (["group", ROBOTS[1].1, "239.80.0.1", "21121"], format!("{KEYS}/udp.keys"));
        let way = match way {
            Way::Tcp => vec!["tcp", ROBOTS[0].1, "21119", &digest],
            Way::Open => group.into(),
            Way::Sealed => [&group[..], &[&keys]].concat(),
        };
        self.network.python("r2", &[&[&*page, &name, "500", "3750", "7000", "-3000"], &way[..]].concat())
    }

    /// Waits until the robot in Python and these are one group with equal views; what all of them say.
    fn agree_with(&self, stranger: &Running, nodes: &[&str]) -> Vec<Value> {
        let numbers = nodes.iter().map(|node| super::number(node));
        let all: BTreeSet<u64> = numbers.chain([STRANGER]).collect();
        let mut states = Vec::new();
        until(format!("{nodes:?} and the robot in Python agree"), || {
            states = self.states(nodes);
            states.push(told(stranger));
            let digests: BTreeSet<&str> = states.iter().filter_map(|state| state["view_digest"].as_str()).collect();
            digests.len() == 1 && states.iter().all(|state| is_of(state, &all))
        });
        states
    }
}

#[test]
fn a_robot_in_python_at_the_tcp_router_is_in_the_team_and_its_intruder_in_all_views() {
    check_stranger(Robots::new(2, by_tcp), Way::Tcp);
}

#[test]
fn a_robot_in_python_without_a_server_is_in_the_team_and_its_intruder_in_all_views() {
    check_stranger(Robots::new(2, by_multicast), Way::Open);
}

#[test]
fn a_robot_in_python_with_the_teams_key_proves_that_it_lives_and_its_intruder_is_in_all_views() {
    let Some(robots) = Robots::new(2, by_sealed_multicast) else { return };
    robots.network.place.say(&["keys", "new", robots.network.place.path(KEYS).to_str().unwrap()]).ok();
    check_stranger(Some(robots), Way::Sealed);
}

fn check_stranger(robots: Option<Robots>, way: Way) {
    let Some(mut robots) = robots else { return };
    let nodes: Vec<&'static str> = robots.nodes().collect();
    nodes.iter().for_each(|node| robots.launch(node));
    let mut stranger = robots.stranger(way);
    for state in &robots.agree_with(&stranger, &nodes)[..nodes.len()] {
        let object = &state["objects"][0];
        let [x_m, y_m, by] = ["x_m", "y_m", "observers"].map(|key| &object[key]);
        assert_eq!((x_m, y_m, by), (&json!(7.0), &json!(-3.0), &json!([STRANGER])), "{state:#}");
        let members = state["members"].as_array().unwrap();
        let member = members.iter().find(|member| member["robot"] == STRANGER).unwrap();
        assert_eq!((&member["direct"], &member["pose"]["x_m"]), (&json!(true), &json!(9.0)), "{member:#}");
    }
    // Now a station makes up an intruder; the robot in Python dies, and is back.
    robots.says("r2", &["call", "team.0", "add_fake", "4.5", "-2"]).ok();
    until("all have two intruders", || {
        robots.agree_with(&stranger, &nodes)[..2].iter().all(|state| state["objects"].as_array().unwrap().len() == 2)
    });
    let first = told(&stranger)["incarnation"].clone();
    stranger.kill();
    robots.agree(&nodes);
    // Without a store it begins with the same incarnation, and hears that it was there.
    let stranger = robots.stranger(way);
    let state = robots.agree_with(&stranger, &nodes).pop().unwrap();
    assert!(state["incarnation"].as_u64() > first.as_u64(), "{state:#} after {first}");
    assert_eq!(state["malformed"], 0, "{state:#}");
    drop(stranger);
    robots.network.stop();
}
