//! `rohrpost record`: files of a recording at the command line.

use crate::harness::{Place, assert_has};
use crate::recordings::{self, channel};
use rohrpost::schema::{DataItem, DataKind, Description, Field, Members, Named, Schema, Type};
use rohrpost::types::Pose;
use rohrpost_recording::{ChannelSpec, LossCause, Message, Session};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Ten seconds of two channels, 1700000000 s after 1970.
fn recording(place: &Place, stem: &str) -> PathBuf {
    let session = Session { node: "base".into(), ..Session::default() };
    let mut writer = recordings::begin(place, stem, session);
    let ty = Type::Struct(Named::new("Pace", Members::Fields(vec![Field::new("speed", Type::U8)])));
    let mut channels = ["motor.0", "motor.1"].map(|name| channel(&mut writer, name, "pace", &ty));
    for number in 0..1_000_u32 {
        let arrival_ns = 1_700_000_000_000_000_000 + u64::from(number) * 10_000_000;
        let message = Message { arrival_ns, stamp_ns: arrival_ns, epoch: 1, sequence: number, data: &[number as u8] };
        writer.write(channels[0], &message).unwrap();
        channels.reverse();
    }
    writer.count_lost(channels[0], LossCause::Disk, 3);
    recordings::end(place, stem, writer)
}

/// A recording in which each name and text is this one.
pub(crate) fn recording_that_says(place: &Place, text: &str, ty: &Type) -> PathBuf {
    let texts = BTreeMap::from([(text.to_owned(), text.to_owned())]);
    let session = Session { node: text.into(), versions: texts.clone(), configuration: texts.clone() };
    let mut writer = recordings::begin(place, "odd", session);
    let field = Field::new(text, ty.clone());
    let data = vec![DataItem { number: 1, kind: DataKind::Data, field }];
    let description =
        Description { name: text.into(), class: text.into(), text: text.into(), functions: Vec::new(), data };
    writer.describe(text, &description).unwrap();
    let channel = writer.channel(&ChannelSpec { name: text, item: text, ty, texts }).unwrap();
    let message = Message { arrival_ns: 1, stamp_ns: 1, epoch: 1, sequence: 0, data: text.as_bytes() };
    writer.write(channel, &message).unwrap();
    recordings::end(place, "odd", writer)
}

#[test]
fn a_recording_is_described_cut_merged_and_recovered() {
    let place = Place::new();
    let path = recording(&place, "base");
    let file = path.to_str().unwrap();
    let text = place.say(&["record", "info", file]).ok();
    assert_has(
        &text,
        [
            ": 1000 messages, ",
            "closed (ended)",
            "3 messages are lost: 3 as the disk was slower than they came, or failed",
            "from 1700000000.000000000 to 1700000009.990000000, 9.990 s",
            "node base",
        ],
    );
    let row = text.lines().find(|line| line.starts_with("motor.0/pace ")).unwrap();
    assert_eq!(row.split_whitespace().collect::<Vec<_>>(), ["motor.0/pace", "500", "50.0", "3", "{speed:", "u8}"]);
    let told = place.say(&["record", "info", file, "--json"]).json();
    assert_eq!((&told["messages"], &told["lost"], &told["is_closed"]), (&1000.into(), &3.into(), &true.into()));
    assert_eq!(told["channels"][1]["topic"], "motor.1/pace");
    let part = place.path("part.mcap");
    let part = part.to_str().unwrap();
    let times = ["--from", "+1s", "--until", "-2.99s", "--json"];
    let told = place.say(&[&["record", "cut", file, "-o", part, "--names", "motor.1"], &times[..]].concat()).json();
    assert_eq!(told["messages"], 300);
    let other = recording(&place, "arm");
    let all = place.path("all.mcap");
    let all = all.to_str().unwrap();
    let text = place.say(&["record", "merge", file, other.to_str().unwrap(), "-o", all]).ok();
    assert!(text.starts_with(&format!("{all}: 2000 messages, ")), "{text}");
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
    assert!(place.say(&["record", "info", file]).ok().contains("not closed: if nothing writes it any more"));
    let recovered = place.path("base-0001.recovered.mcap");
    let writer = std::fs::File::open(&path).unwrap();
    writer.lock().unwrap();
    let told = place.say(&["record", "recover", file]).fails();
    assert!(told.contains("a recorder writes it just now") && !recovered.exists(), "{told}");
    drop(writer);
    let text = place.say(&["record", "recover", file]).ok();
    assert!(text.starts_with(&format!("{}: 1000 messages of {file}, ", recovered.display())), "{text}");
    assert_eq!(place.say(&["record", "info", recovered.to_str().unwrap(), "--json"]).json()["messages"], 1000);
}

/// Poses, ten a second for a second; the heading of the last one is no number.
fn poses(place: &Place) -> PathBuf {
    let session = Session { node: "base".into(), ..Session::default() };
    let mut writer = recordings::begin(place, "poses", session);
    let pose = channel(&mut writer, "mapper.0", "pose", &Pose::schema());
    let speed = channel(&mut writer, "motor.0", "speed", &Type::U8);
    for number in 0..10_u32 {
        let stamp_ns = 1_700_000_000_000_000_000 + u64::from(number) * 100_000_000;
        let heading_rad = if number == 9 { f64::NAN } else { 0.0 };
        let data = [f64::from(number), 0.5, heading_rad].map(f64::to_le_bytes).concat();
        let message = Message { arrival_ns: stamp_ns + 7, stamp_ns, epoch: 3, sequence: number, data: &data };
        writer.write(pose, &message).unwrap();
        writer.write(speed, &Message { data: &[7], ..message }).unwrap();
    }
    recordings::end(place, "poses", writer)
}

