//! The live table, in a terminal of its own.

use crate::harness::{OUTPUT, Place, probe, runs, simulated, until};
use crate::terminal::Terminal;
use crate::tools::{at_a_node, commands};
use nix::sys::signal::Signal;

/// Of the terminal that tools have to fit.
const COLUMNS: u16 = 80;

#[test]
fn a_terminal_shows_a_live_table() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "", ""), &probe("probe.1", "", "start = \"off\"")]);
    let (terminal, mut launch) = Terminal::start(&place, &["launch", config.to_str().unwrap()], 24, 100);
    for words in ["module", "prio", "probe.0", "probe.1", "rst"] {
        terminal.wait_for(words);
    }
    for (rows, columns) in [(1, 1), (3, 10), (200, 500), (24, 80)] {
        terminal.resize(&launch, rows, columns);
        let before = terminal.drawn().len();
        until("it is drawn again", || terminal.drawn().len() > before + 200);
    }
    let robot = place.robot(&config, "main", &mut launch);
    let pid = robot.pid("probe.0");
    crate::harness::signal(pid, Signal::SIGKILL);
    terminal.wait_for("probe.0 was killed by signal 9; starts again in");
    robot.wait_restarted("probe.0", pid);
    launch.stop();
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
    launch.stop();
    assert!(!runs(pid));
    place.assert_empty();
}

#[test]
fn what_does_not_go_to_a_terminal_holds_no_table() {
    let (_place, mut launch, _robot) = Place::running(&[&probe("probe.0", "", "")]);
    assert_eq!(launch.stop(), "node main of test runs: 1 module\n", "nothing else happened");
}

#[test]
fn a_live_table_has_all_columns_and_all_names_in_eighty_columns() {
    let place = Place::new();
    let config = place.config(&[&simulated(), OUTPUT]);
    let (terminal, mut launch) = Terminal::start(&place, &["launch", config.to_str().unwrap()], 24, COLUMNS);
    let screen = terminal.wait_screen("the names", |screen| screen.lines().any(|line| line.trim() == "+ camera.0"));
    for head in ["module", "state", "prio", "sched", "pid", "in/s", "wait", "lost", "rst"] {
        assert!(screen.split_whitespace().any(|word| word == head), "no {head}:\n{screen}");
    }
    assert!(!screen.contains('\\'), "{screen}");
    launch.stop();
}

#[test]
fn what_modules_say_stands_below_the_live_table_which_keeps_its_place() {
    let place = Place::new();
    let config = place.config(&[OUTPUT, &probe("probe.0", "", "")]);
    let (terminal, mut launch) = Terminal::start(&place, &["launch", config.to_str().unwrap(), "--log"], 10, COLUMNS);
    let robot = place.robot(&config, "main", &mut launch);
    robot.wait_on(&mut launch);
    place.say(&["call", "probe.0", "print", "stdout", &"far too long ".repeat(20), "30"]).ok();
    let is_last = |screen: &str| screen.split_whitespace().any(|word| word == "29");
    let screen = terminal.wait_screen("the last line", is_last);
    let first = screen.lines().next().unwrap_or_default();
    assert!(first.starts_with("test, ") && screen.contains("probe.0"), "the table has moved:\n{screen}");
    launch.stop();
}

#[test]
fn every_tool_fits_a_terminal_of_eighty_columns() {
    let (place, mut launch, robot) = Place::running(&[&simulated(), OUTPUT, &probe("probe.0", "rate-hz = 50.0", "")]);
    robot.wait_on(&mut launch);
    let asked = "call probe.0 count 1|list -m -s|stream list|stream info camera.0 image|param list|param get motor.0|\
                 mailbox motor.0.0|delay motor.0 --count 1|hz motor.0 --count 1|graph --seconds 0.2|doctor|\
                 log --level debug|status|top --once --interval 0.1|call motor.0";
    let asked = asked.split('|').map(|words| words.split(' ').collect::<Vec<_>>());
    // These change the node, or speak until they are stopped.
    let left_out = ["restart", "stop", "start", "hz", "bw", "delay", "ping", "echo"];
    let all = commands(&place);
    let each = all.iter().filter(|command| !left_out.contains(&&***command)).filter_map(|command| at_a_node(command));
    let mut too_wide = Vec::new();
    for tool in asked.chain(each) {
        let (terminal, mut running) = Terminal::start(&place, &tool, 24, COLUMNS);
        running.end();
        let drawn = terminal.into_all_drawn();
        assert!(!drawn.is_empty(), "{tool:?} says nothing");
        let widest = drawn.lines().max_by_key(|line| line.chars().count()).unwrap_or_default();
        if widest.chars().count() > COLUMNS.into() {
            too_wide.push(format!("{tool:?}: {widest}"));
        }
    }
    assert!(too_wide.is_empty(), "{too_wide:#?}");
}
