//! A replay that begins somewhere has the newest message of each channel from before, marked as older.

use super::beginning::three_files;
use super::foreign;
use super::support::{Said, cut_off, file_of, memory_folder, noise, options, read, record, said};
use crate::disk::RealDisk;
use crate::read::frames::Frames;
use crate::read::index::Index;
use crate::{Cue, Damage, Options, Player, ReadError, Rotation, Selection, cut, merge};
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Topic and number of a message.
type Which = (String, u32);

/// What a player did.
#[derive(Default)]
struct Played {
    /// When time began first.
    begun_ns: Option<u64>,
    older: Vec<Which>,
    rest: Vec<Which>,
    errors: Vec<ReadError>,
}

/// Plays from a time on to the end, without lines.
fn played(files: &[PathBuf], from_ns: u64) -> Played {
    let mut player = Player::new(files.to_vec(), |channel| channel.topic != "output.0/line");
    assert!(player.seek(from_ns).unwrap());
    let (mut played, mut now_ns) = (Played::default(), 0);
    loop {
        match player.poll(now_ns) {
            Ok(Cue::Begin { system_ns, .. }) => {
                played.begun_ns.get_or_insert(system_ns);
                now_ns = system_ns;
            }
            Ok(Cue::Message(channel, message)) if channel.is_repeated() => {
                assert_eq!((message.arrival_ns, played.rest.len()), (now_ns, 0), "at once, and first");
                played.older.push((channel.topic.to_string(), message.sequence));
            }
            Ok(Cue::Message(channel, message)) => played.rest.push((channel.topic.to_string(), message.sequence)),
            Ok(Cue::Wait { until_ns }) => now_ns = until_ns,
            Ok(Cue::Busy) => {}
            Ok(Cue::End) => return played,
            // The end of a file that was not closed.
            Err(ReadError::Damaged { what: Damage::Cut, .. }) => {}
            Err(error) => played.errors.push(error),
        }
    }
}

fn which(said: &Said) -> Which {
    (said.topic.clone(), said.sequence)
}

/// What a recording without a step of time says: what is true at a time, and what comes from then on.
fn course(all: &[Said], from_ns: u64) -> (Vec<Which>, Vec<Which>) {
    let all = || all.iter().filter(|said| said.topic != "output.0/line");
    let mut newest: BTreeMap<&str, &Said> = BTreeMap::new();
    newest.extend(all().filter(|said| said.arrival_ns < from_ns).map(|said| (&*said.topic, said)));
    let mut older: Vec<&Said> = newest.into_values().collect();
    older.sort_by_key(|said| said.stamp_ns);
    (older.into_iter().map(which).collect(), all().filter(|said| said.arrival_ns >= from_ns).map(which).collect())
}

fn check(files: &[PathBuf], all: &[Said]) {
    let last_ns = all.iter().map(|said| said.arrival_ns).max().unwrap();
    let times = all.iter().flat_map(|said| [said.arrival_ns, said.arrival_ns + 1]);
    for from_ns in times.filter(|from_ns| *from_ns <= last_ns).step_by(all.len() / 40 + 1).chain([last_ns]) {
        let played = played(files, from_ns);
        assert!(played.errors.is_empty(), "from {from_ns} on: {:?}", played.errors);
        assert_eq!((played.older, played.rest), course(all, from_ns), "from {from_ns} on");
    }
}

