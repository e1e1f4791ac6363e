//! A configuration of several files: launched, observed and bundled as one; a variable reaches a module and no tool.

use crate::bundle::Workshop;
use crate::harness::{Place, assert_has, head, probe};
use crate::process::Running;
use std::fs;

const CLASSES: &str = "router 250, probe 96, output 32, tool 16";

/// What all robots have in common: a probe, of which a variable says where it writes.
fn common() -> String {
    let module = probe("probe.0", "rate-hz = 5.0", "");
    let module = module.replace("record = \"record\"", "record = { env = \"P_RECORD\", or = \"record\" }");
    format!("{}[nodes.main]\n{module}", head(CLASSES))
}

const OWN: &str = "include = [\"common.toml\"]\n[[module]]\nname = \"probe.0\"\nsettings.rate-hz = 50.0\n";

#[test]
fn a_robot_of_two_files_runs_as_one_of_one() {
    let place = Place::new();
    place.write("common.toml", common());
    let config = place.write("robot.toml", OWN);
    let resolved = place.say(&["check", "--resolved", config.to_str().unwrap()]).ok();
    assert_has(
        &resolved,
        ["rate-hz = 50.0 #@ robot.toml:4\n", "record = \"record\" #@ common.toml:", " by $P_RECORD\n"],
    );
    let mut command = place.command(&["launch", config.to_str().unwrap()]);
    command.env("P_RECORD", "elsewhere");
    let mut launch = Running::start(command);
    let robot = place.robot(&config, "main", &mut launch);
    robot.wait_on(&mut launch);
    assert!(place.path("elsewhere").exists() && !place.path("record").exists(), "the module has the variable");
    assert!(place.say(&["data"]).ok().contains("beat"), "a tool in another shell has none, and needs none");
    place.end(&mut launch);
    place.write("common.toml", common().replace("probe = { id = 96", "probe = { id = 960"));
    let told = place.say(&["check", config.to_str().unwrap()]).fails();
    assert!(told.contains("common.toml:") && told.contains("960"), "{told}");
}

#[test]
fn a_bundle_has_the_files_that_are_included() {
    let workshop = Workshop::new();
    let place = &workshop.place;
    let whole = fs::read_to_string(place.path("source/config/robot.toml")).unwrap();
    place.write("source/config/common.toml", whole);
    place.write("source/config/robot.toml", "include = [\"common.toml\"]\ninstallation = \"seven\"\n");
    let bundle = workshop.make("1 s");
    let shown = place.say(&["bundle", "show", bundle.to_str().unwrap()]).ok();
    assert_has(&shown, ["config/common.toml", "config/robot.toml", "bin/probe.sh"]);
}
