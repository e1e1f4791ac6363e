//! `rohrpost param`, as a person uses it on a robot that runs.

use crate::completions::offered;
use crate::harness::{OUTPUT, PATIENCE, Place, Robot, assert_has, signal, until, wait};
use crate::process::Running;
use crate::tuned::{shown, tuned};
use nix::sys::signal::Signal;
use rohrpost::common::{self, SetParameters};
use rohrpost_mailbox::monotonic_ns;
use std::path::PathBuf;

/// The same node as the harness's, with a file for saved parameters.
fn config(place: &Place, modules: &[&str]) -> PathBuf {
    let file = place.config(modules);
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, format!("parameters = \"tuned.toml\"\n{text}")).unwrap();
    file
}

fn launched(modules: &[&str]) -> (Place, Running, Robot) {
    let place = Place::new();
    let (launch, robot) = place.launched_from(&config(&place, modules));
    (place, launch, robot)
}

/// The module's own values, once they contain this.
#[track_caller]
fn wait_for(place: &Place, all: &str) {
    until(format!("probe.0 never had {all}"), || {
        let said = place.say(&["call", "probe.0", "get", "all"]);
        said.out.contains(all)
    });
}

#[test]
fn parameters_are_listed_with_unit_range_and_text() {
    let (place, _launch, _robot) = launched(&[OUTPUT, &tuned("probe.0", "mount = \"roof\"", "start = \"off\"")]);
    // Switched off: its parameters exist all the same.
    let table = place.say(&["param", "get", "probe.0"]).ok();
    let lines: Vec<Vec<&str>> = table.lines().map(|line| line.split_whitespace().collect()).collect();
    assert_eq!(lines[0], ["parameter", "value", "unit", "range", "text"]);
    assert_eq!(lines[1][..3], ["gain", "1", "-10..=10"], "{table}");
    assert_eq!(lines[2][..5], ["near-m", "1", "m", "0..=100", "Nearest"], "{table}");
    assert_eq!(lines[4][..3], ["side", "left", "left|straight-ahead"], "{table}");
    assert_eq!(lines.len(), 7, "a setting that is no parameter is not listed:\n{table}");
    let one = place.say(&["param", "get", "probe.0", "near-m"]).ok();
    assert_eq!(one.lines().count(), 2, "{one}");
    let json = place.say(&["param", "get", "probe.0", "far-m", "--json"]).json();
    let expected = serde_json::json!([{ "module": "probe.0", "parameter": "far-m", "value": 9, "unit": "m",
        "type": "u16", "min": 0, "max": 100, "text": "Farthest thing that counts." }]);
    assert_eq!(json, expected);
    let all = place.say(&["param", "list"]).ok();
    assert!(all.contains("\nprobe.0  gain"), "{all}");
    assert!(all.contains("without parameters: output.0\n"), "{all}");
    assert_eq!(place.say(&["param", "list", "--json"]).json().as_array().unwrap().len(), 6);
    let none = place.say(&["param", "get", "output.0"]).ok();
    assert_eq!(none, "output.0 has no parameters: its settings are read when it starts\n");
}

#[test]
fn a_set_value_is_what_the_module_works_with_and_is_told() {
    let (place, _launch, _robot) = launched(&[OUTPUT, &tuned("probe.0", "", "")]);
    for (parameter, value, says) in [
        ("gain", "-2.5", "probe.0 gain: 1 -> -2.5\n"),
        ("gain", "-2.5", "probe.0 gain: -2.5 as before\n"),
        ("gain", "-0.0", "probe.0 gain: -2.5 -> 0\n"),
        ("far-m", "0x10", "probe.0 far-m: 9 -> 16 m\n"),
        ("side", "straight-ahead", "probe.0 side: left -> straight-ahead\n"),
        ("look", "false", "probe.0 look: true -> false\n"),
        ("label", "grüß dich", "probe.0 label: \"a \\\"word\\\"\" -> \"grüß dich\"\n"),
    ] {
        assert_eq!(place.say(&["param", "set", "probe.0", parameter, value]).ok(), says);
    }
    wait_for(&place, " 0 1 16 StraightAhead false grüß dich [gain gain far-m side look label]");
    let log = wait("the change is told", || {
        let log = place.say(&["log", "--module", "probe.0"]).out;
        log.contains("label: ").then_some(log)
    });
    assert!(log.contains("probe.0: far-m: 9 -> 16 m (by tool."), "{log}");
    assert_eq!(log.matches("gain: ").count(), 2, "what stays the same is no change: {log}");
}

