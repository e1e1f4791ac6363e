//! Every tool works for any module on any node, from any node; a silent node is reported, and no tool waits for it.

use crate::harness::{NETWORK, OUTPUT, Place, Robot, halt, probe, signal, wait};
use crate::lan::addresses;
use crate::process::{Running, Said};
use nix::sys::signal::Signal;
use rohrpost_mailbox::FlowInfo;
use serde_json::Value;
use std::time::{Duration, Instant};

/// Of probe.1.
const BEATS_PER_S: f64 = 50.0;

/// Nodes `base`, with the collector and probe.0, and `arm`, with probe.1, which publishes.
struct Two {
    place: Place,
    base: (Running, Robot),
    arm: (Running, Robot),
}

impl Two {
    fn launched() -> Self {
        let place = Place::new();
        let [base, arm] = addresses();
        let nodes = format!(
            "[nodes.base]\naddress = \"{base}\"\ntools = [0, 15]\n[nodes.arm]\naddress = \"{arm}\"\ntools = [16, 31]\n\
             {NETWORK}"
        );
        let modules = [
            format!("{OUTPUT}node = \"base\"\n"),
            probe("probe.0", "hears = \"probe.1\"", "node = \"base\"\ncalls = [\"probe.1\"]"),
            probe("probe.1", &format!("rate-hz = {BEATS_PER_S:.1}"), "node = \"arm\""),
        ];
        let config = place.config_of("test", &nodes, &modules.each_ref().map(String::as_str));
        let start = |node| {
            let mut launch = Running::start(place.command(&["launch", config.to_str().unwrap(), "--node", node]));
            let robot = place.robot(&config, node, &mut launch);
            robot.wait_on(&mut launch);
            (launch, robot)
        };
        let (base, arm) = (start("base"), start("arm"));
        let two = Self { place, base, arm };
        wait("both routers hear each other", || {
            let silent =
                two.say(&["list", "--json"]).json()["nodes"].as_array()?.iter().any(|node| !node["silent"].is_null());
            (!silent).then_some(())
        });
        wait("probe.0 hears probe.1", || {
            let flows = two.base.1.node.traffic();
            flows.iter().any(|flow| is_beat_to(flow, "probe.0", &two.base.1)).then_some(())
        });
        two
    }

    /// Without options: the tool finds its node.
    fn say(&self, arguments: &[&str]) -> Said {
        self.place.say(arguments)
    }

    /// From this node.
    fn say_at(&self, node: &str, arguments: &[&str]) -> Said {
        self.place.say(&[arguments, &["--node", node]].concat())
    }

    fn stop(self) {
        for (mut launch, robot) in [self.base, self.arm] {
            drop(robot);
            launch.stop();
        }
        self.place.assert_empty();
    }
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
    wait(format!("{what}: {is_per_s} a second"), || {
        let per_s = told().as_f64().unwrap_or(0.0);
        println!("{what}: {per_s:.1} a second");
        ((per_s - is_per_s).abs() < is_per_s / 5.0).then_some(())
    });
}