#[test]
fn at_any_time_of_a_recording_each_channel_has_its_newest_message() {
    let folder = memory_folder();
    let files = three_files(folder.path());
    let all: Vec<Said> = files.iter().flat_map(|file| read(file).0).collect();
    check(&files, &all);
    // A later file alone knows what came before it, wherever it is played from.
    let first_ns = read(&files[1]).0[0].arrival_ns;
    for from_ns in [0, first_ns, first_ns + 1] {
        let played = played(&files[1..], from_ns);
        assert_eq!(played.older, course(&all, first_ns + 1).0, "from {from_ns} on");
        assert_eq!(played.begun_ns, Some(first_ns.max(from_ns)));
    }
    // What a file between the two would have said, the later one repeats.
    let gap = [files[0].clone(), files[2].clone()];
    let third_ns = read(&files[2]).0[0].arrival_ns;
    assert_eq!(played(&gap, third_ns).older, course(&all, third_ns).0);
    let mut player = Player::new(gap.to_vec(), |channel| channel.topic == "laser.0/scan");
    let mut numbers = Vec::new();
    loop {
        match player.poll(u64::MAX).unwrap() {
            Cue::Message(channel, message) => numbers.push((message.sequence, channel.is_repeated())),
            Cue::End => break,
            Cue::Begin { .. } | Cue::Wait { .. } | Cue::Busy => {}
        }
    }
    let before: Vec<u32> = (4..24).collect();
    assert_eq!(numbers[..20].iter().map(|(number, _)| *number).collect::<Vec<_>>(), before);
    assert_eq!(numbers[20..], [(30, true)], "the newest of the file that is left out, and none twice");
    files.iter().for_each(|file| cut_off(file, 20));
    check(&files, &all);
}

#[test]
fn parts_and_merged_files_have_it_too() {
    let folder = memory_folder();
    let (all, mut others) = (said(600, 100), said(600, 100));
    for said in &mut others {
        (said.topic, said.arrival_ns) = (format!("rear-{}", said.topic), said.arrival_ns + 2_000);
    }
    let files = [file_of(folder.path(), "front", &all), file_of(folder.path(), "rear", &others)];
    let merged = folder.path().join("merged.mcap");
    merge(&files, &merged, &mut |_, _| {}).unwrap();
    let mut both = [all, others].concat();
    both.sort_by_key(|said| said.arrival_ns);
    check(std::slice::from_ref(&merged), &both);
    let part = folder.path().join("part.mcap");
    let from_ns = both[500].arrival_ns;
    let selection = Selection { from_ns: Some(from_ns), ..Selection::default() };
    cut(&merged, &part, &selection, &mut |_, _| {}).unwrap();
    for from_ns in [from_ns, both[501].arrival_ns, both[900].arrival_ns] {
        let played = played(std::slice::from_ref(&part), from_ns);
        assert_eq!((played.older, played.rest), course(&both, from_ns), "from {from_ns} on");
    }
}

#[test]
fn another_recording_says_nothing_of_this_one() {
    let folder = memory_folder();
    let all = said(60, 10);
    let mut later = all[30..].to_vec();
    later.iter_mut().for_each(|said| said.arrival_ns += 1_000_000);
    let files = [file_of(folder.path(), "a", &all), file_of(folder.path(), "b", &later)];
    for from_ns in [5_000, later[0].arrival_ns] {
        let played = played(&files, from_ns);
        assert_eq!((played.older.len(), played.begun_ns), (0, Some(later[0].arrival_ns)), "from {from_ns} on");
    }
    assert_eq!(played(&files, later[4].arrival_ns).older, course(&later, later[4].arrival_ns).0);
}

#[test]
fn before_a_step_of_time_what_came_later_is_not_older() {
    let folder = memory_folder();
    let mut all = said(300, 100);
    for said in &mut all[200..] {
        (said.arrival_ns, said.epoch) = (said.arrival_ns - 2_500, 2);
    }
    let file = file_of(folder.path(), "a", &all);
    // From 1000 to 2990, then from 500 to 1490.
    let from_ns = all[150].arrival_ns;
    let newest = all[147..150].iter().map(which).collect::<Vec<_>>();
    let played = played(std::slice::from_ref(&file), from_ns);
    assert_eq!((played.older, played.begun_ns), (newest, Some(from_ns)));
    let part = folder.path().join("part.mcap");
    cut(&file, &part, &Selection { from_ns: Some(600), ..Selection::default() }, &mut |_, _| {}).unwrap();
    assert_eq!(crate::info(&part).unwrap().repeated, 0, "nothing came before the first message that is taken");
}

