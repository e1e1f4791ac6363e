//! What stands around a module's process: a script that starts it, `nohup`, a container without an init.

use crate::all_nodes::below;
use crate::harness::{Place, probe, runs, signal, state, until, wait};
use crate::strangers::{contained, launched_in, named};
use nix::sys::signal::Signal;
use std::path::Path;
use std::process::{Command, Stdio};

/// The table of a probe with these keys, its program behind this script, or behind several such.
fn behind(script: &str, scripts: usize, keys: &str) -> String {
    let script = format!("\"sh\", \"-c\", '{script}', ");
    probe("probe.0", "", keys).replacen("program = [", &format!("program = [{}", script.repeat(scripts)), 1)
}

/// Without `exec`, and not the last command: some shells make an `exec` of that.
const WAITS: &str = r#""$0" "$@"; exit $?"#;

#[test]
fn a_module_behind_a_script_is_the_process_that_launch_means() {
    let (place, mut launch, robot) = Place::running(&[&behind(WAITS, 1, "")]);
    let first = robot.pid("probe.0");
    let told = place.say(&["restart", "probe.0"]).ok();
    let second = robot.wait_restarted("probe.0", first).pid;
    assert!(told.contains(&format!("(process {second}; previously process {first})")), "{told}");
    assert_eq!((place.recorded("off"), runs(first)), (1, false), "it reached its safe state");
    signal(second, Signal::SIGKILL);
    launch.wait_for("probe.0 ended with 137; starts again");
    robot.wait_restarted("probe.0", second);
    let (pid, all) = (launch.pid(), below(launch.pid()));
    assert_eq!(all.len(), 2, "the script and the module of {pid}");
    let said = launch.stop();
    assert!(!said.contains("did not stop"), "{said}");
    assert_eq!((place.recorded("off"), all.iter().any(|pid| runs(*pid))), (2, false));
    place.assert_empty();
}

#[test]
fn a_module_behind_scripts_switches_off_when_launch_is_killed() {
    let (place, mut launch, robot) = Place::running(&[&behind(WAITS, 2, "")]);
    let pid = robot.pid("probe.0");
    launch.kill();
    until("the module ends", || !runs(pid));
    assert_eq!(place.recorded("off"), 1);
}

#[test]
fn what_a_module_has_started_ends_with_it() {
    let keys = "restart = { backoff = \"10 ms\" }";
    let (place, mut launch, robot) = Place::running(&[&behind(r#"sleep 600 & exec "$0" "$@""#, 1, keys)]);
    let helper = || wait("a helper", || named(&launch, "sleep").first().copied());
    let (pid, first) = (robot.pid("probe.0"), helper());
    signal(pid, Signal::SIGKILL);
    robot.wait_restarted("probe.0", pid);
    until("the helper of the first one ends", || !runs(first));
    let second = helper();
    launch.stop();
    until("the helper of the second one ends", || !runs(second));
    place.assert_empty();
}

#[test]
fn under_nohup_a_terminal_that_goes_ends_nobody() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "", "")]);
    let launch = place.command(&["launch", config.to_str().unwrap()]);
    let mut command = Command::new("nohup");
    command.arg(launch.get_program()).args(launch.get_args()).env("ROHRPOST_DIR", place.memory());
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let (mut launch, robot) = place.up(command, &config, "main");
    for pid in [launch.pid(), robot.pid("probe.0")] {
        let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap();
        let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap();
        let ignored = u64::from_str_radix(ignored.trim(), 16).unwrap();
        assert!(ignored & 1 << (Signal::SIGHUP as u32 - 1) != 0, "{pid}: {status}");
        signal(pid, Signal::SIGHUP);
    }
    assert_eq!(place.say(&["call", "probe.0", "count", "1"]).ok(), "1\n");
    place.end(&mut launch);
}

#[test]
fn as_the_first_process_of_a_container_launch_leaves_no_zombies() {
    let place = Place::new();
    // Each is left by its parent at once, and ends.
    let script = r#"for i in 1 2 3 4 5; do (sleep 0 &); done; exec "$0" "$@""#;
    let config = place.config(&[&behind(script, 1, "restart = { backoff = \"10 ms\" }")]);
    let Some(mut container) = contained(&place, "exec \"$@\"", &config) else { return };
    let robot = launched_in(&mut container, &place, &config);
    let first = robot.process("probe.0").unwrap().incarnation;
    let is_zombie = |pid: &u32| state(Path::new(&format!("/proc/{pid}/stat"))) == 'Z';
    let zombies = || named(&container, "sleep").into_iter().filter(is_zombie).count();
    until("none is left", || zombies() == 0);
    // Its own children it hears of as ever.
    place.say(&["call", "probe.0", "leave", "3"]).ok();
    container.wait_for("probe.0 ended with 3; starts again");
    wait("it runs again", || robot.process("probe.0").filter(|again| again.incarnation != first));
}
