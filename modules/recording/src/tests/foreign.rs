//! Files of other programs: listed, whatever they hold and however they are packed.

use super::support::memory_folder;
use crate::format::{key, metadata, op};
use crate::read::chunk;
use crate::read::contents::Contents;
use crate::read::frames::Frames;
use crate::read::index::Index;
use crate::{Damage, Info, Reader, Selection, cut, info, merge, recover};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, WriteOptions};
use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::Path;

/// As rosbag2, and others, describe channels: topic, type, schema encoding, message encoding.
const CHANNELS: [(&str, &str, &str, &str); 4] = [
    ("/imu", "sensor_msgs/msg/Imu", "ros2msg", "cdr"),
    ("/pose", "foxglove.PoseInFrame", "protobuf", "protobuf"),
    ("/state", "State", "jsonschema", "json"),
    ("/untyped", "", "", "raw"),
];

/// Forty messages, a microsecond apart, of all channels in turn.
pub(super) fn write(path: &Path, options: WriteOptions) {
    let mut writer = options.profile("ros2").library("other 1.0").create(std::fs::File::create(path).unwrap()).unwrap();
    let ids = CHANNELS.map(|(topic, name, schema_encoding, encoding)| {
        let schema = if name.is_empty() { 0 } else { writer.add_schema(name, schema_encoding, b"text").unwrap() };
        writer.add_channel(schema, topic, encoding, &BTreeMap::new()).unwrap()
    });
    for number in 0..40_u32 {
        let log_time = 1_000 * u64::from(number);
        let channel_id = ids[number as usize % 4];
        let header = MessageHeader { channel_id, sequence: number, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, &[number as u8; 100]).unwrap();
    }
    writer.finish().unwrap();
}

fn check(info: &Info, case: &str) {
    assert_eq!((info.messages, info.lost, info.damages.len(), info.is_closed), (40, 0, 0, true), "{case}");
    assert_eq!((info.profile.as_str(), info.library.as_str()), ("ros2", "other 1.0"), "{case}");
    assert_eq!((info.first_ns, info.last_ns), (Some(0), Some(39_000)), "{case}");
    let channels: Vec<_> = info.channels.iter().collect();
    assert_eq!(channels.len(), CHANNELS.len(), "{case}");
    for (number, (channel, wanted)) in channels.into_iter().zip(CHANNELS).enumerate() {
        let said = (channel.topic.as_str(), channel.type_name.as_str());
        let encodings = (channel.schema_encoding.as_str(), channel.message_encoding.as_str());
        assert_eq!((said, encodings), ((wanted.0, wanted.1), (wanted.2, wanted.3)), "{case}");
        assert_eq!((channel.messages, &channel.ty, &channel.drawn_of), (10, &None, &None), "{case}");
        let first_ns = 1_000 * number as u64;
        assert_eq!((channel.first_ns, channel.last_ns), (Some(first_ns), Some(first_ns + 36_000)), "{case}");
    }
}

#[test]
fn channels_types_encodings_counts_and_times_of_others_are_told() {
    let folder = memory_folder();
    let cases = [
        ("zstd", WriteOptions::new().compression(Some(Compression::Zstd)).chunk_size(Some(500))),
        ("packed by nothing", WriteOptions::new().compression(None).chunk_size(Some(500))),
        ("no chunks", WriteOptions::new().use_chunks(false)),
        ("no index of messages", WriteOptions::new().emit_message_indexes(false)),
        ("no index of chunks", WriteOptions::new().emit_chunk_indexes(false)),
        ("no statistics", WriteOptions::new().emit_statistics(false)),
        ("nothing described again", WriteOptions::new().repeat_channels(false).repeat_schemas(false)),
        ("no schema described again", WriteOptions::new().repeat_schemas(false)),
        ("no summary", WriteOptions::new().emit_summary_records(false).emit_summary_offsets(false)),
    ];
    for (number, (case, options)) in cases.into_iter().enumerate() {
        let path = folder.path().join(format!("{number}.mcap"));
        write(&path, options);
        check(&info(&path).unwrap_or_else(|error| panic!("{case}: {error}")), case);
        let mut reader = Reader::open(&path).unwrap();
        let mut messages = 0;
        while let Some((channel, message)) = reader.next().unwrap() {
            assert_eq!((message.data.len(), channel.is_drawn()), (100, false), "{case}");
            messages += 1;
        }
        assert!(messages == 40 && reader.is_closed(), "{case}: {messages}");
        for from_ns in [20_000, 0, 39_000] {
            assert!(reader.seek(from_ns).unwrap_or_else(|error| panic!("{case}: {error}")), "{case}");
            assert_eq!(reader.next().unwrap().unwrap().1.arrival_ns, from_ns, "{case}");
        }
        assert!(!reader.seek(39_001).unwrap(), "{case}");
    }
}