#[test]
fn a_recording_is_exported_as_json() {
    let place = Place::new();
    let file = poses(&place);
    let (file, to) = (file.to_str().unwrap(), place.path("poses.jsonl"));
    let to = to.to_str().unwrap();
    let export = ["record", "export", file, "-o", to, "--format", "json", "--names", "mapper.0"];
    let text = place.say(&export).ok();
    assert!(text.starts_with(&format!("{to}: 10 messages, ")), "{text}");
    let text = std::fs::read_to_string(to).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 10, "{text}");
    assert_eq!(
        lines[1],
        r#"{"topic":"mapper.0/pose","stamp_ns":1700000000100000000,"epoch":3,"arrival_ns":1700000000100000007,"#
            .to_owned()
            + r#""sequence":1,"value":{"x_m":1.0,"y_m":0.5,"heading_rad":0.0}}"#
    );
    assert!(lines[9].ends_with(r#""value":{"x_m":9.0,"y_m":0.5,"heading_rad":"NaN"}}"#), "{}", lines[9]);
    assert!(place.say(&export).fails().contains("is there already"));
    let part = ["record", "export", file, "-o", "-", "--format", "json", "--from", "+0.5s", "--rate", "5"];
    let text = place.say(&part).ok();
    let topics = text.lines().map(|line| line.split('"').nth(3).unwrap_or_default());
    let count = |topic: &str| topics.clone().filter(|its| *its == topic).count();
    assert_eq!((count("mapper.0/pose"), count("motor.0/speed")), (3, 3), "{text}");
}

#[test]
fn a_recording_is_exported_for_others_to_draw() {
    let place = Place::new();
    let file = poses(&place);
    let (file, to) = (file.to_str().unwrap(), place.path("drawn.mcap"));
    let to = to.to_str().unwrap();
    let text = place.say(&["record", "export", file, "-o", to, "--format", "drawn"]).ok();
    assert_has(
        &text,
        [
            ": 19 messages, ",
            "\nmapper.0/pose/pose: 9\nmapper.0/pose/transform: 9\nworld/transform: 1\n",
            "are on mapper.0",
            "mapper.0/pose: 1 not drawn: ",
            "not drawn, as there is no picture of them: motor.0/speed",
        ],
    );
    place.say(&["record", "info", to]).ok_with(["foxglove.FrameTransform protobuf, drawn of mapper.0/pose"]);
    let told = place.say(&["record", "info", to, "--json"]).json();
    assert_eq!(told["channels"][0]["drawn_of"], "mapper.0/pose");
    assert!(
        place.say(&["record", "export", to, "-o", "-", "--format", "json"]).ok().is_empty(),
        "it is not what was recorded"
    );
    let both = place.path("both.mcap");
    let with =
        ["record", "export", file, "-o", both.to_str().unwrap(), "--format", "drawn", "--with-original", "--rate", "5"];
    assert!(place.say(&with).ok().contains(": 21 messages, "));
}

#[test]
fn mistakes_with_recordings_are_explained() {
    let place = Place::new();
    let path = recording(&place, "base");
    let file = path.to_str().unwrap();
    let part = place.path("part.mcap");
    let part = part.to_str().unwrap();
    for (arguments, words) in [
        (
            &["record", "cut", file, "-o", part, "--names", "motor.7"][..],
            "has no `motor.7`; it has motor.0/pace, motor.1/pace",
        ),
        (&["record", "cut", file, "-o", file], "is there already; remove it, or name another file"),
        (&["record", "merge", file, "-o", file], "is there already"),
        (&["record", "info", "/dev/null/none"], "cannot read"),
        (&["record", "cut", file, "-o", part, "--from", "-1s", "--until", "+1s"], "the time range is empty"),
        (&["record", "export", file, "-o", part, "--format", "drawn"], "nothing of it can be drawn; poses, "),
        (
            &["record", "export", file, "-o", part, "--format", "json", "--names", "motor.7"],
            "has no `motor.7`; it has ",
        ),
        (
            &["record", "export", file, "-o", file, "--format", "json"],
            "is there already; remove it, or name another file",
        ),
        (&["record", "export", file, "-o", part, "--format", "json", "--with-original"], "is for --format drawn"),
    ] {
        place.say(arguments).fails_with([words]);
    }
    let said = place.say(&["record", "cut", file, "-o", part, "--from", "noon"]);
    assert!(said.code == Some(2) && said.err.contains("before the end (-10s)"), "{said:?}");
    let said = place.say(&["record", "export", file, "-o", part, "--format", "drawn", "--rate", "0"]);
    assert!(said.code == Some(2) && said.err.contains("from 0.001 to 1000000 a second"), "{said:?}");
    assert!(!std::path::Path::new(part).exists());
}