#[test]
fn all_nodes_are_listed_from_each_of_them() {
    let two = Two::launched();
    let text = two.say(&["list"]).ok();
    assert!(text.starts_with("nodes base, arm of test, seen from base\n"), "{text}");
    for node in ["base", "arm"] {
        let json = two.say_at(node, &["list", "--json", "-m"]).json();
        let own: Vec<&str> = json["modules"].as_array().unwrap().iter().map(|m| m["node"].as_str().unwrap()).collect();
        assert!(!own.is_empty() && own.iter().all(|of| *of == node), "{json}");
        assert_eq!((&json["node"], json["nodes"].as_array().unwrap().len()), (&node.into(), 1));
    }
    let json = two.say(&["list", "--json"]).json();
    assert_eq!(json["nodes"].as_array().unwrap().len(), 2);
    for (name, node, robot) in [("probe.0", "base", &two.base.1), ("probe.1", "arm", &two.arm.1)] {
        let line = module(&json, name);
        assert_eq!((&line["node"], &line["state"]), (&node.into(), &"on".into()), "{line}");
        assert_eq!(line["pid"], robot.pid(name));
        let mailbox = format!("1.{name}.0");
        let mailboxes = json["mailboxes"].as_array().unwrap();
        let there: Vec<&Value> = mailboxes.iter().filter(|line| line["mailbox"] == mailbox.as_str()).collect();
        assert_eq!((there.len(), &there[0]["node"]), (1, &node.into()));
    }
    std::fs::write(two.place.path("picture"), "pixels").unwrap();
    two.say_at("arm", &["stream", "write", "probe.1", "7", "picture"]).ok();
    for tool in [&["stream", "list", "--json"][..], &["list", "--json"], &["top", "--json", "--interval", "0.1"]] {
        let json = two.say(tool).json();
        let (streams, wanted) = (&json["streams"], ("arm", "probe.1", 7, 1));
        assert_eq!(streams.as_array().unwrap().len(), 1, "{json}");
        let [node, stream, number, written] = ["node", "stream", "number", "written"].map(|key| &streams[0][key]);
        assert!(node == wanted.0 && stream == wanted.1 && *number == wanted.2 && *written == wanted.3, "{streams}");
    }
    for tool in [&["stream", "list"][..], &["list", "--streams"]] {
        let text = two.say(tool).ok();
        assert!(text.contains("\narm   probe.1  -          7  64 x 1024 B   0 of 8  nobody"), "{text}");
    }
    assert_eq!(two.say_at("base", &["stream", "list"]).ok(), "node base of test has no streams\n");
    let once = two.say(&["top", "--once", "--interval", "0.2"]).ok();
    assert!(once.starts_with("test: 2 nodes ") && once.contains("probe.1   arm "), "{once}");
    // It receives each beat twice, in two mailboxes. If they were counted again at delivery, there would be more.
    wait_rate("sent to probe.0, counted once, where it is sent", 2.0 * BEATS_PER_S, || {
        let top = two.say(&["top", "--json", "--interval", "0.5"]).json();
        let far = module(&top, "probe.1");
        let told = (far["cpu_percent"].is_number(), far["memory_bytes"].as_u64() > Some(0));
        assert_eq!(told, (true, true), "launch asked its kernel: {far}");
        assert!(far["uptime_s"].as_f64() < Some(600.0), "{far}");
        let to = far["sends_to"].as_array().unwrap().iter().find(|peer| peer["module"] == "probe.0").cloned();
        to.unwrap_or_default()["packages_per_s"].clone()
    });
    assert_eq!(two.say(&["status", "--json"]).json().as_array().unwrap().len(), 5, "with both routers");
    two.stop();
}

