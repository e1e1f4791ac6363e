//! `rohrpost log` as a person uses it: levels, filters, following.

use crate::harness::{OUTPUT, Place, RECORDED_CLASSES, halt, probe, signal, until, wait};
use crate::output::{call, is_own};
use nix::sys::signal::Signal;

const PATIENT: [&str; 3] = ["log", "--timeout", "60"];

fn log(place: &Place, arguments: &[&str]) -> crate::process::Said {
    place.say(&[&PATIENT, arguments].concat())
}

/// Lines without time and node, without the modules' own reports, and without the notes of `log` about lost lines.
fn shown(place: &Place, arguments: &[&str]) -> Vec<String> {
    let text = log(place, arguments).ok();
    let said = text.lines().filter(|line| !line.starts_with('…')).map(|line| line.split_once("main/").unwrap().1);
    said.filter(|line| !is_own(line.split_once(": ").unwrap().1)).map(str::to_owned).collect()
}

/// Waits until so many probes' own last lines have come: later they would be among the last of all.
fn wait_own(place: &Place, probes: usize) {
    let came = || log(place, &["--text", "running 1 test"]).ok().lines().count();
    until("what probes say of themselves", || came() == probes);
}

#[test]
fn levels_are_set_while_modules_run() {
    let levels = "[output]\nlevels = { \"probe.1\" = \"warn\" }\n";
    let restart = "restart = { backoff = \"50 ms\" }";
    let modules = [OUTPUT, &probe("probe.0", "", restart), &probe("probe.1", "", ""), levels];
    let (place, _launch, robot) = Place::running(&modules);
    let say = |module: &str, level: &str, text: &str| call(&place, &[module, "say", level, text]);

    assert_eq!(log(&place, &["--level", "probe.0=debug"]).ok(), "probe.0: debug, was info\n");
    assert_eq!(log(&place, &["--level", "probe.0=debug"]).ok(), "probe.0: debug, as before\n");
    say("probe.0", "debug", "finer");
    until("a debug line", || shown(&place, &[]).contains(&"probe.0: finer".to_owned()));
    assert_eq!(log(&place, &["--level", "probe=error"]).ok(), "probe.0: error, was debug\nprobe.1: error, was warn\n");
    say("probe.0", "warn", "not sent");
    say("probe.0", "error", "sent");
    until("an error", || shown(&place, &[]).contains(&"probe.0: sent".to_owned()));
    assert!(!shown(&place, &[]).contains(&"probe.0: not sent".to_owned()));

    let two = ["--level", "probe.0=trace", "--level", "output.0=warn", "--json"];
    let set: Vec<serde_json::Value> =
        log(&place, &two).ok().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(set[0], serde_json::json!({ "module": "probe.0", "level": "trace", "before": "error" }));
    assert_eq!(set[1], serde_json::json!({ "module": "output.0", "level": "warn", "before": "info" }));

    let table = log(&place, &["--levels"]).ok();
    let rows: Vec<Vec<&str>> = table.lines().skip(1).map(|row| row.split_whitespace().collect()).collect();
    assert_eq!(rows[0], ["output.0", "warn", "info", "0", "0"], "{table}");
    assert_eq!(rows[1], ["probe.0", "trace", "info", "0", "0"], "{table}");
    assert_eq!(rows[2], ["probe.1", "error", "warn", "0", "0"], "{table}");

    // It is the configuration's again in its next incarnation.
    robot.kill("probe.0");
    let listed = log(&place, &["--levels", "--json"]).json();
    assert_eq!((&listed[1]["level"], &listed[1]["at_start"]), (&"info".into(), &"info".into()));
}

#[test]
fn what_is_set_wrongly_is_told_with_what_would_be_right() {
    let (place, _launch, _robot) = Place::running(&[OUTPUT, &probe("probe.0", "", "")]);
    for (arguments, words) in [
        (&["--level", "probe.0=loud"][..], "no level `loud`; there are error, warn, info, debug, trace"),
        (&["--level", "probe.7=debug"], "the configuration has no module `probe.7`; there are output.0, probe.0"),
        (&["--level", "prob=debug"], "no class `prob`; there are router, probe, output, tool"),
        (&["--level", "tool=debug"], "node `main` has no module of class `tool`"),
        (&["--level", "warn", "--level", "info"], "to set levels write --level NAME=LEVEL"),
        (&["--module", "probe.7"], "the configuration has no module `probe.7`; there are output.0, probe.0"),
        (&["--class", "prob"], "no class `prob`; there are router, probe, output, tool"),
        (&["--since", "5"], "`5` has no unit"),
        (&["--timeout=-1"], "-1 s is no time to wait"),
    ] {
        let told = place.say(&[&["log"], arguments].concat());
        assert!(told.code != Some(0) && told.err.contains(words), "{arguments:?}: {told:?}");
    }
}

#[test]
fn filters_choose_by_module_class_level_text_and_time() {
    let modules = [OUTPUT, &probe("probe.0", "", ""), &probe("probe.1", "", ""), &probe("probe.2", "", "")];
    let (place, _launch, _robot) = Place::running(&modules);
    wait_own(&place, 3);
    for (module, level, text) in [
        ("probe.0", "info", "a Wall ahead"),
        ("probe.1", "warn", "hit the wall"),
        ("probe.2", "error", "wheels blocked"),
        ("probe.0", "info", "turned"),
    ] {
        call(&place, &[module, "say", level, text]);
        until(text, || shown(&place, &[]).iter().any(|line| line.ends_with(text)));
    }
    let (wall, hit, blocked, turned) =
        ("probe.0: a Wall ahead", "probe.1: hit the wall", "probe.2: wheels blocked", "probe.0: turned");
    for (arguments, expected) in [
        (&[][..], &[wall, hit, blocked, turned][..]),
        (&["--module", "probe.0"], &[wall, turned]),
        (&["--module", "probe.0", "--module", "probe.2"], &[wall, blocked, turned]),
        (&["--class", "probe"], &[wall, hit, blocked, turned]),
        (&["--class", "output"], &[]),
        (&["--class", "output", "--module", "probe.1"], &[hit]),
        (&["--level", "warn"], &[hit, blocked]),
        (&["--text", "WALL"], &[wall, hit]),
        (&["--text", "wall", "--level", "warn"], &[hit]),
        (&["--last", "2"], &[blocked, turned]),
        (&["-n", "1", "--text", "wall"], &[hit]),
        (&["-n", "0"], &[]),
        (&["--since", "1 h"], &[wall, hit, blocked, turned]),
        (&["--since", "1 ns"], &[]),
    ] {
        assert_eq!(shown(&place, arguments), expected, "{arguments:?}");
    }
}

