//! Launch: starts in order, watches, stops in reverse, leaves nothing.

use crate::harness::{OUTPUT, PATIENCE, Place, assert_has, halt, probe, runs, until};
use crate::probe::WORK;
use crate::process::Running;
use nix::sys::signal::Signal;

#[test]
fn modules_start_in_order_stop_in_reverse_and_leave_nothing() {
    for number in [Signal::SIGTERM, Signal::SIGINT, Signal::SIGHUP] {
        let (place, mut launch, robot) =
            Place::running(&[OUTPUT, &probe("probe.2", "", ""), &probe("probe.0", "", ""), &probe("probe.1", "", "")]);
        let pids = robot.pids();
        assert_eq!(pids.len(), 4);
        launch.signal(number);
        assert!(launch.end().success(), "{number}: {}{}", launch.out(), launch.err());
        let expected = "probe.2 start,probe.0 start,probe.1 start,probe.2 on,probe.0 on,probe.1 on,probe.1 off,\
                        probe.0 off,probe.2 off";
        assert_eq!(place.record().join(","), expected, "{number}");
        assert!(!pids.iter().any(|pid| runs(*pid)), "{number}: a module outlived its launch");
        place.assert_empty();
        let told = (launch.out(), launch.err());
        assert_eq!(told, ("node main of test runs: 4 modules\n".into(), String::new()), "{number}: no more to tell");
    }
}

#[test]
fn what_a_configuration_resolved_to_lies_beside_the_mailboxes() {
    let (place, mut launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", "optional = true")]);
    let read = std::fs::read_to_string(robot.node.path().join("node.json")).unwrap();
    let resolved: serde_json::Value = serde_json::from_str(&read).unwrap();
    assert_eq!((&resolved["format"], &resolved["node"]), (&1.into(), &"main".into()));
    assert_eq!(resolved["layout"], rohrpost_mailbox::LAYOUT_VERSION);
    assert_eq!(resolved["launch"]["number"], robot.installation.launch_of(&robot.installation.nodes[0]).raw());
    assert_eq!(resolved["routes"], serde_json::json!([]), "there is one node");
    let modules = resolved["installation"]["nodes"][0]["modules"].as_array().unwrap();
    let told: Vec<_> =
        modules.iter().map(|module| (module["name"].as_str().unwrap(), module["number"].clone())).collect();
    let names = ["output.0", "probe.0"];
    assert_eq!(told, names.map(|name| (name, robot.name(name).raw().into())));
    assert_eq!((&modules[0]["optional"], &modules[1]["optional"]), (&false.into(), &true.into()));
    // The link of this name leads to a mailbox.
    let mailbox = format!("{:08x}.mbx", modules[1]["number"].as_u64().unwrap());
    assert!(robot.node.path().join(mailbox).exists());
    let checked = place.say(&["check", "test.toml", "--json"]).json();
    assert_eq!(checked["installation"], resolved["installation"], "`check` says the same");
    place.end(&mut launch);
}

#[test]
fn a_module_that_is_to_wait_stays_off_until_it_is_switched_on() {
    let (place, mut launch, robot) =
        Place::running(&[&probe("probe.0", "", "start = \"off\""), &probe("probe.1", "", "")]);
    // The second is on, so the first was passed over.
    assert_eq!(robot.state("probe.0"), "off");
    assert!(place.say(&["call", "probe.0", "count", "1"]).fails().contains("switch it on"));
    place.say(&["call", "probe.0", "on"]).ok();
    assert_eq!(place.say(&["call", "probe.0", "count", "2"]).ok(), "1\n");
    place.say(&["call", "probe.0", "off"]).ok();
    assert_eq!(robot.state("probe.0"), "off");
    launch.stop();
    assert_eq!(place.counted(), [2]);
}

#[test]
fn a_module_that_will_not_stop_is_killed_and_named() {
    let stop_within = "stop-within = \"300 ms\"";
    let (place, mut launch, robot) = Place::running(&[
        &probe("probe.0", "", ""),
        &probe("probe.1", "ignore-stop = true", stop_within),
        &probe("probe.2", "", stop_within),
        &probe("probe.3", "", stop_within),
    ]);
    let pids = robot.pids();
    halt(robot.pid("probe.2"));
    let mut tool = robot.tool(PATIENCE);
    robot.begin(&mut tool, "probe.3", WORK, &(60_000u64,));
    until("probe.3 works", || place.recorded("work begins") == 1);
    tool.close();
    launch.signal(Signal::SIGTERM);
    // A launcher may forward a signal at once: a second one within moments means the same.
    launch.stop();
    for (module, killed) in [("probe.0", false), ("probe.1", true), ("probe.2", true)] {
        let told = format!("{module} did not stop within 300ms; killed");
        assert_eq!(launch.out().contains(&told), killed, "{module}: {}", launch.out());
    }
    assert!(!pids.iter().any(|pid| runs(*pid)));
    place.assert_empty();
}

#[test]
fn a_second_launch_is_refused_and_the_first_unharmed() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let (pid, config) = (robot.pid("probe.0"), place.path("test.toml"));
    let said = place.say(&["launch", config.to_str().unwrap()]);
    said.fails_with([&format!("launched already, by process {}", launch.pid())]);
    assert_eq!(robot.pid("probe.0"), pid);
    assert_eq!(place.say(&["call", "probe.0", "count", "1"]).ok(), "1\n");
    launch.stop();
    assert_eq!(place.recorded("start"), 1);
    place.assert_empty();
}

