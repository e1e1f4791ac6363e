//! Launch from a bundle: changed files are refused, and what does not stay up goes back by itself.

use crate::bundle::{Workshop, current};
use crate::harness::{runs, until, wait};
use crate::process::Running;
use rohrpost_bundle::NodeFolder;
use std::fs;
use std::path::{Path, PathBuf};

/// No trial of a test takes so long.
const LONG: &str = "24 h";

fn config_of(node: &str) -> PathBuf {
    Path::new(node).join("current/config/robot.toml")
}

fn launch(workshop: &Workshop, node: &str) -> Running {
    workshop.place.start(&["launch", config_of(node).to_str().unwrap()])
}

/// From the folder of the configuration, which is that of a bundle also when another one is current.
fn launch_inside(workshop: &Workshop, node: &str) -> Running {
    let mut command = workshop.place.command(&["launch", "robot.toml"]);
    command.current_dir(config_of(node).parent().unwrap());
    Running::start(command)
}

fn trial(node: &str) -> String {
    NodeFolder::new(node).report().unwrap().trial
}

/// A node with version 1, which has passed its trial, and version 2 with these lines in its program.
fn node_with_two(lines: &str, trial_of_second: &str) -> (Workshop, String) {
    let workshop = Workshop::new();
    let node = workshop.node("node");
    workshop.make("1 ms");
    workshop.push(&node).ok();
    let mut first = launch(&workshop, &node);
    first.wait_for("bundle version 1 has passed its trial");
    first.stop();
    assert_eq!(trial(&node), "passed");
    workshop.write_program(lines);
    workshop.make(trial_of_second);
    workshop.push(&node).ok();
    (workshop, node)
}

#[test]
fn a_changed_file_is_refused_until_it_is_accepted_in_words() {
    let workshop = Workshop::new();
    let node = workshop.node("node");
    workshop.make("1 ms");
    workshop.push(&node).ok();
    let program = Path::new(&node).join("current/bin/probe.sh");
    let right = fs::read_to_string(&program).unwrap();
    let config = config_of(&node);
    let words = ["launch", config.to_str().unwrap()];
    fs::write(&program, format!("{right}# changed")).unwrap();
    let refused = workshop.place.say(&words);
    refused.fails_with(["bin/probe.sh was changed", "nothing is started", "--accept-changed-files"]);
    let mut accepted = workshop.place.start(&[&words[..], &["--accept-changed-files"]].concat());
    accepted.wait_for("node main of test runs: 1 module");
    accepted.stop();
    assert!(accepted.err().contains("warning, --accept-changed-files: "), "{}", accepted.err());
    fs::write(&program, &right).unwrap();
    fs::write(Path::new(&node).join("trusted/ours.pub"), format!("ed25519 {}\n", "ab".repeat(32))).unwrap();
    workshop.place.say(&words).fails_with(["signed with key ", "which is none of those in "]);
    fs::copy(workshop.place.path("source/config/keys/bundle.pub"), Path::new(&node).join("trusted/ours.pub")).unwrap();
    // What a module has written there is told, and does no harm.
    fs::write(Path::new(&node).join("current/config/written"), "").unwrap();
    let (mut running, robot) = workshop.place.launched_from(&config);
    running.wait_for("bundle: config/written is not in the manifest");
    // While it runs: a module that is started again is of the bundle, or is not started.
    let pid = robot.pid("probe.0");
    fs::write(&program, format!("{right}# changed")).unwrap();
    workshop.place.say(&["restart", "probe.0"]);
    running.wait_for("could not be started: ");
    assert!(!runs(pid) && running.out().contains("it was changed: its digest is not that of the bundle's manifest"));
    running.wait_for("given up after 2 restarts");
    running.stop_failed();
}

#[test]
fn a_program_that_crashes_in_its_trial_goes_back_and_the_robot_runs_on() {
    let (workshop, node) = node_with_two("exit 3", LONG);
    let mut running = launch_inside(&workshop, &node);
    running.wait_for("node main of test runs: 1 module");
    let err = running.err();
    assert!(err.contains("bundle version 2 did not start: module probe.0 did not become ready"), "{err}");
    assert!(err.contains("; back to version 1"), "{err}");
    assert_eq!((current(&node), trial(&node)), (1, "passed".into()));
    running.stop();
    workshop.place.assert_empty();
}

