//! `rohrpost replay` of what rosbag2 recorded: its messages come into streams byte for byte, with their stamps, and as
//! far apart as they came.

use crate::conforming::hex;
use crate::harness::{Place, head, until, wait};
use crate::process::Running;
use crate::recordings::messages;
use crate::replayed::{call, position, replay};
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};
use rohrpost::schema::Bytes;
use rohrpost::wire::from_bytes;
use rohrpost_recording::{Selection, cut, merge, recover};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const BEGIN_NS: u64 = 1_700_000_000_000_000_000;
const PERIOD_NS: u64 = 50_000_000;
/// Messages of each topic.
const COUNT: u64 = 41;

/// Topic, type, how types and values are written.
const CHANNELS: [(&str, &str, &str, &str); 3] = [
    ("/scan", "sensor_msgs/msg/LaserScan", "ros2msg", "cdr"),
    ("/image", "sensor_msgs/msg/Image", "ros2msg", "cdr"),
    ("/tf", "tf2_msgs/msg/TFMessage", "ros2msg", "cdr"),
];

/// The module `logd.0` records what is played into its streams; images are longer than records of theirs.
const RECORDED_AGAIN: &str = r#"
[nodes.main]
[[module]]
name = "logd.0"
builtin = "logd"
stop-within = "60 s"
[[module]]
name = "laser.0"
program = "not-there"
[[module]]
name = "camera.0"
program = "not-there"
[module.stream.image]
record = "1 KiB"
[record]
directory = "recordings"
streams = ["*"]
leave-free = "0 B"
"#;

/// A message of a topic: CDR begins with four bytes that say so.
fn message(topic: usize, number: u64) -> Vec<u8> {
    let len = [300 + number as usize, if number == 7 { 3_000 } else { 900 }, 1][topic];
    let content = (0..len).map(|at| (at as u64 * 7 + number) as u8);
    [0, 1, 0, 0].into_iter().chain(content).collect()
}

/// When it was sent, and came.
fn times(topic: usize, number: u64) -> (u64, u64) {
    let came_ns = BEGIN_NS + number * PERIOD_NS + topic as u64 * 1_000_000;
    (came_ns - 300_000, came_ns)
}

/// As rosbag2 writes it.
fn bag(place: &Place) -> PathBuf {
    let path = place.path("bag_0.mcap");
    let options = WriteOptions::new().profile("ros2").library("libmcap 1.4").compression(Some(Compression::Zstd));
    let mut writer = options.chunk_size(Some(8_000)).create(std::fs::File::create(&path).unwrap()).unwrap();
    let ids = CHANNELS.map(|(topic, name, schema_encoding, encoding)| {
        let schema = writer.add_schema(name, schema_encoding, b"std_msgs/Header header").unwrap();
        let texts = BTreeMap::from([("offered_qos_profiles".to_owned(), "- history: 3".to_owned())]);
        writer.add_channel(schema, topic, encoding, &texts).unwrap()
    });
    for number in 0..COUNT {
        for (topic, channel_id) in ids.into_iter().enumerate() {
            let (publish_time, log_time) = times(topic, number);
            let header = MessageHeader { channel_id, sequence: number as u32, log_time, publish_time };
            writer.write_to_known_channel(&header, &message(topic, number)).unwrap();
        }
    }
    writer.finish().unwrap();
    path
}

/// A message of a program that says this of everything.
pub(crate) fn bag_that_says(place: &Place, text: &str) -> PathBuf {
    let path = place.path("odd_0.mcap");
    let options = WriteOptions::new().profile(text).library(text);
    let mut writer = options.create(std::fs::File::create(&path).unwrap()).unwrap();
    let schema = writer.add_schema(text, text, text.as_bytes()).unwrap();
    let channel_id = writer.add_channel(schema, text, text, &BTreeMap::new()).unwrap();
    let header = MessageHeader { channel_id, sequence: 0, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, text.as_bytes()).unwrap();
    writer.finish().unwrap();
    path
}

