//! Packages of a receiver that ends, stops, or crashes on one.

use crate::harness::{PATIENCE, Place, Robot, halt, probe, signal, until};
use crate::probe::{ABORT, COUNT};
use nix::sys::signal::Signal;
use rohrpost::ToolLink;
use rohrpost::serde::Serialize;
use rohrpost_mailbox::Loss;

/// Sends a command once and waits for no answer.
fn throw(robot: &Robot, tool: &mut ToolLink, module: &str, function: u16, arguments: &impl Serialize) {
    let call = robot.begin(tool, module, function, arguments);
    tool.link.forget(call);
}

fn lost(robot: &Robot, module: &str, cause: Loss) -> u64 {
    let mailbox = robot.node.look_at(robot.name(module)).unwrap();
    mailbox.classes.iter().map(|class| class.lost(cause)).sum()
}

#[test]
fn packages_accepted_while_a_module_was_dead_or_stopped_arrive_in_order() {
    for number in [Signal::SIGKILL, Signal::SIGSTOP] {
        let restart = "restart = { policy = \"always\", backoff = \"500 ms\" }";
        let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", restart)]);
        let mut tool = robot.tool(PATIENCE);
        let pid = robot.pid("probe.0");
        if number == Signal::SIGSTOP {
            halt(pid);
        } else {
            signal(pid, number);
            until("probe.0 is dead", || robot.process("probe.0").is_none());
        }
        for count in 1..=20u32 {
            throw(&robot, &mut tool, "probe.0", COUNT, &(count,));
        }
        if number == Signal::SIGSTOP {
            assert_eq!(robot.waiting("probe.0"), 20);
            // Killed while it is stopped: waiting packages are kept for its next incarnation.
            signal(pid, Signal::SIGKILL);
        }
        until("all have been counted", || place.counted().len() >= 20);
        assert_eq!(place.counted(), (1..=20).collect::<Vec<_>>(), "{number}");
        assert_ne!(robot.pid("probe.0"), pid);
        tool.close();
        launch.stop();
        assert_eq!(place.counted().len(), 20, "none ran twice");
        place.assert_empty();
    }
}

#[test]
fn what_waited_for_a_stopped_module_reaches_the_same_process() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let mut tool = robot.tool(PATIENCE);
    let pid = robot.pid("probe.0");
    halt(pid);
    for count in 1..=20u32 {
        throw(&robot, &mut tool, "probe.0", COUNT, &(count,));
    }
    signal(pid, Signal::SIGCONT);
    until("all have been counted", || place.counted().len() >= 20);
    assert_eq!(place.counted(), (1..=20).collect::<Vec<_>>());
    assert_eq!(robot.pid("probe.0"), pid);
    tool.close();
    launch.stop();
}

#[test]
fn a_poison_package_is_handed_out_twice_and_the_module_lives_on() {
    let restart = "restart = { policy = \"always\", backoff = \"50 ms\", at-most = 20 }";
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", restart)]);
    let mut tool = robot.tool(PATIENCE);
    // `abort` is idempotent, so that only the mailbox ends the crashes.
    throw(&robot, &mut tool, "probe.0", ABORT, &());
    throw(&robot, &mut tool, "probe.0", COUNT, &(7u32,));
    until("the next package is counted", || place.counted() == [7]);
    assert_eq!(place.recorded("abort"), 2);
    assert_eq!(lost(&robot, "probe.0", Loss::Poison), 1);
    assert_eq!(robot.process("probe.0").unwrap().restarts, 2);
    assert_eq!(place.say(&["call", "probe.0", "count", "8"]).ok(), "2\n");
    place.say(&["list", "--mailboxes"]).ok_with(["1 poison"]);
    tool.close();
    launch.stop();
}

#[test]
fn a_command_that_must_not_run_twice_is_not_handed_to_the_module_again() {
    let restart = "restart = { policy = \"always\", backoff = \"50 ms\" }";
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", restart)]);
    place.say(&["call", "probe.0", "abort_once", "--timeout", "60"]).fails_with(["interrupted, outcome unknown"]);
    assert_eq!(place.recorded("abort"), 1);
    assert_eq!(lost(&robot, "probe.0", Loss::Poison), 0);
    launch.stop();
}

#[test]
fn stale_packages_are_dropped_after_a_restart_and_counted() {
    let keys = "restart = { policy = \"always\", backoff = \"4 s\" }\n[module.mailbox.commands]\nmax-age = \"3 s\"";
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", keys)]);
    let mut tool = robot.tool(PATIENCE);
    let pid = robot.pid("probe.0");
    signal(pid, Signal::SIGKILL);
    for count in 1..=5u32 {
        throw(&robot, &mut tool, "probe.0", COUNT, &(count,));
    }
    robot.wait_restarted("probe.0", pid);
    throw(&robot, &mut tool, "probe.0", COUNT, &(6u32,));
    until("the fresh one is counted", || !place.counted().is_empty());
    assert_eq!(place.counted(), [6]);
    assert_eq!(lost(&robot, "probe.0", Loss::Stale), 5);
    tool.close();
    launch.stop();
}

#[test]
fn a_full_mailbox_says_so_and_counts_it() {
    let keys = "stop-within = \"200 ms\"\n[module.mailbox.commands]\nslots = 4\nfull = \"reject\"";
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", keys)]);
    let mut tool = robot.tool(PATIENCE);
    halt(robot.pid("probe.0"));
    for count in 1..=4u32 {
        throw(&robot, &mut tool, "probe.0", COUNT, &(count,));
    }
    place.say(&["call", "probe.0", "count", "5"]).fails_with(["is full"]);
    assert!(lost(&robot, "probe.0", Loss::Refused) >= 1);
    signal(robot.pid("probe.0"), Signal::SIGCONT);
    until("what was accepted is counted", || place.counted().len() >= 4);
    assert_eq!(place.say(&["call", "probe.0", "count", "6"]).ok(), "5\n");
    assert_eq!(place.counted(), [1, 2, 3, 4, 6]);
    tool.close();
    launch.stop();
}
