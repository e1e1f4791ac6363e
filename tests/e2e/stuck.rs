//! Stuck, failed and incompatible modules are visible from outside, in the same words everywhere, and the others go on.

use crate::harness::{OUTPUT, Place, Robot, probe, until, wait};
use crate::output::lines;
use crate::probe::WORK;
use crate::process::{Running, without_real_time};
use crate::terminal::Terminal;
use nix::sys::signal::Signal;
use rohrpost_launch::survey::Standing;
use serde_json::Value;
use std::time::Duration;

/// A tool's line about this module.
fn told(place: &Place, tool: &[&str], module: &str) -> Option<Value> {
    let said = place.say(tool);
    let json: Value = serde_json::from_str(&said.out).unwrap_or_else(|_| panic!("{said:?}"));
    let modules = if json.is_array() { &json } else { &json["modules"] };
    modules.as_array()?.iter().find(|line| line["module"] == module).cloned()
}

/// All tools show the same state. Returns its description and the last error, when `list` shows this state.
fn standing(place: &Place, module: &str, state: &str) -> Value {
    let listed = wait(format!("{module} is {state}"), || {
        told(place, &["list", "--json"], module).filter(|line| line["state"] == state)
    });
    for tool in [&["status", "--json"][..], &["top", "--json", "--interval", "0.1"]] {
        wait(format!("{tool:?} says {state}"), || {
            told(place, tool, module).filter(|line| line["state"] == state && line["restarts"] == listed["restarts"])
        });
    }
    assert!(Standing::WORDS.contains(&state));
    let table = place.say(&["list"]).ok();
    assert!(table.lines().any(|line| line.starts_with(module) && line.contains(state)), "{table}");
    listed
}

fn begun(place: &Place, modules: &[&str]) -> (Running, Robot) {
    let config = place.config(modules);
    let mut launch = place.start(&["launch", "--quiet", config.to_str().unwrap()]);
    let robot = place.robot(&config, "main", &mut launch);
    (launch, robot)
}

#[test]
fn a_handler_that_does_not_come_back_is_seen_from_outside() {
    let keys = "busy-after = \"300 ms\"\nstop-within = \"200 ms\"";
    let (place, mut launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", keys), &probe("probe.1", "", "")]);
    assert_eq!(standing(&place, "probe.0", "on")["error"], Value::Null);
    let mut tool = robot.tool(Duration::from_secs(60));
    robot.begin(&mut tool, "probe.0", WORK, &(600_000_u64,));
    let busy = standing(&place, "probe.0", "busy");
    let why = busy["error"].as_str().unwrap();
    assert!(why.starts_with("in `work` for "), "{why}");
    let later = wait("it lasts", || {
        told(&place, &["status", "probe.0", "--json"], "probe.0").filter(|line| line["error"] != why)
    });
    assert!(later["failure"].as_str().unwrap().starts_with("in `work` for "), "{later}");
    assert_eq!(told(&place, &["list", "--json"], "probe.1").unwrap()["state"], "on");
    let warned = wait("a warning", || {
        let all = lines(&place, "probe.0");
        let mut warnings = all.into_iter().filter(|line| line["level"] == "warn");
        warnings.find(|line| line["text"].as_str().unwrap().starts_with("is busy: in `work` for "))
    });
    assert!(warned["text"].as_str().unwrap().contains("hears nobody"), "{warned}");
    tool.close();
    let out = launch.stop();
    let notes = out.lines().filter(|line| line.starts_with("probe.0 is busy: in `work` for "));
    assert_eq!(notes.count(), 1, "told once: {out}");
}

#[test]
fn a_handler_that_was_long_says_so_when_it_comes_back() {
    let (place, _launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", "busy-after = \"50 ms\"")]);
    let mut tool = robot.tool(Duration::from_secs(60));
    robot.begin(&mut tool, "probe.0", WORK, &(300_u64,));
    until("it says so", || {
        let all = lines(&place, "probe.0");
        let was = |line: &Value| line["text"].as_str().unwrap().starts_with("was in `work` for 0.");
        all.iter().any(was)
    });
    tool.close();
}

