//! The tools that measure, against a source that keeps its own record; and that looking changes nothing.

use crate::harness::{PATIENCE, Place, Robot, halt, probe, signal, wait};
use crate::probe::ProbingInterface;
use crate::process::Running;
use nix::sys::signal::Signal;
use rohrpost::common::{SUBSCRIBE, Subscribe};
use rohrpost::macro_support::append;
use rohrpost::mailbox::{Receiver, local, monotonic_ns};
use serde_json::Value;
use std::time::Duration;

/// Lines that are whole, as JSON.
fn lines(tool: &Running) -> Vec<Value> {
    let out = tool.out();
    let whole = out.rsplit_once('\n').map_or("", |(whole, _)| whole);
    whole.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn last(tool: &Running, holds: impl Fn(&Value) -> bool) -> Option<Value> {
    lines(tool).into_iter().rev().find(holds)
}

/// Within one in a hundred of what the source knows, which itself is known between two bounds.
#[track_caller]
fn agrees(what: &str, figure: &Value, (low, high): (f64, f64)) {
    let figure = figure.as_f64().unwrap_or_else(|| panic!("{what}: {figure}"));
    assert!(
        low * 0.99 <= figure && figure <= high * 1.01,
        "{what}: the tool says {figure}, the source {low} to {high}"
    );
}

/// A value that the source published: between which moments, ns, and how many bytes.
struct Published {
    before: f64,
    after: f64,
    second: u64,
    bytes: u64,
}

fn published(place: &Place) -> Vec<Published> {
    let text = std::fs::read_to_string(place.path("published")).unwrap_or_default();
    let line = |line: &str| {
        let numbers: Vec<u64> = line.split(' ').map(|number| number.parse().unwrap()).collect();
        let [before, after, bytes] = numbers[..] else { panic!("{line}") };
        Published { before: before as f64, after: after as f64, second: after / 1_000_000_000, bytes }
    };
    text.lines().map(line).collect()
}

/// A package as a receiver saw it: bounds of how long it waited, ns, and its bytes.
struct Taken {
    waited: (u64, u64),
    bytes: u64,
}

/// Takes what comes, slowly, so that packages wait for times that are long beside the measuring of them.
fn take_slowly(data: &mut Receiver, taken: &mut Vec<Taken>) {
    loop {
        let before = monotonic_ns();
        let Some(package) = data.try_receive() else { break };
        let after = monotonic_ns();
        let waited = (before.saturating_sub(package.published_ns()), after.saturating_sub(package.published_ns()));
        taken.push(Taken { waited, bytes: package.body().len() as u64 });
    }
    std::thread::sleep(Duration::from_millis(20));
}

#[test]
fn figures_agree_with_a_known_source() {
    let place = Place::new();
    let (_launch, robot) = place.launched(&[&probe("probe.0", "blob-hz = 150.0", "start = \"off\"")]);
    let mut tool = robot.tool(PATIENCE);
    let wish = Subscribe { number: 3, id: 1, period_us: 0, lease_ms: 600_000, mailbox: local::DATA };
    tool.data().unwrap();
    let write = |body: &mut Vec<u8>| append(body, &wish);
    wait("probe.0 is ready", || (robot.state("probe.0") == "off").then_some(()));
    tool.call(robot.name("probe.0"), SUBSCRIBE, ProbingInterface::hash(), write, |_| Ok(())).unwrap();
    let me = robot.installation.classes.format(tool.link.me());
    let start =
        |arguments: &[&str]| Running::start(place.command(&[arguments, &["--json", "--window", "1000"]].concat()));
    let hz = start(&["hz", "probe.0", "blob"]);
    let bw = start(&["bw", "probe.0", "blob"]);
    let bw_in = start(&["bw", &me]);
    let delay = start(&["delay", "probe.0"]);
    let mut tools = [hz, bw, bw_in, delay];
    for tool in &mut tools {
        wait("its first line, before anything is published", || {
            tool.assert_runs();
            (!lines(tool).is_empty()).then_some(())
        });
    }
    place.say(&["call", "probe.0", "on"]).ok();
    let mut taken = Vec::new();
    wait("500 values", || {
        take_slowly(tool.data().unwrap(), &mut taken);
        (taken.len() >= 500).then_some(())
    });
    place.say(&["call", "probe.0", "off"]).ok();
    let source = published(&place);
    wait("all values", || {
        take_slowly(tool.data().unwrap(), &mut taken);
        (taken.len() >= source.len()).then_some(())
    });
    let all = source.len() as u64;
    assert_eq!(taken.len(), source.len());

    let [hz, bw, bw_in, delay] = &tools;
    let (first, end) = (&source[0], &source[source.len() - 1]);
    let intervals = || source.windows(2).map(|pair| (pair[1].before - pair[0].after, pair[1].after - pair[0].before));
    let count = (all - 1) as f64;
    let long = ((end.before - first.after) / 1e9, (end.after - first.before) / 1e9);

    let line = wait("hz has counted all", || last(hz, |line| line["values"] == all));
    // The source has stopped by now, and the rate goes down with each line; what it was is in the intervals.
    let silent_s = |line: &Value| line["silent_s"].as_f64().unwrap_or(0.0);
    let until = silent_s(&line);
    agrees("rate", &line["values_per_s"], (count / (long.1 + until), count / (long.0 + until)));
    agrees("mean interval", &line["interval_mean_s"], (long.0 / count, long.1 / count));
    let least = |of: fn((f64, f64)) -> f64| intervals().map(of).fold(f64::MAX, f64::min) / 1e9;
    let most = |of: fn((f64, f64)) -> f64| intervals().map(of).fold(0.0, f64::max) / 1e9;
    agrees("shortest interval", &line["interval_min_s"], (least(|i| i.0), least(|i| i.1)));
    agrees("longest interval", &line["interval_max_s"], (most(|i| i.0), most(|i| i.1)));
    // Distances from the mean, each as small and as large as it can have been.
    let mean = (long.0 + long.1) / 2.0 / count * 1e9;
    let off = |interval: (f64, f64)| {
        let ends = ((interval.0 - mean).abs(), (interval.1 - mean).abs());
        let inside = interval.0 <= mean && mean <= interval.1;
        (if inside { 0.0 } else { ends.0.min(ends.1) }, ends.0.max(ends.1))
    };
    let std = |of: fn((f64, f64)) -> f64| {
        (intervals().map(|interval| of(off(interval)).powi(2)).sum::<f64>() / count).sqrt() / 1e9
    };
    let blur = (long.1 - long.0) / count;
    agrees("standard deviation", &line["interval_std_s"], (std(|o| o.0) - blur, std(|o| o.1) + blur));

    let line = wait("bw has counted all", || last(bw, |line| line["packages"] == all));
    let bytes: u64 = source.iter().map(|value| value.bytes).sum();
    assert_eq!(line["bytes"], bytes);
    let until = silent_s(&line);
    let per_s = |seconds: f64| bytes as f64 / all as f64 * count / (seconds + until);
    agrees("bytes a second", &line["bytes_per_s"], (per_s(long.1), per_s(long.0)));
    assert_eq!(line["bytes_mean"], bytes as f64 / all as f64);
    assert_eq!((&line["bytes_min"], &line["bytes_max"]), (&11.into(), &101.into()));
    assert!(source.iter().map(|value| value.second).max().unwrap() > first.second, "more than a second of it");

    let line = wait("bw has counted what came in", || {
        last(bw_in, |line| line["direction"] == "in" && line["packages"] == all)
    });
    assert_eq!(line["bytes"], taken.iter().map(|taken| taken.bytes).sum::<u64>());
    assert_eq!((&line["bytes_min"], &line["bytes_max"]), (&(11 + 16).into(), &(101 + 16).into()));

    let row = wait("delay has counted all", || {
        let line = last(delay, |_| true)?;
        line["waits"]
            .as_array()
            .unwrap()
            .iter()
            .find(|row| row["subscriber"] == true && row["received"] == all)
            .cloned()
    });
    let mean = |of: fn(&Taken) -> u64| taken.iter().map(|taken| of(taken) as f64).sum::<f64>() / all as f64 / 1e9;
    agrees("mean wait", &row["waited_mean_s"], (mean(|taken| taken.waited.0), mean(|taken| taken.waited.1)));
    let longest = |of: fn(&Taken) -> u64| taken.iter().map(of).max().unwrap() as f64 / 1e9;
    agrees(
        "longest wait",
        &row["waited_max_ever_s"],
        (longest(|taken| taken.waited.0), longest(|taken| taken.waited.1)),
    );
    // The histogram has two buckets to the octave.
    let mut waits: Vec<u64> = taken.iter().map(|taken| taken.waited.0).collect();
    waits.sort_unstable();
    for (figure, share) in [("waited_p50_s", 0.5), ("waited_p99_s", 0.99)] {
        let known = waits[(share * count) as usize] as f64 / 1e9;
        let told = row[figure].as_f64().unwrap();
        assert!((0.6..1.6).contains(&(told / known)), "{figure}: {told}, known {known}");
    }
    for tool in &mut tools {
        tool.stop();
        assert_eq!(tool.err(), "");
    }
    tool.close();
}

/// Everything that is counted on a node, as text.
fn all_counts(robot: &Robot) -> String {
    let node = &robot.node;
    let mailboxes: Vec<_> = node.mailboxes().unwrap().into_iter().map(|name| node.look_at(name).unwrap()).collect();
    let sent: Vec<_> = node.traffic().into_iter().filter(|flow| !flow.is_publication()).collect();
    format!("{mailboxes:#?}\n{sent:#?}\n{:#?}", node.participants())
}

/// Fails with the lines that differ.
#[track_caller]
fn assert_same(now: &str, before: &str) {
    let differ = |pair: &(&str, &str)| pair.0 != pair.1;
    let differing: Vec<_> = before.lines().zip(now.lines()).filter(differ).collect();
    assert!(before.len() == now.len() && differing.is_empty(), "{differing:#?}");
}

#[test]
fn looking_changes_nothing() {
    let place = Place::new();
    let (_launch, robot) =
        place.launched(&[&probe("probe.0", "rate-hz = 100.0", ""), &probe("probe.1", "rate-hz = 30.0", "")]);
    let incarnation = || {
        let tool = robot.tool(PATIENCE);
        let incarnation = tool.link.participant().incarnation();
        tool.close();
        incarnation
    };
    place.say(&["call", "probe.0", "count", "1"]).ok();
    let (before, life) = (all_counts(&robot), incarnation());
    // Who has come and gone again has left nothing.
    assert_same(&all_counts(&robot), &before);
    let watching: Vec<Running> = [
        &["hz", "probe.0", "--count", "2"][..],
        &["hz", "probe.1", "beat", "--count", "2"],
        &["bw", "probe.0", "--count", "2"],
        &["bw", "probe.0", "beat", "--count", "2"],
        &["delay", "probe.0", "--count", "2"],
        &["graph", "--seconds", "1"],
        &["graph", "--seconds", "0.1", "--all", "--silent", "--json"],
        &["graph", "--seconds", "0.1", "--dot"],
        &["graph", "--seconds", "0.1", "--svg"],
        &["top", "--json", "--interval", "0.5"],
        &["top", "--once", "--interval", "0.5"],
    ]
    .into_iter()
    .map(|arguments| Running::start(place.command(arguments)))
    .collect();
    for tool in watching {
        tool.said().ok();
    }
    // Packages, losses, waits, flows, participants.
    assert_same(&all_counts(&robot), &before);
    // The first tool's calls have one as well.
    assert_eq!(incarnation(), life + 2, "nobody joined meanwhile");
    let status = place.say(&["status", "--json"]).json();
    assert_eq!((&status[0]["subscribers"], &status[1]["subscribers"]), (&0.into(), &0.into()));
}

#[test]
fn hz_tells_what_is_silent_and_what_does_not_exist() {
    let place = Place::new();
    let (mut launch, robot) =
        place.launched(&[&probe("probe.0", "rate-hz = 50.0", "restart = { policy = \"never\" }")]);
    let text = place.say(&["hz", "probe.0", "--count", "1"]).ok();
    let [beat, silence, blob] = text.lines().collect::<Vec<_>>()[..] else { panic!("{text}") };
    assert!(beat.starts_with("beat     ") && beat.contains(" Hz  mean ") && beat.ends_with(" values"), "{text}");
    assert!(silence.contains("never published; `rohrpost status` tells"), "{text}");
    assert!(blob.starts_with("blob     "), "{text}");
    for (arguments, error) in [
        (&["hz", "probe.0", "bleat"][..], "probe.0 has no data `bleat`; it has: beat, silence, blob\n"),
        (&["hz", "probe.7"], "the configuration has no module `probe.7`; there are probe.0\n"),
        (&["bw", "probe.7"], "the configuration has no module `probe.7`; there are probe.0\n"),
        (&["delay", "probe.7"], "the configuration has no module `probe.7`; there are probe.0\n"),
        (&["hz", "probe.0", "--window", "0"], "a window of 0 s holds nothing; try --window 1\n"),
    ] {
        assert_eq!(place.say(arguments).fails(), error);
    }
    // What has stopped is not called slow.
    halt(robot.pid("probe.0"));
    let text = place.say(&["hz", "probe.0", "beat", "--seconds", "0.3"]).ok();
    assert!(text.contains("nothing new in this window; the last came "), "{text}");
    let mut hz = Running::start(place.command(&["hz", "probe.0", "beat"]));
    hz.wait_for("nothing new");
    signal(robot.pid("probe.0"), Signal::SIGKILL);
    launch.wait_for("probe.0");
    hz.wait_for("never published");
    hz.stop();
}

#[test]
fn what_stops_is_silent_and_no_longer_as_quick_as_it_was() {
    let place = Place::new();
    let (_launch, robot) = place.launched(&[&probe("probe.0", "rate-hz = 50.0", "")]);
    let mut tools = [["hz", "probe.0", "beat", "--json"], ["bw", "probe.0", "beat", "--json"]]
        .map(|arguments| Running::start(place.command(&arguments)));
    let names = [["values", "values_per_s"], ["packages", "packages_per_s"]];
    for (tool, [count, _]) in tools.iter().zip(names) {
        wait("it goes on", || last(tool, |line| line[count].as_u64() >= Some(20) && line["silent_s"].is_null()));
    }
    halt(robot.pid("probe.0"));
    for (tool, [count, per_s]) in tools.iter_mut().zip(names) {
        // Within the window of ten seconds, of which most is good.
        let is_silent = |line: &Value| line[count].as_u64() > Some(1) && line["silent_s"].as_f64() > Some(1.0);
        let line = wait("it is silent", || last(tool, is_silent));
        let [sent, rate, silent_s] = [count, per_s, "silent_s"].map(|name| line[name].as_f64().unwrap());
        assert!(rate > 0.0 && rate * silent_s < sent, "{line}");
        if let Some(mean_s) = line["interval_mean_s"].as_f64() {
            assert!(rate * mean_s < 0.99, "{line}");
        }
        let after = wait("it is silent for longer", || last(tool, |later| later["silent_s"].as_f64() > Some(silent_s)));
        assert!(after[per_s].as_f64().is_none_or(|later| later < rate), "{line} {after}");
        tool.stop();
    }
    let text = place.say(&["hz", "probe.0", "beat", "--count", "1"]).ok();
    assert!(text.contains("nothing new in this window; the last came "), "{text}");
    signal(robot.pid("probe.0"), Signal::SIGCONT);
}

#[test]
fn a_node_that_is_launched_again_is_found_again() {
    let place = Place::new();
    let (mut launch, robot) = place.launched(&[&probe("probe.0", "rate-hz = 50.0", "")]);
    let config = robot.installation.path.clone();
    let start = |arguments: &[&str]| Running::start(place.command(arguments));
    let mut tools = [
        start(&["hz", "probe.0", "beat", "--json"]),
        start(&["bw", "probe.0", "beat", "--json"]),
        start(&["delay", "probe.0", "--json"]),
    ];
    let values = |line: &Value| {
        line["values"].as_u64().or(line["packages"].as_u64()).or(line["published"][0]["values"].as_u64()).unwrap()
    };
    for tool in &tools {
        wait("a value", || last(tool, |line| values(line) > 1));
    }
    drop(robot);
    launch.stop();
    for tool in &tools {
        wait("that launch has ended", || tool.err().contains("waiting until it is launched again").then_some(()));
    }
    let mut launch = place.launch(&config);
    let robot = place.robot(&config, "main", &mut launch);
    robot.wait_on(&mut launch);
    for tool in &mut tools {
        wait("that it is there again", || tool.err().contains("node `main` was launched again").then_some(()));
        let before = lines(tool).len();
        wait("values of the new one", || lines(tool)[before..].iter().any(|line| values(line) > 1).then_some(()));
        tool.stop();
    }
}

#[test]
fn ping_counts_answers_and_ends_at_its_deadline() {
    let place = Place::new();
    let (_launch, robot) = place.launched(&[&probe("probe.0", "", "")]);
    let text = place.say(&["ping", "probe.0", "-c", "5", "--interval", "0"]).ok();
    assert!(text.contains("probe.0: answer 5 after "), "{text}");
    assert!(text.contains("probe.0: 5 sent, 5 answered, 0 lost\nround min "), "{text}");
    assert!(text.contains(" (there ") && text.contains("\nthere min ") && text.contains("\nback  min "), "{text}");
    let said = place.say(&["ping", "probe.0", "-c", "3", "--interval", "0", "--json"]).ok();
    let said: Vec<Value> = said.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!((said.len(), &said[3]["answered"], &said[3]["lost"]), (4, &3.into(), &0.into()));
    let figures = ["min_s", "p50_s", "p99_s", "max_s"].map(|figure| said[3][figure].as_f64().unwrap());
    assert!(figures.is_sorted() && figures[0] > 0.0, "{figures:?}");
    let ways = ["there_s", "back_s"].map(|way| said[0][way].as_f64().unwrap());
    assert!(ways.iter().all(|way| *way > 0.0) && said[0]["ways_error_s"] == 0.0, "{}", said[0]);
    let round_s = said[0]["round_trip_s"].as_f64().unwrap();
    assert!((ways[0] + ways[1] - round_s).abs() < 0.02 + round_s, "both ways are the round: {}", said[0]);
    assert_eq!((&said[3]["there"]["known"], &said[3]["back"]["known"]), (&3.into(), &3.into()));

    let pid = robot.pid("probe.0");
    halt(pid);
    let started = std::time::Instant::now();
    let said = place.say(&["ping", "probe.0", "-c", "2", "--interval", "0", "--timeout", "0.2"]);
    assert!(started.elapsed() < PATIENCE / 2, "{:?}", started.elapsed());
    assert!(said.out.contains("probe.0: none 2: no answer within 200ms"), "{said:#?}");
    assert!(said.out.contains("probe.0: 2 sent, 0 answered, 2 lost"), "{said:#?}");
    let error = said.fails();
    let why = format!("probe.0 answered nothing: its process {pid} is there, its state is on, and ");
    assert!(error.starts_with(&why) && error.contains(&format!("kill -CONT {pid} goes on")), "{error}");
    signal(pid, Signal::SIGCONT);
    place.say(&["ping", "probe.0", "-c", "1"]).ok();
    let error = place.say(&["ping", "probe.3", "-c", "1"]).fails();
    assert!(error.contains("the configuration has no module `probe.3`; there are probe.0"), "{error}");
}

#[test]
fn send_repeats_a_command_and_counts_what_came_of_it() {
    let place = Place::new();
    let (_launch, _robot) = place.launched(&[&probe("probe.0", "", "")]);
    let counts = place.say(&["send", "probe.0", "count", "7", "--rate", "100", "--count", "12", "--json"]).json();
    assert_eq!((&counts["sent"], &counts["answered"], &counts["timeouts"]), (&12.into(), &12.into(), &0.into()));
    assert_eq!(place.counted(), [7; 12]);
    let said = place.say(&["send", "probe.0", "refuse", "no", "--rate", "100", "--count", "3"]);
    // What a busy computer keeps from being sent in time is left out, and counted too.
    assert!(said.out.starts_with("3 sent, 0 answered, ") && said.out.ends_with("3 refused\n"), "{said:#?}");
    assert_eq!(said.code, Some(1), "{said:#?}");
    assert_eq!(said.err.matches("refuse: ").count(), 1, "told once: {said:#?}");
    place.say(&["call", "probe.0", "off"]).ok();
    let said = place.say(&["send", "probe.0", "count", "8", "--rate", "100", "--count", "3"]);
    assert!(said.out.starts_with("3 sent, 0 answered, ") && said.out.ends_with("3 faults\n"), "{said:#?}");
    assert_eq!(said.code, Some(1), "{said:#?}");
    assert_eq!(said.err, "probe.0: the module is off; switch it on first\n");
    place.say(&["call", "probe.0", "on"]).ok();
    let mut send = Running::start(place.command(&["send", "probe.0", "count", "9", "--rate", "200"]));
    wait("it goes on until it is stopped", || (place.counted().iter().filter(|n| **n == 9).count() > 50).then_some(()));
    let told = send.stop();
    let nines = place.counted().iter().filter(|n| **n == 9).count();
    assert!(told.starts_with(&format!("{nines} sent, {nines} answered")), "{told}");
    for (arguments, error) in [
        (&["send", "probe.0", "cound", "7"][..], "no function `cound`; it has: "),
        (&["send", "probe.0", "count"], "count <number: u32> takes 1 arguments, not 0"),
        (
            &["send", "probe.0", "count", "7", "--timeout", "1e19"],
            "10000000000000000000 s is no time to wait; write 0 to",
        ),
    ] {
        let said = place.say(arguments).fails();
        assert!(said.starts_with(error), "{said}");
    }
}

#[test]
fn graph_shows_who_sends_what_to_whom() {
    let place = Place::new();
    let (_launch, robot) = place.launched(&[&probe("probe.0", "rate-hz = 50.0", "")]);
    let mut echo = Running::start(place.command(&["echo", "probe.0", "beat"]));
    let mut send = Running::start(place.command(&["send", "probe.0", "count", "5", "--rate", "50"]));
    echo.wait_for("\n");
    wait("it counts", || (!place.counted().is_empty()).then_some(()));
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
    wait("all that it saw are run", || (place.counted().len() as u64 >= counted(&command)).then_some(()));
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
    let early = Running::start(place.command(&["graph", "--seconds", "3600", "--json"]));
    wait("it heeds Ctrl-C", || early.heeds_control_c().then_some(()));
    early.signal(Signal::SIGINT);
    let graph = early.said().json();
    assert!(graph["interval_s"].as_f64().unwrap() < 3600.0, "{graph}");
    for edge in graph["edges"].as_array().unwrap() {
        assert!(edge["packages_per_s"].as_f64().is_some_and(f64::is_finite), "{edge}");
    }
    let told = place.say(&["graph", "--seconds", "0", "--silent"]).fails();
    assert_eq!(told, "in 0 s nothing is sent; try --seconds 2\n");
    let told = place.say(&["graph", "--seconds", "0.1", "-o", "nowhere/graph.txt"]).fails();
    assert!(told.contains("name a file in a folder that is there"), "{told}");
    // With nobody sending, it says so.
    robot.tool(PATIENCE).close();
    assert_eq!(
        place.say(&["graph", "--seconds", "0.1"]).ok(),
        "nobody sent anything within 0.1 s; --silent shows who did before\n"
    );
}
