//! A person restarts, stops and starts single modules of a node that runs.

use crate::harness::{OUTPUT, PATIENCE, Place, halt, probe, signal, until, wait};
use nix::sys::signal::Signal;
use rohrpost::CallError;
use rohrpost_launch::launcher::{AskLaunch, ChildState, ControlError, Phase};
use std::time::{Duration, Instant};

fn child(place: &crate::harness::Robot, module: &str) -> ChildState {
    let mut tool = place.tool(PATIENCE);
    let children = tool.children(tool.launcher()).unwrap();
    tool.close();
    children.into_iter().find(|child| child.module == module).unwrap()
}

#[test]
fn a_module_is_restarted_stopped_and_started_and_nobody_else_notices() {
    let keys = "restart = { policy = \"on-failure\", at-most = 1, within = \"60 s\" }";
    let (place, mut launch, robot) =
        Place::running(&[OUTPUT, &probe("probe.0", "", keys), &probe("probe.1", "", "calls = [\"probe.0\"]")]);
    let other = robot.pid("probe.1");
    for _ in 0..3 {
        let pid = robot.pid("probe.0");
        let said = place.say(&["restart", "probe.0"]).ok();
        assert!(said.contains("probe.0 runs and is on after "), "{said}");
        assert!(said.contains(&format!("previously process {pid}")), "{said}");
        assert_ne!(robot.pid("probe.0"), pid);
    }
    assert_eq!(place.say(&["list", "--json"]).json()["modules"][1]["restarts"], 0, "its policy was not asked");
    assert!(place.say(&["start", "probe.0"]).fails().contains("probe.0 runs already; `rohrpost restart probe.0`"));

    place.say(&["stop", "probe.0"]).ok_with(["probe.0 is stopped (ended with 0 when told to)"]);
    assert!(robot.process("probe.0").is_none());
    assert!(
        place
            .say(&["call", "probe.0", "count", "1"])
            .fails()
            .contains("probe.0 does not run; `rohrpost start probe.0` starts it"),
        "nobody waits for it"
    );
    assert!(place.say(&["stop", "probe.0"]).fails().contains("probe.0 is stopped already; `rohrpost start probe.0`"));
    assert_eq!(child(&robot, "probe.0").phase, Phase::Stopped);

    place.say(&["start", "probe.0"]).ok_with(["probe.0 runs and is on"]);
    assert_eq!(place.say(&["call", "probe.0", "count", "1"]).ok(), "1\n");
    // A restart by a person does not count: one restart by its policy is left.
    let pid = robot.pid("probe.0");
    signal(pid, Signal::SIGKILL);
    assert_eq!(robot.wait_restarted("probe.0", pid).restarts, 1);
    assert_eq!(robot.pid("probe.1"), other);
    let out = launch.stop();
    assert_eq!(out.matches("probe.0 is started again, as asked").count(), 3, "{out}");
    assert!(out.contains("probe.0 is stopped, as asked"), "{out}");
    place.assert_empty();
}

#[test]
fn a_restarted_module_is_on_if_it_was_on() {
    let (place, mut launch, robot) =
        Place::running(&[&probe("probe.0", "", ""), &probe("probe.1", "", "start = \"off\"")]);
    place.say(&["call", "probe.0", "off"]).ok();
    place.say(&["call", "probe.1", "on"]).ok();
    for (module, state) in [("probe.0", "off"), ("probe.1", "on")] {
        place.say(&["restart", module]).ok_with([&format!("{module} runs and is {state}")]);
        assert_eq!(robot.state(module), state);
    }
    for (module, state) in [("probe.0", "on"), ("probe.1", "off")] {
        place.say(&["stop", module]).ok();
        let said = place.say(&["start", module]).ok();
        assert!(said.contains(&format!("{module} runs and is {state}")), "started anew, as configured: {said}");
    }
    launch.stop();
}

#[test]
fn one_that_hangs_on_its_way_out_keeps_nobody_waiting_and_a_second_word_ends_it() {
    let (place, mut launch, robot) =
        Place::running(&[&probe("probe.0", "", "stop-within = \"20 min\""), &probe("probe.1", "", "")]);
    halt(robot.pid("probe.0"));
    assert_eq!(place.say(&["restart", "probe.0", "--no-wait"]).ok(), "probe.0 is being started\n");
    assert_eq!(child(&robot, "probe.0").phase, Phase::Stopping);
    robot.kill("probe.1");
    assert_eq!(child(&robot, "probe.0").phase, Phase::Stopping);
    place.say(&["stop", "probe.0", "--timeout", "0.2"]).fails_with(["probe.0 is still stopping after 200ms"]);
    // The first signal stops modules in order; a second one, moments later, kills the rest.
    wait("launch ends", || {
        launch.signal(Signal::SIGINT);
        std::thread::sleep(Duration::from_millis(100));
        launch.ended()
    });
    assert!(launch.end().success());
    let out = launch.out();
    assert!(out.contains("told to stop a second time; killed at once: probe.0"), "{out}");
    place.assert_empty();
}

