//! `rohrpost replay` of a robot that was recorded: played and recorded again it is the same; a fresh mapper draws the
//! same map; and the replay is paused, stepped and sought by calls.

use crate::harness::{OUTPUT, Place, RECORDED_CLASSES, Robot, until, wait};
use crate::process::Running;
use crate::recordings::{self, messages};
use rohrpost::interfaces::{LaserInterface, WheelsInterface};
use rohrpost::schema::Type;
use rohrpost::types::OccupancyGrid;
use rohrpost::wire::from_bytes;
use rohrpost_config::Installation;
use rohrpost_mailbox::{StreamId, SystemClock};
use rohrpost_recording::{Message, RecordedChannel, Session, info};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const TIME: &str = r#"
[time]
source = "simulation"
speed = 2.0
"#;

const MODULES: &str = r#"
[[module]]
name = "logd.0"
builtin = "logd"
stop-within = "60 s"
[module.mailbox.data]
slots = 1024
size = "20 KiB"
[[module]]
name = "motor.0"
aliases = ["odometry.0", "laser.0"]
builtin = "sim"
start = "off"
settings = { map = "building.map", seed = 1, laser-rate-hz = 10, odometry-rate-hz = 20 }
[module.stream.odometry]
record = "128 B"
keep = 1024
[module.stream.scan]
keep = 256
[[module]]
name = "mapper.0"
builtin = "mapper"
calls = ["laser.0", "odometry.0"]
settings = { laser = "laser.0", odometry = "odometry.0", resolution-m = 0.1 }
[[module]]
name = "pilot.0"
builtin = "pilot"
calls = ["laser.0", "motor.0"]
settings = { laser = "laser.0", motor = "motor.0", seed = 16 }
[record]
directory = "recordings"
streams = ["*"]
data = ["*"]
output = true
leave-free = "0 B"
flush = "20 ms"
sync = "100 ms"
"#;

/// A value as it was recorded.
#[derive(Debug, PartialEq)]
struct Recorded {
    stamp_ns: u64,
    epoch: u64,
    bytes: Vec<u8>,
}

pub(crate) fn call(place: &Place, module: &str, function: &[&str]) -> Value {
    place.say(&[&["call", module, "--json"], function].concat()).json()
}

pub(crate) fn position(place: &Place) -> Value {
    call(place, "replay.0", &["position"])
}

/// Readers of the streams that a mapper needs.
fn readers(robot: &Robot) -> usize {
    let streams = [("laser.0", LaserInterface::SCAN.number), ("odometry.0", WheelsInterface::ODOMETRY.number)];
    let readers = streams.map(|(module, number)| {
        let info = robot.node.inspect_stream(StreamId { name: robot.name(module), number }).unwrap();
        info.map_or(0, |info| usize::from(info.readers))
    });
    readers.into_iter().sum()
}

/// Messages that the recorder has written or lost, and what it has in memory.
fn recorded_so_far(place: &Place) -> (u64, u64, u64) {
    let state = call(place, "logd.0", &["recording"]);
    let count = |key: &str| state[key].as_u64().unwrap();
    (count("written"), count("lost"), count("waiting"))
}

/// Some seconds of a robot that drives and maps, from its first value on.
fn record(place: &Place) -> PathBuf {
    place.copy("config/building.map");
    let config = place.config(&[&RECORDED_CLASSES, TIME, OUTPUT, MODULES]);
    let mut launch = place.launch(&config);
    let robot = place.robot(&config, "main", &mut launch);
    until("the modules are there", || {
        launch.assert_runs();
        ["logd.0", "mapper.0", "pilot.0"].iter().all(|module| robot.state(module) == "on")
    });
    until("mapper and recorder listen", || readers(&robot) == 4);
    until("the recorder knows of all", || call(place, "logd.0", &["recording"])["channels"].as_u64() >= Some(6));
    place.say(&["call", "motor.0", "on"]).ok();
    until("it has mapped", || {
        launch.assert_runs();
        call(place, "mapper.0", &["counts"])["mapped"].as_u64() > Some(40)
    });
    place.say(&["call", "motor.0", "off"]).ok();
    // All that changed of the map is published within half a second.
    let clock = SystemClock::open(&robot.node);
    let off_ns = clock.now().ns;
    until("the map is published", || clock.now().ns > off_ns + 5_000_000_000);
    until("all is written", || recorded_so_far(place).2 == 0);
    launch.stop();
    let file = place.path("recordings/main-0001.mcap");
    assert_eq!(info(&file).unwrap().lost, 0);
    file
}