#[test]
fn damage_before_the_place_is_told_and_hides_no_other_channel() {
    let folder = memory_folder();
    let mut all = said(4_000, 1_000);
    all[10].topic = "mapper.0/map".into();
    let rotation = Rotation::default();
    record(Box::new(RealDisk), Options { rotation, ..options(folder.path()) }, &all);
    let path = folder.path().join("base-0001.mcap");
    let from_ns = all[3_900].arrival_ns;
    assert!(played(std::slice::from_ref(&path), from_ns).older.contains(&which(&all[10])));
    let mut bytes = std::fs::read(&path).unwrap();
    // In the first chunk, which has the map.
    let at = bytes.windows(100).position(|its| *its == noise(20, 1_000)[..100]).unwrap();
    bytes[at] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    let played = played(std::slice::from_ref(&path), from_ns);
    assert_eq!((played.older.len(), played.rest.len()), (3, 100), "the scans");
    assert!(matches!(&played.errors[..], [ReadError::Damaged { .. }]), "{:?}", played.errors);
}

/// However they are packed.
#[test]
fn files_of_others_have_it_too() {
    let folder = memory_folder();
    for (number, options) in [
        WriteOptions::new().compression(Some(Compression::Zstd)).chunk_size(Some(500)),
        WriteOptions::new().use_chunks(false),
        WriteOptions::new().emit_message_indexes(false),
        WriteOptions::new().emit_statistics(false),
        WriteOptions::new().emit_summary_records(false).emit_summary_offsets(false),
    ]
    .into_iter()
    .enumerate()
    {
        let path = folder.path().join(format!("{number}.mcap"));
        foreign::write(&path, options);
        for (from_ns, newest) in [(2_000, &[0, 1][..]), (20_000, &[16, 17, 18, 19]), (38_500, &[35, 36, 37, 38])] {
            let played = played(std::slice::from_ref(&path), from_ns);
            let numbers: Vec<u32> = played.older.iter().map(|(_, number)| *number).collect();
            assert_eq!(numbers, newest, "{number}, from {from_ns} on");
            assert_eq!((played.rest.len() as u64, played.begun_ns), (40 - from_ns.div_ceil(1_000), Some(from_ns)));
        }
    }
}

/// Several threads wrote it, each its chunks.
#[test]
fn in_files_of_others_the_newest_is_the_newest_by_time() {
    let folder = memory_folder();
    for has_index in [true, false] {
        let path = folder.path().join(format!("{has_index}.mcap"));
        let options = WriteOptions::new().chunk_size(Some(100)).profile("ros2").emit_message_indexes(has_index);
        let mut writer = options.create(std::fs::File::create(&path).unwrap()).unwrap();
        let channel_id = writer.add_channel(0, "/imu", "raw", &BTreeMap::new()).unwrap();
        for log_time in [1_000, 3_000, 2_000, 4_000] {
            let header = MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
            writer.write_to_known_channel(&MessageHeader { sequence: log_time as u32, ..header }, &[7; 200]).unwrap();
        }
        writer.finish().unwrap();
        assert_eq!(played(&[path], 3_500).older, [("/imu".to_owned(), 3_000)], "{has_index}");
    }
}

/// What it repeats is taken, what is damaged is told, and the rest is played.
#[test]
fn damage_behind_what_a_file_repeats_is_passed_over() {
    let folder = memory_folder();
    let path = folder.path().join("0.mcap");
    let mut writer = WriteOptions::new()
        .profile(crate::format::PROFILE)
        .compression(None)
        .create(std::fs::File::create(&path).unwrap())
        .unwrap();
    let texts = BTreeMap::from([(crate::format::key::REPEATED.to_owned(), "true".to_owned())]);
    let repeated = writer.add_channel(0, "/a", "raw", &texts).unwrap();
    let own = writer.add_channel(0, "/b", "raw", &BTreeMap::new()).unwrap();
    for (sequence, (channel_id, log_time)) in (0..).zip([(repeated, 10), (own, 10), (own, 20)]) {
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, &[7; 100]).unwrap();
        writer.flush().unwrap();
    }
    writer.finish().unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    let chunks = Index::read(&mut Frames::open(&path).unwrap()).unwrap().chunks;
    let ends = chunks[1].chunk_start_offset + chunks[1].chunk_length;
    bytes[ends as usize - 50] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    let Played { older, rest, errors, .. } = played(&[path], 5);
    assert_eq!((older, rest), (vec![("/a".to_owned(), 0)], vec![("/b".to_owned(), 2)]));
    assert!(matches!(errors[..], [ReadError::Damaged { what: Damage::ChunkSum, .. }]), "{errors:?}");
}
