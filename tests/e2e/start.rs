//! What keeps a node from starting, and what is said about it.

use crate::harness::{OUTPUT, Place, assert_has, probe, until};

#[test]
fn a_module_that_does_not_start_is_named_and_nothing_is_left() {
    let restart = "restart = { policy = \"on-failure\", at-most = 1, backoff = \"10 ms\" }";
    for (settings, keys, words) in [
        ("panic-at-start = true", restart, ["ended with 101", "a probe was asked to panic"]),
        ("exit-at-start = 3", restart, ["ended with 3", "a probe was asked to end with 3"]),
        ("refuse-at-start = true", restart, ["ended with 1", "probe.1: a probe was asked not to start"]),
        ("hang-at-start = true", "ready-within = \"200 ms\"\nrestart = \"never\"", ["killed by signal 9", "probe.1"]),
        ("speed = 3", restart, ["test.toml:", "speed"]),
    ] {
        let place = Place::new();
        let config = place
            .config(&[&probe("probe.0", "", ""), &probe("probe.1", settings, &format!("required = true\n{keys}"))]);
        let said = place.say(&["launch", config.to_str().unwrap()]);
        assert_eq!(said.code, Some(1), "{settings}: {said:?}");
        let told = said.err;
        assert!(told.contains("module probe.1 did not become ready"), "{told}");
        for words in words {
            assert!(told.contains(words), "{settings}: no `{words}` in: {told}");
        }
        place.assert_empty();
    }
}

#[test]
fn a_slow_module_is_waited_for() {
    let (place, mut launch, _robot) =
        Place::running(&[&probe("probe.0", "slow-ms = 1500", ""), &probe("probe.1", "", "")]);
    assert!(place.record().starts_with(&["probe.0 start".into(), "probe.1 start".into(), "probe.0 on".into()]));
    launch.stop();
}

#[test]
fn launch_can_be_stopped_while_modules_start() {
    let place = Place::new();
    let slow = probe("probe.1", "slow-ms = 600000", "ready-within = \"20 min\"\nstop-within = \"200 ms\"");
    let config = place.config(&[&probe("probe.0", "", ""), &slow]);
    let mut launch = place.launch(&config);
    until("probe.1 starts", || place.recorded("start") == 2);
    launch.stop_failed();
    assert!(launch.err().contains("probe.1 did not become ready: told to stop"), "{}", launch.err());
    place.assert_empty();
}

#[test]
fn a_module_that_does_not_switch_on_is_in_error_and_the_others_work() {
    let (place, mut launch, robot) =
        Place::begun(&[&probe("probe.0", "refuse-on = true", ""), &probe("probe.1", "", "")]);
    until("probe.1 is on", || robot.state("probe.1") == "on");
    launch.wait_for("probe.0 could not be switched on: ");
    assert!(launch.out().contains("a probe was asked not to work"), "{}", launch.out());
    let status = place.say(&["status"]);
    assert_eq!(status.code, Some(1), "somebody is in error");
    assert!(status.out.contains("error") && status.out.contains("a probe was asked not to work"), "{}", status.out);
    place.say(&["call", "probe.0", "count", "1"]).fails_with(["a probe was asked not to work"]);
    place.say(&["status", "probe.1"]).ok();
    launch.stop_failed();
    assert!(launch.err().contains("probe.0 is in error: a probe was asked not to work"), "{}", launch.err());
}

#[test]
fn a_missing_program_is_told_before_anything_starts() {
    let place = Place::new();
    let missing = "[[module]]\nname = \"probe.1\"\nprogram = \"rohrpost-nowhere\"\n";
    let path = "[[module]]\nname = \"probe.2\"\nprogram = \"./nowhere\"\n";
    let config = place.config(&[&probe("probe.0", "", ""), missing, path]);
    let told = place.say(&["launch", config.to_str().unwrap()]).fails();
    for (module, program) in
        [("probe.1", "`rohrpost-nowhere` is neither in"), ("probe.2", "`./nowhere` is no program at")]
    {
        let line = 1 + std::fs::read_to_string(&config).unwrap().split(module).next().unwrap().matches('\n').count();
        // A module's line is that of its `[[module]]`.
        let words = format!("test.toml:{}: module `{module}`: {program}", line - 1);
        assert!(told.contains(&words), "no `{words}` in: {told}");
    }
    assert_eq!(place.record().len(), 0, "a module was started");
    place.assert_empty();
}

#[test]
fn an_optional_module_is_left_out_with_a_notice() {
    let missing = "[[module]]\nname = \"probe.1\"\nprogram = \"rohrpost-nowhere\"\noptional = true\n";
    let (place, mut launch, robot) = Place::begun(&[&probe("probe.0", "", ""), missing, OUTPUT]);
    until("output.0 is on", || robot.state("output.0") == "on");
    launch.wait_for("the module is left out, since it is optional");
    let out = launch.stop();
    assert!(out.contains("module `probe.1`: `rohrpost-nowhere` is neither in"), "{out}");
    place.assert_empty();
}

#[test]
fn a_broken_configuration_starts_nothing() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "", "calls = [\"probe.9\"]")]);
    let file = config.to_str().unwrap();
    for arguments in [&["launch", file][..], &["check", file], &["list", "--config", file]] {
        place.say(arguments).fails_with(["test.toml:1", "probe.9"]);
    }
    place.say(&["launch", "nowhere.toml"]).fails_with(["nowhere.toml"]);
    place.assert_empty();
}

#[test]
fn check_explains_good_files_and_places_the_mistakes_of_bad_ones() {
    let place = Place::new();
    for file in ["demo.toml", "demo-log.toml"] {
        let path = format!("{}/../config/{file}", env!("CARGO_MANIFEST_DIR"));
        place.say(&["check", &path]).ok_with(["mapper.0", "laser.0"]);
    }
    let config = place.config(&[OUTPUT, "[[module]]\nname = \"probe.1\"\nprogram = \"nowhere\"\n"]);
    let said = place.say(&["check", config.to_str().unwrap()]).ok();
    assert!(said.contains("note: ") && said.contains("`nowhere`"), "another computer may have it: {said}");
    place.say(&["check", config.to_str().unwrap(), "--node", "other"]).fails_with(["main"]);
    let text = "installation = \"broken\"\n[system]\nname = \"robot\"\nid = 1\n[classes]\nlaser = { id = 500 }\n\
                tool = { id = 16 }\n[nodes.main]\n[[module]]\nname = \"laser.0\"\nbuiltin = \"smi\"\n";
    let broken = place.write("broken.toml", text);
    let told = place.say(&["check", broken.to_str().unwrap()]).fails();
    assert_has(&told, ["broken.toml:6: ", "broken.toml:11: ", "did you mean `sim`?"]);
}

#[test]
fn a_module_that_is_configured_wrongly_is_not_started_again() {
    let place = Place::new();
    // As a program of its own it is asked nothing before it runs.
    let program = format!("program = [\"{}\", \"run\", \"output\"]", env!("CARGO_BIN_EXE_rohrpost"));
    let config = place.config(&[&format!("[[module]]\nname = \"output.0\"\n{program}\nsettings = {{ colour = 1 }}\n")]);
    let said = place.say(&["launch", config.to_str().unwrap(), "--quiet"]).fails();
    assert!(said.contains("settings of module `output.0`: unknown field `colour`"), "{said}");
    assert!(said.contains("ended with 78") && !said.contains("starts again"), "{said}");
    place.assert_empty();
}