#[test]
fn a_program_that_crashes_after_its_start_goes_back_and_the_robot_runs_on() {
    // Its first process is well until it is told to crash; the next ones never are.
    let crash = "if [ -e ../crashed ]; then exit 3; fi";
    let (workshop, node) = node_with_two(&crash.replace("../crashed", "crashed"), LONG);
    let mut running = launch(&workshop, &node);
    running.wait_for("bundle version 2: its trial has begun; all modules must stay up for 24 h");
    assert_eq!(trial(&node), "running");
    workshop.place.write("crashed", "");
    let robot = workshop.place.robot(&config_of(&node), "main", &mut running);
    crate::harness::signal(robot.pid("probe.0"), nix::sys::signal::Signal::SIGKILL);
    wait("it goes back", || {
        running.err().contains("bundle version 2 did not stay up: probe.0 is failed; back to version 1").then_some(())
    });
    until("version 1 runs", || running.out().matches("node main of test runs").count() == 2);
    assert_eq!(current(&node), 1);
    running.stop();
}

#[test]
fn a_launch_that_is_killed_in_its_trial_is_the_last_of_that_bundle() {
    let (workshop, node) = node_with_two("# well", LONG);
    let mut running = launch(&workshop, &node);
    running.wait_for("its trial has begun");
    running.kill();
    assert_eq!((current(&node), trial(&node)), (2, "running".into()));
    let mut running = launch_inside(&workshop, &node);
    running.wait_for("node main of test runs: 1 module");
    let err = running.err();
    assert!(err.contains("bundle version 2: its launch was killed in its trial, or the computer lost power"), "{err}");
    assert_eq!(current(&node), 1);
    running.stop();
}

#[test]
fn a_launch_that_is_stopped_in_its_trial_has_not_failed() {
    let (workshop, node) = node_with_two("# well", LONG);
    let mut running = launch(&workshop, &node);
    running.wait_for("its trial has begun");
    running.stop();
    assert_eq!((current(&node), trial(&node)), (2, "due".into()));
    // Also before its modules are on.
    let (workshop, node) = node_with_two("exec sleep 600", LONG);
    let mut running = launch(&workshop, &node);
    until("it has begun", || trial(&node) == "running");
    let robot = workshop.place.robot(&config_of(&node), "main", &mut running);
    until("the module starts", || robot.installation.modules.len() == 1 && !running.out().contains("runs"));
    running.stop_failed();
    assert!(running.err().contains("told to stop"), "{}", running.err());
    assert_eq!((current(&node), trial(&node)), (2, "due".into()));
}

#[test]
fn a_configuration_that_this_rohrpost_refuses_goes_back() {
    let (workshop, node) = node_with_two("# well", LONG);
    // As a newer rohrpost would have made it: signed, and with a key that this one does not know.
    let config = workshop.place.path("source/config/robot.toml");
    let text = fs::read_to_string(&config).unwrap();
    let bundles = workshop.place.path("source/config/bundles");
    fs::write(&config, format!("{text}from-the-future = true\n")).unwrap();
    let key = rohrpost_bundle::SigningKey::load(&workshop.place.path("source/config/keys/bundle.key")).unwrap();
    let path = |path: &str| rohrpost_bundle::FilePath::parse(path).unwrap();
    let files = ["config/robot.toml", "bin/probe.sh"]
        .map(|file| rohrpost_bundle::Ingredient { path: path(file), source: workshop.place.path("source").join(file) });
    let recipe = rohrpost_bundle::Recipe {
        installation: "test".into(),
        version: None,
        trial: std::time::Duration::from_secs(60),
        configuration: path("config/robot.toml"),
        files: files.to_vec(),
    };
    rohrpost_bundle::make(&recipe, &key, &bundles).unwrap();
    workshop.push(&node).ok();
    let mut running = launch(&workshop, &node);
    // Version 2 has a trial of its own.
    running.wait_for("bundle version 2: its trial has begun");
    assert!(running.err().contains("bundle version 3 did not start: "), "{}", running.err());
    assert_eq!(current(&node), 2);
    running.stop();
}

