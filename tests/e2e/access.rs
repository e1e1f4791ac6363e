//! `[access]` also restricts commands between modules of one node.

use crate::harness::{PATIENCE, Place, probe, until};
use crate::probe::{COUNT, ProbingInterface};
use rohrpost::common::{DESCRIBE, HASH, OFF};
use rohrpost::{CallError, Fault};

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
    let text = std::fs::read_to_string(place.path("test.toml")).unwrap();
    let line = text.lines().position(|line| line.starts_with("probe = [\"probe\"]")).unwrap() + 1;
    for (number, hash) in [(COUNT, ProbingInterface::hash()), (OFF, HASH), (DESCRIBE, HASH)] {
        let call = tool.begin(module, number, hash, |_| Ok(())).unwrap();
        let refused = tool.link.wait(call, |_| Ok(())).unwrap_err();
        let CallError::Fault(_, Fault::NotAllowed { node, rule }) = &refused else { panic!("{number}: {refused}") };
        assert_eq!(node, "main");
        assert!(rule.ends_with(&format!("test.toml:{line}")), "{refused}");
    }
    assert_eq!((place.counted(), robot.state("probe.0")), (Vec::new(), "on"), "launch switched it on");
    let hears = || place.record().iter().any(|line| line.starts_with("probe.1 each"));
    until("a class that is listed subscribes", hears);
    tool.close();
    launch.stop();
}
