//! Output of modules arrives: through floods, panics, full disks and the collector's own death.

use crate::harness::{OUTPUT, Place, json_lines, probe, signal, until, wait};
use nix::sys::signal::Signal;
use serde_json::Value;
use std::fs;

/// The collector's lines of a module.
pub(crate) fn lines(place: &Place, module: &str) -> Vec<Value> {
    let text = place.say(&["log", "--json", "--timeout", "60", "--module", module]).ok();
    json_lines(&text)
}

/// Calls a function of a probe, however busy the computer is.
pub(crate) fn call(place: &Place, arguments: &[&str]) {
    place.say(&[&["call", "--timeout", "60"], arguments].concat()).ok();
}

/// Whether a line is a module's own, and not one that a test asked a probe for: the report that it is on, and the
/// output of the test program as which a probe runs. Launch forwards the latter a moment after it was printed, so at
/// any time.
pub(crate) fn is_own(text: &str) -> bool {
    ["is on", "running 1 test"].contains(&text)
}

fn texts(lines: &[Value]) -> Vec<&str> {
    lines.iter().map(|line| line["text"].as_str().unwrap()).collect()
}

fn sum(lines: &[Value], key: &str) -> u64 {
    lines.iter().map(|line| line[key].as_u64().unwrap()).sum()
}

#[test]
fn a_flood_of_one_module_hides_no_error() {
    let (place, _launch, _robot) = Place::running(&[OUTPUT, &probe("probe.0", "", ""), &probe("probe.1", "", "")]);
    let flood = place.start(&["call", "--timeout", "60", "probe.0", "flood", "info", "100000"]);
    call(&place, &["probe.1", "say", "error", "help"]);
    until("another's error", || texts(&lines(&place, "probe.1")).contains(&"help"));
    flood.said().ok();
    call(&place, &["probe.0", "say", "error", "my own"]);
    let said = |all: &[Value]| texts(all).iter().filter(|text| text.starts_with("flood ")).count() as u64;
    // Suppressed lines are reported after a pause, which on a busy computer may be in the middle, too.
    let all = wait("its own error, and how much was suppressed", || {
        let all = lines(&place, "probe.0");
        let whole = texts(&all).contains(&"my own") && said(&all) + sum(&all, "suppressed") >= 100_000;
        whole.then_some(all)
    });
    // Not one is unaccounted for.
    let said = said(&all);
    assert!((200..2_000).contains(&said), "{said} of 100000 at 100 a second");
    assert_eq!((said + sum(&all, "suppressed"), sum(&all, "lost_before")), (100_000, 0));
    let told = all.iter().find(|line| line["suppressed"].as_u64() > Some(0)).unwrap();
    assert_eq!(told["level"], "warn");
    let text = told["text"].as_str().unwrap();
    assert!(text.contains("lines were suppressed in ") && text.contains("more than 100 a second"), "{text}");
    let status = place.say(&["status", "probe.0", "--json", "--timeout", "60"]).json();
    assert_eq!(status[0]["output_suppressed"], 100_000 - said);
}

#[test]
fn errors_have_an_allowance_of_their_own() {
    let few = "[output]\nrate = 1\nburst = 3\n";
    let (place, _launch, _robot) = Place::running(&[OUTPUT, &probe("probe.0", "", ""), few]);
    for (level, lines) in [("info", "50"), ("error", "50")] {
        call(&place, &["probe.0", "flood", level, lines]);
    }
    let all = wait("both are told of", || {
        let all = lines(&place, "probe.0");
        (sum(&all, "suppressed") > 90).then_some(all)
    });
    for (level, told) in [("info", "lines were suppressed"), ("error", "errors were suppressed")] {
        let said = all.iter().filter(|line| line["level"] == level);
        let flood = said.filter(|line| line["text"].as_str().unwrap().starts_with("flood ")).count();
        assert!((1..20).contains(&flood), "{flood} of level {level}: {all:#?}");
        assert!(texts(&all).iter().any(|text| text.contains(told)), "{all:#?}");
    }
}

/// Without an effective limit, the collector's mailbox is the limit; refused lines are counted.
#[test]
fn a_collector_that_is_flooded_takes_errors_of_others() {
    let many = "[output]\nrate = 1000000\nburst = 100000\nring = 100000\n";
    let (place, _launch, _robot) =
        Place::running(&[OUTPUT, &probe("probe.0", "", ""), &probe("probe.1", "", ""), many]);
    let flood = place.start(&["call", "--timeout", "60", "probe.0", "flood", "info", "20000"]);
    call(&place, &["probe.1", "say", "error", "help"]);
    until("another's error", || texts(&lines(&place, "probe.1")).contains(&"help"));
    flood.said().ok();
    // The first may find the module's own queue full of the flood still.
    let mut tries = 0;
    let all = wait("the last", || {
        tries += 1;
        call(&place, &["probe.0", "say", "info", "the last"]);
        let all = lines(&place, "probe.0");
        texts(&all).contains(&"the last").then_some(all)
    });
    let said = texts(&all).iter().filter(|text| text.starts_with("flood ") || **text == "the last").count() as u64;
    assert_eq!(said + sum(&all, "lost_before"), 20_000 + tries, "{said} said");
}

