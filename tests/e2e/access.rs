//! `[access]` also restricts commands between modules of one node.

use crate::harness::{PATIENCE, Place, probe, until};
use crate::probe::{COUNT, ProbingInterface};
use rohrpost::common::{DESCRIBE, HASH, OFF};
use rohrpost::{CallError, Fault};

/// Where the file has a rule, as faults name it.
fn rule(place: &Place, begin: &str) -> String {
    let file = place.path("test.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    let line = 1 + text.lines().position(|line| line.starts_with(begin)).unwrap();
    format!("{}:{line}", file.display())
}

#[track_caller]
fn assert_refused(refused: &CallError, place: &Place, begin: &str) {
    let expected = Fault::NotAllowed { node: "main".into(), rule: rule(place, begin) };
    assert!(matches!(refused, CallError::Fault(_, fault) if *fault == expected), "{refused}");
}

#[test]
fn on_one_node_a_class_that_is_not_listed_commands_nothing_and_is_told_the_line() {
    let access = "[access]\nprobe = [\"probe\"]\n";
    let (place, mut launch, robot) = Place::running(&[
        access,
        &probe("probe.0", "rate-hz = 100.0", ""),
        // Its class is listed: its subscriptions are commands, too.
        &probe("probe.1", "hears = \"probe.0\"", "calls = [\"probe.0\"]"),
    ]);
    let mut tool = robot.tool(PATIENCE);
    let module = robot.name("probe.0");
    for (number, hash) in [(COUNT, ProbingInterface::hash()), (OFF, HASH), (DESCRIBE, HASH)] {
        let call = tool.begin(module, number, hash, |_| Ok(())).unwrap();
        let refused = tool.link.wait(call, |_| Ok(())).unwrap_err();
        assert_refused(&refused, &place, "probe = [");
    }
    assert_eq!((place.counted(), robot.state("probe.0")), (Vec::new(), "on"), "launch switched it on");
    let hears = || place.record().iter().any(|line| line.starts_with("probe.1 each"));
    until("a class that is listed subscribes", hears);
    tool.close();
    launch.stop();
}

#[test]
fn a_module_with_a_line_of_its_own_is_commanded_by_those_listed_there_alone() {
    let (place, mut launch, robot) = Place::running(&[
        "[access]\nprobe = [\"probe\"]\n\"probe.0\" = [\"tool\"]\n",
        &probe("probe.0", "rate-hz = 100.0", ""),
        // Its class may command all others of the class; `calls` with this name would not be accepted.
        &probe("probe.1", "hears = \"probe.0\"", ""),
    ]);
    assert_eq!(robot.count("probe.0", 1, PATIENCE).unwrap(), 1, "it is listed");
    assert_refused(&robot.count("probe.1", 2, PATIENCE).unwrap_err(), &place, "probe = [");
    let rule = rule(&place, "\"probe.0\"");
    launch.wait_for(&format!("subscription to `beat` of probe.0: node main refuses it: {rule}, [access]"));
    let is_beat = |line: &String| line.starts_with("probe.1 each") || line.starts_with("probe.1 newest");
    assert!(!place.record().iter().any(is_beat), "{:?}", place.record());
    assert_eq!(place.counted(), [1]);
    launch.stop();
}
