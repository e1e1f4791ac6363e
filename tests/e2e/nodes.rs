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

#[test]
fn two_nodes_of_one_system_are_apart() {
    let place = Place::new();
    let nodes = "[nodes.base]\ntools = [0, 15]\n[nodes.arm]\ntools = [16, 31]\n";
    let modules = [probe("probe.0", "", "node = \"base\""), probe("probe.1", "", "node = \"arm\"")];
    let config = place.config_of("test", nodes, &[&modules[0], &modules[1]]);
    let file = config.to_str().unwrap();
    let told = place.say(&["launch", file]).fails();
    assert!(told.contains("which node?") && told.contains("base, arm") && told.contains("--node"), "{told}");
    let mut running = Vec::new();
    for node in ["base", "arm"] {
        let mut launch = crate::process::Running::start(place.command(&["launch", file, "--node", node]));
        let robot = place.robot(&config, node, &mut launch);
        robot.wait_on(&mut launch);
        running.push((launch, robot));
    }
    for (node, own, other) in [("base", "probe.0", "probe.1"), ("arm", "probe.1", "probe.0")] {
        let at = ["--config", file, "--node", node];
        let list = place.say(&[&["list", "--json"], &at[..]].concat()).json();
        assert_eq!(list["modules"].as_array().unwrap().len(), 1);
        assert_eq!(list["modules"][0]["module"], own);
        assert_eq!(place.say(&[&["call"], &at[..], &[own, "count", "1"]].concat()).ok(), "1\n");
        let told = place.say(&[&["call"], &at[..], &[other, "count", "1"]].concat()).fails();
        let why =
            format!("{other} is a module of node {}, and this is {node}", if node == "base" { "arm" } else { "base" });
        assert!(told.contains(&why), "{told}");
    }
    for (mut launch, robot) in running {
        drop(robot);
        launch.stop();
    }
    place.assert_empty();
}