/// A file of another program with a message on each of three channels that have words of ours, and metadata that do.
fn with_our_words(path: &Path, profile: &str) {
    let options = WriteOptions::new().profile(profile);
    let mut writer = options.create(std::fs::File::create(path).unwrap()).unwrap();
    let (epoch, most) = (key::EPOCH, u64::MAX.to_string());
    for (number, word) in [(key::REPEATED, "true"), (key::DRAWN, "/scan"), (epoch, &most)].into_iter().enumerate() {
        let texts = [word, ("colour", "red")].map(|(key, text)| (key.to_owned(), text.to_owned()));
        let channel_id = writer.add_channel(0, &format!("/{number}"), "raw", &texts.into()).unwrap();
        let header = MessageHeader { channel_id, sequence: 0, log_time: 5, publish_time: 0 };
        writer.write_to_known_channel(&header, &[7]).unwrap();
    }
    for name in [metadata::LOST, metadata::SESSION, "theirs"] {
        let texts = BTreeMap::from([("/0".to_owned(), "9".to_owned())]);
        writer.write_metadata(&Metadata { name: name.into(), metadata: texts }).unwrap();
    }
    writer.finish().unwrap();
}

/// Other programs may mean anything by our words, and nothing is repeated, drawn, or of an epoch.
#[test]
fn our_words_in_files_of_others_mean_nothing() {
    let folder = memory_folder();
    for profile in ["ros2", ""] {
        let path = folder.path().join(format!("{profile}.mcap"));
        with_our_words(&path, profile);
        let mut readers =
            [Reader::open(&path).unwrap(), Reader::select(&path, &Selection::default()).unwrap()].into_iter();
        assert!(readers.all(|mut reader| {
            let mut messages = 0;
            while let Some((channel, message)) = reader.next().unwrap() {
                assert!(!channel.is_repeated() && !channel.is_drawn() && message.epoch == 0, "{channel:?}");
                messages += 1;
            }
            messages == 3
        }));
        let info = info(&path).unwrap();
        assert_eq!((info.messages, info.repeated, info.epochs.len(), info.lost), (3, 0, 0, 0));
        assert!(info.channels.iter().all(|channel| channel.drawn_of.is_none()) && info.session.is_empty());
    }
}

/// They are there, and mean in the new file what they mean in the old one.
#[test]
fn our_words_in_files_of_others_stay_theirs_in_files_that_are_made_of_these() {
    let folder = memory_folder();
    let [theirs, cut_out, before, merged, whole] =
        ["theirs", "cut", "before", "merged", "whole"].map(|name| folder.path().join(name));
    with_our_words(&theirs, "ros2");
    let from = |from_ns| Selection { from_ns, ..Selection::default() };
    assert_eq!(cut(&theirs, &cut_out, &from(None), &mut |_, _| {}).unwrap().0, 3);
    assert_eq!(cut(&theirs, &before, &from(Some(6)), &mut |_, _| {}).unwrap().0, 0);
    // Nothing of it is repeated, though it is there twice.
    assert_eq!(merge(&[theirs.clone(), theirs.clone()], &merged, &mut |_, _| {}).unwrap().0, 6);
    assert_eq!(recover(&theirs, &whole, &mut |_, _| {}).unwrap().messages, 3);
    for (made, messages, repeated) in [(cut_out, 3, 0), (before, 0, 3), (merged, 6, 0), (whole, 3, 0)] {
        let told = info(&made).unwrap();
        assert_eq!((told.messages, told.repeated, told.lost), (messages, repeated, 0), "{}", made.display());
        assert_eq!((told.profile.as_str(), told.session.len()), ("ros2", 0));
        for name in [metadata::LOST, metadata::SESSION, "theirs"] {
            assert!(told.others.iter().any(|(other, texts)| other == name && texts["/0"] == "9"), "{name}: {told:?}");
        }
        assert_eq!(told.channels.len(), 3, "{told:?}");
        let mut contents = Contents::open(&made).unwrap();
        while contents.next().unwrap().is_some() {}
        let words: BTreeSet<_> = contents.definitions().channels().flat_map(|(_, its)| its.unheeded.keys()).collect();
        assert_eq!(
            words.into_iter().collect::<Vec<_>>(),
            [key::DRAWN, key::EPOCH, key::REPEATED],
            "{}",
            made.display()
        );
        assert!(told.channels.iter().all(|channel| channel.drawn_of.is_none()) && told.epochs.is_empty(), "{told:?}");
        let mut reader = Reader::open(&made).unwrap();
        while let Some((channel, _)) = reader.next().unwrap() {
            assert_eq!(channel.texts.get("colour").map(String::as_str), Some("red"), "theirs stay");
        }
    }
}