#[test]
fn a_follower_survives_the_collector_and_says_so() {
    let output = "[[module]]\nname = \"output.0\"\nbuiltin = \"output\"\nrestart = { backoff = \"50 ms\" }\n";
    let (place, mut launch, robot) = Place::running(&[output, &probe("probe.0", "", "")]);
    wait_own(&place, 1);
    let say = |text: &str| call(&place, &["probe.0", "say", "info", text]);
    for number in 0..20 {
        say(&format!("earlier {number}"));
    }
    let is_last = |line: &String| line.ends_with("earlier 19");
    until("the collector has all", || shown(&place, &[]).last().is_some_and(is_last));
    let mut follower = place.start(&["log", "--follow", "--last", "1", "--timeout", "1"]);
    follower.wait_for("earlier 19");
    assert!(!follower.out().contains("earlier 18"), "{}", follower.out());

    // It has fewer lines than before when it comes back: its numbers begin anew.
    robot.kill("output.0");
    say("after its death");
    follower.wait_for("main/probe.0: after its death\n");
    assert!(follower.out().contains("… output.0 was started again; the lines"), "{}", follower.out());

    // It hangs; that is told once.
    let times = |what: &str| follower.out().matches(what).count();
    let (waited, answered) = (times("Waiting for it."), times("answers again"));
    let pid = robot.pid("output.0");
    halt(pid);
    until("it is told", || times("Waiting for it.") > waited);
    say("while it hangs");
    signal(pid, Signal::SIGCONT);
    until("what was said meanwhile", || times("main/probe.0: while it hangs\n") == 1);
    let told = (times("Waiting for it.") - waited, times("answers again") - answered);
    assert_eq!(told.0, told.1, "{}", follower.out());
    assert_eq!(times("after its death"), 1, "{}", follower.out());
    assert!(times("`rohrpost list` shows its process") > 0, "{}", follower.out());

    launch.stop();
    follower.end();
    assert!(follower.err().contains("launch has ended, and node `main` with it"), "{}", follower.err());
}

#[test]
fn a_follower_is_told_what_the_ring_no_longer_has() {
    let small = "[output]\nring = 5\nburst = 1000\n";
    let (place, _launch, _robot) = Place::running(&[OUTPUT, &probe("probe.0", "", ""), small]);
    let mut follower = place.start(&["log", "--follow", "--json", "--timeout", "60"]);
    follower.wait_for("is on");
    // It stands still while more is said than is kept.
    halt(follower.pid());
    call(&place, &["probe.0", "flood", "info", "50"]);
    until("the last one", || shown(&place, &[]).contains(&"probe.0: flood 49".to_owned()));
    signal(follower.pid(), Signal::SIGCONT);
    follower.wait_for("flood 49");
    until("it is told", || follower.err().contains("lines are lost: output.0 keeps fewer"));
    assert!(follower.out().lines().all(|line| line.starts_with('{')), "programs read lines alone");
    follower.stop();
}

#[test]
fn a_collector_that_does_not_answer_is_told_with_what_to_do() {
    let (place, _launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", "")]);
    call(&place, &["output.0", "off"]);
    log(&place, &[]).fails_with(["the collector output.0 is switched off: `rohrpost call output.0 on`"]);
    call(&place, &["output.0", "on"]);
    log(&place, &[]).ok();
    let pid = robot.pid("output.0");
    halt(pid);
    place.say(&["log", "--timeout", "0.2"]).fails_with(["no answer from output.0 within 200ms", "`rohrpost list`"]);
    signal(pid, Signal::SIGCONT);
}

/// Of a module that does not start, and of one that is not there.
#[test]
fn a_line_has_the_number_of_the_error_that_ended_a_module() {
    let place = Place::new();
    let motor = r#"
[[module]]
name = "motor.0"
aliases = ["odometry.0", "laser.0"]
builtin = "sim"
required = false
settings = { map = "missing.map" }
"#;
    let pilot = "[[module]]\nname = \"pilot.0\"\nprogram = \"./script\"\nrequired = false\n";
    place.program("script", "#!/no/such/interpreter\n");
    let config = place.config(&[&RECORDED_CLASSES, motor, OUTPUT, pilot]);
    let _launch = place.launch(&config);
    let told = |module: &str| {
        let said = place.say(&["log", "--timeout", "60", "--json", "--level", "error", "--module", module]);
        let lines = said.out.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
        lines.into_iter().find(|line| line.get("errno").is_some())
    };
    for (module, words) in [("motor.0", "missing.map: No such file"), ("pilot.0", "could not be started: ")] {
        let line = wait(format!("a line of {module}"), || told(module));
        assert_eq!((&line["errno"], &line["errno_text"]), (&2.into(), &"No such file or directory".into()), "{line}");
        assert!(line["text"].as_str().unwrap().contains(words), "{line}");
    }
}
