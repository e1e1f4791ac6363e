//! What a robot's scanner shows becomes an intruder for its whole team, unless a teammate can be there.

use super::{Robots, by_multicast, team_module};
use crate::harness::{assert_has, until};
use serde_json::Value;

/// The map that all robots have.
const ROOM: &str = "rohrpost-map 1
cell_m 0.5
map
####################
#..................#
#..................#
#..................#
#..................#
#>.................#
#..................#
#..................#
#..................#
#..................#
####################
";
/// Middles of two squares of the room, where things stand in the first robot's world; metres.
const STRANGER: (f64, f64) = (4.25, 3.75);
const TEAMMATE: (f64, f64) = (4.25, 1.75);
/// So far from the middle of a square its corners are.
const CORNER_M: f64 = 0.36;

/// The room with something in the two squares.
fn world() -> String {
    let mut lines: Vec<String> = ROOM.lines().map(str::to_owned).collect();
    for line in [3 + 3, 3 + 7] {
        lines[line].replace_range(8..9, "#");
    }
    lines.join("\n") + "\n"
}

/// A robot that stands at a place. The first one sees, once its scanner works.
fn robot(node: &str) -> String {
    let (x_m, y_m) = match node {
        "r1" => (0.75, 2.75),
        "r2" => (8.75, 2.75),
        _ => TEAMMATE,
    };
    let eyes = "odometry = \"odometry.0\", laser = \"laser.0\", ";
    let sim = "[[module]]\nname = \"motor.0\"\naliases = [\"odometry.0\", \"laser.0\"]\nbuiltin = \"sim\"\nsettings = \
               { map = \"world.map\", scanner = \"dead\" }\n";
    let (sim, eyes) = if node == "r1" { (sim, eyes) } else { ("", "") };
    // Teammates stand: a late hello makes the place where they may be no larger.
    let settings = format!(
        "{eyes}map = \"room.map\", start = {{ x-m = {x_m}, y-m = {y_m} }}, gate-m = 1.0, speed-max-m-s = 0.0, \
         friend-max-age-s = 8.0"
    );
    let team = team_module(&settings);
    let calls = "builtin = \"team\"\ncalls = [\"odometry.0\", \"laser.0\"]";
    let team = if node == "r1" { team.replace("builtin = \"team\"", calls) } else { team };
    format!("{}{sim}{team}", by_multicast(node))
}

fn objects(state: &Value) -> &[Value] {
    state["objects"].as_array().map_or(&[], Vec::as_slice)
}

fn is_at(object: &Value, (x_m, y_m): (f64, f64)) -> bool {
    let [x, y] = ["x_m", "y_m"].map(|key| object[key].as_f64().unwrap());
    (x - x_m).hypot(y - y_m) <= CORNER_M
}

#[test]
fn what_a_scanner_sees_is_an_intruder_for_all_and_a_silent_teammate_may_be_one() {
    let Some(mut robots) = Robots::of(3, "motor 200, odometry 160, laser 150, ", robot) else { return };
    robots.network.place.write("room.map", ROOM);
    robots.network.place.write("world.map", world());
    let nodes: Vec<&'static str> = robots.nodes().collect();
    nodes.iter().for_each(|node| robots.launch(node));
    let states = robots.agree(&nodes);
    assert!(states.iter().all(|state| objects(state).is_empty()), "nobody sees anything: {states:#?}");

    robots.says("r1", &["param", "set", "motor.0", "scanner", "works"]).ok();
    until("the second robot sees what the first one has seen", || {
        robots.states(&["r2"]).iter().any(|state| objects(state).iter().any(|object| object["certain"] == true))
    });
    for state in robots.agree(&nodes) {
        let [object] = objects(&state) else { panic!("a stranger, and no teammate: {state:#?}") };
        assert!(is_at(object, STRANGER) && object["may_be"].is_null(), "{object}");
        assert_eq!(object["observers"], serde_json::json!([1]), "{object}");
    }

    robots.network.kill("r3", true);
    until("where the silent one was stands something that may be it", || {
        let states = robots.states(&["r1", "r2"]);
        let is_suspected = |object: &Value| object["may_be"] == 3 && is_at(object, TEAMMATE);
        states.iter().all(|state| objects(state).iter().any(is_suspected))
    });
    let shown = robots.says("r2", &["team"]).out;
    assert_has(&shown, ["out of contact", "may be robot 3, silent for ", "certain"]);

    robots.launch("r3");
    robots.agree(&nodes);
    until("it is heard, so it is no object any more", || {
        robots.states(&nodes).iter().all(|state| objects(state).len() == 1)
    });
}
