//! A replay that begins in the middle of things: at a later file, at a time, behind a seek, or over and over.

use crate::harness::{Place, head, until, wait};
use crate::process::Running;
use crate::recordings;
use crate::replayed::{call, position, replay};
use rohrpost::schema::{DataItem, DataKind, Description, Field, Type};
use rohrpost_recording::{Message, Writer};
use std::path::PathBuf;
use std::time::{Duration, Instant};

const MODULES: &str = r#"
[nodes.main]
[[module]]
name = "calib.0"
program = "calib"
[[module]]
name = "laser.0"
program = "laser"
"#;

const BEGIN_NS: u64 = 1_700_000_000_000_000_000;
const OFFSET: u8 = 77;

fn description(class: &str, item: &str, kind: DataKind) -> Description {
    let name = class.chars().take(1).flat_map(char::to_uppercase).chain(class.chars().skip(1)).collect();
    let data = vec![DataItem { number: 1, kind, field: Field::new(item, Type::U8) }];
    Description { name, class: class.into(), text: String::new(), functions: Vec::new(), data }
}

/// Two files of one recording: an offset, which comes once, and a scan each tenth of a second, six in a file.
fn two_files(place: &Place) -> [PathBuf; 2] {
    let session = recordings::session("", "robot.toml", &(head("calib 90, laser 100, tool 16") + MODULES));
    let mut writer = recordings::begin(place, "main", session);
    let mut channel = |class: &str, item: &str, kind: DataKind| {
        let name = format!("{class}.0");
        writer.describe(&name, &description(class, item, kind)).unwrap();
        recordings::channel(&mut writer, &name, item, &Type::U8)
    };
    let offset = channel("calib", "offset", DataKind::Data);
    let scan = channel("laser", "scan", DataKind::Stream);
    let write = |writer: &mut Writer, channel, tenth: u8, value: u8| {
        let arrival_ns = BEGIN_NS + u64::from(tenth) * 100_000_000;
        let (sequence, data) = (tenth.into(), &[value]);
        writer.write(channel, &Message { arrival_ns, stamp_ns: arrival_ns, epoch: 1, sequence, data }).unwrap();
    };
    write(&mut writer, offset, 0, OFFSET);
    for number in 1..=12_u8 {
        if number == 7 {
            drop(writer.rotate().unwrap());
        }
        write(&mut writer, scan, number, number);
    }
    writer.finish().1.unwrap();
    ["main-0001.mcap", "main-0002.mcap"].map(|name| place.path(name))
}

/// Waits until so many older values were played.
fn wait_older(place: &Place, replay: &mut Running, count: u64) {
    until("what is older is played", || {
        replay.assert_runs();
        let said = place.say(&["call", "replay.0", "position", "--json"]);
        said.code == Some(0) && said.json()["older"] == count
    });
}

/// The newest record of the scans.
fn scan(place: &Place) -> u64 {
    place.say(&["stream", "read", "laser.0", "scan", "--json"]).json()["value"].as_u64().unwrap()
}

#[test]
fn a_later_file_is_played_with_what_its_info_says_it_begins_with() {
    let place = Place::new();
    let [_, second] = two_files(&place);
    let said = place.say(&["record", "info", second.to_str().unwrap()]);
    said.ok_with(["begins with the newest of earlier, which is not counted, of calib.0/offset"]);
    let part = place.path("part.mcap");
    let cut = ["record", "cut", second.to_str().unwrap(), "-o", part.to_str().unwrap(), "--names", "calib.0"];
    assert!(place.say(&cut).ok().contains(": 0 messages, "));
    for file in [second, part] {
        let mut replay = replay(&place, &file, &["--names", "calib.0", "--paused"]);
        wait_older(&place, &mut replay, 1);
        assert_eq!(call(&place, "calib.0", &["get", "offset"]), OFFSET);
        place.say(&["call", "replay.0", "resume"]).ok();
        let said = replay.said();
        assert!(said.out.contains("played 0 values of 1 channel in ") && said.code == Some(0), "{said:?}");
        assert!(said.out.contains(" s, and 1 from before its beginning"), "{said:?}");
        place.assert_empty();
    }
}

#[test]
fn from_a_time_on_and_behind_a_seek_each_stream_and_value_is_the_newest_of_before() {
    let place = Place::new();
    let [first, second] = two_files(&place);
    let words = [second.to_str().unwrap(), "--from", "+0.35s", "--paused"];
    let mut replay = replay(&place, &first, &words);
    wait_older(&place, &mut replay, 2);
    assert_eq!((call(&place, "calib.0", &["get", "offset"]), scan(&place)), (OFFSET.into(), 3));
    let began = position(&place);
    assert_eq!((&began["played"], &began["at_s"]), (&0.into(), &0.35.into()), "time is what was asked for");
    place.say(&["call", "replay.0", "step"]).ok();
    until("a value is played", || position(&place)["played"] == 1);
    assert_eq!(scan(&place), 4);
    for (older, at_s, newest) in [(4, "0.95", 9), (6, "0.25", 2), (6, "0", 2)] {
        place.say(&["call", "replay.0", "seek", at_s]).ok();
        wait_older(&place, &mut replay, older);
        assert_eq!(scan(&place), newest, "at {at_s} s");
    }
    assert_eq!(position(&place)["played"], 1);
    place.say(&["call", "replay.0", "resume"]).ok();
    let said = replay.said();
    assert!(said.out.contains("played 14 values of 2 channels in "), "{said:?}");
}

/// Such a round would begin again at once, as fast as a processor can.
#[test]
fn a_looped_part_without_length_takes_a_tenth_of_a_second_a_round() {
    let place = Place::new();
    let [first, _] = two_files(&place);
    let mut replay = replay(&place, &first, &["--names", "calib.0", "--loop", "--rate", "1000"]);
    replay.wait_for("--loop: what is repeated lasts 0ns; each round takes 100ms at least");
    let rounds = |place: &Place| {
        let said = place.say(&["call", "replay.0", "position", "--json"]);
        (said.code == Some(0)).then(|| said.json()["rounds"].as_u64().unwrap())
    };
    let before = wait("it repeats", || rounds(&place).filter(|rounds| *rounds > 0));
    let began = Instant::now();
    let after = wait("it repeats on", || rounds(&place).filter(|rounds| *rounds >= before + 5));
    // One of them may have ended just then.
    let least = Duration::from_millis(100) * (after - before - 1) as u32;
    assert!(began.elapsed() >= least - Duration::from_millis(50), "{} rounds in {:?}", after - before, began.elapsed());
    assert!(call(&place, "calib.0", &["get", "offset"]) == OFFSET);
    place.end(&mut replay);
}
