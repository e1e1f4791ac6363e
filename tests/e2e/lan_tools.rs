//! Every tool works for any module on any node, from any node; a silent node is reported, and no tool waits for it.

use crate::harness::{OUTPUT, Place, Robot, assert_has, halt, probe, signal, until, wait};
use crate::network::{NETWORK, Network, addresses, at, nodes};
use crate::process::Said;
use nix::sys::signal::Signal;
use rohrpost_mailbox::FlowInfo;
use serde_json::Value;
use std::time::{Duration, Instant};

/// Of probe.1.
const BEATS_PER_S: f64 = 50.0;

/// Nodes `base`, with the collector and probe.0, and `arm`, with probe.1, which publishes.
fn launched() -> Network {
    let place = Place::new();
    let [base, arm] = addresses();
    let modules = [
        at("base", OUTPUT),
        probe("probe.0", "hears = \"probe.1\"", "node = \"base\"\ncalls = [\"probe.1\"]"),
        probe("probe.1", &format!("rate-hz = {BEATS_PER_S:.1}"), "node = \"arm\""),
    ];
    let nodes = nodes([("base", &base), ("arm", &arm)]) + NETWORK;
    let config = place.config_of("test", &nodes, &modules.each_ref().map(String::as_str));
    let two = Network::new(place, config, None).launched(&["base", "arm"]);
    until("both routers hear each other", || {
        let told = two.place.say(&["list", "--json"]).json();
        told["nodes"].as_array().is_some_and(|nodes| nodes.iter().all(|node| node["silent"].is_null()))
    });
    until("probe.0 hears probe.1", || {
        let base = two.robot("base");
        base.node.traffic().iter().any(|flow| is_beat_to(flow, "probe.0", base))
    });
    two
}

/// From this node.
fn say_at(two: &Network, node: &str, arguments: &[&str]) -> Said {
    two.place.say(&[arguments, &["--node", node]].concat())
}

/// Whether these are data for this module.
fn is_beat_to(flow: &FlowInfo, module: &str, robot: &Robot) -> bool {
    flow.to.module() == robot.name(module) && flow.kind.0 < 0 && flow.to.local() >= 2
}

fn module<'a>(json: &'a Value, name: &str) -> &'a Value {
    json["modules"].as_array().unwrap().iter().find(|module| module["module"] == name).unwrap()
}

/// Waits until a rate is told as it is, to a fifth: while the computer is busy there are others for a moment.
fn wait_rate(what: &str, is_per_s: f64, mut told: impl FnMut() -> Value) {
    until(format!("{what}: {is_per_s} a second"), || {
        let per_s = told().as_f64().unwrap_or(0.0);
        println!("{what}: {per_s:.1} a second");
        (per_s - is_per_s).abs() < is_per_s / 5.0
    });
}

