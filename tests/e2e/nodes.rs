//! Several nodes on one computer never see each other.

use crate::harness::{Place, assert_has, probe};

#[test]
fn two_configurations_on_one_computer_are_apart() {
    let place = Place::new();
    let mut robots = Vec::new();
    for installation in ["first", "second"] {
        let config = place.config_of(installation, "[nodes.main]", &[&probe("probe.0", "", "")]);
        let (launch, robot) = place.launched_from(&config);
        robots.push((launch, robot, config));
    }
    let told = place.say(&["list"]).fails();
    assert_has(&told, ["several installations run here: first, second; say which with -i NAME"]);
    let call = |installation: usize, count: &str| {
        let config = robots[installation].2.to_str().unwrap();
        place.say(&["call", "--config", config, "probe.0", "count", count]).ok()
    };
    assert_eq!(call(0, "1"), "1\n");
    assert_eq!(place.say(&["list", "-i", "second"]).ok().lines().next(), Some("node main of second"));
    let told = place.say(&["list", "-i", "third"]).fails();
    assert_eq!(told, "no installation `third` runs here; there are: first, second\n");
    assert_eq!(call(0, "2"), "2\n");
    assert_eq!(call(1, "3"), "1\n", "the other one has counted nothing yet");
    let (mut first, _robot, _) = robots.remove(0);
    first.stop();
    // Now there is one only.
    assert_eq!(place.say(&["call", "probe.0", "count", "4"]).ok(), "2\n");
    let (mut second, _robot, _) = robots.remove(0);
    place.end(&mut second);
}