#[test]
fn a_hung_module_is_killed_and_comes_back() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "stop-within = \"300 ms\"")]);
    let pid = robot.pid("probe.0");
    halt(pid);
    place.say(&["restart", "probe.0"]).ok_with(["probe.0 runs and is on"]);
    assert_ne!(robot.pid("probe.0"), pid);
    let out = launch.stop();
    assert!(out.contains("probe.0 did not stop within 300ms; killed"), "{out}");
}

#[test]
fn hung_modules_wait_beside_each_other_at_the_end() {
    let (hung, within) = (6, Duration::from_millis(2000));
    let probes: Vec<String> = (0..hung)
        .map(|n| probe(&format!("probe.{n}"), "", &format!("stop-within = \"{} ms\"", within.as_millis())))
        .collect();
    let probes: Vec<&str> = probes.iter().map(String::as_str).collect();
    let (place, mut launch, robot) = Place::running(&probes);
    robot.pids().into_iter().for_each(halt);
    let told = Instant::now();
    let out = launch.stop();
    assert!(told.elapsed() < within * (hung - 1), "one after the other: {:?}", told.elapsed());
    assert_eq!(out.matches("did not stop within 2s; killed").count(), hung as usize, "{out}");
    place.assert_empty();
}

#[test]
fn one_that_failed_for_good_is_started_by_a_person_and_is_forgiven() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "restart = \"never\"")]);
    place.say(&["call", "probe.0", "leave", "3"]).ok();
    launch.wait_for("probe.0 ended with 3");
    let failed = child(&robot, "probe.0");
    assert_eq!((failed.phase, failed.pid, failed.lives), (Phase::Failed, None, 1));
    assert!(failed.last_end.starts_with("ended with 3"), "{failed:?}");
    assert!(place.say(&["stop", "probe.0"]).fails().contains("has ended already"));
    place.say(&["start", "probe.0"]).ok();
    assert_eq!(child(&robot, "probe.0").lives, 2);
    launch.stop();
}

#[test]
fn a_module_that_does_not_come_back_is_told_with_its_own_words() {
    let place = Place::new();
    let ends = format!("exit-at-start = 3, wait-for = {:?}", place.path("end"));
    let (mut launch, robot) =
        place.launched(&[&probe("probe.0", &ends, "restart = \"never\""), &probe("probe.1", "", "")]);
    place.write("end", "");
    let said = place.say(&["restart", "probe.0"]).fails();
    assert!(said.contains("probe.0 does not run: ended with 3"), "{said}");
    assert!(said.contains("a probe was asked to end with 3"), "{said}");
    assert_eq!(robot.state("probe.1"), "on");
    launch.stop_failed();
}

#[test]
fn orders_that_cannot_be_carried_out_say_why() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    place.say(&["restart", "probe.7"]).fails_with(["no module `probe.7`"]);
    let mut tool = robot.tool(PATIENCE);
    for text in ["probe.7", "nonsense", "tool.0"] {
        let refused = tool.restart(tool.launcher(), text);
        assert!(
            matches!(&refused, Err(CallError::Module(_, ControlError::NoModule(name))) if name == text),
            "{refused:?}"
        );
    }
    assert!(matches!(tool.start(tool.launcher(), "probe.0"), Err(CallError::Module(_, ControlError::Running(_)))));
    tool.close();
    // Any tool can read launch's interface, and call it.
    place.say(&["call", "tool.0"]).ok_with(["restart <module: text>"]);
    place.say(&["call", "tool.0", "stop", "probe.0"]).ok();
    until("probe.0 is stopped", || child(&robot, "probe.0").phase == Phase::Stopped);
    launch.stop();
}

#[test]
fn without_a_launch_it_is_told_that_nobody_watches() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let config = place.path("test.toml");
    launch.kill();
    until("its module has ended", || robot.process("probe.0").is_none());
    let said = place.say(&["restart", "probe.0", "--config", config.to_str().unwrap()]);
    said.fails_with(["no launch watches over probe.0", "rohrpost launch"]);
    place.say(&["clean"]).ok();
    place.assert_empty();
}
