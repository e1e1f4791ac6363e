//! The wormhole between program and motor: whatever the program does, the robot brakes, and touches nothing.

use crate::harness::{PATIENCE, Place, halt, repository, signal, wait};
use crate::process::Running;
use crate::python_node::package;
use crate::robot::Robot;
use nix::sys::signal::Signal;
use rohrpost::ToolLink;
use rohrpost::interfaces::{ControlRefusal, HeldHalt, SupervisorInterface, WheelsInterface};
use rohrpost::types::{Odometry, Pose, Twist};
use rohrpost::wire::{append, from_bytes};
use serde_json::Value;

/// What the simulation says of a touch.
const TOUCHED: &str = "drove against something";

const PROGRAM: &str = include_str!("python/supervised.py");

/// Where [`programmed`] is to go, from its start, metres ahead.
const DESTINATION_M: f64 = 1.5;

/// The demo's robot as `config/demo-supervised.toml` has it.
fn supervised() -> (Place, Running, Robot) {
    supervised_with(Place::new(), &[])
}

/// The demo's robot with other lines.
fn supervised_with(place: Place, changes: &[(&str, &str)]) -> (Place, Running, Robot) {
    place.copy("config/building.map");
    let text = std::fs::read_to_string(repository("config/demo-supervised.toml")).unwrap();
    let text = changes.iter().fold(text, |text, (old, new)| {
        assert!(text.contains(old), "{old}");
        text.replacen(old, new, 1)
    });
    let config = place.write("robot.toml", text);
    let (launch, robot) = place.launched_from(&config);
    (place, launch, robot)
}

/// A program of one's own, in Python: it names a destination, and follows what the wormhole tells of control.
fn programmed() -> (Place, Running, Robot) {
    let place = Place::new();
    let package = package(&place);
    place.program("supervised.py", PROGRAM.replace("PACKAGE", package.to_str().unwrap()));
    let settings = format!("settings = {{ x-m = {DESTINATION_M}, y-m = 0.0 }}\nrestart = \"never\"");
    let changes = [
        ("builtin = \"pilot\"", "program = \"./supervised.py\""),
        ("settings = { laser = \"laser.0\", motor = \"motor.0\", cruise-m-s = 0.6, seed = 16 }", &*settings),
        ("calls = [\"laser.0\", \"motor.0\"]", "calls = [\"wormhole.0\"]"),
        ("calls = [{ to = \"motor.1\"", "calls = [\"odometry.0\", { to = \"motor.1\""),
        ("lag-ms = 50", "lag-ms = 50\nsafety = \"greedy\"\ngreedy-s = 60\nodometry = \"odometry.0\""),
    ];
    supervised_with(place, &changes)
}

fn odometry(robot: &Robot, tool: &mut ToolLink) -> Option<Odometry> {
    let newest = robot.newest(tool, "odometry.0", WheelsInterface::ODOMETRY.data());
    newest.ok().map(|(_, odometry)| odometry)
}

fn control(place: &Place) -> Value {
    place.say(&["call", "wormhole.0", "state", "--json"]).json()
}

fn wait_for(place: &Place, what: &str, is_so: impl Fn(&Value) -> bool) {
    wait(what, || is_so(&control(place)).then_some(()));
}

/// By what the wheels say.
fn wait_until_it_stands(robot: &Robot) {
    let mut tool = robot.tool(PATIENCE);
    wait("the robot stands", || (odometry(robot, &mut tool)?.twist == Twist::default()).then_some(()));
    tool.close();
}

#[test]
fn the_ten_lines_of_the_book_supervise_the_robot_of_the_demo() {
    let place = Place::new();
    place.copy("config/building.map");
    let page = std::fs::read_to_string(repository("docs/src/supervision.md")).unwrap();
    let blocks = page.split("\n```toml\n").skip(1).map(|rest| rest.split("```").next().unwrap());
    let [class, rest, ..] = blocks.collect::<Vec<_>>()[..] else { panic!("the page has other blocks") };
    assert_eq!(class.lines().chain(rest.lines()).count() + 3, 10, "with the three lines that are changed");
    let mut text = std::fs::read_to_string(repository("config/demo.toml")).unwrap();
    for (before, after) in [
        ("pilot = { id", format!("{class}pilot = {{ id").as_str()),
        ("source = \"simulation\"", "source = \"local\""),
        ("name = \"motor.0\"", "name = \"motor.1\""),
        ("map = \"building.map\",", "map = \"building.map\", dead-man-ms = 100,"),
    ] {
        assert_eq!(text.matches(before).count(), 1, "{before}");
        text = text.replace(before, after);
    }
    let config = place.write("robot.toml", format!("{text}\n{rest}"));
    place.say_at_once(&["check", config.to_str().unwrap()]).ok();
    let mut launch = place.launch(&config);
    wait("the pilot drives", || {
        let said = place.say(&["call", "wormhole.0", "state"]);
        (said.out.contains("mode: Active") && said.out.contains("driven_by: \"pilot.0\"")).then_some(())
    });
    launch.stop();
    place.assert_empty();
}

