//! The measuring tools, compared with a source that keeps its own record; and observing changes nothing.

use crate::harness::{PATIENCE, Place, Robot, json_lines, patient, probe, until, wait};
use crate::probe::ProbingInterface;
use crate::process::Running;
use rohrpost::common::{DataHead, SUBSCRIBE, Subscribe};
use rohrpost::wire::append;
use rohrpost_mailbox::{Receiver, local, monotonic_ns};
use serde_json::Value;
use std::time::Duration;

/// Lines that are whole, as JSON.
pub(crate) fn lines(tool: &Running) -> Vec<Value> {
    let out = tool.out();
    let whole = out.rsplit_once('\n').map_or("", |(whole, _)| whole);
    json_lines(whole)
}

pub(crate) fn last(tool: &Running, holds: impl Fn(&Value) -> bool) -> Option<Value> {
    lines(tool).into_iter().rev().find(holds)
}

/// Within one percent of the source's own figure, which itself lies between two bounds.
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

/// Takes packages slowly, so that they wait for times that are long compared with the measurement.
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
    let (place, _launch, robot) = Place::running(&[&probe("probe.0", "blob-hz = 150.0", "start = \"off\"")]);
    let mut tool = robot.tool(PATIENCE);
    let wish = Subscribe { number: 3, id: 1, period_us: 0, lease_ms: 60_000, mailbox: local::DATA };
    tool.data().unwrap();
    let write = |body: &mut Vec<u8>| append(body, &wish);
    until("probe.0 is ready", || robot.state("probe.0") == "off");
    tool.call(robot.name("probe.0"), SUBSCRIBE, ProbingInterface::hash(), write, |_| Ok(())).unwrap();
    let me = robot.installation.classes.format(tool.link.me());
    let start = |arguments: &[&str]| place.start(&[arguments, &["--json", "--window", "1000"]].concat());
    let hz = start(&["hz", "probe.0", "blob"]);
    let bw = start(&["bw", "probe.0", "blob"]);
    let bw_in = start(&["bw", &me]);
    let delay = start(&["delay", "probe.0"]);
    let mut tools = [hz, bw, bw_in, delay];
    for tool in &mut tools {
        until("its first line, before anything is published", || {
            tool.assert_runs();
            !lines(tool).is_empty()
        });
    }
    let mut taken = Vec::new();
    // Packages are taken meanwhile: the mailbox has room for less than a second of them.
    let order = |data: &mut Receiver, taken: &mut Vec<Taken>, word| {
        let mut said = place.start(&patient(&["call", "probe.0", word]));
        let done = wait("it is done", || {
            take_slowly(data, taken);
            said.ended()
        });
        assert!(done.success(), "{}", said.err());
    };
    order(tool.data().unwrap(), &mut taken, "on");
    until("500 values", || {
        take_slowly(tool.data().unwrap(), &mut taken);
        taken.len() >= 500
    });
    order(tool.data().unwrap(), &mut taken, "off");
    let source = published(&place);
    until("all values", || {
        take_slowly(tool.data().unwrap(), &mut taken);
        taken.len() >= source.len()
    });
    let all = source.len() as u64;
    assert_eq!(taken.len(), source.len());

    let [hz, bw, bw_in, delay] = &tools;
    let (first, end) = (&source[0], &source[source.len() - 1]);
    let intervals = || source.windows(2).map(|pair| (pair[1].before - pair[0].after, pair[1].after - pair[0].before));
    let count = (all - 1) as f64;
    let long = ((end.before - first.after) / 1e9, (end.after - first.before) / 1e9);

    let line = wait("hz has counted all", || last(hz, |line| line["values"] == all));
    // The source has stopped by now, and the rate falls with each line; the earlier rate is in the intervals.
    let silent_s = |line: &Value| line["silent_s"].as_f64().unwrap_or(0.0);
    let until = silent_s(&line);
    agrees("rate", &line["values_per_s"], (count / (long.1 + until), count / (long.0 + until)));
    agrees("mean interval", &line["interval_mean_s"], (long.0 / count, long.1 / count));
    let least = |of: fn((f64, f64)) -> f64| intervals().map(of).fold(f64::MAX, f64::min) / 1e9;
    let most = |of: fn((f64, f64)) -> f64| intervals().map(of).fold(0.0, f64::max) / 1e9;
    agrees("shortest interval", &line["interval_min_s"], (least(|i| i.0), least(|i| i.1)));
    agrees("longest interval", &line["interval_max_s"], (most(|i| i.0), most(|i| i.1)));
    // Deviations from the mean, each as small and as large as possible.
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
    assert_eq!(
        (&line["bytes_min"], &line["bytes_max"]),
        (&(11 + DataHead::BYTES).into(), &(101 + DataHead::BYTES).into())
    );

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
    // The histogram has two buckets per octave.
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

/// All counts of a node, as text.
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
    let (place, _launch, robot) =
        Place::running(&[&probe("probe.0", "rate-hz = 100.0", ""), &probe("probe.1", "rate-hz = 30.0", "")]);
    let incarnation = || {
        let tool = robot.tool(PATIENCE);
        let incarnation = tool.link.participant().incarnation();
        tool.close();
        incarnation
    };
    place.say(&["call", "probe.0", "count", "1"]).ok();
    let (before, newest) = (all_counts(&robot), incarnation());
    // A tool that has come and gone has left nothing.
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
    .map(|arguments| place.start(arguments))
    .collect();
    for tool in watching {
        tool.said().ok();
    }
    // Packages, losses, waits, flows, participants.
    assert_same(&all_counts(&robot), &before);
    // The first tool's calls have one as well.
    assert_eq!(incarnation(), newest + 2, "nobody joined meanwhile");
    let status = place.say(&["status", "--json"]).json();
    assert_eq!((&status[0]["subscribers"], &status[1]["subscribers"]), (&0.into(), &0.into()));
}
