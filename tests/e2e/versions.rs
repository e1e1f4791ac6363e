//! Programs of another version: none guesses, each names both versions and a remedy.

use crate::harness::{OUTPUT, PATIENCE, Place, Robot, probe};
use crate::tools::{at_a_node, commands};
use rohrpost::common;
use rohrpost_mailbox::LAYOUT_VERSION;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;

const OTHER: u32 = 99;

/// Writes a layout version into a file of the node, where every version has it.
pub(crate) fn write_version(file: &Path, version: u32) {
    let file = File::options().write(true).open(file).unwrap();
    file.write_all_at(&version.to_ne_bytes(), 8).unwrap();
}

fn node_file(robot: &Robot) -> std::path::PathBuf {
    robot.node.path().join("node")
}

#[test]
fn every_tool_says_that_a_node_is_of_another_version() {
    let (place, mut launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", "")]);
    let config = place.path("test.toml");
    let config = config.to_str().unwrap();
    let length = node_file(&robot).metadata().unwrap().len();
    write_version(&node_file(&robot), OTHER);
    let commands = commands(&place);
    let mut all: Vec<Vec<&str>> = commands.iter().filter_map(|command| at_a_node(command)).collect();
    all.extend([vec!["list", "--config", config], vec!["launch", config]]);
    for arguments in all {
        let told = place.say(&arguments).fails();
        let both = format!("layout {OTHER}, this program has {LAYOUT_VERSION}");
        assert!(told.contains(&both), "{arguments:?}: {told}");
        assert!(told.contains("use the `rohrpost` that launched it, or stop what runs there"), "{arguments:?}: {told}");
    }
    let by_hand = place.say(&["run", "output", "--config", config, "--name", "output.0"]);
    assert!(by_hand.err.contains("was made by another version"), "{by_hand:?}");
    for arguments in [&["clean"][..], &["doctor"], &["version"]] {
        let said = place.say(arguments);
        assert!(said.out.contains("another version") && said.out.contains("layout 99"), "{arguments:?}: {said:?}");
    }
    assert_eq!(node_file(&robot).metadata().unwrap().len(), length, "it was left as it is");
    write_version(&node_file(&robot), LAYOUT_VERSION);
    place.say(&["status"]).ok();
    place.end(&mut launch);
}

#[test]
fn a_mailbox_of_another_version_is_told_from_a_broken_one() {
    let (place, mut launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", "")]);
    let mailbox = robot.node.path().join(format!("{:08x}.mbx", robot.name("probe.0").raw()));
    write_version(&mailbox, OTHER);
    let said = place.say(&["call", "probe.0", "count", "1"]);
    said.fails_with([&format!("another version (layout {OTHER}, this program {LAYOUT_VERSION})")]);
    write_version(&mailbox, LAYOUT_VERSION);
    assert_eq!(place.say(&["call", "probe.0", "count", "1"]).ok(), "1\n");
    place.end(&mut launch);
}

#[test]
fn what_launch_of_another_version_noted_is_not_guessed_at() {
    let (place, mut launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", "")]);
    let noted = robot.node.path().join(rohrpost_modules::runtime::CONFIG_FILE);
    let text = std::fs::read_to_string(&noted).unwrap();
    std::fs::write(&noted, "{ \"something\": \"else\" }").unwrap();
    place.say(&["list"]).fails_with(["was written by another version of launch; say --config FILE"]);
    place.say(&["list", "--config", place.path("test.toml").to_str().unwrap()]).ok();
    std::fs::write(&noted, text).unwrap();
    place.end(&mut launch);
}

#[test]
fn a_program_of_other_common_functions_is_told_both_versions() {
    let (place, mut launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", "")]);
    let mut tool = robot.tool(PATIENCE);
    for function in [common::STATUS, common::DESCRIBE, common::PARAMETERS] {
        let told = tool.call(robot.name("probe.0"), function, common::HASH - 1, |_| Ok(()), |_| Ok(())).unwrap_err();
        let both = format!("common functions of version {0}, this program has {0}", common::HASH);
        assert!(told.to_string().contains(&both), "{told}");
    }
    tool.close();
    place.end(&mut launch);
}

#[test]
fn a_program_says_which_version_it_is() {
    let place = Place::new();
    let versions =
        format!("rohrpost {} (layout of shared memory {LAYOUT_VERSION}, common functions ", env!("CARGO_PKG_VERSION"));
    for arguments in ["--version", "-V", "version"] {
        let said = place.say(&[arguments]).ok();
        assert!(said.starts_with(&versions), "{said}");
    }
    let json = place.say(&["version", "--json"]).json();
    assert_eq!((&json["layout"], &json["other_versions"]), (&LAYOUT_VERSION.into(), &serde_json::json!([])));
}