#[test]
fn a_stopped_and_a_killed_program_lose_control_and_regain_it() {
    let (place, mut launch, robot) = supervised();
    wait_for(&place, "the pilot drives", |state| state["mode"] == "Active");
    halt(robot.pid("pilot.0"));
    wait_for(&place, "the stopped pilot has lost control", |state| state["mode"] != "Active");
    wait_until_it_stands(&robot);
    signal(robot.pid("pilot.0"), Signal::SIGCONT);
    wait_for(&place, "it drives again", |state| state["mode"] == "Active" && state["gained"].as_u64() >= Some(2));
    robot.kill("pilot.0");
    wait_for(&place, "its next run drives", |state| state["mode"] == "Active" && state["gained"].as_u64() >= Some(3));
    let log = place.say(&["log"]).ok();
    assert!(!log.contains(TOUCHED) && log.contains("the driver has lost control; the robot brakes"), "{log}");
    launch.stop();
    place.assert_empty();
}

#[test]
fn a_halt_is_acknowledged_by_name_survives_the_wormhole_and_is_let_go_by_its_holder_alone() {
    let (place, mut launch, robot) = supervised();
    wait_for(&place, "the pilot drives", |state| state["mode"] == "Active");
    place.say(&["halt", "--as", "anna"]).ok_with(["halted: wormhole.0, until `rohrpost resume` of anna@"]);
    wait_until_it_stands(&robot);
    place.say(&["halt", "--as", "bob@desk"]).ok_with(["halted: wormhole.0, until `rohrpost resume` of bob@desk"]);
    let halts = control(&place)["halts"].clone();
    robot.kill("wormhole.0");
    wait("the next wormhole answers", || (place.say(&["call", "wormhole.0", "state"]).code == Some(0)).then_some(()));
    assert_eq!(control(&place)["halts"], halts, "the next run holds what the one before held");
    place.say(&["resume", "--as", "anna"]).fails_with(["still held: wormhole.0, by bob@desk"]);
    let status = place.say(&["status", "wormhole.0"]).ok();
    assert!(status.contains("held by") && status.contains("bob@desk") && status.contains("pilot.0"), "{status}");
    wait("tools show it", || place.say(&["list"]).ok().contains("halted by bob@desk;").then_some(()));
    // Nobody is told as stopped that has not said so.
    halt(robot.pid("wormhole.0"));
    place.say(&["halt", "--timeout", "0.5"]).fails_with(["NOT halted: wormhole.0: no answer"]);
    signal(robot.pid("wormhole.0"), Signal::SIGCONT);
    place.say(&["resume", "--as", "bob@desk"]).ok_with(["free: wormhole.0"]);
    wait_for(&place, "the pilot drives again", |state| state["mode"] == "Active");
    let log = place.say(&["log"]).ok();
    assert!(!log.contains(TOUCHED) && log.contains("the robot stands: held by anna@"), "{log}");
    launch.stop();
    place.assert_empty();
}

#[test]
fn a_person_halts_takes_over_and_drives_at_walls_and_nobody_goes_past_the_wormhole() {
    let (place, mut launch, robot) = supervised();
    wait_for(&place, "the pilot drives", |state| state["mode"] == "Active");
    place
        .say(&["call", "motor.1", "drive", "0.5", "0"])
        .fails_with(["[access]", "lists the classes that may command this one"]);
    let mut person = robot.tool(PATIENCE);
    let supervisor = SupervisorInterface::hash();
    let mut call = |function: u16, arguments: &[u8]| {
        let write = |body: &mut Vec<u8>| {
            body.extend_from_slice(arguments);
            Ok(())
        };
        person.call(robot.name("wormhole.0"), function, supervisor, write, |bytes| Ok(bytes.to_vec())).unwrap()
    };
    let is_taken = |answer: Vec<u8>| from_bytes::<Result<(), ControlRefusal>>(&answer).unwrap() == Ok(());
    // halt(1, ""), resume(1, ""): then held by nobody.
    assert!(is_taken(call(17, &[1, 0])));
    wait_until_it_stands(&robot);
    assert_eq!(control(&place)["halts"].as_array().map(Vec::len), Some(1));
    assert_eq!(from_bytes::<Result<Vec<HeldHalt>, ControlRefusal>>(&call(18, &[1, 0])).unwrap(), Ok(Vec::new()));
    // take_over(): full speed ahead, without a look, until a wall is in the way.
    assert!(is_taken(call(20, &[])));
    let in_the_way = |state: &Value| -> u64 {
        let causes = state["causes"].as_array().unwrap();
        let of_walls = causes.iter().filter(|cause| cause["cause"].as_str().unwrap().contains("is in the way"));
        of_walls.map(|cause| cause["count"].as_u64().unwrap()).sum()
    };
    let mut ahead = Vec::new();
    append(&mut ahead, &(500_u32, 0.7, 0.2)).unwrap();
    let (mut driven, before) = (0, in_the_way(&control(&place)));
    wait("the envelope has something to do", || {
        driven += u32::from(is_taken(call(16, &ahead)));
        let state = control(&place);
        let drives = state["mode"] == "Active" && state["driver"] == "Person";
        (driven > 2 && drives && in_the_way(&state) > before).then_some(())
    });
    // give_back()
    assert!(is_taken(call(21, &[])));
    wait_for(&place, "the pilot drives again", |state| state["mode"] == "Active" && state["driver"] == "Program");
    person.close();
    let log = place.say(&["log"]).ok();
    assert!(!log.contains(TOUCHED) && log.contains("the driver has control"), "{log}");
    launch.stop();
    place.assert_empty();
}

