//! What an index says of the places of parts: checked against the file.

use super::support::memory_folder;
use crate::format::op;
use crate::read::frames::HEAD_BYTES;
use crate::{CutError, Damage, ReadError, Reader, SelectError, Selection, cut, info};
use mcap::WriteOptions;
use mcap::records::{MessageHeader, Metadata};
use std::collections::BTreeMap;
use std::path::Path;

/// Where a record of the index says where a part is, and of an attachment also how long.
const OFFSET: usize = HEAD_BYTES;
const LENGTH: usize = OFFSET + 8;

/// A file of another program with chunks of a message each, metadata and an attachment.
fn file(chunks: usize) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = WriteOptions::new().calculate_summary_section_crc(false).create(&mut bytes).unwrap();
    let channel_id = writer.add_channel(0, "/a", "raw", &BTreeMap::new()).unwrap();
    let header = MessageHeader { channel_id, sequence: 0, log_time: 5, publish_time: 5 };
    for _ in 0..chunks {
        writer.write_to_known_channel(&header, &[7; 50]).unwrap();
        writer.flush().unwrap();
    }
    let texts = BTreeMap::from([("colour".to_owned(), "red".to_owned())]);
    writer.write_metadata(&Metadata { name: "theirs".into(), metadata: texts }).unwrap();
    let (name, media_type) = ("calib.bin".to_owned(), "application/octet-stream".to_owned());
    let data = [7; 50].as_slice().into();
    writer.attach(&mcap::Attachment { log_time: 1, create_time: 1, name, media_type, data }).unwrap();
    writer.finish().unwrap();
    drop(writer);
    bytes.into_inner()
}

/// Where the records of a type are.
fn places(bytes: &[u8], wanted: u8) -> Vec<usize> {
    let (mut at, mut places) = (mcap::MAGIC.len(), Vec::new());
    while at < bytes.len() - mcap::MAGIC.len() {
        if bytes[at] == wanted {
            places.push(at);
        }
        at += HEAD_BYTES + number(bytes, at + 1) as usize;
    }
    places
}

fn number(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

fn set(bytes: &mut [u8], at: usize, number: u64) {
    bytes[at..at + 8].copy_from_slice(&number.to_le_bytes());
}

fn cut_all(path: &Path) -> Result<(u64, u64), CutError> {
    let to = path.with_extension("cut");
    let _ = std::fs::remove_file(&to);
    cut(path, &to, &Selection::default(), &mut |_, _| {})
}

#[test]
fn an_attachment_is_as_long_as_its_record_and_ends_in_the_file() {
    const LONG: u64 = 1 << 40;
    let folder = memory_folder();
    let path = folder.path().join("a.mcap");
    let good = file(1);
    let (record, index) = (places(&good, op::ATTACHMENT)[0], places(&good, op::ATTACHMENT_INDEX)[0]);
    let long = number(&good, index + LENGTH);
    // Two times, two texts.
    let data_size = record + HEAD_BYTES + 16 + 4 + "calib.bin".len() + 4 + "application/octet-stream".len();
    assert_eq!(number(&good, data_size), 50);
    std::fs::write(&path, &good).unwrap();
    cut_all(&path).unwrap();
    for (case, changes) in [
        ("longer than the record", &[(index + LENGTH, long + 1)][..]),
        ("nothing there", &[(index + OFFSET, record as u64 + 1)]),
        ("behind all numbers", &[(index + OFFSET, u64::MAX - 4)]),
        ("longer than the file", &[(index + LENGTH, LONG), (record + 1, LONG - 9), (data_size, LONG - 200)]),
    ] {
        let mut bytes = good.clone();
        changes.iter().for_each(|(at, number)| set(&mut bytes, *at, *number));
        std::fs::write(&path, bytes).unwrap();
        let told = cut_all(&path);
        let what = Damage::Record { op: op::ATTACHMENT };
        let is_it = |error: &ReadError| matches!(error, ReadError::Damaged { what: its, .. } if *its == what);
        assert!(matches!(&told, Err(CutError::Select(SelectError::Read(error))) if is_it(error)), "{case}: {told:?}");
    }
}

/// A part that is listed a hundred times is there once.
#[test]
fn what_is_listed_often_is_read_once() {
    const TIMES: usize = 100;
    let folder = memory_folder();
    let path = folder.path().join("a.mcap");
    // In the statistics: messages, schemas, channels, and then these counts.
    for (listed, count) in [(op::ATTACHMENT_INDEX, 14), (op::METADATA_INDEX, 18), (op::CHUNK_INDEX, 22)] {
        let mut bytes = file(1);
        let count = places(&bytes, op::STATISTICS)[0] + HEAD_BYTES + count;
        assert_eq!(bytes[count..count + 4], [1, 0, 0, 0], "{listed}");
        bytes[count..count + 4].copy_from_slice(&(TIMES as u32).to_le_bytes());
        let index = places(&bytes, listed)[0];
        let ends = index + HEAD_BYTES + number(&bytes, index + 1) as usize;
        let more = bytes[index..ends].repeat(TIMES - 1);
        bytes.splice(ends..ends, more);
        std::fs::write(&path, bytes).unwrap();
        let told = info(&path).unwrap();
        let parts = (told.messages, told.chunks, told.others.len(), told.attachments.len());
        assert_eq!(parts, (1, 1, 1, 1), "{listed}");
        cut_all(&path).unwrap();
        let told = info(&path.with_extension("cut")).unwrap();
        assert_eq!((told.messages, told.attachments.len()), (1, 1), "{listed}");
        assert_eq!(told.others.iter().filter(|(name, _)| name == "theirs").count(), 1, "{listed}");
        let mut reader = Reader::select(&path, &Selection::default()).unwrap();
        let messages = std::iter::from_fn(|| reader.next().unwrap().map(|_| ())).count();
        assert_eq!(messages, 1, "{listed}");
    }
}

/// Nor behind the last record. Each is read once, also in the order of time.
#[test]
fn a_chunk_does_not_reach_into_the_next_one() {
    const CHUNK_LENGTH: usize = HEAD_BYTES + 24;
    let folder = memory_folder();
    let path = folder.path().join("a.mcap");
    for chunk in 0..3 {
        let mut bytes = file(3);
        let index = places(&bytes, op::CHUNK_INDEX)[chunk];
        set(&mut bytes, index + CHUNK_LENGTH, u64::MAX);
        std::fs::write(&path, bytes).unwrap();
        let mut reader = Reader::to_play(&path).unwrap();
        let messages = std::iter::from_fn(|| reader.next().unwrap().map(|_| ())).count();
        assert_eq!((messages, info(&path).unwrap().messages), (3, 3), "chunk {chunk}");
    }
}
