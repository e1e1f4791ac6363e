//! Teams that drive: robots with payload, wormhole and body as real processes, in an arena that referees them.

use crate::harness::{Place, lab, until, wait};
use nix::sys::signal::Signal;
use serde_json::Value;

/// What a robot says of itself, or of its team.
fn asked(place: &Place, node: &str, words: &[&str]) -> Value {
    let said = place.say(&[words, &["--node", node, "--json"]].concat());
    said.out.lines().next().and_then(|line| serde_json::from_str(line).ok()).unwrap_or_default()
}

#[test]
fn a_team_from_one_file_finds_itself_stops_goes_on_and_loses_a_robot() {
    let place = Place::new();
    place.copy("config/team.toml");
    place.copy("config/hall.map");
    let mut team = place.start(&["team", "launch", "team.toml", "--robots", "3"]);
    team.wait_for("no intruder");
    until("three are one group that agrees", || {
        let state = asked(&place, "robot2", &["team"]);
        state["leader"] == 1 && state["group"] == 3 && state["views_equal"] == true
    });
    let drives = |node| asked(&place, node, &["call", "wormhole.0", "state"])["mode"] == "Active";
    until("payloads drive", || ["robot1", "robot2", "robot3"].into_iter().all(drives));
    place.say(&["team", "stop"]).ok_with(["robot1:\nhalted: wormhole.0", "robot2:\nhalted", "robot3:\nhalted"]);
    place.say(&["team", "resume"]).ok_with(["robot1:\nfree: wormhole.0", "robot2:\nfree", "robot3:\nfree"]);
    place.say(&["team", "kill", "9"]).fails_with(["robot 9 does not run here"]);
    place.say(&["team", "kill", "2"]).ok_with(["killed", "processes of robot2"]);
    wait("the others miss it", || (asked(&place, "robot1", &["team"])["members"][0]["fresh"] == false).then_some(()));
    team.signal(Signal::SIGINT);
    assert_eq!(team.end().code(), Some(1), "a robot did not end in order");
    let out = team.out();
    assert!(out.contains("\n0 touches by robots that moved towards what they touched, of 0 in all; "), "{out}");
    place.say(&["clean"]).ok_with(["robot2"]);
    place.assert_empty();
}

/// Splits, merges, and deaths of a payload and of a robot, while an intruder is found and blocked.
#[test]
fn eight_robots_block_an_intruder_and_touch_nothing() {
    let place = Place::new();
    if lab([("one", "10.80.0.1"), ("two", "10.80.0.2")], "a team").is_none() {
        return;
    }
    let mut demo = place.start(&["demo", "--team", "8", "--seconds", "60"]);
    for words in ["all reachable entrances are held", "it is whole again", "the leader is back", "The demo "] {
        demo.wait_for(words);
    }
    let said = demo.said();
    assert_eq!(said.code, Some(0), "{said:?}");
    let verdict = said.out.split_once("The demo went well.\n").unwrap_or_else(|| panic!("{said:?}")).1;
    assert!(verdict.starts_with("0 touches by robots that moved towards what they touched"), "{verdict}");
    assert!(verdict.lines().next().is_some_and(|line| line.ends_with("all reachable entrances held")), "{verdict}");
    assert!(!verdict.contains("never"), "{verdict}");
    place.assert_empty();
}

#[test]
fn what_keeps_a_team_from_its_launch_is_told_with_its_remedy() {
    let place = Place::new();
    place.copy("config/team.toml");
    place.copy("config/hall.map");
    let text = std::fs::read_to_string(place.path("team.toml")).unwrap();
    let launch = "robots = 6\narena = { map = \"hall.map\" }";
    for (change, words) in [
        ("robots = 6", "missing field `arena`"),
        ("robots = 6\narena = { map = \"no.map\" }", "no.map: No such file"),
        ("robots = 6\narena = { map = \"hall.map\", beams = 0 }", "`beams` is 0; use 1 to 10000"),
        ("robots = 200\narena = { map = \"hall.map\" }", "the map has no room for 200 robots"),
        ("robots = 2\narena = { map = \"hall.map\" }\nrobot = [{ id = 1, cel = \"1,1\" }]", "unknown field `cel`"),
        ("robots = 2\narena = { map = \"hall.map\" }\nrobot = [{ id = 1, cell = \"0,0\" }]", "0,0 is no path"),
    ] {
        assert!(text.contains(launch));
        place.write("wrong.toml", text.replace(launch, change));
        place.say(&["team", "launch", "wrong.toml"]).fails_with([words]);
    }
    place.write("bare.toml", text.replace("[team.launch]", "").replace(launch, ""));
    place.say(&["team", "launch", "bare.toml"]).fails_with(["no [team.launch]", "write for example"]);
    place.write("fast.toml", text.replace("seed = 1 }", "seed = 1, wandering-m-s = 0.6 }"));
    place.say(&["check", "fast.toml"]).fails_with(["expected 0 < wandering < searching < blocking"]);
}
