//! Several nodes on one computer never see each other.

use crate::harness::{Place, probe};

#[test]
fn two_configurations_on_one_computer_are_apart() {
    let place = Place::new();
    let mut robots = Vec::new();
    for installation in ["first", "second"] {
        let config = place.config_of(installation, "[nodes.main]", &[&probe("probe.0", "", "")]);
        let mut launch = place.launch(&config);
        let robot = place.robot(&config, "main", &mut launch);
        robot.wait_on(&mut launch);
        robots.push((launch, robot, config));
    }
    let told = place.say(&["list"]).fails();
    for words in ["several nodes run here", "--config", "first.main", "second.main"] {
        assert!(told.contains(words), "no `{words}` in: {told}");
    }
    let call = |installation: usize, count: &str| {
        let config = robots[installation].2.to_str().unwrap();
        place.say(&["call", "--config", config, "probe.0", "count", count]).ok()
    };
    assert_eq!(call(0, "1"), "1\n");
    assert_eq!(call(0, "2"), "2\n");
    assert_eq!(call(1, "3"), "1\n", "the other one has counted nothing yet");
    let (mut first, robot, _) = robots.remove(0);
    drop(robot);
    first.stop();
    // Now there is one only.
    assert_eq!(place.say(&["call", "probe.0", "count", "4"]).ok(), "2\n");
    let (mut second, robot, _) = robots.remove(0);
    drop(robot);
    second.stop();
    place.assert_empty();
}