/// All of a file by topic, in the order in which it came.
fn values(file: &Path) -> BTreeMap<String, Vec<Recorded>> {
    let mut values: BTreeMap<String, Vec<Recorded>> = BTreeMap::new();
    let read = |channel: &RecordedChannel, &Message { stamp_ns, epoch, data, .. }: &Message<'_>| {
        Some((channel.topic.to_string(), Recorded { stamp_ns, epoch, bytes: data.to_vec() }))
    };
    messages(file, read).into_iter().for_each(|(topic, value)| values.entry(topic).or_default().push(value));
    values
}

/// The map at the end: the last patch of each place.
fn map(values: &[Recorded]) -> BTreeMap<String, Vec<u8>> {
    let patch = |value: &Recorded| {
        let grid: OccupancyGrid = from_bytes(&value.bytes).unwrap();
        (format!("{:?}", grid.origin), value.bytes.clone())
    };
    values.iter().map(patch).collect()
}

/// How long after the begin of a file the first value of a topic arrived.
fn seconds_to(file: &Path, topic: &str) -> f64 {
    let came = messages(file, |channel, message| Some((channel.topic == topic, message.arrival_ns)));
    let (_, first_ns) = came.iter().find(|(is_it, _)| *is_it).unwrap_or_else(|| panic!("no {topic}"));
    (first_ns - came[0].1) as f64 / 1e9
}

/// Goes there, and waits for the epoch that begins there.
fn seek(place: &Place, at_s: f64) -> Value {
    let epoch = position(place)["epoch"].as_u64();
    place.say(&["call", "replay.0", "seek", &format!("{at_s:.6}")]).ok();
    let sought = wait("time steps", || Some(position(place)).filter(|position| position["epoch"].as_u64() > epoch));
    let there = sought["at_s"].as_f64().unwrap();
    assert!((at_s - 0.001..at_s + 1.0).contains(&there), "{sought}");
    sought
}

pub(crate) fn replay(place: &Place, file: &Path, words: &[&str]) -> Running {
    let all = [&["replay", file.to_str().unwrap(), "--quiet", "--no-gui"], words].concat();
    place.start(&all)
}

/// The node of a replay.
fn replaying(place: &Place, replay: &mut Running) -> Robot {
    let config = place.config_of("test-replay", "[nodes.main]", &[&RECORDED_CLASSES, TIME, OUTPUT, MODULES]);
    Installation::load(&config).unwrap();
    let robot = place.robot(&config, "replay", replay);
    wait("the player is there", || {
        replay.assert_runs();
        place.say(&["call", "replay.0", "position"]).code.filter(|code| *code == 0)
    });
    robot
}

#[test]
fn what_is_replayed_and_recorded_again_is_the_same_and_a_fresh_mapper_draws_the_same_map() {
    let place = Place::new();
    let first = record(&place);
    let said = place.say(&["replay", first.to_str().unwrap(), "--run", "logd.0"]);
    said.fails_with(["it would write files into\n  ", "add --run-recorded to let it"]);
    let words = ["--run", "mapper.0", "--run", "logd.0", "--run-recorded", "--rate", "5", "--paused"];
    let mut replay = replay(&place, &first, &words);
    let robot = replaying(&place, &mut replay);
    until("all listen", || {
        replay.assert_runs();
        readers(&robot) == 4 && call(&place, "logd.0", &["recording"])["channels"].as_u64() >= Some(7)
    });
    assert_eq!(position(&place)["played"], 0);
    place.say(&["call", "replay.0", "resume"]).ok();
    let said = replay.said();
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.out.contains(" values of ") && said.out.contains("error of spacing at rate 5: "), "{said:?}");
    place.assert_empty();

    let (mut before, mut after) = (values(&first), values(&place.path("recordings/replay-0001.mcap")));
    assert_eq!(info(&place.path("recordings/replay-0001.mcap")).unwrap().lost, 0);
    let mut take = |topic: &str| [&mut before, &mut after].map(|values| values.remove(topic).unwrap());
    let [map_before, map_after] = take("mapper.0/map").map(|patches| map(&patches));
    assert!(map_before.len() > 3, "{} patches", map_before.len());
    assert!(map_before == map_after, "the maps differ");
    let [poses_before, poses_after] = take("mapper.0/pose");
    assert!(poses_before == poses_after, "{poses_before:?}\n{poses_after:?}");
    after.remove("replay.0/state").unwrap();
    let names = |values: &BTreeMap<String, Vec<Recorded>>| values.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&before), names(&after));
    for (topic, values) in &before {
        assert!(values == &after[topic], "{topic}: {values:?}\n{:?}", after[topic]);
    }
}

