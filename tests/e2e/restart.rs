//! Modules that end, and what launch does then.

use crate::harness::{OUTPUT, Place, halt, probe, signal, until};
use crate::output::lines;
use nix::sys::signal::Signal;
use std::time::{Duration, Instant};

#[test]
fn policies_say_after_which_end_a_module_starts_again() {
    for (policy, code, again) in [
        ("never", 0, false),
        ("never", 3, false),
        ("on-failure", 0, false),
        ("on-failure", 3, true),
        ("always", 0, true),
        ("always", 3, true),
    ] {
        let restart = format!("restart = {{ policy = \"{policy}\", backoff = \"50 ms\" }}");
        let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", &restart)]);
        let pid = robot.pid("probe.0");
        place.say(&["call", "probe.0", "leave", &code.to_string()]).ok();
        launch.wait_for(&format!("probe.0 ended with {code}"));
        if again {
            assert_eq!(robot.wait_restarted("probe.0", pid).restarts, 1, "{policy}, {code}");
        } else {
            assert!(robot.process("probe.0").is_none(), "{policy}, {code}");
        }
        launch.signal(Signal::SIGTERM);
        let (status, given_up) = (launch.end(), !again && code != 0);
        assert_eq!(status.code(), Some(i32::from(given_up)), "{policy}, {code}: {}", launch.err());
        assert_eq!(launch.err().contains("probe.0 failed for good: ended with 3"), given_up, "{}", launch.err());
        assert_eq!(place.recorded("start"), if again { 2 } else { 1 }, "{policy}, {code}");
        place.assert_empty();
    }
}

#[test]
fn a_killed_module_works_again_and_its_restarts_are_counted() {
    let (place, mut launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", "")]);
    let mut pid = robot.pid("probe.0");
    for count in 1..=2 {
        signal(pid, Signal::SIGKILL);
        let process = robot.wait_restarted("probe.0", pid);
        assert_eq!(process.restarts, count);
        pid = process.pid;
        assert_eq!(place.say(&["call", "probe.0", "count", "1"]).ok(), "1\n", "a new incarnation counts anew");
    }
    let list = place.say(&["list", "--json"]).json();
    assert_eq!(list["modules"][1]["restarts"], 2);
    assert_eq!(list["modules"][0]["restarts"], 0, "the other module did not notice");
    let out = launch.stop();
    assert_eq!(out.matches("probe.0 was killed by signal 9; starts again in").count(), 2, "{out}");
}

#[test]
fn pauses_grow_and_a_module_that_keeps_ending_is_given_up() {
    let restart = "restart = { policy = \"always\", backoff = \"100 ms\", at-most = 3, within = \"60 s\" }";
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", restart), &probe("probe.1", "", "")]);
    let mut pid = robot.pid("probe.0");
    for pause in ["100ms", "200ms", "400ms"] {
        let killed = Instant::now();
        signal(pid, Signal::SIGKILL);
        launch.wait_for(&format!("starts again in {pause}"));
        pid = robot.wait_restarted("probe.0", pid).pid;
        let least = Duration::from_millis(pause.trim_end_matches("ms").parse().unwrap());
        assert!(killed.elapsed() >= least, "it came back after {:?}, before {pause}", killed.elapsed());
    }
    signal(pid, Signal::SIGKILL);
    launch.wait_for("probe.0 was killed by signal 9; given up after 3 restarts within 60s");
    assert_eq!(robot.state("probe.1"), "on", "the others go on");
    until("its mailboxes are gone", || {
        robot.node.mailboxes().unwrap().iter().all(|n| n.module() != robot.name("probe.0"))
    });
    let told = place.say(&["call", "probe.0", "count", "1"]).fails();
    assert!(
        told.contains("probe.0 has failed: was killed by signal 9") && told.contains("`rohrpost start probe.0`"),
        "nothing waits for a module that never comes: {told}"
    );
    let status = place.say(&["status"]);
    assert_eq!(status.code, Some(1), "one does not answer: {}", status.out);
    launch.stop_failed();
    assert!(launch.err().contains("probe.0 failed for good: was killed by signal 9; given up"), "{}", launch.err());
    assert_eq!(place.recorded("start"), 5);
    place.assert_empty();
}

#[test]
fn a_stopped_module_does_not_keep_its_launch_from_watching_others() {
    let (place, mut launch, robot) =
        Place::running(&[&probe("probe.0", "", "stop-within = \"200 ms\""), &probe("probe.1", "", "")]);
    halt(robot.pid("probe.0"));
    robot.kill("probe.1");
    let status = place.say(&["status", "--timeout", "0.3"]);
    assert_eq!(status.code, Some(1));
    let silent = status.out.lines().find(|line| line.starts_with("probe.0")).unwrap();
    assert!(silent.contains("unreachable") && silent.contains("no answer from"), "{silent}");
    launch.stop();
}

#[test]
fn launch_stops_while_a_module_waits_to_be_started_again() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "restart = { backoff = \"10 min\" }")]);
    signal(robot.pid("probe.0"), Signal::SIGKILL);
    launch.wait_for("starts again in 600s");
    until("probe.0 is gone", || robot.process("probe.0").is_none());
    launch.stop();
    assert_eq!(place.recorded("start"), 1);
    place.assert_empty();
}