#[test]
fn modules_that_fail_keep_nobody_from_starting_and_have_the_same_state_everywhere() {
    let place = Place::new();
    let (launch, robot) = begun(
        &place,
        &[
            &probe("probe.0", "refuse-at-start = true", "restart = { backoff = \"10 min\", at-most = 7 }"),
            &probe("probe.1", "exit-at-start = 78", ""),
            &probe("probe.2", "refuse-on = true", ""),
            &probe("probe.3", "", ""),
            "[[module]]\nname = \"probe.4\"\nprogram = \"./not-there\"\noptional = true\n",
        ],
    );
    until("the last is on", || robot.state("probe.3") == "on");
    let waiting = standing(&place, "probe.0", "restarting");
    assert_eq!(
        (&waiting["attempt"], &waiting["attempts_max"], &waiting["restarts"]),
        (&1.into(), &7.into(), &1.into())
    );
    assert!(waiting["error"].as_str().unwrap().contains("a probe was asked not to start"), "{waiting}");
    assert!(place.say(&["list"]).ok().contains("restarting (1 of 7)"));
    let failed = standing(&place, "probe.1", "failed");
    assert!(failed["error"].as_str().unwrap().starts_with("ended with 78"), "{failed}");
    let error = standing(&place, "probe.2", "error");
    assert_eq!(error["error"], "a probe was asked not to work");
    let stopped = wait("left out", || told(&place, &["list", "--json"], "probe.4"));
    assert_eq!((&stopped["state"], &stopped["error"]), (&"stopped".into(), &"left out: its program is missing".into()));
    place.say(&["stop", "probe.3", "--timeout", "60"]).ok();
    standing(&place, "probe.3", "stopped");
    launch.signal(Signal::SIGINT);
    let said = launch.said();
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.err.contains("probe.1 failed for good: ended with 78"), "{said:?}");
    assert!(said.err.contains("probe.2 is in error: a probe was asked not to work"), "{said:?}");
}

#[test]
fn a_module_that_is_required_keeps_its_node_from_starting() {
    let place = Place::new();
    let required = "required = true\nrestart = { backoff = \"1 ms\", at-most = 2 }";
    let config = place.config(&[&probe("probe.0", "", ""), &probe("probe.1", "refuse-at-start = true", required)]);
    let said = place.start(&["launch", "--quiet", config.to_str().unwrap()]).said();
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.err.contains("module probe.1 did not become ready"), "{said:?}");
    assert!(said.err.contains("given up after 2 restarts"), "{said:?}");
    place.assert_empty();
}

#[test]
fn an_interface_that_no_name_of_the_module_fits_is_refused_at_the_start() {
    let place = Place::new();
    let config = place.config(&[&probe("wheel.0", "rate-hz = 100.0", "")]);
    let text = std::fs::read_to_string(&config).unwrap();
    std::fs::write(&config, text.replace("probe = { id = 96 }", "probe = { id = 96 }\nwheel = { id = 97 }")).unwrap();
    let said = place.start(&["launch", "--quiet", config.to_str().unwrap()]).said();
    assert_eq!(said.code, Some(1), "{said:?}");
    let both = "the program of `wheel.0` serves an interface of class `probe`, but the module is called `wheel.0`";
    assert!(said.err.contains(both), "{said:?}");
    place.assert_empty();
}

#[test]
fn data_of_an_interface_that_the_module_does_not_serve_are_refused_and_launch_says_so() {
    let place = Place::new();
    let (launch, _robot) = begun(&place, &[&probe("probe.0", "foreign-data = true", "")]);
    // Launch asks for the reason, and tools see it from then on.
    let why = wait("the reason", || standing(&place, "probe.0", "error")["error"].as_str().map(str::to_owned));
    assert!(why.contains("data `noise` of an interface of class `probe`") && why.contains("as `probe.0`"), "{why}");
    launch.signal(Signal::SIGINT);
    let said = launch.said();
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.err.contains(&format!("probe.0 is in error: {why}")), "{said:?}");
}

/// As a user without the right to real time: launch loses the capability that gives it.
#[test]
fn without_the_right_to_real_time_the_terminal_says_so() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "", ""), &probe("probe.1", "", "")]);
    let text = std::fs::read_to_string(&config).unwrap();
    std::fs::write(&config, text.replace("real-time-from = 256", "real-time-from = 96")).unwrap();
    let mut command = place.command(&["launch", "--quiet", config.to_str().unwrap()]);
    without_real_time(&mut command);
    let (mut launch, _robot) = place.up(command, &config, "main");
    let out = launch.stop();
    assert!(out.contains("no real time: probe.0, probe.1 run like ordinary programs"), "{out}");
}

#[test]
fn the_live_table_says_how_modules_are_scheduled_and_what_went_wrong() {
    let place = Place::new();
    let restart = "restart = { backoff = \"10 min\" }";
    let config = place.config(&[&probe("probe.0", "", ""), &probe("probe.1", "refuse-at-start = true", restart)]);
    let (terminal, mut launch) = Terminal::start(&place, &["launch", config.to_str().unwrap()], 40, 100);
    terminal.wait_row("probe.0", &["on", "nice"]);
    terminal.wait_row("probe.1", &["restarting", "(1", "5)"]);
    terminal.wait_row("probe.1:", &["ended", "asked"]);
    launch.stop();
}