#[test]
fn all_nodes_are_listed_from_each_of_them() {
    let two = launched();
    let text = two.place.say(&["list"]).ok();
    assert!(text.starts_with("nodes base, arm of test, seen from base\n"), "{text}");
    for node in ["base", "arm"] {
        let json = say_at(&two, node, &["list", "--json", "-m"]).json();
        let own: Vec<&str> = json["modules"].as_array().unwrap().iter().map(|m| m["node"].as_str().unwrap()).collect();
        assert!(!own.is_empty() && own.iter().all(|of| *of == node), "{json}");
        assert_eq!((&json["node"], json["nodes"].as_array().unwrap().len()), (&node.into(), 1));
    }
    let json = two.place.say(&["list", "--json"]).json();
    assert_eq!(json["nodes"].as_array().unwrap().len(), 2);
    for (name, node, robot) in [("probe.0", "base", two.robot("base")), ("probe.1", "arm", two.robot("arm"))] {
        let line = module(&json, name);
        assert_eq!((&line["node"], &line["state"]), (&node.into(), &"on".into()), "{line}");
        assert_eq!(line["pid"], robot.pid(name));
        let mailbox = format!("1.{name}.0");
        let mailboxes = json["mailboxes"].as_array().unwrap();
        let there: Vec<&Value> = mailboxes.iter().filter(|line| line["mailbox"] == mailbox.as_str()).collect();
        assert_eq!((there.len(), &there[0]["node"]), (1, &node.into()));
    }
    two.place.write("picture", "pixels");
    say_at(&two, "arm", &["stream", "write", "probe.1", "7", "picture"]).ok();
    for tool in [&["stream", "list", "--json"][..], &["list", "--json"], &["top", "--json", "--interval", "0.1"]] {
        let json = two.place.say(tool).json();
        let (streams, wanted) = (&json["streams"], ("arm", "probe.1", 7, 1));
        assert_eq!(streams.as_array().unwrap().len(), 1, "{json}");
        let [node, stream, number, written] = ["node", "stream", "number", "written"].map(|key| &streams[0][key]);
        assert!(node == wanted.0 && stream == wanted.1 && *number == wanted.2 && *written == wanted.3, "{streams}");
    }
    for tool in [&["stream", "list"][..], &["list", "--streams"]] {
        two.place.say(tool).ok_with(["\narm   probe.1  -          7  64 x 1024 B   0 of 8  nobody"]);
    }
    assert_eq!(say_at(&two, "base", &["stream", "list"]).ok(), "node base of test has no streams\n");
    let once = two.place.say(&["top", "--once", "--interval", "0.2"]).ok();
    assert!(once.starts_with("test: 2 nodes ") && once.contains("probe.1   arm "), "{once}");
    // It receives each beat twice, in two mailboxes. If they were counted again at delivery, there would be more.
    wait_rate("sent to probe.0, counted once, where it is sent", 2.0 * BEATS_PER_S, || {
        let top = two.place.say(&["top", "--json", "--interval", "0.5"]).json();
        let far = module(&top, "probe.1");
        let told = (far["cpu_percent"].is_number(), far["memory_bytes"].as_u64() > Some(0));
        assert_eq!(told, (true, true), "launch asked its kernel: {far}");
        assert!(far["uptime_s"].as_f64() < Some(600.0), "{far}");
        let to = far["sends_to"].as_array().unwrap().iter().find(|peer| peer["module"] == "probe.0").cloned();
        to.unwrap_or_default()["packages_per_s"].clone()
    });
    assert_eq!(two.place.say(&["status", "--json"]).json().as_array().unwrap().len(), 5, "with both routers");
    two.stop();
}

#[test]
fn figures_of_another_node_are_as_those_of_ones_own() {
    let two = launched();
    for node in ["base", "arm"] {
        let line = |arguments: &[&str], number: usize| -> Value {
            let said = say_at(&two, node, &[arguments, &["--count", "1", "--json"]].concat()).ok();
            serde_json::from_str(said.lines().nth(number).unwrap()).unwrap()
        };
        wait_rate(&format!("published, from {node}"), BEATS_PER_S, || {
            line(&["hz", "probe.1", "beat", "--seconds", "1.5"], 0)["values_per_s"].clone()
        });
        // Each beat comes to two mailboxes.
        wait_rate(&format!("into probe.0, each delivery once, from {node}"), 2.0 * BEATS_PER_S, || {
            line(&["bw", "probe.0"], 0)["packages_per_s"].clone()
        });
        wait_rate(&format!("out of probe.1, each sent once, from {node}"), 2.0 * BEATS_PER_S, || {
            line(&["bw", "probe.1"], 1)["packages_per_s"].clone()
        });
        until(format!("probe.0 has received many, from {node}"), || {
            let delay = line(&["delay", "probe.1"], 0);
            let waits = delay["waits"].as_array().unwrap();
            let far = waits.iter().find(|wait| wait["mailbox"] == "1.probe.0.2").unwrap();
            assert_eq!(far["subscriber"], true, "from {node}: {far}");
            far["received"].as_u64() > Some(10)
        });
    }
    let mut graph = Value::Null;
    wait_rate("an edge of the graph", 2.0 * BEATS_PER_S, || {
        graph = two.place.say(&["graph", "--seconds", "1", "--json"]).json();
        let edges = graph["edges"].as_array().unwrap();
        let beats: Vec<&Value> =
            edges.iter().filter(|edge| edge["what"] == "beat" && edge["carries"] == "data").collect();
        let ends = beats.iter().map(|edge| (&edge["from"], &edge["to"])).collect::<Vec<_>>();
        assert_eq!(ends, [(&"probe.1".into(), &"probe.0".into())], "{graph}");
        beats[0]["packages_per_s"].clone()
    });
    assert_eq!(module(&graph, "probe.1")["node"], "arm");
    until("something of the arm is drawn", || {
        two.place.say(&["graph", "--seconds", "0.2", "--svg"]).ok().contains("on arm")
    });
    two.stop();
}

