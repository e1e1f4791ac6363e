//! Launch dies: no module drives on, and cleaning removes the remains without harm to living processes.

use crate::harness::{PATIENCE, Place, Robot, halt, probe, runs, signal, until, wait};
use crate::probe::COUNT;
use crate::process::Running;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use std::sync::atomic::{AtomicBool, Ordering};

fn wait_gone(pids: &[u32]) {
    until(format!("{pids:?} end"), || !pids.iter().any(|pid| runs(*pid)));
}

/// Launches again and sees it work.
fn again(place: &Place) -> (Running, Robot) {
    let config = place.path("test.toml");
    place.launched_from(&config)
}

#[test]
fn modules_switch_off_and_end_when_launch_is_killed() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", ""), &probe("probe.1", "", "")]);
    let pids = robot.pids();
    launch.kill();
    wait_gone(&pids);
    for module in ["probe.0", "probe.1"] {
        assert_eq!(place.record().iter().filter(|line| **line == format!("{module} off")).count(), 1);
    }
    place.say(&["list"]).fails_with(["no node runs here"]);
    let (mut launch, _robot) = again(&place);
    assert_eq!(place.say(&["call", "probe.0", "count", "1"]).ok(), "1\n");
    place.end(&mut launch);
}

#[test]
fn what_waited_for_the_last_run_does_not_drive_the_next() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "restart = { backoff = \"10 min\" }")]);
    let mut tool = robot.tool(PATIENCE);
    signal(robot.pid("probe.0"), Signal::SIGKILL);
    launch.wait_for("probe.0 was killed by signal 9; starts again in 600s");
    robot.begin(&mut tool, "probe.0", COUNT, &(1u32,));
    assert_eq!(robot.waiting("probe.0"), 1);
    launch.kill();
    tool.close();
    let (mut launch, _robot) = again(&place);
    assert_eq!(place.say(&["call", "probe.0", "count", "2"]).ok(), "1\n");
    assert_eq!(place.counted(), [2]);
    launch.stop();
}

#[test]
fn a_module_that_was_stopped_when_launch_died_is_woken_and_switches_off() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", ""), &probe("probe.1", "", "")]);
    let (pids, stopped) = (robot.pids(), robot.pid("probe.0"));
    halt(stopped);
    launch.kill();
    // Mostly the kernel does this, preceded by SIGHUP; not if the new parent is in the same session.
    let _ = kill(Pid::from_raw(stopped as i32), Signal::SIGCONT);
    wait_gone(&pids);
    assert_eq!(place.recorded("off"), 2);
}

#[test]
fn the_next_launch_ends_a_module_that_would_not_end() {
    for stopped in [false, true] {
        let keys = "stop-within = \"300 ms\"";
        let (place, mut launch, robot) =
            Place::running(&[&probe("probe.0", "ignore-stop = true", keys), &probe("probe.1", "", keys)]);
        let (pid, other) = (robot.pid("probe.0"), robot.pid("probe.1"));
        launch.kill();
        wait_gone(&[other]);
        assert!(runs(pid));
        if stopped {
            halt(pid);
        }
        let (mut launch, robot) = again(&place);
        assert!(!runs(pid));
        launch.wait_for(&format!("probe.0 (process {pid}) ran already, left over from an earlier launch; ended"));
        assert_ne!(robot.pid("probe.0"), pid);
        place.end(&mut launch);
    }
}

#[test]
fn clean_removes_what_a_crash_left_and_nothing_that_lives() {
    let place = Place::new();
    assert!(place.say(&["clean"]).ok().contains("nothing to clean"));
    let dead = place.config_of("dead", "[nodes.main]", &[&probe("probe.0", "", "")]);
    let (mut launch, robot) = place.launched_from(&dead);
    let pids = robot.pids();
    launch.kill();
    wait_gone(&pids);
    let (mut launch, robot) = place.launched(&[&probe("probe.0", "", "")]);
    let before = robot.node.mailboxes().unwrap();
    let said = place.say(&["clean"]).ok();
    assert!(said.contains("removed ") && said.contains("dead.main"), "{said}");
    assert!(said.contains("test.main is in use; removed 0 mailboxes"), "{said}");
    assert!(!place.memory().join("dead.main").exists());
    assert_eq!(robot.node.mailboxes().unwrap(), before);
    assert_eq!(place.say(&["call", "probe.0", "count", "1"]).ok(), "1\n");
    place.end(&mut launch);
}

#[test]
fn clean_keeps_the_packages_of_a_module_that_is_about_to_start_again() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "restart = { backoff = \"1 s\" }")]);
    let mut tool = robot.tool(PATIENCE);
    let pid = robot.pid("probe.0");
    signal(pid, Signal::SIGKILL);
    until("probe.0 is dead", || robot.process("probe.0").is_none());
    let call = robot.begin(&mut tool, "probe.0", COUNT, &(5u32,));
    assert!(place.say(&["clean"]).ok().contains("removed 0 mailboxes"));
    let counted: u64 = tool.link.wait(call, |bytes| rohrpost::wire::from_bytes(bytes)).unwrap();
    assert_eq!((counted, place.counted()), (1, vec![5]));
    tool.close();
    launch.stop();
}

#[test]
fn clean_leaves_modules_alone_that_outlived_their_launch() {
    let (place, mut launch, robot) =
        Place::running(&[&probe("probe.0", "ignore-stop = true", "stop-within = \"300 ms\"")]);
    let pid = robot.pid("probe.0");
    launch.kill();
    place.say(&["clean"]).ok_with(["is in use"]);
    assert!(runs(pid));
    signal(pid, Signal::SIGKILL);
    wait_gone(&[pid]);
    assert!(place.say(&["clean"]).ok().contains("removed "));
    place.assert_empty();
}

#[test]
fn clean_leaves_alone_what_is_no_node() {
    let place = Place::new();
    std::fs::create_dir(place.memory().join("notes")).unwrap();
    std::fs::write(place.memory().join("notes/shopping"), "milk").unwrap();
    std::fs::write(place.memory().join("list"), "bread").unwrap();
    place.say(&["clean"]).ok();
    assert!(place.memory().join("notes/shopping").exists() && place.memory().join("list").exists());
}

/// Tells the others that a test is over, also when it fails.
struct Ended<'a>(&'a AtomicBool);

impl Drop for Ended<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[test]
fn launches_and_cleaning_at_the_same_time_do_not_harm_each_other() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "", "")]);
    let over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !over.load(Ordering::Relaxed) {
                let said = place.say(&["clean"]);
                assert_eq!(said.code, Some(0), "{said:?}");
            }
        });
        let _over = Ended(&over);
        for _ in 0..8 {
            let mut launch = place.launch(&config);
            wait("the probe answers", || {
                launch.assert_runs();
                place.say(&["call", "probe.0", "count", "1"]).code.filter(|code| *code == 0)
            });
            launch.stop();
        }
    });
    place.assert_empty();
}