/// Waits until the player has a position.
fn begun(place: &Place, replay: &mut Running) -> Value {
    wait("time begins", || {
        replay.assert_runs();
        let said = place.say(&["call", "replay.0", "position", "--json"]);
        (said.code == Some(0)).then(|| said.json()).filter(|position| position["time_ns"] != 0)
    })
}

/// The newest record of a stream: its bytes as hex, its stamp, and the text of its item.
fn newest(place: &Place, module: &str, item: &str) -> Value {
    place.say(&["stream", "read", module, item, "--json", "--bytes", "0"]).json()
}

#[test]
fn topics_of_another_program_are_listed_and_played_into_streams_that_are_named() {
    let place = Place::new();
    let file = bag(&place);
    let text = place.say(&["record", "info", file.to_str().unwrap()]).ok();
    assert!(text.contains("not one of ours: ros2, written by libmcap 1.4"), "{text}");
    let row = text.lines().find(|line| line.starts_with("/scan ")).unwrap();
    let row: Vec<&str> = row.split_whitespace().collect();
    assert_eq!(row, ["/scan", "41", "20.0", "0", "sensor_msgs/msg/LaserScan", "cdr", "ros2msg"]);

    let into = ["--into", "/scan=laser.0/scan", "/image=camera.0/image", "--paused"];
    let mut replay = replay(&place, &file, &into);
    begun(&place, &mut replay);
    place.say(&["call", "replay.0", "step"]).ok();
    until("a message is played", || position(&place)["played"] == 1);
    let read = newest(&place, "laser.0", "scan");
    assert_eq!(read["value"]["hex"], hex(&message(0, 0)), "{read}");
    assert!(read.to_string().contains(&times(0, 0).0.to_string()), "{read}");
    place.say(&["call", "laser.0"]).ok_with(["Messages of /scan: sensor_msgs/msg/LaserScan cdr ros2msg"]);

    place.say(&["call", "replay.0", "seek", "1.0"]).ok();
    place.say(&["call", "replay.0", "step_by", "0.26"]).ok();
    until("messages are played", || position(&place)["played"].as_u64() >= Some(13));
    assert_eq!(newest(&place, "laser.0", "scan")["value"]["hex"], hex(&message(0, 25)));
    assert_eq!(newest(&place, "camera.0", "image")["value"]["hex"], hex(&message(1, 25)));

    // Stepped to its end it stays, until it is told otherwise.
    place.say(&["call", "replay.0", "step_by", "10"]).ok();
    until("it is at its end", || position(&place)["ended"] == true);
    assert_eq!(position(&place)["paused"], true);
    assert_eq!(newest(&place, "camera.0", "image")["value"]["hex"], hex(&message(1, COUNT - 1)));
    place.say(&["call", "replay.0", "seek", "0.5"]).ok();
    until("it is no more", || position(&place)["ended"] == false);
    place.say(&["call", "replay.0", "step_by", "10"]).ok();
    until("it is at its end again", || position(&place)["ended"] == true);
    place.say(&["call", "replay.0", "resume"]).ok();
    let said = replay.said();
    assert_eq!(said.code, Some(0), "{said:?}");
    assert!(said.out.contains(" values of 2 channels in "), "{said:?}");
    place.assert_empty();
}

/// Stamps and bytes of a topic, and when they came.
fn recorded(file: &Path, topic: &str) -> Vec<(u64, Vec<u8>, u64)> {
    messages(file, |channel, message| {
        let bytes = || from_bytes::<Bytes>(message.data).unwrap().0;
        (channel.topic == topic).then(|| (message.stamp_ns, bytes(), message.arrival_ns))
    })
}