/// Changes the configuration that the next bundle is made of.
fn change_config(workshop: &Workshop, change: impl FnOnce(String) -> String) {
    let config = workshop.place.path("source/config/robot.toml");
    let changed = change(fs::read_to_string(&config).unwrap());
    fs::write(&config, changed).unwrap();
}

#[test]
fn a_launch_that_is_told_to_stop_on_its_way_back_ends() {
    let workshop = Workshop::new();
    let node = workshop.node("node");
    workshop.make("1 ms");
    workshop.push(&node).ok();
    workshop.write_program("if [ -e crashed ]; then exit 3; fi");
    let second = "[[module]]\nname = \"probe.1\"\nprogram = \"../bin/probe.sh\"\nstop-within = \"10 min\"\n";
    change_config(&workshop, |text| text + second);
    workshop.make(LONG);
    workshop.push(&node).ok();
    let mut running = launch(&workshop, &node);
    running.wait_for("bundle version 2: its trial has begun");
    let robot = workshop.place.robot(&config_of(&node), "main", &mut running);
    // Stands, so that the end of the modules takes its time.
    let last = robot.pid("probe.1");
    crate::harness::signal(last, nix::sys::signal::Signal::SIGSTOP);
    workshop.place.write("crashed", "");
    crate::harness::signal(robot.pid("probe.0"), nix::sys::signal::Signal::SIGKILL);
    wait("it goes back", || running.err().contains("probe.0 is failed; back to version 1").then_some(()));
    running.signal(nix::sys::signal::Signal::SIGTERM);
    crate::harness::signal(last, nix::sys::signal::Signal::SIGCONT);
    assert_eq!(running.end().code(), Some(1), "{}", running.err());
    assert_eq!(running.out().matches("node main of test runs").count(), 1, "{}", running.out());
    assert_eq!(current(&node), 1);
    workshop.place.assert_empty();
}

#[test]
fn a_module_that_is_not_on_fails_the_trial() {
    let (workshop, node) = node_with_two("# well", "24 h");
    change_config(&workshop, |text| text.replace("settings = {", "settings = { refuse-on = true,"));
    workshop.make("1 ms");
    workshop.push(&node).ok();
    let mut running = launch(&workshop, &node);
    running.wait_for("bundle version 2: its trial has begun");
    let err = running.err();
    assert!(
        err.contains("bundle version 3 did not stay up: probe.0 is ") && err.contains("; back to version 2"),
        "{err}"
    );
    running.stop();
}

#[test]
fn mistakes_of_the_command_line_and_other_files_decide_no_trial() {
    let (workshop, node) = node_with_two("# well", LONG);
    let config = config_of(&node);
    for (words, why) in [(["--log=warning"].as_slice(), "warning"), (&["--node", "bsae"], "has no node `bsae`")] {
        let words = [&["launch", config.to_str().unwrap()], words].concat();
        workshop.place.say(&words).fails_with([why]);
        assert_eq!((current(&node), trial(&node)), (2, "due".into()), "{why}");
    }
    let other = config.with_file_name("other.toml");
    fs::write(&other, "").unwrap();
    workshop.place.say(&["launch", other.to_str().unwrap()]).fails_with(["other.toml:"]);
    fs::remove_file(&other).unwrap();
    assert_eq!((current(&node), trial(&node)), (2, "due".into()));
    // A link in place of the configuration is a changed file, wherever it leads to.
    let outside = workshop.place.path("outside.toml");
    fs::rename(&config, &outside).unwrap();
    std::os::unix::fs::symlink(&outside, &config).unwrap();
    let mut running = launch(&workshop, &node);
    running.wait_for("node main of test runs: 1 module");
    let err = running.err();
    assert!(err.contains("config/robot.toml is no regular file") && err.contains("; back to version 1"), "{err}");
    running.stop();
}
