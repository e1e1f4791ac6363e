//! `graph`: all flows with sender and receiver, as a table, as JSON, and drawn.

use crate::harness::{OUTPUT, PATIENCE, Place, probe, simulated, until, wait};
use nix::sys::signal::Signal;
use serde_json::Value;

/// A module's own mailbox takes data, whatever its local id; output lines go to the collector alone.
#[test]
fn data_in_a_mailbox_of_ones_own_are_named() {
    let modules = [
        OUTPUT,
        &probe("probe.0", "rate-hz = 50.0, blob-hz = 50.0", ""),
        &probe("probe.1", "hears = \"probe.0\"", "calls = [\"probe.0\"]"),
        &probe("probe.2", "watches = \"probe.0\"", "calls = [\"probe.0\"]"),
    ];
    let (place, _launch, _robot) = Place::running(&modules);
    place.say(&["call", "probe.1", "say", "info", "a line"]).ok();
    let graph = place.say(&["graph", "--seconds", "0.5", "--silent", "--json"]).json();
    let flows = |to: &str| {
        let edges = graph["edges"].as_array().unwrap().iter().filter(|edge| edge["to"] == to);
        let sent = edges.filter(|edge| edge["carries"] == "data" || edge["carries"] == "output");
        sent.map(|edge| ["from", "carries", "what"].map(|key| edge[key].as_str().unwrap().to_owned()))
            .collect::<Vec<_>>()
    };
    let data = |name: &str| ["probe.0", "data", name].map(str::to_owned);
    assert_eq!(flows("probe.1"), [data("beat")], "its data mailbox, and one of its own");
    assert_eq!(flows("probe.2"), [data("blob")]);
    assert!(flows("output.0").contains(&["probe.1", "output", "lines"].map(str::to_owned)), "{:?}", flows("output.0"));
}

#[test]
fn readers_of_streams_are_in_the_table_and_in_the_drawing() {
    let mapper = "[[module]]\nname = \"mapper.0\"\nbuiltin = \"mapper\"\ncalls = [\"laser.0\", \"odometry.0\"]\n\
                  settings = { laser = \"laser.0\", odometry = \"odometry.0\" }\n";
    let (place, mut launch, robot) = Place::running(&[&simulated(), OUTPUT, mapper]);
    robot.wait_on(&mut launch);
    let edges = wait("the mapper reads what the motor writes", || {
        let graph = place.say(&["graph", "--seconds", "0.5", "--json"]).json();
        let edges = graph["edges"].as_array().unwrap().iter().filter(|edge| edge["carries"] == "stream");
        let edges: Vec<Value> = edges.cloned().collect();
        (edges.len() == 2).then_some(edges)
    });
    let said = |edge: &Value| ["from", "to", "what"].map(|key| edge[key].as_str().unwrap().to_owned());
    assert_eq!(said(&edges[0]), ["motor.0", "mapper.0", "odometry"]);
    assert_eq!(said(&edges[1]), ["motor.0", "mapper.0", "scan"]);
    for edge in &edges {
        assert!(edge["packages"].as_u64().unwrap() > 0 && edge["bytes_per_s"].as_f64().unwrap() > 0.0, "{edge}");
    }
    // Where a stream cannot travel as data, its own command is named; where it can, it is printed.
    until("a picture", || place.say(&["stream", "read", "camera.0", "image"]).code == Some(0));
    for words in [&["echo", "camera.0", "--count", "1"][..], &["call", "camera.0", "get", "image"]] {
        place.say(words).fails_with(["`rohrpost stream read camera.0 image` prints the newest record"]);
    }
    assert!(!place.say(&["log", "--level", "error"]).ok().contains("image"), "nobody was asked for it");
    assert_eq!(place.say(&["echo", "odometry.0", "--count", "1"]).ok().lines().count(), 1);
    place.say(&["graph", "--seconds", "0.5", "--svg"]).ok_with([">scan ", ">odometry "]);
}

