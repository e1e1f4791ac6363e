//! Exact replay of a module that reads long records which are recorded anyhow: its journal has their sums.

use crate::exact::{recording, replayed, seers_recorded, wait_journaled};
use crate::harness::{Place, Robot, halt, signal, until};
use crate::recordings::messages;
use crate::seer::PICTURE_BYTES;
use nix::sys::signal::Signal;
use rohrpost_mailbox::StreamId;
use std::path::Path;

/// Messages of a topic: their sequences and lengths.
fn recorded(file: &Path, topic: &str) -> Vec<(u32, usize)> {
    messages(file, |channel, message| {
        (channel.topic == topic && !channel.is_repeated()).then_some((message.sequence, message.data.len()))
    })
}

/// Pictures that were ever written.
fn written(robot: &Robot) -> u64 {
    let id = StreamId { name: robot.name("seer.0"), number: 2 };
    robot.node.inspect_stream(id).unwrap().unwrap().written
}

#[test]
fn long_records_are_taken_out_of_the_recording_and_a_missing_one_is_refused() {
    let place = Place::new();
    let (mut launch, _robot) = seers_recorded(&place, &["pictures"], "streams = [\"seer.0/picture\"]\n");
    let file = recording(&place, 1);
    let is_recorded = || place.say(&["call", "logd.0", "channels", "0"]).ok().contains("seer.0/picture");
    until("its pictures are recorded", is_recorded);
    // From now on it writes pictures, and reads each twice.
    place.say(&["call", "seer.0", "add", "1"]).ok();
    wait_journaled(&file, "seer.0", 20);
    launch.stop();

    let lengths = |topic| recorded(&file, topic).into_iter().map(|(_, bytes)| bytes).collect::<Vec<_>>();
    let (pictures, picture_bytes) = (lengths("seer.0/picture").len(), lengths("seer.0/picture").iter().sum::<usize>());
    let journal_bytes: usize = lengths("seer.0/journal").iter().sum();
    assert!(pictures > 5 && picture_bytes >= pictures * PICTURE_BYTES, "{pictures} pictures, {picture_bytes} B");
    assert!(journal_bytes < picture_bytes / 10, "{journal_bytes} B of the journal, {picture_bytes} B of pictures");
    let run = &replayed(&place, &file, &[])[0];
    assert_eq!((&run["result"], &run["is_whole"]), (&"identical".into(), &true.into()), "{run:#}");
    assert!(run["outputs"].as_u64() >= Some(2 * pictures as u64), "{pictures} pictures, {run:#}");
    let said = place.say(&["replay", "--exact", file.to_str().unwrap(), "seer.0", "--list"]);
    said.ok_with(["it is given what is recorded anyhow: record 0 of stream 2 of 1.110.0.0, "]);

    let part = place.path("part.mcap");
    let [from, to] = [&file, &part].map(|path| path.to_str().unwrap());
    place.say(&["record", "cut", from, "-o", to, "--names", "seer.0/journal"]).ok();
    let run = &replayed(&place, &part, &[])[0];
    assert_eq!(run["result"], "refused", "{run:#}");
    assert!(run["events"].as_u64() > Some(2), "{run:#}");
    let why = run["why"].as_str().unwrap();
    assert!(why.starts_with("record 0 of stream 2 of 1.110.0.0, ") && why.contains("is not in the recording"), "{why}");
}

#[test]
fn a_recorder_that_starts_again_goes_on_behind_what_is_in_a_file() {
    let place = Place::new();
    let (mut launch, robot) = seers_recorded(&place, &["pictures"], "streams = [\"seer.0/picture\"]\n");
    let [first, second, third] = [1, 2, 3].map(|number| recording(&place, number));
    let is_recorded = || place.say(&["call", "logd.0", "channels", "0"]).ok().contains("seer.0/picture");
    until("its pictures are recorded", &is_recorded);
    place.say(&["call", "seer.0", "add", "1"]).ok();
    wait_journaled(&first, "seer.0", 20);

    // Pictures come while there is no recorder, and no more than the stream keeps.
    let (killed, seer) = (robot.pid("logd.0"), robot.pid("seer.0"));
    signal(killed, Signal::SIGKILL);
    let before = written(&robot);
    until("pictures that nobody records", || written(&robot) > before + 5);
    halt(seer);
    robot.wait_restarted("logd.0", killed);
    until("its pictures are recorded again", &is_recorded);
    signal(seer, Signal::SIGCONT);
    wait_journaled(&second, "seer.0", 20);
    let recovered = rohrpost_recording::recovered_path(&first);
    until("what was killed is made whole", || recovered.exists());
    halt(seer);
    place.say(&["restart", "logd.0"]).ok();
    until("its pictures are recorded by the third", is_recorded);
    signal(seer, Signal::SIGCONT);
    wait_journaled(&third, "seer.0", 20);
    launch.stop();

    let files = [recovered, second, third];
    let pictures = files.iter().flat_map(|file| recorded(file, "seer.0/picture"));
    let sequences: Vec<u32> = pictures.map(|(sequence, _)| sequence).collect();
    assert!(sequences.len() > 15, "{sequences:?}");
    assert_eq!(sequences, (0..sequences.len() as u32).collect::<Vec<_>>(), "nothing twice, and nothing missing");
    let all = place.path("all.mcap");
    let merged = files.iter().map(|file| file.to_str().unwrap());
    let command: Vec<&str> = ["record", "merge", "-o", all.to_str().unwrap()].into_iter().chain(merged).collect();
    place.say(&command).ok();
    let run = &replayed(&place, &all, &[])[0];
    assert_eq!((&run["result"], &run["is_whole"]), (&"identical".into(), &true.into()), "{run:#}");
}
