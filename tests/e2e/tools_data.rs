//! What modules publish and say, as tools show it.

use crate::harness::{OUTPUT, Place, json_lines, probe, until};
use crate::output::{call, is_own};
use crate::process::Running;
use crate::recorded::{RECORD, launched};
use nix::sys::signal::Signal;
use std::os::unix::fs::FileExt;
use std::time::Instant;

#[test]
fn echo_counts_and_numbers_what_comes() {
    let (place, _launch, _robot) = Place::running(&[&probe("probe.0", "rate-hz = 50.0", "")]);
    let shown = json_lines(&place.say(&["echo", "probe.0", "beat", "--count", "5", "--json"]).ok());
    assert_eq!(shown.len(), 5);
    for (index, pair) in shown.windows(2).enumerate() {
        assert_eq!(pair[0]["sequence"], index, "{pair:?}");
        assert_eq!(pair[0]["value"].as_u64().unwrap() + 1, pair[1]["value"].as_u64().unwrap(), "none is left out");
        assert!(pair[0]["time_ns"].as_u64() < pair[1]["time_ns"].as_u64(), "{pair:?}");
        assert_eq!(pair[1]["missed"], 0);
    }
    let text = place.say(&["echo", "probe.0", "beat", "-c", "2"]).ok();
    assert_eq!(text.lines().count(), 2);
    assert!(text.lines().next().unwrap().contains(" #0 "), "{text}");
}

#[test]
fn echo_with_a_rate_shows_the_newest_that_often() {
    let (place, _launch, _robot) = Place::running(&[&probe("probe.0", "rate-hz = 100.0", "")]);
    let start = Instant::now();
    let shown = json_lines(&place.say(&["echo", "probe.0", "beat", "--rate", "10", "--count", "6", "--json"]).ok());
    let took = start.elapsed().as_secs_f64();
    assert!(took >= 0.45, "6 values 0.1 s apart came within {took} s");
    // Ten beats lie between two of ten a second; a busy computer makes it a few more or less.
    let values: Vec<u64> = shown.iter().map(|line| line["value"].as_u64().unwrap()).collect();
    let (first, last) = (values[0], values[5]);
    assert!((20.0..=f64::max(200.0, 150.0 * took)).contains(&((last - first) as f64)), "{values:?} in {took} s");
    assert!(values.is_sorted(), "{values:?}");
}

#[test]
fn echo_goes_on_when_its_module_is_restarted_and_ends_by_ctrl_c() {
    let restart = "restart = { backoff = \"50 ms\" }";
    let (place, _launch, robot) = Place::running(&[&probe("probe.0", "rate-hz = 50.0", restart)]);
    let mut echo = place.start(&["echo", "probe.0", "beat", "--json"]);
    let beats = |echo: &Running| json_lines(echo.out().rsplit_once('\n').map_or("", |(whole, _)| whole));
    until("it beats", || beats(&echo).len() > 20);
    robot.kill("probe.0");
    until("beats of the new incarnation", || {
        echo.assert_runs();
        // Its numbers begin anew.
        let numbers: Vec<_> = beats(&echo).iter().map(|line| line["sequence"].as_u64()).collect();
        !numbers.is_sorted()
    });
    echo.stop();
    assert_eq!(echo.err(), "");
    until("nobody is subscribed", || {
        let status = place.say(&["status", "probe.0", "--json"]).json();
        status[0]["subscribers"] == 0
    });
}

