//! `rohrpost bench local`. Its sentence for other computers is tested beside its code, its measurements in `benches`.

use crate::harness::{OUTPUT, Place, json_lines, probe};
use rohrpost_testbed::report::has_two_processors;
use serde_json::Value;

/// Sizes of each case, and the floor beside it.
const CASES: [(&str, &str); 2] = [("blocking", "futex"), ("spinning", "spin")];

#[test]
fn the_self_test_has_all_figures() {
    if !has_two_processors() {
        return;
    }
    let place = Place::new();
    let said = place.say(&["bench", "local", "--json"]);
    let lines = json_lines(&said.ok());
    assert_eq!(lines.first().unwrap()["case"], "environment");
    assert_eq!(lines.last().unwrap()["case"], "environment-after");
    for (case, floor) in CASES {
        for bytes in [64, 1024] {
            let row = |contender: &str| {
                let is_it =
                    |line: &&Value| line["case"] == case && line["bytes"] == bytes && line["contender"] == contender;
                lines.iter().find(is_it).unwrap_or_else(|| panic!("no {case} {bytes} {contender}: {lines:#?}"))
            };
            for row in [row("rohrpost"), row(floor)] {
                assert!(row["p50"].as_f64().unwrap() > 0.0 && row["unit"] == "us", "{row}");
            }
            let ours = row("rohrpost");
            assert!(
                ours["vs"] == floor && ours["ratio_p50"].as_f64().unwrap() > 0.0 && ours["met"].is_boolean(),
                "{ours}"
            );
        }
    }
    assert_eq!(lines.len(), 2 + 2 * 2 * 2, "{lines:#?}");
    place.assert_empty();
}

#[test]
fn a_running_robot_is_not_disturbed_and_the_user_is_told() {
    if !has_two_processors() {
        return;
    }
    let (place, mut launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", "")]);
    let pid = robot.pid("probe.0");
    let said = place.say(&["bench", "local"]);
    assert!(said.err.starts_with("warning: ") && said.err.contains("is launched on this computer"), "{said:?}");
    assert!(said.out.contains("LOOK: ") && said.out.contains("a node is launched"), "{said:?}");
    let rows = said.out.lines().filter(|line| line.starts_with(" blocking ") || line.starts_with(" spinning ")).count();
    assert_eq!((said.code, rows), (Some(0), 8), "{said:?}");
    assert_eq!(robot.pid("probe.0"), pid);
    place.end(&mut launch);
}