#[test]
fn figures_of_another_node_are_as_those_of_ones_own() {
    let two = Two::launched();
    for node in ["base", "arm"] {
        let line = |arguments: &[&str], number: usize| -> Value {
            let said = two.say_at(node, &[arguments, &["--count", "1", "--json"]].concat()).ok();
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
        wait(format!("probe.0 has received many, from {node}"), || {
            let delay = line(&["delay", "probe.1"], 0);
            let waits = delay["waits"].as_array().unwrap();
            let far = waits.iter().find(|wait| wait["mailbox"] == "1.probe.0.2").unwrap();
            assert_eq!(far["subscriber"], true, "from {node}: {far}");
            (far["received"].as_u64() > Some(10)).then_some(())
        });
    }
    let mut graph = Value::Null;
    wait_rate("an edge of the graph", 2.0 * BEATS_PER_S, || {
        graph = two.say(&["graph", "--seconds", "1", "--json"]).json();
        let edges = graph["edges"].as_array().unwrap();
        let beats: Vec<&Value> =
            edges.iter().filter(|edge| edge["what"] == "beat" && edge["carries"] == "data").collect();
        let ends = beats.iter().map(|edge| (&edge["from"], &edge["to"])).collect::<Vec<_>>();
        assert_eq!(ends, [(&"probe.1".into(), &"probe.0".into())], "{graph}");
        beats[0]["packages_per_s"].clone()
    });
    assert_eq!(module(&graph, "probe.1")["node"], "arm");
    wait("something of the arm is drawn", || {
        two.say(&["graph", "--seconds", "0.2", "--svg"]).ok().contains("on arm").then_some(())
    });
    two.stop();
}

#[test]
fn modules_of_another_node_are_asked_and_controlled_as_ones_own() {
    let two = Two::launched();
    for (node, count) in [("base", 1), ("arm", 5)] {
        let called = two.say_at(node, &["call", "probe.1", "count", "7"]).ok();
        assert_eq!(called, format!("{count}\n"));
        assert_eq!(two.say_at(node, &["echo", "probe.1", "beat", "--count", "2"]).ok().lines().count(), 2);
        let sent = two.say_at(node, &["send", "probe.1", "count_again", "1", "--count", "3", "--rate", "50"]).ok();
        assert!(sent.starts_with("3 sent, 3 answered"), "what a busy computer left out is told, too: {sent}");
        let ping = two.say_at(node, &["ping", "probe.1", "-c", "2", "--interval", "0", "--json"]).ok();
        let ping: Value = serde_json::from_str(ping.lines().last().unwrap()).unwrap();
        assert_eq!(ping["answered"], 2);
        let seen = two.say_at(node, &["mailbox", "probe.1", "--json"]).json();
        assert_eq!((&seen["node"], &seen["receiver"]["pid"]), (&"arm".into(), &two.arm.1.pid("probe.1").into()));
        assert!(
            two.say_at(node, &["mailbox", "probe.1.9"]).fails().contains("probe.1 has no mailbox `probe.1.9`; it has")
        );
    }
    // The collector on `base` has the lines of a module on `arm`.
    let line = |from: &str| {
        let log = two.say_at(from, &["log", "--module", "probe.1"]).out;
        log.lines().any(|line| line.contains("arm/probe.1: far away")).then_some(())
    };
    two.say(&["call", "probe.1", "say", "info", "far away"]).ok();
    wait("the line is there", || line("base"));
    wait("and is read from the other node", || line("arm"));
    let level = two.say(&["log", "--level", "probe.1=debug"]).ok();
    assert_eq!(level, "probe.1: debug, was info\n");

    let old = two.arm.1.pid("probe.1");
    let said = two.say_at("base", &["restart", "probe.1"]).ok();
    assert!(said.starts_with("probe.1 runs and is on after ") && said.contains(&format!("previously process {old}")));
    assert!(two.say_at("base", &["stop", "probe.1"]).ok().starts_with("probe.1 is stopped"));
    let told = two.say_at("base", &["call", "probe.1", "count", "1"]).fails();
    assert!(told.contains("probe.1 does not run on node arm"), "{told}");
    let told = two.say_at("base", &["hz", "probe.1"]).fails();
    assert!(told.contains("probe.1"), "{told}");
    let told = two.say_at("base", &["bw", "probe.1"]).fails();
    assert!(told.contains("probe.1 does not run on node arm; `rohrpost start probe.1` starts it"), "{told}");
    assert!(two.say_at("base", &["start", "probe.1"]).ok().starts_with("probe.1 runs and is on"));
    two.stop();
}

#[test]
fn time_tells_of_all_nodes_and_how_far_off_each_may_be() {
    let two = Two::launched();
    let told = wait("all nodes follow one master", || {
        let said = two.say(&["time", "--json"]);
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

    let text = two.say(&["time"]).ok();
    for words in ["node", "bound", "base", "arm", "master", "slave", "µs"] {
        assert!(text.contains(words), "no `{words}` in:\n{text}");
    }
    let only = two.say_at("arm", &["time", "--json"]).json();
    assert_eq!((only["nodes"].as_array().unwrap().len(), &only["nodes"][0]["node"]), (1, &"arm".into()));
    two.stop();
}

#[test]
fn a_silent_node_is_told_and_nobody_waits_for_it() {
    let two = Two::launched();
    let launch = two.arm.0.pid();
    let router = two.arm.1.pid("router.1");
    halt(launch);
    let began = Instant::now();
    // Its router still runs: only launch is asked in vain, and only briefly.
    let list = two.say(&["list"]).ok();
    assert!(list.contains("node arm is silent: no answer within 1s"), "{list}");
    assert!(began.elapsed() < Duration::from_secs(20), "{:?}", began.elapsed());
    halt(router);
    let silent = wait("base's router has found out", || {
        let list = two.say(&["list", "--json"]).json();
        let arm = list["nodes"].as_array().unwrap().iter().find(|node| node["node"] == "arm").unwrap().clone();
        arm["silent"].as_str().is_some_and(|why| why.contains("no datagrams come from it")).then_some(list)
    });
    let far = module(&silent, "probe.1");
    assert_eq!((&far["state"], &far["node"], &far["pid"]), (&"unreachable".into(), &"arm".into(), &Value::Null));
    // It reports so twice a second.
    wait("its router knows since when", || two.say(&["list"]).ok().contains("node arm is silent since ").then_some(()));
    let once = two.say(&["top", "--once", "--interval", "0.1"]).ok();
    assert!(once.contains("arm SILENT") && once.contains("unreachable"), "{once}");
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
        let told = two.say(arguments).fails();
        assert!(told.contains("node arm is silent"), "{arguments:?}: {told}");
        assert!(began.elapsed() < Duration::from_secs(20), "{arguments:?}: {:?}", began.elapsed());
    }
    let status = two.say(&["status"]);
    assert!(status.code == Some(1) && status.out.contains("node arm is silent"), "{status:?}");
    let graph = two.say(&["graph", "--seconds", "0.3"]).ok();
    assert!(graph.contains("node arm is silent"), "{graph}");
    signal(router, Signal::SIGCONT);
    signal(launch, Signal::SIGCONT);
    wait("it is heard again", || (!two.say(&["list"]).ok().contains("silent")).then_some(()));
    two.stop();
}