#[test]
fn modules_of_another_node_are_asked_and_controlled_as_ones_own() {
    let two = launched();
    for (node, count) in [("base", 1), ("arm", 5)] {
        let called = say_at(&two, node, &["call", "probe.1", "count", "7"]).ok();
        assert_eq!(called, format!("{count}\n"));
        assert_eq!(say_at(&two, node, &["echo", "probe.1", "beat", "--count", "2"]).ok().lines().count(), 2);
        let sent = say_at(&two, node, &["send", "probe.1", "count_again", "1", "--count", "3", "--rate", "50"]).ok();
        assert!(sent.starts_with("3 sent, 3 answered"), "what a busy computer left out is told, too: {sent}");
        let ping = say_at(&two, node, &["ping", "probe.1", "-c", "2", "--interval", "0", "--json"]).ok();
        let ping: Value = serde_json::from_str(ping.lines().last().unwrap()).unwrap();
        assert_eq!(ping["answered"], 2);
        let seen = say_at(&two, node, &["mailbox", "probe.1", "--json"]).json();
        assert_eq!((&seen["node"], &seen["receiver"]["pid"]), (&"arm".into(), &two.robot("arm").pid("probe.1").into()));
        assert!(
            say_at(&two, node, &["mailbox", "probe.1.9"])
                .fails()
                .contains("probe.1 has no mailbox `probe.1.9`; it has")
        );
    }
    // The collector on `base` has the lines of a module on `arm`.
    let line = |from: &str| {
        let log = say_at(&two, from, &["log", "--module", "probe.1"]).out;
        log.lines().any(|line| line.contains("arm/probe.1: far away")).then_some(())
    };
    two.place.say(&["call", "probe.1", "say", "info", "far away"]).ok();
    wait("the line is there", || line("base"));
    wait("and is read from the other node", || line("arm"));
    let level = two.place.say(&["log", "--level", "probe.1=debug"]).ok();
    assert_eq!(level, "probe.1: debug, was info\n");

    let old = two.robot("arm").pid("probe.1");
    let said = say_at(&two, "base", &["restart", "probe.1"]).ok();
    assert!(said.starts_with("probe.1 runs and is on after ") && said.contains(&format!("previously process {old}")));
    assert!(say_at(&two, "base", &["stop", "probe.1"]).ok().starts_with("probe.1 is stopped"));
    say_at(&two, "base", &["call", "probe.1", "count", "1"]).fails_with(["probe.1 does not run on node arm"]);
    say_at(&two, "base", &["hz", "probe.1"]).fails_with(["probe.1"]);
    say_at(&two, "base", &["bw", "probe.1"])
        .fails_with(["probe.1 does not run on node arm; `rohrpost start probe.1` starts it"]);
    assert!(say_at(&two, "base", &["start", "probe.1"]).ok().starts_with("probe.1 runs and is on"));
    two.stop();
}

