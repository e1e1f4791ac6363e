//! The wormhole between program and motor: whatever the program does, the robot brakes, and touches nothing.

use crate::harness::{PATIENCE, Place, halt, repository, signal, wait};
use crate::process::Running;
use crate::robot::Robot;
use nix::sys::signal::Signal;
use rohrpost::interfaces::{ControlRefusal, SupervisorInterface, WheelsInterface};
use rohrpost::types::{Odometry, Twist};
use rohrpost::wire::{append, from_bytes};
use serde_json::Value;

/// What the simulation says of a touch.
const TOUCHED: &str = "drove against something";

/// The demo's robot as `config/demo-supervised.toml` has it.
fn supervised() -> (Place, Running, Robot) {
    let place = Place::new();
    place.copy("config/building.map");
    let text = std::fs::read_to_string(repository("config/demo-supervised.toml")).unwrap();
    let config = place.write("robot.toml", text);
    let (launch, robot) = place.launched_from(&config);
    (place, launch, robot)
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
    wait("the robot stands", || {
        let odometry = WheelsInterface::ODOMETRY.data();
        let (_, Odometry { twist, .. }) = robot.newest(&mut tool, "odometry.0", odometry).ok()?;
        (twist == Twist::default()).then_some(())
    });
    tool.close();
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
    // halt(1), resume(): then held by nobody.
    assert!(is_taken(call(17, &[1])));
    wait_until_it_stands(&robot);
    assert_eq!(control(&place)["halted_by"].as_array().map(Vec::len), Some(1));
    assert_eq!(from_bytes::<Vec<String>>(&call(18, &[])).unwrap(), [""; 0]);
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