#[test]
fn a_refused_value_says_why_and_changes_nothing() {
    let (place, _launch, _robot) = launched(&[OUTPUT, &tuned("probe.0", "", "")]);
    for (parameter, value, says) in [
        ("gain", "10.000001", "`gain` is 10.000001, out of range: -10..=10"),
        ("gain", "NaN", "`gain` is NaN, out of range: -10..=10"),
        ("gain", "-inf", "`gain` is -inf, out of range: -10..=10"),
        ("gain", "fast", "`gain`: expected a number (f64), got `fast`"),
        ("near-m", "101", "`near-m` is 101 m, out of range: 0..=100 m"),
        ("near-m", "-1", "`near-m`: -1 is out of range: u16 is 0 to 65535"),
        ("near-m", "1.5", "`near-m`: "),
        ("near-m", "9", "the module refuses: near-m 9 must be below far-m 9"),
        ("side", "up", "`side`: expected left|straight-ahead, got `up`"),
        ("look", "1", "`look`: expected true or false, got `1`"),
        ("gian", "1", "probe.0 has no parameter `gian`; did you mean `gain`? it has: gain, near-m, far-m"),
        ("mount", "roof", "probe.0 has no parameter `mount`; "),
    ] {
        place.say(&["param", "set", "probe.0", parameter, value]).fails_with([says]);
    }
    wait_for(&place, " 1 1 9 Left true a \\\"word\\\" []");
    for (arguments, says) in [
        (&["param", "set", "output.0", "ring", "1"][..], "output.0 has no parameters"),
        (&["param", "get", "probe.1"], "the configuration has no module `probe.1`; there are"),
        (&["param", "get", "prob.0"], "did you mean `probe`?"),
        (&["param", "set", "probe.0", "gain", "1", "--timeout=-1"], "-1 s is no time to wait"),
    ] {
        place.say(arguments).fails_with([says]);
    }
    assert_eq!(place.say(&["param"]).code, Some(2));
    assert_eq!(place.say(&["param", "set", "probe.0", "gain"]).code, Some(2));
}

#[test]
fn shells_offer_modules_and_their_parameters() {
    let (place, _launch, _robot) = launched(&[OUTPUT, &tuned("probe.0", "", "")]);
    for (words, offers) in [
        (&["rohrpost", "param", "get", "pro"][..], &["probe.0"][..]),
        (&["rohrpost", "param", "save", "o"], &["output.0"]),
        (&["rohrpost", "param", "set", "probe.0", "l"], &["look", "label"]),
        (&["rohrpost", "param", "get", "output.0", ""], &[]),
    ] {
        // A module that is slow to answer is not waited for.
        until(format!("{words:?} offers {offers:?}"), || offered(&place, words) == offers);
    }
}

#[test]
fn a_module_that_hangs_is_given_up_in_time() {
    let (place, _launch, robot) = launched(&[&tuned("probe.0", "", "")]);
    crate::harness::halt(robot.pid("probe.0"));
    let began = monotonic_ns();
    let said = place.say(&["param", "list", "--timeout", "0.3"]);
    assert!(said.err.contains("no answer from probe.0 within 300ms"), "{said:?}");
    assert_eq!(said.code, Some(1));
    assert!(u128::from(monotonic_ns() - began) < PATIENCE.as_nanos(), "it has a deadline");
    signal(robot.pid("probe.0"), Signal::SIGCONT);
}