#[test]
fn a_robot_that_starts_held_stands_until_a_person_lets_it_go_and_is_not_held_again_by_a_death() {
    let place = Place::new();
    place.copy("config/building.map");
    let text = std::fs::read_to_string(repository("config/demo-supervised.toml")).unwrap();
    let text = text.replace("lag-ms = 50", "lag-ms = 50\nstarts-held = true");
    let (mut launch, robot) = place.launched_from(&place.write("robot.toml", text));
    wait_for(&place, "the pilot would drive", |state| state["mode"] == "Active");
    assert_eq!(control(&place)["halts"][0]["holder"], "start@robot");
    place.say(&["resume"]).fails_with(["still held: wormhole.0, by start@robot"]);
    place.say(&["resume", "--force"]).ok_with(["free: wormhole.0"]);
    robot.kill("wormhole.0");
    wait("the next wormhole answers", || (place.say(&["call", "wormhole.0", "state"]).code == Some(0)).then_some(()));
    assert_eq!(control(&place)["halts"].as_array().map(Vec::len), Some(0));
    launch.stop();
    place.assert_empty();
}

/// Seed 000, 5.1.2: the restart is disabled, and the program is killed on its way.
#[test]
fn the_robot_of_a_killed_program_drives_to_its_last_destination_and_stands() {
    let (place, mut launch, robot) = programmed();
    wait_for(&place, "the program drives", |state| state["mode"] == "Active");
    signal(robot.pid("pilot.0"), Signal::SIGKILL);
    wait_for(&place, "the wormhole drives", |state| state["drives_itself"] == true);
    wait_for(&place, "it has arrived", |state| state["drives_itself"] == false);
    wait_until_it_stands(&robot);
    let mut tool = robot.tool(PATIENCE);
    let Pose { x_m, y_m, .. } = odometry(&robot, &mut tool).expect("the simulation answers").pose;
    tool.close();
    assert!(f64::hypot(x_m - DESTINATION_M, y_m) < 0.26, "it stands at {x_m} {y_m}");
    let log = place.say(&["log"]).ok();
    assert!(!log.contains(TOUCHED) && log.contains("drives to the program's last destination"), "{log}");
    // A module has failed for good.
    launch.stop_failed();
    place.assert_empty();
}

/// Seed 000, 2.1: the program learns that it has lost control, and needs less.
#[test]
fn a_program_follows_what_it_is_told_of_control_and_plans_only_as_long_as_it_has_it() {
    let (place, mut launch, robot) = programmed();
    let plans = || place.say(&["call", "pilot.0", "plans", "--json"]).json().as_u64().unwrap();
    let wait_for_plans = |plans_before: u64| wait("it plans", || (plans() > plans_before).then_some(()));
    wait_for_plans(0);
    place.say(&["call", "wormhole.0", "take_over"]).ok();
    wait_until_it_stands(&robot);
    // It is told within a look, and each of these calls waits until the program has no other work.
    let mut last = plans();
    wait("it plans no more", || {
        let before = std::mem::replace(&mut last, plans());
        (before == last).then_some(())
    });
    assert_eq!(control(&place)["driver"], "Person");
    place.say(&["call", "wormhole.0", "give_back"]).ok();
    wait_for_plans(last);
    launch.stop();
    place.assert_empty();
}

#[test]
fn a_person_that_has_taken_over_keeps_the_program_off_when_the_wormhole_dies() {
    let (place, mut launch, robot) = supervised();
    wait_for(&place, "the pilot drives", |state| state["mode"] == "Active");
    place.say(&["call", "wormhole.0", "take_over"]).ok();
    wait_until_it_stands(&robot);
    let driver = control(&place)["driven_by"].clone();
    robot.kill("wormhole.0");
    wait("the next wormhole answers", || (place.say(&["call", "wormhole.0", "state"]).code == Some(0)).then_some(()));
    let state = control(&place);
    assert_eq!((&state["driver"], &state["driven_by"]), (&"Person".into(), &driver), "{state}");
    place.say(&["call", "wormhole.0", "give_back"]).ok();
    wait_for(&place, "the pilot drives again", |state| state["mode"] == "Active" && state["driver"] == "Program");
    let log = place.say(&["log"]).ok();
    assert!(!log.contains(TOUCHED) && log.contains("drives, until `give_back`"), "{log}");
    launch.stop();
    place.assert_empty();
}