/// Also where the index does not say where messages are, or of which channels.
#[test]
fn a_part_of_a_file_of_others_is_taken() {
    let folder = memory_folder();
    let cases = [
        WriteOptions::new().chunk_size(Some(500)),
        WriteOptions::new().use_chunks(false),
        WriteOptions::new().emit_message_indexes(false),
        WriteOptions::new().emit_chunk_indexes(false),
        WriteOptions::new().repeat_channels(false).repeat_schemas(false),
        WriteOptions::new().repeat_schemas(false),
    ];
    for (case, options) in cases.into_iter().enumerate() {
        let file = |kind: &str| folder.path().join(format!("{kind}{case}.mcap"));
        write(&file("whole"), options);
        let selection = Selection { from_ns: Some(20_000), names: vec!["/imu".into()], ..Selection::default() };
        assert_eq!(cut(&file("whole"), &file("part"), &selection, &mut |_, _| {}).unwrap().0, 5, "{case}");
        let channels = info(&file("part")).unwrap().channels;
        assert_eq!((channels[0].topic.as_str(), channels[0].messages, channels.len()), ("/imu", 5, 1), "{case}");
    }
}

/// A chunk's body, as the format has it.
fn chunk_of(records: &[u8], claimed: u64, compression: &str, packed: &[u8]) -> Vec<u8> {
    let mut body = [0; 16].to_vec();
    body.extend(claimed.to_le_bytes());
    body.extend(crc32fast::hash(records).to_le_bytes());
    body.extend((compression.len() as u32).to_le_bytes());
    body.extend(compression.bytes());
    body.extend((packed.len() as u64).to_le_bytes());
    body.extend(packed);
    body
}

#[test]
fn chunks_packed_by_lz4_are_read_and_others_are_named() {
    let records: Vec<u8> = (0..100_000_u32).flat_map(|number| (number / 7).to_le_bytes()).collect();
    let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
    encoder.write_all(&records).unwrap();
    let packed = encoder.finish().unwrap();
    let len = records.len() as u64;
    let mut found = Vec::new();
    assert_eq!(chunk::unpack(&chunk_of(&records, len, "lz4", &packed), &mut found), Ok(()));
    assert!(found == records);
    for (claimed, packed) in [(len - 1, &packed[..]), (len + 1, &packed), (len, &packed[..packed.len() / 2])] {
        let told = chunk::unpack(&chunk_of(&records, claimed, "lz4", packed), &mut found);
        assert!(matches!(told, Err(Damage::ChunkSum | Damage::Compression)) && found.is_empty(), "{told:?}");
    }
    let told = chunk::unpack(&chunk_of(&records, len, "bz2", &packed), &mut found);
    assert_eq!(told, Err(Damage::ForeignCompression("bz2".into())));
}

/// Of forty zeroes a chunk of no bytes may be made, with the length that it has.
#[test]
fn a_message_that_could_be_a_chunk_is_one_of_its_type() {
    let folder = memory_folder();
    let path = folder.path().join("0.mcap");
    let mut writer = WriteOptions::new().use_chunks(false).create(std::fs::File::create(&path).unwrap()).unwrap();
    let channel_id = writer.add_channel(0, "/a", "raw", &BTreeMap::new()).unwrap();
    for sequence in 0..5 {
        let header = MessageHeader { channel_id, sequence, log_time: 5, publish_time: 5 };
        writer.write_to_known_channel(&header, &[0; 18]).unwrap();
    }
    writer.finish().unwrap();
    let told = recover(&path, &path.with_extension("new"), &mut |_, _| {}).unwrap();
    assert_eq!((told.messages, told.damages), (5, vec![]));
    // A chunk with a wrong type stays one.
    write(&path, WriteOptions::new().chunk_size(Some(500)));
    let mut bytes = std::fs::read(&path).unwrap();
    let at = Index::read(&mut Frames::open(&path).unwrap()).unwrap().chunks[0].chunk_start_offset;
    assert_eq!(std::mem::replace(&mut bytes[at as usize], op::MESSAGE), op::CHUNK);
    std::fs::write(&path, bytes).unwrap();
    let told = recover(&path, &path.with_extension("other"), &mut |_, _| {}).unwrap();
    assert!(matches!(told.damages[..], [(its, Damage::NoRecord { op: op::MESSAGE, .. })] if its == at), "{told:?}");
}

/// The index says that the last message came before the first. The messages themselves say when they came.
#[test]
fn times_of_an_index_that_contradicts_itself_are_those_of_the_messages() {
    let folder = memory_folder();
    let path = folder.path().join("0.mcap");
    write(&path, WriteOptions::new().calculate_summary_section_crc(false));
    let mut bytes = std::fs::read(&path).unwrap();
    // Statistics: type and length; counts of 8, 2 and four times 4 bytes; two times; a count of each of four channels.
    let head = [&[op::STATISTICS][..], &86_u64.to_le_bytes()].concat();
    let times = bytes.windows(9).rposition(|its| its == head).unwrap() + 9 + 26;
    let (first, last) = bytes[times..times + 16].split_at_mut(8);
    assert_eq!((&*first, &*last), (&[0; 8][..], &39_000_u64.to_le_bytes()[..]));
    first.swap_with_slice(last);
    std::fs::write(&path, bytes).unwrap();
    check(&info(&path).unwrap(), "first and last exchanged");
}