#[test]
fn graph_shows_senders_receivers_and_data() {
    let (place, _launch, robot) = Place::running(&[&probe("probe.0", "rate-hz = 50.0", "")]);
    let mut echo = place.start(&["echo", "probe.0", "beat"]);
    let mut send = place.start(&["send", "probe.0", "count", "5", "--rate", "10"]);
    echo.wait_for("\n");
    until("it counts", || !place.counted().is_empty());
    let graph = wait("both are in the graph", || {
        let graph = place.say(&["graph", "--seconds", "0.5", "--json"]).json();
        let kinds = |carries: &str| graph["edges"].as_array().unwrap().iter().any(|edge| edge["carries"] == carries);
        (kinds("data") && kinds("command") && kinds("reply")).then_some(graph)
    });
    let edge = |carries: &str| {
        graph["edges"].as_array().unwrap().iter().find(|edge| edge["carries"] == carries).unwrap().clone()
    };
    let (data, command, reply) = (edge("data"), edge("command"), edge("reply"));
    assert_eq!((&data["from"], &data["what"]), (&"probe.0".into(), &"beat".into()));
    assert_eq!((&command["to"], &command["what"]), (&"probe.0".into(), &"count".into()));
    assert_eq!((&reply["to"], &reply["what"]), (&command["from"], &"count answered".into()));
    let counted = |edge: &Value| edge["packages"].as_u64().unwrap();
    for edge in [&data, &command, &reply] {
        let (packages, per_s) = (counted(edge), edge["packages_per_s"].as_f64().unwrap());
        assert!(packages > 0 && per_s > 0.0 && per_s.is_finite(), "{edge}");
    }
    until("all that it saw are run", || place.counted().len() as u64 >= counted(&command));
    assert!(graph["interval_s"].as_f64().unwrap() >= 0.5, "{graph}");
    let modules: Vec<_> = graph["modules"].as_array().unwrap().iter().map(|module| module["module"].clone()).collect();
    assert_eq!(modules.len(), 3, "{modules:?}");
    let text = place.say(&["graph", "--seconds", "0.5"]).ok();
    assert!(text.starts_with("from ") && text.contains("probe.0"), "{text}");
    let dot = place.say(&["graph", "--seconds", "0.5", "--dot"]).ok();
    assert!(dot.starts_with("digraph rohrpost {\n") && dot.contains("[label = \"beat "), "{dot}");
    assert!(dot.contains("\"probe.0\" [label = \"probe.0\"]") && !dot.contains("answered"), "{dot}");
    assert!(place.say(&["graph", "--seconds", "0.5", "--dot", "--all"]).ok().contains("count answered "));
    assert_eq!(place.say(&["graph", "--seconds", "0.5", "--svg", "-o", "graph.svg"]).ok(), "");
    let svg = std::fs::read_to_string(place.path("graph.svg")).unwrap();
    assert!(svg.starts_with("<svg xmlns=") && svg.ends_with("</svg>\n"), "{svg}");
    assert!(svg.contains(">probe.0</text>") && svg.contains(">beat ") && svg.contains(">count "), "{svg}");
    echo.stop();
    send.stop();
    let early = place.start(&["graph", "--seconds", "3600", "--json"]);
    until("it heeds Ctrl-C", || early.heeds_control_c());
    early.signal(Signal::SIGINT);
    let graph = early.said().json();
    assert!(graph["interval_s"].as_f64().unwrap() < 3600.0, "{graph}");
    for edge in graph["edges"].as_array().unwrap() {
        assert!(edge["packages_per_s"].as_f64().is_some_and(f64::is_finite), "{edge}");
    }
    let told = place.say(&["graph", "--seconds", "0", "--silent"]).fails();
    assert_eq!(told, "in 0 s nothing is sent; try --seconds 2\n");
    let said = place.say(&["graph", "--seconds", "0.1", "-o", "nowhere/graph.txt"]);
    said.fails_with(["name a file in a folder that is there"]);
    // Without any sender, it says so.
    robot.tool(PATIENCE).close();
    let told = place.say(&["graph", "--seconds", "0.1"]).ok();
    let is_told =
        told.starts_with("no package was sent within ") && told.ends_with(" s; --silent shows earlier senders\n");
    assert!(is_told, "it says how long it was really: {told}");
}
