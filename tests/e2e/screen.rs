//! The live table, in a terminal of its own.

use crate::harness::{Place, probe, runs, wait};
use crate::terminal::Terminal;
use nix::sys::signal::Signal;

#[test]
fn a_terminal_shows_a_live_table() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "", ""), &probe("probe.1", "", "start = \"off\"")]);
    let (terminal, mut launch) = Terminal::start(&place, &["launch", config.to_str().unwrap()], 24, 100);
    for words in ["module", "priority", "probe.0", "probe.1", "restarts"] {
        terminal.wait_for(words);
    }
    for (rows, columns) in [(1, 1), (3, 10), (200, 500), (24, 80)] {
        terminal.resize(&launch, rows, columns);
        let before = terminal.drawn().len();
        wait("it is drawn again", || (terminal.drawn().len() > before + 200).then_some(()));
    }
    let robot = place.robot(&config, "main", &mut launch);
    let pid = robot.pid("probe.0");
    crate::harness::signal(pid, Signal::SIGKILL);
    terminal.wait_for("probe.0 was killed by signal 9; starts again in");
    robot.wait_restarted("probe.0", pid);
    drop(robot);
    launch.signal(Signal::SIGINT);
    assert!(launch.end().success(), "{}", terminal.drawn());
    assert!(!terminal.drawn().contains("panicked"), "{}", terminal.drawn());
    place.assert_empty();
}

#[test]
fn a_closed_terminal_hurts_nobody() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "", "")]);
    let (terminal, mut launch) = Terminal::start(&place, &["launch", config.to_str().unwrap()], 24, 100);
    terminal.wait_for("probe.0");
    let robot = place.robot(&config, "main", &mut launch);
    robot.wait_on(&mut launch);
    let pid = robot.pid("probe.0");
    terminal.close();
    // It works on, unseen, until it is told to stop: a session of its own would be sent SIGHUP, see `launch.rs`.
    assert_eq!(place.say(&["call", "probe.0", "count", "1"]).ok(), "1\n");
    crate::harness::signal(pid, Signal::SIGKILL);
    robot.wait_restarted("probe.0", pid);
    let pid = robot.pid("probe.0");
    drop(robot);
    launch.signal(Signal::SIGINT);
    assert!(launch.end().success());
    assert!(!runs(pid));
    place.assert_empty();
}

#[test]
fn what_does_not_go_to_a_terminal_holds_no_table() {
    let place = Place::new();
    let (mut launch, _robot) = place.launched(&[&probe("probe.0", "", "")]);
    assert_eq!(launch.stop(), "node main of test runs: 1 module\n", "nothing else happened");
}