#[test]
fn what_modules_say_is_kept_and_filtered() {
    let levels = "[output]\nlevels = { \"probe.1\" = \"warn\" }\n";
    let (place, _launch, _robot) =
        Place::running(&[OUTPUT, &probe("probe.0", "", ""), &probe("probe.1", "", ""), levels]);
    for (module, level, text) in [
        ("probe.0", "info", "first"),
        ("probe.0", "debug", "not sent: its level is info"),
        ("probe.0", "warn", "second"),
        ("probe.1", "info", "not sent: its level is warn"),
        ("probe.1", "error", "third"),
    ] {
        call(&place, &[module, "say", level, text]);
    }
    let texts = |arguments: &[&str]| -> Vec<String> {
        let shown = json_lines(&place.say(&[&["log", "--json", "--timeout", "60"], arguments].concat()).ok());
        let asked = shown.iter().filter(|line| !is_own(line["text"].as_str().unwrap()));
        asked.map(|line| format!("{} {} {}", line["module"], line["level"], line["text"]).replace('"', "")).collect()
    };
    until("all lines", || texts(&[]).iter().any(|line| line.contains("third")));
    assert_eq!(texts(&[]), ["probe.0 info first", "probe.0 warn second", "probe.1 error third"]);
    assert_eq!(texts(&["--level", "warn"]), ["probe.0 warn second", "probe.1 error third"]);
    assert_eq!(texts(&["--level", "error"]), ["probe.1 error third"]);
    assert_eq!(texts(&["--module", "probe.0"]), ["probe.0 info first", "probe.0 warn second"]);
    assert_eq!(texts(&["--module", "probe.0", "--level", "error"]), [""; 0]);
    call(&place, &["probe.0", "output-level", "debug"]);
    call(&place, &["probe.0", "say", "debug", "fourth"]);
    until("the debug line", || texts(&[]).contains(&"probe.0 debug fourth".into()));
    let text = place.say(&["log", "--level", "error", "--timeout", "60"]).ok();
    let (time, rest) = text.split_once(' ').unwrap();
    assert_eq!((time.len(), rest), ("08:36:01.257".len(), "error main/probe.1: third\n"));
}

#[test]
fn a_log_that_is_followed_shows_lines_as_they_come() {
    let (place, _launch, _robot) = Place::running(&[OUTPUT, &probe("probe.0", "", "")]);
    let mut log = place.start(&["log", "--follow", "--module", "probe.0"]);
    log.wait_for("probe.0: is on");
    for text in ["one", "two", "three"] {
        place.say(&["call", "probe.0", "say", "info", text]).ok();
        log.wait_for(&format!("info  main/probe.0: {text}"));
    }
    log.stop();
    assert_eq!(log.err(), "");
}

#[test]
fn lines_of_a_module_that_fails_reach_the_log() {
    let restart = "restart = { backoff = \"50 ms\" }";
    let (place, mut launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", restart)]);
    let pid = robot.pid("probe.0");
    place.say(&["call", "probe.0", "leave", "3"]).ok();
    launch.wait_for("probe.0 ended with 3; starts again in 50ms");
    robot.wait_restarted("probe.0", pid);
    until("it says twice that it is on", || {
        let text = place.say(&["log", "--module", "probe.0"]).out;
        text.matches("is on").count() == 2
    });
}

#[test]
fn status_shows_each_module() {
    let (place, _launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "rate-hz = 50.0", "")]);
    let mut echo = place.start(&["echo", "probe.0", "beat"]);
    echo.wait_for("\n");
    let status = place.say(&["status", "--json"]).json();
    let module = &status[1];
    assert_eq!((&module["module"], &module["state"]), (&"probe.0".into(), &"on".into()));
    assert_eq!((&module["subscribers"], &module["missed"]), (&1.into(), &0.into()));
    assert_eq!(module["incarnation"], robot.process("probe.0").unwrap().incarnation);
    assert!(module["failure"].is_null());
    let text = place.say(&["status"]).ok();
    assert!(text.starts_with("module ") && text.lines().count() == 3, "{text}");
    echo.stop();
}

#[test]
fn what_waits_for_a_module_in_error_says_why_and_ends() {
    let (place, launch, robot) = launched(RECORD);
    // Its stream `frame` has the number 2.
    let ring = robot.node.path().join(format!("{:08x}.2.ring", robot.name("feeder.0").raw()));
    until("the writer finds the damage", || {
        let ring = std::fs::File::options().write(true).open(&ring).unwrap();
        // All but what it was made as.
        ring.write_all_at(&vec![0xff; ring.metadata().unwrap().len() as usize - 4096], 4096).unwrap();
        place.say(&["call", "feeder.0", "feed", "100"]);
        robot.state("feeder.0") == "error"
    });
    for words in [
        &["echo", "feeder.0", "count"][..],
        &["hz", "feeder.0", "--window", "1"],
        &["bw", "feeder.0", "count", "--window", "1"],
        &["stream", "read", "feeder.0", "frame", "--next", "1000000"],
    ] {
        let said = place.say(words);
        let why = "feeder.0 is in error, and nothing comes of it: ";
        assert!(said.code == Some(1) && said.err.contains(why), "{words:?}: {said:?}");
        assert!(said.err.contains("stream `frame` of feeder.0 is damaged"), "{words:?}: {said:?}");
    }
    launch.signal(Signal::SIGINT);
    assert_eq!(launch.said().code, Some(1), "a module is in error");
}