#[test]
fn a_replay_is_paused_stepped_and_sought_by_calls() {
    let place = Place::new();
    let first = record(&place);
    let file = first.to_str().unwrap();
    place.say(&["replay", file, "--from", "+2s", "--until", "+1s"]).fails_with(["the time range is empty"]);
    let told = place.say(&["replay", file, "--run", "mapper.7"]).fails();
    assert!(told.contains("--run mapper.7: the configuration has no such module; it has output.0"), "{told}");
    let mut replay = replay(&place, &first, &["--paused"]);
    let robot = replaying(&place, &mut replay);
    let clock = SystemClock::open(&robot.node);
    let began = wait("time begins", || Some(position(&place)).filter(|position| position["time_ns"] != 0));
    assert_eq!((&began["paused"], &began["played"], began["at_s"].as_f64()), (&true.into(), &0.into(), Some(0.0)));
    place.say(&["call", "replay.0", "step"]).ok();
    let played = |count: u64| move |position: &Value| position["played"].as_u64() >= Some(count);
    let stepped = wait("a value is played", || Some(position(&place)).filter(played(1)));
    assert_eq!((&stepped["played"], stepped["epoch"].as_u64()), (&1.into(), began["epoch"].as_u64()));
    // Before the robot drives there is little to see.
    let drives_s = seconds_to(&first, "laser.0/scan");
    let sought = seek(&place, drives_s);
    assert_eq!(sought["played"], 1);
    place.say(&["call", "replay.0", "step_by", "1.5"]).ok();
    let at_least = |at_s: f64| move |position: &Value| position["at_s"].as_f64() >= Some(at_s);
    let stepped = wait("a time is played", || Some(position(&place)).filter(at_least(drives_s + 1.49)));
    assert!(stepped["at_s"].as_f64() < Some(drives_s + 1.7) && stepped["played"].as_u64() > Some(20), "{stepped}");
    assert_eq!(clock.record().unwrap().pace_ppb, 0);
    assert_eq!(clock.now().ns, stepped["time_ns"].as_u64().unwrap());
    let sought = seek(&place, drives_s + 0.5);
    assert_eq!(sought["played"], stepped["played"]);
    place.say(&["call", "replay.0", "rate", "3"]).ok();
    place.say(&["call", "replay.0", "resume"]).ok();
    wait("it plays on", || Some(position(&place)).filter(played(sought["played"].as_u64().unwrap() + 20)));
    assert_eq!(clock.record().unwrap().pace_ppb, 3_000_000_000);
    place.say(&["call", "replay.0", "pause"]).ok();
    until("time stands still", || clock.record().unwrap().pace_ppb == 0);
    for (words, told) in [
        (["replay.0", "rate", "0"].as_slice(), "Rate(0)"),
        (&["replay.0", "seek", "1000000"], "at_s: 1000000"),
        (&["replay.0", "step_by", "0"], "Step(0)"),
        (&["motor.0", "halt"], "motor.0 is played from a recording and takes no commands"),
    ] {
        let refused = place.say(&[&["call"], words].concat());
        assert!(refused.code != Some(0), "{refused:?}");
        assert!(refused.out.contains(told) || refused.err.contains(told), "{refused:?}");
    }
    // Stepped to its end it stays there.
    place.say(&["call", "replay.0", "step_by", "1000"]).ok();
    let at_end = wait("it is at its end", || Some(position(&place)).filter(|position| position["ended"] == true));
    assert_eq!(at_end["paused"], true);
    let sought = seek(&place, drives_s);
    assert_eq!((&sought["paused"], &sought["ended"]), (&true.into(), &false.into()));
    let said = replay.stop();
    assert!(said.contains(" values of ") && said.contains(" s, to "), "{said}");
    place.assert_empty();
}

#[test]
fn what_cannot_be_replayed_is_refused_in_words() {
    let place = Place::new();
    let mut writer = recordings::begin(&place, "old", Session::default());
    let speed = recordings::channel(&mut writer, "motor.0", "speed", &Type::U8);
    writer.write(speed, &Message { arrival_ns: 1, stamp_ns: 1, epoch: 1, sequence: 0, data: &[7] }).unwrap();
    recordings::end(&place, "old", writer);
    let said = place.say(&["replay", "old-0001.mcap"]);
    said.fails_with(["does not describe its modules, as it was recorded by an older version"]);
    place.say(&["replay", "nowhere.mcap"]).fails_with(["nowhere.mcap"]);
}