#[test]
fn saved_values_come_back_after_a_kill_and_at_the_next_start() {
    let modules = [OUTPUT, &tuned("probe.0", "gain = 2.0", ""), &tuned("probe.1", "", "")];
    let (place, mut launch, robot) = launched(&modules);
    place.say(&["param", "set", "probe.0", "gain", "3.5"]).ok();
    place.say(&["param", "set", "probe.0", "label", "two\nlines = \"x\""]).ok();
    place.say(&["param", "set", "probe.1", "side", "straight-ahead"]).ok();
    place.say(&["param", "save"]).ok_with(["tuned.toml: probe.0 (6), probe.1 (6)"]);
    let text = std::fs::read_to_string(place.path("tuned.toml")).unwrap();
    assert_has(
        &text,
        ["[\"probe.0\"]\n# Factor of what is published. (-10..=10)\ngain = 3.5\n", "(0..=100 m)\nnear-m = 1\n"],
    );
    // Unsaved values are lost with the process.
    place.say(&["param", "set", "probe.0", "far-m", "50"]).ok();
    robot.kill("probe.0");
    wait_for(&place, " 3.5 1 9 Left true two\\nlines = \\\"x\\\" []");
    // One module alone: what is saved of the other stays.
    place.say(&["param", "set", "probe.0", "gain", "4"]).ok();
    place.say(&["param", "set", "probe.1", "side", "left"]).ok();
    place.say(&["param", "save", "probe.0"]).ok();
    launch.stop();
    let (_launch, _robot) = place.launched_from(&place.path("test.toml"));
    assert_eq!(shown(place.say(&["param", "get", "probe.0"]), "gain"), "4");
    assert_eq!(shown(place.say(&["param", "get", "probe.1"]), "side"), "straight-ahead");
    place.say(&["check", place.path("test.toml").to_str().unwrap()]).ok_with(["gain = 4.0"]);
}

#[test]
fn a_file_is_loaded_whole_or_not_at_all_module_by_module() {
    let (place, _launch, _robot) = launched(&[OUTPUT, &tuned("probe.0", "", ""), &tuned("probe.1", "", "")]);
    let file = |text: &str| place.write("other.toml", text);
    // Only together they are valid: each alone would be refused.
    file("[\"probe.0\"]\nnear-m = 20\nfar-m = 30\ngain = 2\n[\"probe.1\"]\ngain = 11\nside = \"straight-ahead\"\n");
    for dry in [true, false] {
        let said = place.say(&[&["param", "load", "other.toml"][..], if dry { &["--dry-run"] } else { &[] }].concat());
        assert_eq!(said.code, Some(1), "{said:?}");
        assert_eq!(said.err, "probe.1 keeps its values: `gain` is 11, out of range: -10..=10\n");
        assert!(said.out.contains("probe.0 near-m: 1 -> 20 m\nprobe.0 far-m: 9 -> 30 m\nprobe.0 gain: 1 -> 2\n"));
        assert_eq!(said.out.contains("(nothing was set)"), dry);
        let gain = shown(place.say(&["param", "get", "probe.0"]), "gain");
        assert_eq!(gain, if dry { "1" } else { "2" });
    }
    wait_for(&place, " 2 20 30 Left true a \\\"word\\\" [near-m+far-m+gain]");
    assert_eq!(shown(place.say(&["param", "get", "probe.1"]), "side"), "left");
    for (text, says) in [
        (
            "[\"probe.1\"]\nside = \"straight-ahead\"\ngian = 1\n",
            "other.toml:3: probe.1 has no parameter `gian`; did you mean `gain`?",
        ),
        (
            "[\"probe.1\"]\ngain = \"1\"\n",
            "other.toml:2: `gain`: \"1\" is text; write a value of type f64, without quotes",
        ),
        ("[\"probe.1\"]\nlook = 3\n", "other.toml:2: `look`: expected true or false"),
        (
            "[\"probe.1\"]\nnear-m = 9\nfar-m = 9\n",
            "probe.1 keeps its values: the module refuses: near-m 9 must be below",
        ),
        ("[\"output.0\"]\nring = 9\n", "output.0 has no parameters"),
        ("[\"prob.1\"]\ngain = 1\n", "other.toml:1: `prob.1` names no module; did you mean [\"probe.1\"]?"),
        ("", "other.toml has no parameters of any module"),
        ("gain = ", "other.toml:1: this is no TOML"),
    ] {
        file(text);
        place.say(&["param", "load", "other.toml"]).fails_with([says]);
    }
    assert_eq!(shown(place.say(&["param", "get", "probe.1"]), "side"), "left");
    place.say(&["param", "load", "nowhere.toml"]).fails_with(["nowhere.toml: "]);
}

