//! Printed text of modules becomes output, unless it already is.

use crate::harness::{OUTPUT, Place, probe, until, wait};
use crate::output::{call, lines};
use crate::probe::FILE;
use crate::process::Running;
use serde_json::Value;

fn texts(lines: &[Value], level: &str) -> Vec<String> {
    let of_level = lines.iter().filter(|line| line["level"] == level);
    of_level.map(|line| line["text"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn what_a_module_prints_is_a_line_of_its_own() {
    let (place, _launch, _robot) = Place::running(&[OUTPUT, &probe("probe.0", "", "")]);
    call(&place, &["probe.0", "print", "stdout", "a remark", "1"]);
    call(&place, &["probe.0", "print", "stderr", "a complaint", "1"]);
    // Also printed by its own output layer, for launch to repeat; it must not come twice.
    call(&place, &["probe.0", "say", "error", "said and printed"]);
    call(&place, &["probe.0", "print", "stdout", "the end", "1"]);
    let all = wait("the last line", || {
        let all = lines(&place, "probe.0");
        texts(&all, "info").contains(&"the end 0".into()).then_some(all)
    });
    let info = texts(&all, "info");
    assert!(info.contains(&"a remark 0".into()), "{all:#?}");
    assert_eq!(texts(&all, "warn"), ["a complaint 0"], "{all:#?}");
    assert_eq!(texts(&all, "error"), ["said and printed"], "{all:#?}");
}

#[test]
fn last_words_are_errors_and_above_them_stands_how_it_ended() {
    let restart = "restart = { backoff = \"50 ms\" }";
    let (place, mut launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", restart)]);
    let pid = robot.pid("probe.0");
    let dying = place.start(&["call", "--timeout", "60", "probe.0", "last_words", "no more oil"]);
    robot.wait_restarted("probe.0", pid);
    drop(dying);
    let all = wait("how it ended", || {
        let errors = texts(&lines(&place, "probe.0"), "error");
        errors.iter().any(|text| text.contains("was killed by signal 6; starts again in 50ms")).then_some(errors)
    });
    assert_eq!(all[0], "no more oil", "{all:?}");
    assert_eq!(all.len(), 2, "{all:?}");
    let out = launch.stop();
    assert!(out.contains("probe.0 was killed by signal 6; starts again in 50ms\n"), "{out}");
    assert!(out.contains("\n    no more oil\n"), "{out}");
}

#[test]
fn a_panic_comes_once_and_its_back_trace_with_it() {
    let place = Place::new();
    let config = place.config(&[OUTPUT, &probe("probe.0", "", "restart = { backoff = \"50 ms\" }")]);
    let mut command = place.command(&["launch", config.to_str().unwrap()]);
    command.env("RUST_BACKTRACE", "1");
    let (mut launch, robot) = place.up(command, &config, "main");
    let pid = robot.pid("probe.0");
    let panicking = place.start(&["call", "--timeout", "60", "probe.0", "panic", "here"]);
    robot.wait_restarted("probe.0", pid);
    drop(panicking);
    let errors = wait("how it ended", || {
        let errors = texts(&lines(&place, "probe.0"), "error");
        errors.iter().any(|text| text.contains("starts again in 50ms")).then_some(errors)
    });
    let panics = errors.iter().filter(|text| text.contains("two lines"));
    assert_eq!(panics.count(), 1, "{errors:#?}");
    let is_trace = |text: &str| text.contains(&format!("/{FILE}:")) && !text.contains("panicked");
    let all = lines(&place, "probe.0");
    assert!(
        all.iter().all(|line| !is_trace(line["text"].as_str().unwrap())),
        "where it came from is no output: {all:#?}"
    );
    let out = launch.stop();
    assert!(out.contains(&format!("error thread `probe::module` panicked at {FILE}:")), "{out}");
    assert!(out.lines().any(is_trace), "{out}");
    assert!(!out.contains(['\u{1d}', '\u{1e}']), "marks are for launch only: {out:?}");
}

#[test]
fn a_module_that_prints_without_end_floods_nobody() {
    let (place, _launch, robot) = Place::running(&[
        OUTPUT,
        &probe("probe.0", "", ""),
        &probe("probe.1", "", "restart = { backoff = \"50 ms\" }"),
    ]);
    let flood = place.start(&["call", "--timeout", "60", "probe.0", "print", "stdout", "flood", "100000"]);
    robot.kill("probe.1");
    call(&place, &["probe.1", "say", "error", "help"]);
    until("another's error", || texts(&lines(&place, "probe.1"), "error").contains(&"help".into()));
    flood.said().ok();
    // Not one is missing from the account.
    let sum = |all: &[Value], key: &str| all.iter().map(|line| line[key].as_u64().unwrap()).sum::<u64>();
    until("all are accounted for", || {
        let all = lines(&place, "probe.0");
        let printed = texts(&all, "info").iter().filter(|text| text.starts_with("flood ")).count() as u64;
        assert!(printed < 5_000, "{printed} of 100000 at 100 a second");
        printed + sum(&all, "suppressed") + sum(&all, "lost_before") == 100_000
    });
}

#[test]
fn a_panic_while_there_is_no_collector_arrives_when_there_is_one() {
    let restart = "restart = { backoff = \"50 ms\", at-most = 9 }";
    let (place, _launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", restart)]);
    place.say(&["stop", "output.0", "--timeout", "60"]).ok();
    let pid = robot.pid("probe.0");
    let panicking = place.start(&["call", "--timeout", "60", "probe.0", "panic", "here"]);
    robot.wait_restarted("probe.0", pid);
    drop(panicking);
    place.say(&["start", "output.0", "--timeout", "60"]).ok();
    until("the panic", || {
        let all = lines(&place, "probe.0");
        all.iter().any(|line| line["text"].as_str().unwrap().contains("of a panic"))
    });
}

#[test]
fn without_a_collector_launch_repeats_errors() {
    let restart = "restart = { backoff = \"50 ms\", at-most = 9 }";
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", restart)]);
    call(&place, &["probe.0", "say", "error", "nobody collects this"]);
    let pid = robot.pid("probe.0");
    let dying = place.start(&["call", "--timeout", "60", "probe.0", "last_words", "no more oil"]);
    robot.wait_restarted("probe.0", pid);
    drop(dying);
    let out = launch.stop();
    assert!(out.contains("\n    error nobody collects this\n    no more oil\n"), "{out}");
}

#[test]
fn the_back_trace_of_a_panic_that_comes_again_and_again_is_told_once_with_the_own_frames() {
    let place = Place::new();
    let restart = "restart = { backoff = \"1 ms\", at-most = 3 }";
    let config = place.config(&[OUTPUT, &probe("probe.0", "panic-at-start = true", restart)]);
    let mut command = place.command(&["launch", "--quiet", config.to_str().unwrap()]);
    command.env("RUST_BACKTRACE", "1");
    let said = Running::start(command).said();
    assert_eq!(said.code, Some(1), "{said:?}");
    let all = said.out + &said.err;
    let count = |text: &str| all.lines().filter(|line| line.contains(text)).count();
    assert_eq!(count(&format!("panicked at {FILE}:")), 2, "the first end says why, and so does the last: {all}");
    assert_eq!(count("; as before"), 2, "{all}");
    let place_of_panic = all.lines().find_map(|line| line.split("panicked at ").nth(1)).unwrap();
    let traced = format!("/{}", place_of_panic.trim_end_matches(':'));
    assert_eq!(count(&traced), 1, "{traced} in {all}");
    for others in ["/rustc/", "modules/src/", "std::panicking"] {
        assert_eq!(count(others), 0, "{others}: {all}");
    }
}

#[test]
fn launch_shows_what_modules_say_if_it_is_asked_to() {
    for (log, is_shown) in [("--log", true), ("--log=warn", false)] {
        let place = Place::new();
        let config = place.config(&[OUTPUT, &probe("probe.0", "", "")]);
        let (mut launch, _robot) = place.up(place.command(&["launch", config.to_str().unwrap(), log]), &config, "main");
        call(&place, &["probe.0", "print", "stdout", "a remark", "1"]);
        call(&place, &["probe.0", "say", "error", "a complaint"]);
        let shown = wait("it is shown", || Some(launch.err()).filter(|err| err.contains("probe.0: a complaint\n")));
        assert_eq!(shown.contains(" info  main/probe.0: is on\n"), is_shown, "{log}: {shown}");
        until("what it printed", || !is_shown || launch.err().contains("probe.0: a remark 0\n"));
        launch.stop();
        assert_eq!(
            (launch.out().as_str(), launch.err().contains('\u{1b}')),
            ("node main of test runs: 2 modules\n", false)
        );
    }
}

#[test]
fn what_is_to_be_shown_needs_a_collector_and_a_level() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "", "")]);
    for (log, told) in [("--log", "add a module with `builtin = \"output\"`"), ("--log=loud", "no level `loud`")] {
        place.say(&["launch", config.to_str().unwrap(), log]).fails_with([told]);
    }
}