#[test]
fn what_others_recorded_is_played_byte_for_byte_and_what_is_too_long_is_counted() {
    let place = Place::new();
    let file = bag(&place);
    let config = place.write("again.toml", head("laser 150, camera 140, logd 24, tool 16") + RECORDED_AGAIN);
    let config = config.to_str().unwrap();
    let into = ["--into", "/scan=laser.0/scan", "/image=camera.0/image"];
    let more = ["--config", config, "--run", "logd.0", "--rate", "2", "--paused"];
    let mut replay = replay(&place, &file, &[&into[..], &more].concat());
    begun(&place, &mut replay);
    until("the recorder listens", || {
        replay.assert_runs();
        call(&place, "logd.0", &["recording"])["channels"].as_u64() >= Some(2)
    });
    place.say(&["call", "replay.0", "resume"]).ok();
    let said = replay.said();
    assert_eq!(said.code, Some(0), "{said:?}");
    let played = 2 * COUNT - 1;
    assert!(said.out.contains(&format!("played {played} values of 2 channels in ")), "{said:?}");
    assert!(said.out.contains("\n1 values were too large or too late for their streams"), "{said:?}");

    let again = place.path("recordings/replay-0001.mcap");
    for (topic, name) in [(0, "laser.0/scan"), (1, "camera.0/image")] {
        let sent = (0..COUNT).filter(|number| (topic, *number) != (1, 7));
        let sent: Vec<_> = sent.map(|number| (times(topic, number), message(topic, number))).collect();
        let came = recorded(&again, name);
        assert_eq!(came.len(), sent.len(), "{name}");
        for (((published_ns, logged_ns), sent), (stamp_ns, came, came_ns)) in sent.into_iter().zip(came) {
            assert!((stamp_ns, &came) == (published_ns, &sent), "{name} at {logged_ns}: {came:?}");
            // The node's time is the recording's.
            assert!(came_ns >= logged_ns, "{name} came at {came_ns}, {} ns early", logged_ns - came_ns);
        }
    }
    place.assert_empty();
}

/// What is made of their files is still theirs: nobody asks for modules that Rohrpost would have described.
#[test]
fn what_is_cut_merged_and_recovered_of_others_is_played_as_theirs() {
    let place = Place::new();
    let file = bag(&place);
    let [part, merged, whole] = ["part.mcap", "merged.mcap", "whole.mcap"].map(|name| place.path(name));
    cut(&file, &part, &Selection::default(), &mut |_, _| {}).unwrap();
    merge(std::slice::from_ref(&file), &merged, &mut |_, _| {}).unwrap();
    recover(&file, &whole, &mut |_, _| {}).unwrap();
    for made in [part, merged, whole] {
        let replay = replay(&place, &made, &["--into", "/scan=laser.0/scan", "/image=camera.0/image", "--rate", "8"]);
        let said = replay.said();
        assert_eq!(said.code, Some(0), "{}: {said:?}", made.display());
        let played = format!("played {} values of 2 channels in ", 2 * COUNT);
        assert!(said.out.contains(&played), "{}: {said:?}", made.display());
    }
    place.assert_empty();
}

#[test]
fn what_others_recorded_needs_streams_that_can_be_made() {
    let place = Place::new();
    let file = bag(&place);
    let file = file.to_str().unwrap();
    for (words, told) in [
        (&[][..], "name streams for its messages, such as `--into /image=sensor.0/value`; it has /image (sensor_msgs/"),
        (&["--into", "/none=laser.0/scan"], "--into /none=laser.0/scan: nothing of it is recorded; it has /image ("),
        (&["--into", "/scan=laser.0/scan", "/tf=laser.0/scan"], "--into names laser.0/scan twice"),
        (&["--into", "/scan=laser.0/scan", "/scan=laser.0/other"], "--into names /scan twice"),
        (&["--into", "/scan=laser"], "write TOPIC=MODULE/STREAM, such as /scan=laser.0/scan"),
        (&["--into", "/scan=tool.0/scan"], "modules of class `tool` are programs run by hand"),
        (&[file, "--into", "/scan=laser.0/scan"], "name each file once, in order"),
        (&["--into", "/scan=laser.0/scan", "--run", "mapper.0"], "the files have no configuration; name one"),
    ] {
        let refused = place.say(&[&["replay", file], words].concat());
        assert!(refused.code != Some(0) && refused.err.contains(told), "{refused:?}");
    }
}
