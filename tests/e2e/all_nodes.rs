//! `launch --all`: all nodes of a configuration on this computer, in network namespaces.

use crate::harness::{OUTPUT, Place, assert_has, lacks_namespaces, probe, runs, until};
use crate::network::{NETWORK, at, launched_all, nodes};
use crate::process::Running;
use nix::sys::signal::Signal;
use rohrpost_testbed::report::skipped;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::os::unix::fs::chown;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Command, Stdio};

fn two() -> String {
    nodes([("base", "10.77.0.1"), ("arm", "10.77.0.2")]) + NETWORK
}

/// probe.0 on `base`, and on `arm` probe.1, with further settings and keys.
fn configured(place: &Place, settings: &str, keys: &str) -> PathBuf {
    let modules =
        [probe("probe.0", "", "node = \"base\""), probe("probe.1", settings, &format!("node = \"arm\"\n{keys}"))];
    place.config_of("test", &two(), &[&modules[0], &modules[1]])
}

/// Both nodes, with these further words for launch.
fn both(place: &Place, words: &[&str]) -> Option<(Running, PathBuf)> {
    let config = configured(place, "", "");
    let launch = launched_all(place, &config, &["base", "arm"], words)?;
    assert_has(&launch.out(), ["│ node base of test runs: 2 modules", "│ node arm of test runs: 2 modules"]);
    Some((launch, config))
}

/// Processes that a process has started, recursively.
pub(crate) fn below(pid: u32) -> Vec<u32> {
    let text = std::fs::read_to_string(format!("/proc/{pid}/task/{pid}/children")).unwrap_or_default();
    let children: Vec<u32> = text.split_whitespace().filter_map(|pid| pid.parse().ok()).collect();
    children.iter().flat_map(|pid| std::iter::once(*pid).chain(below(*pid))).collect()
}

fn devices() -> BTreeSet<std::ffi::OsString> {
    std::fs::read_dir("/sys/class/net").into_iter().flatten().flatten().map(|entry| entry.file_name()).collect()
}

#[test]
fn nodes_start_talk_and_are_stopped() {
    let (place, before) = (Place::new(), devices());
    let Some((mut launch, config)) = both(&place, &[]) else { return };
    assert!(launch.out().starts_with("security = \"none\": packages between nodes are neither sealed nor signed"));
    assert_eq!(place.say_at(&config, "base", &["call", "probe.1", "count", "1"]).ok(), "1\n");
    assert_eq!(place.say_at(&config, "arm", &["call", "probe.0", "count", "2"]).ok(), "1\n");
    assert_eq!(devices(), before, "the lab's devices are in the lab");
    let processes = below(launch.pid());
    assert_eq!(processes.len(), 6, "two launches, two routers, two probes");
    launch.stop();
    assert_eq!(launch.err(), "", "nothing to complain of");
    let record = place.record();
    let ends: Vec<&str> = record.iter().filter_map(|line| line.strip_suffix(" off")).collect();
    assert_eq!(ends, ["probe.1", "probe.0"], "the last node first");
    assert!(processes.iter().all(|pid| !runs(*pid)));
    place.assert_empty();
}

#[test]
fn nothing_is_left_when_it_is_killed() {
    let place = Place::new();
    let Some((mut launch, _config)) = both(&place, &[]) else { return };
    let processes = below(launch.pid());
    assert_eq!(processes.len(), 6);
    launch.kill();
    until("all that it started ends", || processes.iter().all(|pid| !runs(*pid)));
    place.assert_empty();
}

#[test]
fn a_node_that_does_not_start_ends_them_all() {
    let place = Place::new();
    let config = configured(&place, "exit_at_start = 3", "restart = \"never\"");
    let said = place.say(&["launch", config.to_str().unwrap(), "--all"]);
    if lacks_namespaces(&said.err) {
        return;
    }
    let told = said.fails();
    assert!(told.contains("arm │ module probe.1 did not become ready"), "{told}");
    assert!(told.contains("node arm did not start: exit status: 1"), "{told}");
    place.assert_empty();
}

/// A killed node is reported, and the others go on.
#[test]
fn a_node_that_ends_leaves_the_others_alone() {
    let place = Place::new();
    let Some((mut launch, config)) = both(&place, &[]) else { return };
    let arm = place.robot_at(&config, "arm").node.launcher().unwrap();
    crate::harness::signal(arm, Signal::SIGKILL);
    until("its end is told", || launch.err().contains("node arm ended: signal: 9"));
    assert_eq!(place.say_at(&config, "base", &["call", "probe.0", "count", "1"]).ok(), "1\n");
    launch.stop_failed();
    // Its modules end after their launch; `clean` removes files that it had no time to remove.
    until("nothing of it lives", || {
        place.say(&["clean"]).ok();
        std::fs::read_dir(place.memory()).unwrap().next().is_none()
    });
}

