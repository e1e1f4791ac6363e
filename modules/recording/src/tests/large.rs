//! Long messages and chunks, as other programs write them, are read; what is longer than that is told as a limit.

use super::support::memory_folder;
use crate::format::{RECORD_BYTES_MAX, op};
use crate::write::records;
use crate::{FileLimit, ReadError, Reader, Selection, cut, info, merge, recover};
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};
use std::collections::BTreeMap;
use std::path::Path;

/// A message each of these lengths; all are in one chunk, or in none.
fn write(path: &Path, options: WriteOptions, lengths: &[usize]) {
    let options = options.compression(Some(Compression::Zstd)).chunk_size(None);
    let mut writer = options.create(std::fs::File::create(path).unwrap()).unwrap();
    let channel_id = writer.add_channel(0, "/cloud", "raw", &BTreeMap::new()).unwrap();
    for (number, len) in (0..).zip(lengths) {
        let header = MessageHeader { channel_id, sequence: number, log_time: number.into(), publish_time: 0 };
        writer.write_to_known_channel(&header, &vec![number as u8; *len]).unwrap();
    }
    writer.finish().unwrap();
}

fn lengths(reader: &mut Reader) -> Vec<usize> {
    let mut all = Vec::new();
    while let Some((_, message)) = reader.next().unwrap() {
        all.push(message.data.len());
    }
    all
}

#[test]
fn long_messages_and_chunks_of_others_are_read_and_kept() {
    let wanted = [30 << 20, 5, 22 << 20];
    for options in [WriteOptions::new(), WriteOptions::new().use_chunks(false)] {
        let folder = memory_folder();
        let [path, part, merged, whole] = ["long", "part", "merged", "whole"].map(|name| folder.path().join(name));
        write(&path, options, &wanted);
        let all = Selection::default();
        cut(&path, &part, &all, &mut |_, _| {}).unwrap();
        merge(std::slice::from_ref(&path), &merged, &mut |_, _| {}).unwrap();
        assert_eq!(recover(&path, &whole, &mut |_, _| {}).unwrap().damages, []);
        for path in [&path, &part, &merged, &whole] {
            assert_eq!(info(path).unwrap().messages, 3, "{}", path.display());
            assert_eq!(lengths(&mut Reader::select(path, &all).unwrap()), wanted, "{}", path.display());
            assert_eq!(lengths(&mut Reader::to_play(path).unwrap()), wanted, "{}", path.display());
        }
    }
}

/// A chunk that is said to be this long before compression, between two others.
#[test]
fn what_is_longer_is_told_as_a_limit_and_costs_itself_alone() {
    let folder = memory_folder();
    let [short, path, to] = ["short", "long", "whole"].map(|name| folder.path().join(name));
    write(&short, WriteOptions::new().emit_summary_records(false), &[3]);
    let bytes = std::fs::read(&short).unwrap();
    let chunk_at = 8 + 9 + u64::from_le_bytes(*bytes[9..].first_chunk().unwrap()) as usize;
    let chunk_len = 9 + u64::from_le_bytes(*bytes[chunk_at + 1..].first_chunk().unwrap()) as usize;
    let chunk = &bytes[chunk_at..chunk_at + chunk_len];
    let mut long = Vec::new();
    let claimed = RECORD_BYTES_MAX as u64 + 1;
    records::put(&mut long, op::CHUNK, |body| {
        body.raw(&chunk[9..25]).u64(claimed).raw(&chunk[33..]);
    });
    std::fs::write(&path, [&bytes[..chunk_at], chunk, &long, &bytes[chunk_at..]].concat()).unwrap();
    let limit = FileLimit::Chunk(claimed);
    let says = "a chunk of 134217729 bytes before compression; chunks of up to 128 MiB are read";
    let error = cut(&path, &folder.path().join("part"), &Selection::default(), &mut |_, _| {}).unwrap_err();
    assert!(error.to_string().contains(says) && !error.to_string().contains("damaged"), "{error}");
    let mut reader = Reader::open(&path).unwrap();
    assert!(reader.next().unwrap().is_some());
    let error = reader.next().map(drop).unwrap_err();
    assert!(matches!(error, ReadError::TooMuch { limit: told, .. } if told == limit), "{error}");
    let told = recover(&path, &to, &mut |_, _| {}).unwrap();
    assert_eq!((told.messages, told.damage_count, told.was_closed), (2, 1, true), "{told:?}");
    assert!(told.damages[0].1.to_string().contains(says), "{told:?}");
}