#[test]
fn time_tells_of_all_nodes_and_how_far_off_each_may_be() {
    let two = launched();
    let told = wait("all nodes follow one master", || {
        let said = two.place.say(&["time", "--json"]);
        (said.code == Some(0)).then(|| said.json())
    });
    assert_eq!(told["agree"], true, "{told}");
    let nodes = told["nodes"].as_array().unwrap();
    let of = |field: &str| nodes.iter().map(|node| node["clock"][field].clone()).collect::<Vec<Value>>();
    assert_eq!((nodes.len(), of("node")), (2, vec!["base".into(), "arm".into()]), "{told}");
    let mut roles = of("role");
    roles.sort_by_key(Value::to_string);
    assert_eq!(roles, ["master", "slave"], "{told}");
    for node in nodes {
        let clock = &node["clock"];
        // Two processes of one computer, which may be busy.
        let (bound_ns, off_ns) = (clock["error_ns"].as_u64().unwrap(), clock["offset_ns"].as_i64().unwrap());
        assert!(bound_ns < 1_000_000_000, "{node}");
        if clock["role"] == "master" {
            assert_eq!(
                (&clock["master"], bound_ns, off_ns),
                (&clock["node"], 0, 0),
                "it is right by definition: {node}"
            );
        } else {
            assert!(
                bound_ns > 0 && clock["round_trip_ns"].as_u64() > Some(0),
                "the way there and back takes time: {node}"
            );
        }
        assert!(node["ago_ns"].is_i64() && node["failure"].is_null(), "{node}");
    }
    assert_eq!((of("master")[0].clone(), of("term")[0].clone()), (of("master")[1].clone(), of("term")[1].clone()));

    let text = two.place.say(&["time"]).ok();
    assert_has(&text, ["node", "bound", "base", "arm", "master", "slave", "µs"]);
    let only = say_at(&two, "arm", &["time", "--json"]).json();
    assert_eq!((only["nodes"].as_array().unwrap().len(), &only["nodes"][0]["node"]), (1, &"arm".into()));
    two.stop();
}

#[test]
fn a_silent_node_is_told_and_nobody_waits_for_it() {
    let two = launched();
    let launch = two.launcher("arm").pid();
    let router = two.robot("arm").pid("router.1");
    halt(launch);
    let began = Instant::now();
    // Its router still runs: only launch is asked in vain, and only briefly.
    two.place.say(&["list"]).ok_with(["node arm is silent: no answer within 1s"]);
    assert!(began.elapsed() < Duration::from_secs(20), "{:?}", began.elapsed());
    halt(router);
    let silent = wait("base's router has found out", || {
        let list = two.place.say(&["list", "--json"]).json();
        let arm = list["nodes"].as_array().unwrap().iter().find(|node| node["node"] == "arm").unwrap().clone();
        arm["silent"].as_str().is_some_and(|why| why.contains("no datagrams come from it")).then_some(list)
    });
    let far = module(&silent, "probe.1");
    assert_eq!((&far["state"], &far["node"], &far["pid"]), (&"unreachable".into(), &"arm".into(), &Value::Null));
    // It reports so twice a second.
    until("its router knows since when", || two.place.say(&["list"]).ok().contains("node arm is silent since "));
    two.place.say(&["top", "--once", "--interval", "0.1"]).ok_with(["arm SILENT", "unreachable"]);
    for arguments in [
        &["call", "probe.1", "count", "1"][..],
        &["hz", "probe.1"],
        &["bw", "probe.1"],
        &["delay", "probe.1"],
        &["mailbox", "probe.1"],
        &["restart", "probe.1"],
        &["echo", "probe.1", "beat"],
        &["send", "probe.1", "count", "1", "--count", "1"],
        &["ping", "probe.1", "-c", "1"],
        &["param", "get", "probe.1"],
    ] {
        let began = Instant::now();
        two.place.say(arguments).fails_with(["node arm is silent"]);
        assert!(began.elapsed() < Duration::from_secs(20), "{arguments:?}: {:?}", began.elapsed());
    }
    let status = two.place.say(&["status"]);
    assert!(status.code == Some(1) && status.out.contains("node arm is silent"), "{status:?}");
    two.place.say(&["graph", "--seconds", "0.3"]).ok_with(["node arm is silent"]);
    signal(router, Signal::SIGCONT);
    signal(launch, Signal::SIGCONT);
    until("it is heard again", || !two.place.say(&["list"]).ok().contains("silent"));
    two.stop();
}
