//! Exact replay of a module that reads long records which are recorded anyhow: its journal has their sums.

use crate::exact::{recording, replayed, seers_recorded, wait_journaled};
use crate::harness::{Place, wait};
use crate::seer::PICTURE_BYTES;
use std::path::Path;

/// Messages of a topic, and their bytes.
fn recorded(file: &Path, topic: &str) -> (usize, usize) {
    let mut reader = rohrpost_recording::Reader::open(file).unwrap();
    let (mut count, mut bytes) = (0, 0);
    while let Some((channel, message)) = reader.next().unwrap() {
        if channel.topic == topic && !channel.is_repeated() {
            (count, bytes) = (count + 1, bytes + message.data.len());
        }
    }
    (count, bytes)
}

#[test]
fn long_records_are_taken_out_of_the_recording_and_a_missing_one_is_refused() {
    let place = Place::new();
    let (mut launch, robot) = seers_recorded(&place, &["pictures"], "streams = [\"seer.0/picture\"]\n");
    let file = recording(&place, 1);
    let is_recorded = || place.say(&["call", "logd.0", "channels", "0"]).ok().contains("seer.0/picture");
    wait("its pictures are recorded", || is_recorded().then_some(()));
    // From now on it writes pictures, and reads each twice.
    place.say(&["call", "seer.0", "add", "1"]).ok();
    wait_journaled(&file, "seer.0", 20);
    drop(robot);
    launch.stop();

    let (pictures, picture_bytes) = recorded(&file, "seer.0/picture");
    let (_, journal_bytes) = recorded(&file, "seer.0/journal");
    assert!(pictures > 5 && picture_bytes >= pictures * PICTURE_BYTES, "{pictures} pictures, {picture_bytes} B");
    assert!(journal_bytes < picture_bytes / 10, "{journal_bytes} B of the journal, {picture_bytes} B of pictures");
    let run = &replayed(&place, &file, &[])[0];
    assert_eq!((&run["result"], &run["is_whole"]), (&"identical".into(), &true.into()), "{run:#}");
    assert!(run["outputs"].as_u64() >= Some(2 * pictures as u64), "{pictures} pictures, {run:#}");
    let listed = place.say(&["replay", "--exact", file.to_str().unwrap(), "seer.0", "--list"]).ok();
    assert!(listed.contains("it is given what is recorded anyhow: record 0 of stream 2 of 1.110.0.0, "), "{listed}");

    let part = place.path("part.mcap");
    place.say(&["record", "cut", file.to_str().unwrap(), part.to_str().unwrap(), "seer.0/journal"]).ok();
    let run = &replayed(&place, &part, &[])[0];
    assert_eq!(run["result"], "refused", "{run:#}");
    assert!(run["events"].as_u64() > Some(2), "{run:#}");
    let why = run["why"].as_str().unwrap();
    assert!(why.starts_with("record 0 of stream 2 of 1.110.0.0, ") && why.contains("is not in the recording"), "{why}");
}
