//! Launch ends what a launch has started, and nobody else: not in another pid namespace, not by its number alone.

use crate::all_nodes::below;
use crate::harness::{OUTPUT, Place, Robot, probe, runs, signal, until, wait};
use crate::process::Running;
use nix::sys::signal::Signal;
use rohrpost_mailbox::{Node, ParticipantInfo};
use rohrpost_testbed::report::skipped;
use std::path::Path;
use std::process::{Command, Stdio};

/// A script in a pid namespace of its own with its own /proc, as in a container that shares /dev/shm; `"$@"` in it
/// launches the configuration. All in it end when this drops. None where users make no namespaces.
pub(crate) fn contained(place: &Place, script: &str, config: &Path) -> Option<Running> {
    let spaces = ["--user", "--map-root-user", "--pid", "--fork", "--kill-child", "--mount-proc"];
    if !Command::new("unshare").args(spaces).arg("true").stderr(Stdio::null()).status().is_ok_and(|made| made.success())
    {
        skipped("users make no pid namespaces here");
        return None;
    }
    let launch = place.command(&["launch", config.to_str().unwrap()]);
    let mut command = Command::new("unshare");
    command.args(spaces).args(["sh", "-c", script, "sh"]).arg(launch.get_program()).args(launch.get_args());
    command.env("ROHRPOST_DIR", place.memory()).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    Some(Running::start(command))
}

/// The node that a container launches, when all its modules are on.
pub(crate) fn launched_in(container: &mut Running, place: &Place, config: &Path) -> Robot {
    let node = place.memory().join("test.main");
    wait("the node", || {
        container.assert_runs();
        Node::open(&node).ok()
    });
    let robot = place.robot_at(config, "main");
    robot.wait_on(container);
    robot
}

/// Processes of this name in a container, by their numbers outside.
pub(crate) fn named(container: &Running, name: &str) -> Vec<u32> {
    let is_named = |pid: &u32| std::fs::read_to_string(format!("/proc/{pid}/comm")).is_ok_and(|it| it.trim() == name);
    below(container.pid()).into_iter().filter(is_named).collect()
}

fn use_of(robot: &Robot, module: &str) -> Option<(u32, u32)> {
    robot.process(module).map(|ParticipantInfo { pid, incarnation, .. }| (pid, incarnation))
}

#[test]
fn a_launch_ends_nobody_in_another_container_and_nobody_here_with_the_same_number() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "ignore-stop = true", "stop-within = \"300 ms\"")]);
    let Some(mut first) = contained(&place, "\"$@\" & exec sleep 600", &config) else { return };
    let robot = launched_in(&mut first, &place, &config);
    let before = use_of(&robot, "probe.0");
    // Nor is the process of its number out here taken for the module.
    let listed = place.say(&["list", "--json"]).json();
    assert_eq!(listed["modules"][0]["scheduling"], "-", "{listed}");
    named(&first, "rohrpost").iter().for_each(|launch| signal(*launch, Signal::SIGKILL));
    until("its launch is dead", || robot.node.launcher().is_none());
    // In the second container each number up to the module's is that of a process that has nothing to do with it.
    let number = before.unwrap().0;
    let script = format!("n=0; while [ $n -lt {number} ]; do sleep 600 & n=$!; done; \"$@\"; echo ended with $?; wait");
    let mut second = contained(&place, &script, &config).unwrap();
    second.wait_for("ended with 1");
    let told = format!("probe.0 runs already, as process {number}; launch ends only what a launch has started");
    let why = "it runs in another one, such as a container";
    until("it says why", || second.err().contains(&told) && second.err().contains(why));
    // All but the shell, which is the first.
    let bystanders = || named(&second, "sleep").into_iter().filter(|pid| runs(*pid)).count();
    until(format!("{number} less one bystanders live"), || bystanders() == number as usize - 1);
    // From outside the number means yet another process.
    place.say(&["launch", config.to_str().unwrap()]).fails_with([why]);
    assert_eq!(use_of(&robot, "probe.0"), before, "it runs on");
    drop((first, second));
    until("it has ended with its container", || robot.process("probe.0").is_none());
    let mut launch = place.launch(&config);
    place.robot(&config, "main", &mut launch).wait_on(&mut launch);
    place.end(&mut launch);
}

#[test]
fn the_last_word_of_a_dead_module_is_not_that_of_a_new_one_with_the_same_number() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "", "")]);
    let Some(mut first) = contained(&place, "exec \"$@\"", &config) else { return };
    let robot = launched_in(&mut first, &place, &config);
    drop(first);
    until("all in it have ended", || robot.node.participants().is_empty());
    let keys = "ready-within = \"500 ms\"\nrestart = \"never\"\nrequired = true";
    let config = place.config(&[&probe("probe.0", "hang-at-start = true", keys)]);
    let mut second = contained(&place, "exec \"$@\"", &config).unwrap();
    assert!(!second.end().success());
    assert!(second.err().contains("probe.0 was not ready within 500ms; killed"), "{}", second.err());
}

#[test]
fn a_module_that_was_started_by_hand_is_left_alone_and_named() {
    let place = Place::new();
    let config = place.config(&[OUTPUT, &probe("probe.0", "", "")]);
    let file = config.to_str().unwrap();
    let mut by_hand = place.start(&["run", "output", "--config", file, "--name", "output.0"]);
    let pid = by_hand.pid();
    let node = wait("the node", || Node::open(&place.memory().join("test.main")).ok());
    until("it is there", || node.participants().iter().any(|there| there.pid == pid));
    let told = place.say(&["launch", file]).fails();
    let why = format!("output.0 runs already, as process {pid}; launch ends only what a launch has started");
    assert!(told.contains(&why) && told.contains(&format!("by hand: end it (kill {pid})")), "{told}");
    by_hand.assert_runs();
    by_hand.stop();
    drop(node);
    let mut launch = place.launch(&config);
    place.robot(&config, "main", &mut launch).wait_on(&mut launch);
    place.end(&mut launch);
}