#[test]
fn a_file_that_is_something_else_is_not_written_over() {
    let (place, _launch, _robot) = Place::running(&[OUTPUT, &tuned("probe.0", "", "")]);
    let said = place.say(&["param", "save"]);
    said.fails_with(["no file to save to; use `-o FILE`, or write `parameters = \"tuned.toml\"`"]);
    let before = std::fs::read_to_string(place.path("test.toml")).unwrap();
    let said = place.say(&["param", "save", "-o", "test.toml"]);
    said.fails_with(["test.toml is no file of parameters, and is left alone"]);
    assert_eq!(std::fs::read_to_string(place.path("test.toml")).unwrap(), before);
    place.say(&["param", "save", "-o", "no/such/folder.toml"]).fails_with(["cannot be written"]);
    let told = place.say(&["param", "save", "output.0", "-o", "own.toml"]).fails();
    assert!(told.contains("output.0 has no parameters") && !place.path("own.toml").exists(), "{told}");
    place.say(&["param", "save", "-o", "own.toml"]).ok();
    assert_eq!(place.say(&["param", "load", "own.toml"]).ok().matches("as before").count(), 6);
}

#[test]
fn a_bad_file_is_told_before_anything_runs_or_by_the_module() {
    let place = Place::new();
    let file = config(&place, &[&tuned("probe.0", "", "restart = \"never\"")]);
    let file = file.to_str().unwrap();
    let tuned_file = |text: &str| place.write("tuned.toml", text);
    tuned_file("[\"probe.1\"]\n");
    for command in ["check", "launch"] {
        let said = place.say(&[command, file]);
        said.fails_with(["tuned.toml:1: `probe.1` names no module; did you mean [\"probe.0\"]?"]);
    }
    for (text, says) in [
        (
            "\n[\"probe.0\"]\ngain = 99\n",
            "tuned.toml:3: settings of module `probe.0`: `gain` is 99, out of range: -10..=10",
        ),
        (
            "[\"probe.0\"]\nmount = \"roof\"\n",
            "tuned.toml:2: settings of module `probe.0`: `mount` is no parameter; there are gain",
        ),
        ("[\"probe.0\"]\nmuont = \"roof\"\n", "tuned.toml:2: settings of module `probe.0`: unknown field `muont`"),
    ] {
        tuned_file(text);
        // Only the user's own program knows its settings.
        place.say(&["check", file]).ok();
        let mut launch = place.start(&["launch", file]);
        launch.end();
        let said = launch.out() + &launch.err();
        assert!(said.contains(says), "{text}\n  says: {said}\n  should say: {says}");
    }
}