#[test]
fn every_panic_arrives_with_its_place_and_message() {
    let restart = "restart = { backoff = \"50 ms\", at-most = 9 }";
    let (place, mut launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", restart)]);
    for (how, ends, words) in [
        ("thread", false, &[("thread `wheels` panicked at ", ":\nthe wheels came off")][..]),
        ("here", true, &[("panicked at ", ":\ntwo lines\nof a panic")]),
        ("twice", true, &[("panicked at ", ":\nthe first of two"), ("panicked at ", ":\nthe second of two")]),
    ] {
        let pid = robot.pid("probe.0");
        let panicking = place.start(&["call", "--timeout", "60", "probe.0", "panic", how]);
        for (begin, end) in words {
            let line = wait(format!("{how}: {begin} … {end}"), || {
                let has = |line: &Value| {
                    let text = line["text"].as_str().unwrap();
                    text.contains(&format!("{begin}{}:", crate::probe::FILE)) && text.ends_with(end)
                };
                lines(&place, "probe.0").into_iter().find(has)
            });
            assert_eq!((&line["level"], &line["module"]), (&"error".into(), &"probe.0".into()), "{line}");
        }
        if ends {
            robot.wait_restarted("probe.0", pid);
        } else {
            panicking.said().ok();
            assert_eq!(robot.pid("probe.0"), pid, "a panic of another thread ends nobody");
        }
        launch.assert_runs();
    }
}

#[test]
fn a_killed_collector_loses_no_line_of_the_file() {
    let output =
        "[[module]]\nname = \"output.0\"\nbuiltin = \"output\"\nrestart = { backoff = \"50 ms\", at-most = 9 }\n";
    let file = "[output]\nburst = 10000\nfile = \"robot.log\"\n";
    let (place, _launch, robot) = Place::running(&[output, &probe("probe.0", "", ""), file]);
    let read = || fs::read_to_string(place.path("robot.log")).unwrap();
    for round in 1..=3 {
        let (pid, before) = (robot.pid("output.0"), read().matches("flood ").count());
        // Fewer than may wait in its mailbox while it is away.
        let flood = place.start(&["call", "--timeout", "60", "probe.0", "flood", "info", "300"]);
        until("the flood began", || read().matches("flood ").count() > before);
        signal(pid, Signal::SIGKILL);
        flood.said().ok();
        robot.wait_restarted("output.0", pid);
        let text = wait("the last line", || Some(read()).filter(|text| text.matches("flood 299\n").count() >= round));
        for number in 0..300 {
            let count = text.matches(&format!("info  main/probe.0: flood {number}\n")).count();
            assert!(count >= round, "flood {number} is there {count} times after {round} floods");
        }
        // The successor also gets the line that it had in hand.
        let twice = text.matches("flood ").count() - 300 * round;
        assert!(twice <= round, "{twice} lines stand there twice after {round} deaths");
    }
    let text = read();
    let first = text.lines().find(|line| line.contains("probe.0: is on")).unwrap();
    let (time, _) = first.split_once(' ').unwrap();
    assert!(
        time.len() == "2026-11-21T10:31:03.907123Z".len() && time.starts_with("20") && time.ends_with('Z'),
        "{first}"
    );
}

#[test]
fn files_are_put_aside_and_programs_read_them() {
    let file = "[output]\nburst = 10000\nfile = \"robot.log\"\nfile-size = \"8 KiB\"\nfiles = 2\nformat = \"json\"\n";
    let (place, _launch, _robot) = Place::running(&[OUTPUT, &probe("probe.0", "", ""), file]);
    call(&place, &["probe.0", "flood", "warn", "250"]);
    let read = |name: &str| fs::read_to_string(place.path(name)).unwrap_or_default();
    until("the last line", || read("robot.log").contains("\"flood 249\""));
    let mut numbers = Vec::new();
    for name in ["robot.log.2", "robot.log.1", "robot.log"] {
        let text = read(name);
        assert!(text.len() <= 8 << 10, "{name} has {} bytes", text.len());
        for line in text.lines() {
            let line: Value = serde_json::from_str(line).unwrap();
            let text = line["text"].as_str().unwrap();
            if is_own(text) {
                continue;
            }
            for (key, value) in [("node", "main"), ("module", "probe.0"), ("class", "probe"), ("level", "warn")] {
                assert_eq!(line[key], value, "{line}");
            }
            assert!(line["time_ns"].is_u64() && line["time"].as_str().unwrap().ends_with('Z'), "{line}");
            numbers.push(text["flood ".len()..].parse::<u32>().unwrap());
        }
    }
    let first = numbers[0];
    assert!(first > 0 && numbers.into_iter().eq(first..250), "none is missing between the files");
    assert!(!place.path("robot.log.3").exists());
}

#[test]
fn a_full_disk_costs_the_file_its_lines_and_nothing_else() {
    let place = Place::new();
    let path = place.path("robot.log");
    std::os::unix::fs::symlink("/dev/full", &path).unwrap();
    let (_launch, _robot) = place.launched(&[OUTPUT, &probe("probe.0", "", ""), "[output]\nfile = \"robot.log\"\n"]);
    for text in ["one", "two"] {
        call(&place, &["probe.0", "say", "info", text]);
    }
    until("the ring goes on", || texts(&lines(&place, "probe.0")).contains(&"two"));
    let told = lines(&place, "output.0");
    let told: Vec<&str> = texts(&told).into_iter().filter(|text| text.contains("robot.log")).collect();
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("takes no lines: No space left on device"), "{told:?}");
    fs::remove_file(&path).unwrap();
    wait("it is written again", || {
        call(&place, &["probe.0", "say", "info", "three"]);
        fs::read_to_string(&path).ok().filter(|text| text.contains("probe.0: three"))
    });
    let again = wait("and that is said", || {
        let told = lines(&place, "output.0");
        texts(&told).iter().find(|text| text.contains("takes lines again")).map(ToString::to_string)
    });
    assert!(again.ends_with("are missing there"), "{again}");
}
