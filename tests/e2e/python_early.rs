//! A module in Python that reads streams before they are written: it waits as one in Rust does, here and for another
//! node. And what it prints and logs stands in one order.

use crate::harness::{OUTPUT, Place, Robot, head, until, wait};
use crate::network::{NETWORK, addresses, at, nodes};
use crate::process::Running;
use crate::python_node::package;

const EARLY: &str = include_str!("python/early.py");
const COUNTING: &str = include_str!("python/counting.py");
const CLASSES: &str = "router 250, laser 150, camera 120, gripper 110, output 32, tool 16";
const REPLICA: &str = r#"
[[replica]]
stream = "laser.0/scan"
to = ["base"]
"#;

/// The launch of node `base`, where a gripper waits for cameras without a program, and for a laser of a node that is
/// off.
fn launched(settings: &str) -> (Place, Running, Robot) {
    let place = Place::new();
    let [base, brain] = addresses();
    let nodes = nodes([("base", &base), ("brain", &brain)]);
    let camera = |number: u8| {
        format!(
            "[[module]]\nnode = \"base\"\nname = \"camera.{number}\"\nprogram = \"./counting.py\"\noptional = true\n\
             [module.stream.count]\nkeep = 4096\n"
        )
    };
    let gripper = format!(
        "[[module]]\nnode = \"base\"\nname = \"gripper.0\"\nprogram = \"./early.py\"\n\
         calls = [\"camera.0\", \"camera.1\", \"laser.0\"]\nsettings = {{ {settings} }}\n"
    );
    let laser = "[[module]]\nnode = \"brain\"\nname = \"laser.0\"\nprogram = \"true\"\n";
    let modules = [at("base", OUTPUT), gripper, camera(0), camera(1), laser.to_owned()].concat();
    let config = place.write("robot.toml", [&head(CLASSES), REPLICA, NETWORK, &nodes, &modules].concat());
    place.program("early.py", EARLY);
    let mut command = place.command(&["launch", config.to_str().unwrap(), "--node", "base"]);
    command.env("PYTHONPATH", package(&place)).env("PYTHONDONTWRITEBYTECODE", "1");
    let mut launch = Running::start(command);
    let robot = place.robot(&config, "base", &mut launch);
    launch.wait_for("runs: ");
    (place, launch, robot)
}

#[test]
fn a_reader_before_its_writer_waits_and_reads_from_the_first_record_on() {
    let (place, mut launch, robot) = launched("");
    assert_eq!(robot.state("gripper.0"), "on");
    let early = place.say(&["call", "gripper.0", "early", "--json"]).json();
    let (count, scan) = ("`count` of camera.0", "`scan` of laser.0");
    let none = |what: &str| format!("NoRecord: {what} has no record yet");
    let within = |what: &str, s: &str| format!("NoRecord: no record of {what} came within {s} s");
    let told = [
        none(count),
        within(count, "0.0"),
        none(count),
        none(count),
        none(count),
        none(count),
        none(scan),
        within(scan, "0.2"),
        "0".into(),
    ];
    assert_eq!(early, serde_json::json!(told));
    // Their programs are there now.
    place.program("counting.py", COUNTING);
    place.say(&["start", "camera.0"]).ok();
    assert_eq!(place.say(&["call", "gripper.0", "first", "--timeout", "60"]).ok(), "7\n");
    let last: u32 = place.say(&["call", "gripper.0", "last"]).ok().trim().parse().unwrap();
    assert!(last >= 7);
    assert_eq!(robot.state("gripper.0"), "on");
    place.end(&mut launch);
}

#[test]
fn tools_say_one_thing_of_a_module_in_error_and_of_one_that_is_off() {
    let (place, mut launch, robot) = launched("fails = true");
    until("it is in error", || robot.state("gripper.0") == "error");
    let why = "ValueError: no hand";
    for words in [&["list"][..], &["call", "gripper.0", "first"], &["start", "gripper.0"], &["status", "gripper.0"]] {
        let said = place.say(words);
        let told = format!("{}{}", said.out, said.err);
        assert!(told.contains("error") && told.contains(why), "{words:?}: {told}");
    }
    place.say(&["start", "gripper.0"]).fails_with(["gripper.0 runs, but is in error", "`rohrpost restart gripper.0`"]);
    place.say(&["call", "gripper.0", "off"]).ok();
    let said = place.say(&["start", "gripper.0"]);
    said.fails_with(["runs already, and is off; `rohrpost call gripper.0 on` switches it on"]);
    place.end(&mut launch);
}

#[test]
fn what_is_printed_and_what_is_logged_stand_in_one_order() {
    let (place, mut launch, _robot) = launched("");
    place.say(&["call", "gripper.0", "prints"]).ok();
    let said = wait("all of it is in the log", || {
        let log = place.say(&["log"]).out;
        let texts = log.lines().filter_map(|line| line.split_once("gripper.0: ")).map(|(_, text)| text.to_owned());
        let texts: Vec<String> =
            texts.filter(|text| text.starts_with("printed ") || text.starts_with("logged ")).collect();
        (texts.len() >= 40).then_some(texts)
    });
    let expected: Vec<String> = (0..20).flat_map(|n| [format!("printed {n}"), format!("logged {n}")]).collect();
    assert_eq!(said, expected);
    place.end(&mut launch);
}