#[test]
fn saved_values_of_built_in_modules_are_checked_before_anything_runs() {
    let place = Place::new();
    place.copy("config/building.map");
    let demo = include_str!("../../config/demo.toml");
    place.write("demo.toml", format!("parameters = \"tuned.toml\"\n{demo}"));
    for (text, says) in [
        (
            "[\"pilot.0\"]\ncruise-m-s = 7\n",
            "tuned.toml:2: [\"pilot.0\"]: `cruise-m-s` is 7 m/s, out of range: 0..=1.5 m/s",
        ),
        (
            "[\"pilot.0\"]\ncruise = 7\n",
            "tuned.toml:2: [\"pilot.0\"]: `cruise` is no parameter; did you mean `cruise-m-s`?",
        ),
        ("[\"motor.0\"]\nseed = 7\n", "tuned.toml:2: [\"motor.0\"]: `seed` is no parameter; there are laser-rate-hz, "),
        ("[\"mapper.0\"]\nlaser = 7\n", "tuned.toml:2: [\"mapper.0\"]: `laser` is no parameter; the module has none"),
    ] {
        place.write("tuned.toml", text);
        for command in [&["check", "demo.toml"][..], &["launch", "demo.toml"]] {
            place.say(command).fails_with([says]);
        }
    }
    place.assert_empty();
}

#[test]
fn no_bytes_bring_a_module_down() {
    let (_place, _launch, robot) = launched(&[&tuned("probe.0", "", "")]);
    let (module, pid) = (robot.name("probe.0"), robot.pid("probe.0"));
    let mut tool = robot.tool(PATIENCE);
    let mut random = 0x9E37_79B9_7F4A_7C15u64;
    let mut byte = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 56) as u8
    };
    for round in 0..2000u32 {
        let bytes: Vec<u8> = (0..byte() % 32).map(|_| byte()).collect();
        if round % 2 == 0 {
            let number = if round % 4 == 0 { common::SET_PARAMETERS } else { common::PARAMETERS };
            let write = |body: &mut Vec<u8>| {
                body.extend_from_slice(&bytes);
                Ok(())
            };
            let _ = tool.call(module, number, common::HASH, write, |bytes| Ok(bytes.len()));
        } else {
            let names = ["gain", "near-m", "far-m", "side", "look", "label", "", "gain"];
            let name = names[usize::from(byte() % 8)].to_owned();
            let values = vec![(name, bytes)];
            let _ = tool.set_parameters(module, &SetParameters { values, only_check: byte() % 2 == 0 });
        }
    }
    let parameters = tool.parameters(module).unwrap();
    assert_eq!(parameters.len(), 6);
    for parameter in &parameters {
        // All values that were set have passed the check.
        let values = vec![(parameter.field.name.clone(), parameter.value.clone())];
        tool.set_parameters(module, &SetParameters { values, only_check: true }).unwrap();
    }
    assert_eq!(robot.pid("probe.0"), pid, "it was not even started again");
    tool.close();
}

#[test]
fn the_pilot_drives_as_fast_as_it_was_set_to() {
    let place = Place::new();
    let _demo = place.start(&["demo", "--no-gui", "--quiet"]);
    let speed = || {
        let said = place.say(&["call", "motor.0", "get", "motion", "--json"]);
        let json: serde_json::Value = serde_json::from_str(&said.out).ok()?;
        json["speed_m_s"].as_f64()
    };
    wait("it drives", || speed().filter(|speed| *speed > 0.2));
    place.say(&["param", "set", "pilot.0", "cruise-m-s", "0.1"]).ok();
    wait("it has slowed down", || speed().filter(|speed| *speed <= 0.1));
    let mut drove = false;
    for _ in 0..20 {
        let speed = wait("its speed", speed);
        assert!(speed <= 0.1 + 1e-9, "{speed} m/s");
        drove |= speed > 0.05;
    }
    until("it goes on driving", || drove || speed().is_some_and(|speed| speed > 0.05));
    let told = place.say(&["param", "set", "pilot.0", "cruise-m-s", "7"]).fails();
    assert_eq!(told, "`cruise-m-s` is 7 m/s, out of range: 0..=1.5 m/s\n");
}