/// The first ends are told whole, the tenth, the twentieth and so on in one line each; so on the terminal, and in the
/// log.
#[test]
fn a_module_that_ends_again_and_again_floods_neither_the_terminal_nor_the_log() {
    for (settings, cause, lines_of_each_end) in [
        ("exit-at-start = 3", "a probe was asked to end with 3", 4),
        ("panic-at-start = true", "a probe was asked to panic", 16),
    ] {
        let (place, began) = (Place::new(), Instant::now());
        let restart = "restart = { policy = \"always\", backoff = \"1 ms\", at-most = 1000, within = \"50 ms\" }";
        let config = place.config(&[OUTPUT, &probe("probe.0", settings, restart), &probe("probe.1", "", "")]);
        let mut launch = place.launch(&config);
        let _robot = place.robot(&config, "main", &mut launch);
        for starts in 1..=42 {
            until("it ends again and again", || place.recorded("start") >= starts);
        }
        until("the list says that it is started again", || {
            let list = place.say(&["list"]).out;
            list.lines().any(|line| line.starts_with("probe.0") && line.contains("restarting ("))
        });
        let log = lines(&place, "probe.0");
        let out = launch.stop();
        let ends = place.recorded("start");
        assert!(ends < 160, "{ends} ends, of which the last that is told is the eightieth at most");
        let told = out.lines().filter(|line| line.starts_with("probe.0 ") && line.contains("starts again in ")).count();
        // Other last words are told in full, every ten seconds at most: on a busy computer some are not said in time.
        let others = began.elapsed().as_secs() as usize / 10;
        assert!((8..=9 + others).contains(&told), "{told} of {ends} are told: {out}");
        let count = |text: &str| out.lines().filter(|line| line.contains(text)).count();
        let in_sums = count(" times in ");
        assert_eq!(count(" in a row; its last words: "), in_sums, "{out}");
        assert!((5..=5 + others).contains(&(told - in_sums)), "{out}");
        // One that ends by itself when all are stopped is told in full, too.
        assert!(count(cause) <= told + 1, "{out}");
        let lines_max = (5 + others + 1) * lines_of_each_end + told + 6;
        assert!(out.lines().count() <= lines_max, "{out}");
        assert!(log.len() <= lines_max, "{} lines: {log:#?}", log.len());
        let causes = log.iter().filter(|line| line["text"].as_str().unwrap().contains(cause)).count();
        assert!((5..=told).contains(&causes), "{causes}: {log:#?}");
        place.assert_empty();
    }
}
