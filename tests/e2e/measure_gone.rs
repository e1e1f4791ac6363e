//! The measuring tools with a source that never was, stops, dies, or is launched again.

use crate::harness::{Place, halt, probe, signal, until, wait};
use crate::measure::{last, lines};
use nix::sys::signal::Signal;
use serde_json::Value;

#[test]
fn hz_tells_what_is_silent_and_what_does_not_exist() {
    let (place, mut launch, robot) =
        Place::running(&[&probe("probe.0", "rate-hz = 50.0", "restart = { policy = \"never\" }")]);
    let text = place.say(&["hz", "probe.0", "--count", "1"]).ok();
    let [beat, silence, blob] = text.lines().collect::<Vec<_>>()[..] else { panic!("{text}") };
    assert!(beat.starts_with("beat     ") && beat.contains(" Hz  mean ") && beat.contains(" values"), "{text}");
    assert!(silence.contains("never published; `rohrpost status` tells"), "{text}");
    assert!(blob.starts_with("blob     "), "{text}");
    for (arguments, error) in [
        (&["hz", "probe.0", "bleat"][..], "probe.0 has no data `bleat`; it has: beat, silence, blob\n"),
        (&["hz", "probe.7"], "the configuration has no module `probe.7`; there are probe.0\n"),
        (&["bw", "probe.7"], "the configuration has no module `probe.7`; there are probe.0\n"),
        (&["delay", "probe.7"], "the configuration has no module `probe.7`; there are probe.0\n"),
        (&["hz", "probe.0", "--window", "0"], "a window of 0 s is empty; try --window 1\n"),
    ] {
        assert_eq!(place.say(arguments).fails(), error);
    }
    // A stopped source is not called slow.
    halt(robot.pid("probe.0"));
    let said = place.say(&["hz", "probe.0", "beat", "--seconds", "0.3"]);
    said.ok_with(["nothing new in this window; the last value was sent "]);
    let mut hz = place.start(&["hz", "probe.0", "beat"]);
    hz.wait_for("nothing new");
    signal(robot.pid("probe.0"), Signal::SIGKILL);
    launch.wait_for("probe.0");
    hz.wait_for("never published");
    hz.stop();
}

#[test]
fn what_stops_is_silent_and_no_longer_as_quick_as_it_was() {
    let (place, _launch, robot) = Place::running(&[&probe("probe.0", "rate-hz = 50.0", "")]);
    let mut tools = [["hz", "probe.0", "beat", "--json"], ["bw", "probe.0", "beat", "--json"]]
        .map(|arguments| place.start(&arguments));
    let names = [["values", "values_per_s"], ["packages", "packages_per_s"]];
    for (tool, [count, _]) in tools.iter().zip(names) {
        wait("it goes on", || last(tool, |line| line[count].as_u64() >= Some(20) && line["silent_s"].is_null()));
    }
    halt(robot.pid("probe.0"));
    for (tool, [count, per_s]) in tools.iter_mut().zip(names) {
        // Within the window of ten seconds, most of which is good.
        let is_silent = |line: &Value| line[count].as_u64() > Some(1) && line["silent_s"].as_f64() > Some(1.0);
        let line = wait("it is silent", || last(tool, is_silent));
        let [sent, rate, silent_s] = [count, per_s, "silent_s"].map(|name| line[name].as_f64().unwrap());
        assert!(rate > 0.0 && rate * silent_s < sent, "{line}");
        if let Some(mean_s) = line["interval_mean_s"].as_f64() {
            assert!(rate * mean_s < 0.99, "{line}");
        }
        let after = wait("it is silent for longer", || last(tool, |later| later["silent_s"].as_f64() > Some(silent_s)));
        assert!(after[per_s].as_f64().is_none_or(|later| later < rate), "{line} {after}");
        tool.stop();
    }
    let said = place.say(&["hz", "probe.0", "beat", "--count", "1"]);
    said.ok_with(["nothing new in this window; the last value was sent "]);
    signal(robot.pid("probe.0"), Signal::SIGCONT);
}

#[test]
fn a_node_that_is_launched_again_is_found_again() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "rate-hz = 50.0", "")]);
    let config = robot.installation.path.clone();
    let start = |arguments: &[&str]| place.start(arguments);
    let mut tools = [
        start(&["hz", "probe.0", "beat", "--json"]),
        start(&["bw", "probe.0", "beat", "--json"]),
        start(&["delay", "probe.0", "--json"]),
    ];
    let values = |line: &Value| {
        line["values"].as_u64().or(line["packages"].as_u64()).or(line["published"][0]["values"].as_u64()).unwrap()
    };
    for tool in &tools {
        wait("a value", || last(tool, |line| values(line) > 1));
    }
    launch.stop();
    for tool in &tools {
        until("that launch has ended", || tool.err().contains("waiting until it is launched again"));
    }
    let (_launch, _robot) = place.launched_from(&config);
    for tool in &mut tools {
        until("that it is there again", || tool.err().contains("node `main` was launched again"));
        let before = lines(tool).len();
        until("values of the new one", || lines(tool)[before..].iter().any(|line| values(line) > 1));
        tool.stop();
    }
}