#[test]
fn calls_are_counted_once_over_a_bad_network() {
    let place = Place::new();
    let bad = "loss=10%,delay=1ms,jitter=500us,duplicate=5%,reorder=10%,seed=3";
    let Some((mut launch, config)) = both(&place, &["--impair", bad]) else { return };
    let mut expected = Vec::new();
    for number in 1..=12 {
        let said = place.say_at(&config, "base", &["call", "probe.1", "count", &number.to_string()]);
        // A failed call is reported, and may have run; none runs twice.
        if said.code == Some(0) {
            expected.push(number);
        }
    }
    let counted = place.counted();
    let once: BTreeSet<u32> = counted.iter().copied().collect();
    assert_eq!(once.len(), counted.len(), "twice: {counted:?}");
    assert!(expected.len() >= 10 && expected.iter().all(|number| once.contains(number)), "{expected:?} {counted:?}");
    place.end(&mut launch);
}

#[test]
fn what_cannot_be_launched_is_told_with_its_remedy() {
    let place = Place::new();
    let one = place.config(&[OUTPUT]);
    let one = one.to_str().unwrap();
    let told = place.say(&["launch", one, "--all"]).fails();
    assert_eq!(told, format!("{one} has one node; launch it without --all: rohrpost launch {one}\n"));
    let config = configured(&place, "", "");
    let config = config.to_str().unwrap();
    place.say(&["launch", config, "--node", "roof"]).fails_with(["roof", "base, arm"]);
    for (arguments, words) in [
        (&["--all", "--node", "base"][..], "cannot be used with"),
        (&["--impair", "loss=5%"], "--all"),
        (&["--all", "--impair", "loss=5"], "write a share from 0% to 100%, such as loss=5%"),
    ] {
        let said = place.say(&[&["launch", config], arguments].concat());
        assert!(said.code == Some(2) && said.err.contains(words), "{said:?}");
    }
    place.assert_empty();
}

/// For tests that run as root: an ordinary user also launches all nodes, if users may make namespaces.
#[test]
fn a_user_without_rights_launches_all_nodes() {
    const NOBODY: u32 = 65_534;
    if !nix::unistd::geteuid().is_root() {
        return skipped("root alone can be somebody else; the other tests ran without its rights");
    }
    let place = Place::new();
    // Not a program in the tests' own folder: users may have no access to that folder.
    let config = place.config_of("test", &two(), &[&at("arm", OUTPUT)]);
    let launch = place.command(&["launch", config.to_str().unwrap(), "--all"]);
    let program = place.path("rohrpost");
    // Copied by a process of its own: a file that this process has open for writing is also held by a child that
    // another test forks just then, until the child executes its program; until then the copy cannot be executed ("text
    // file busy").
    assert!(Command::new("cp").arg(launch.get_program()).arg(&program).status().unwrap().success());
    for path in [place.memory(), config.parent().unwrap()] {
        chown(path, Some(NOBODY), Some(NOBODY)).unwrap();
    }
    let mut command = Command::new(&program);
    command.args(launch.get_args()).env("ROHRPOST_DIR", place.memory()).current_dir(config.parent().unwrap());
    command.uid(NOBODY).gid(NOBODY).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut launch = Running::start(command);
    until("it runs, or may not", || {
        let runs = ["base of test runs: 1 module", "arm of test runs: 2 modules"];
        launch.ended().is_some() || runs.iter().all(|runs| launch.out().contains(runs))
    });
    if lacks_namespaces(&launch.err()) {
        return;
    }
    place.end(&mut launch);
}

/// As on a computer without the right: a user namespace with a limit of zero.
#[test]
fn without_the_right_to_namespaces_it_says_what_gives_it() {
    let place = Place::new();
    let config = configured(&place, "", "");
    let launch = place.command(&["launch", config.to_str().unwrap(), "--all"]);
    let mut script = String::from("echo 0 > /proc/sys/user/max_net_namespaces && exec \"$@\"");
    // A marker that the limit was set, since not every computer has the program or the right.
    let _ = write!(script, " || exit 99");
    let mut limited = Command::new("unshare");
    limited
        .args(["--user", "--map-root-user", "sh", "-c", &script, "sh"])
        .arg(launch.get_program())
        .args(launch.get_args());
    limited.env("ROHRPOST_DIR", place.memory()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let Ok(child) = limited.spawn() else { return skipped("there is no `unshare`") };
    let output = child.wait_with_output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    if output.status.code() == Some(99) || told.starts_with("unshare:") {
        return skipped("users make no namespaces here");
    }
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.starts_with("network namespaces cannot be made here (") && told.contains("run it as root"), "{told}");
    place.assert_empty();
}