#[test]
fn of_many_launches_at_once_one_wins() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "", "")]);
    let mut launches: Vec<Running> = (0..6).map(|_| place.launch(&config)).collect();
    until("all but one have ended", || {
        let ended = launches.iter_mut().filter_map(Running::ended).count();
        ended == 5
    });
    let winner = launches.iter_mut().position(|launch| launch.ended().is_none()).unwrap();
    let mut winner = launches.swap_remove(winner);
    let robot = place.robot(&config, "main", &mut winner);
    robot.wait_on(&mut winner);
    for launch in &mut launches {
        assert_eq!(launch.end().code(), Some(1));
        assert!(launch.err().contains(&format!("launched already, by process {}", winner.pid())), "{}", launch.err());
    }
    assert_eq!(place.say(&["call", "probe.0", "count", "1"]).ok(), "1\n");
    winner.stop();
    assert_eq!(place.recorded("start"), 1);
    place.assert_empty();
}

#[test]
fn what_runs_is_listed_with_state_priority_and_process() {
    let (place, _launch, robot) =
        Place::running(&[OUTPUT, &probe("probe.0", "", ""), &probe("probe.7", "", "start = \"off\"")]);
    let list = place.say(&["list", "--json"]).json();
    assert_eq!((list["installation"].as_str(), list["node"].as_str()), (Some("test"), Some("main")));
    let modules = list["modules"].as_array().unwrap();
    for (line, (module, state, priority)) in
        modules.iter().zip([("output.0", "on", 32), ("probe.0", "on", 96), ("probe.7", "off", 96)])
    {
        assert_eq!(line["module"], module);
        assert_eq!(line["state"], state, "{line}");
        assert_eq!(line["priority"], priority, "{line}");
        assert_eq!(line["pid"], robot.pid(module), "{line}");
        assert_eq!(line["restarts"], 0, "{line}");
        assert!(line["scheduling"].as_str().unwrap().starts_with("nice "), "{line}");
    }
    assert_eq!(modules.len(), 3);
    let text = place.say(&["list", "--mailboxes"]).ok();
    assert!(text.starts_with("node main of test\n"), "{text}");
    assert_has(&text, ["probe.7", "1.probe.0.0", "commands", "32 x 1024 B", "displace"]);
}

#[test]
fn a_tool_that_still_runs_is_named_when_launch_ends() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let tool = robot.tool(PATIENCE);
    let out = launch.stop();
    assert!(out.contains("somebody still uses") && out.contains("rohrpost clean"), "{out}");
    tool.close();
    assert!(place.say(&["clean"]).ok().contains("removed "));
    place.assert_empty();
}
