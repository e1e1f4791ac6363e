//! Small files that ask for much: what is kept of them is bounded, and limits are told as limits.

use super::support::memory_folder;
use crate::format::{DESCRIBED_BYTES_MAX, SCHEMA_ENCODING, op};
use crate::{FileLimit, ReadError, Reader, RecoverError, info, recover};
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};
use rohrpost_schema::Type;
use std::collections::BTreeMap;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::Arc;

/// A compressed file of channels of one type, with these texts and a message each.
fn write(path: &Path, channels: u16, ty: &Type, texts: &BTreeMap<String, String>) {
    let options = WriteOptions::new().compression(Some(Compression::Zstd)).repeat_channels(false);
    let mut writer = options.create(std::fs::File::create(path).unwrap()).unwrap();
    let schema = writer.add_schema("T", SCHEMA_ENCODING, &ty.to_bytes()).unwrap();
    for number in 0..channels {
        let channel_id = writer.add_channel(schema, &format!("a.0/b{number}"), "postcard", texts).unwrap();
        let header = MessageHeader { channel_id, sequence: 0, log_time: 1, publish_time: 1 };
        writer.write_to_known_channel(&header, &[]).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn a_type_is_read_once_for_all_of_its_channels() {
    let folder = memory_folder();
    let path = folder.path().join("one.mcap");
    write(&path, 1_000, &Type::Tuple(vec![Type::U8; 16_000]), &BTreeMap::new());
    let told = info(&path).unwrap();
    let types: Vec<&Arc<Type>> = told.channels.iter().map(|channel| channel.ty.as_ref().unwrap()).collect();
    assert!(types.len() == 1_000 && types.iter().all(|ty| Arc::ptr_eq(ty, types[0])));
    let (mut reader, mut first) = (Reader::open(&path).unwrap(), None);
    while let Some((channel, _)) = reader.next().unwrap() {
        let ty = channel.ty.clone().unwrap();
        assert!(Arc::ptr_eq(first.get_or_insert(ty.clone()), &ty));
    }
}

#[test]
fn descriptions_beyond_the_limit_are_refused_as_such() {
    let folder = memory_folder();
    let path = folder.path().join("long.mcap");
    let texts = BTreeMap::from([("text".to_owned(), "a".repeat(1 << 20))]);
    write(&path, 40, &Type::Unit, &texts);
    assert!(std::fs::metadata(&path).unwrap().len() < 1 << 20, "what is compressed says nothing of what it takes");
    let check = |error: &ReadError| {
        assert!(matches!(error, ReadError::TooMuch { limit: FileLimit::Described, .. }), "{error}");
        let says = "what it describes (types, channels, modules, metadata) takes more than 256 MiB of memory";
        assert!(error.to_string().contains(says), "{error}");
    };
    check(&info(&path).unwrap_err());
    let mut reader = Reader::open(&path).unwrap();
    check(&std::iter::repeat_with(|| reader.next().map(drop)).find_map(Result::err).unwrap());
    match recover(&path, &folder.path().join("new.mcap"), &mut |_, _| {}) {
        Err(RecoverError::Read(error)) => check(&error),
        other => panic!("{other:?}"),
    }
}

/// The file is sparse: its texts are of zeroes, and take no room.
#[test]
fn metadata_beyond_the_limit_are_refused_as_such() {
    const TEXT_BYTES: usize = 16 << 20;
    let folder = memory_folder();
    let path = folder.path().join("long.mcap");
    let file = std::fs::File::create(&path).unwrap();
    file.write_all_at(mcap::MAGIC, 0).unwrap();
    let mut at = mcap::MAGIC.len() as u64;
    for _ in 0..DESCRIBED_BYTES_MAX / TEXT_BYTES {
        // No name; length of the list; no key; length of its text.
        let fields = [0, 8 + TEXT_BYTES as u32, 0, TEXT_BYTES as u32].map(u32::to_le_bytes).concat();
        let len = (fields.len() + TEXT_BYTES) as u64;
        file.write_all_at(&[&[op::METADATA][..], &len.to_le_bytes(), &fields].concat(), at).unwrap();
        at += 9 + len;
        file.set_len(at).unwrap();
    }
    let error = info(&path).err().unwrap();
    assert!(matches!(error, ReadError::TooMuch { limit: FileLimit::Described, .. }), "{error}");
}

/// A record of these bytes.
fn record(op: u8, body: &[u8]) -> Vec<u8> {
    [&[op][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

/// A file of one chunk, with messages of channels that nothing describes.
fn of_no_channel(path: &Path, channels: &[u16]) {
    let message = |channel: &u16| record(op::MESSAGE, &[&channel.to_le_bytes()[..], &[0; 20]].concat());
    let messages: Vec<u8> = channels.iter().flat_map(message).collect();
    let len = (messages.len() as u64).to_le_bytes();
    // Times, length, no sum, no compression, length.
    let chunk = [&[0; 16][..], &len, &[0; 8], &len, &messages].concat();
    std::fs::write(path, [mcap::MAGIC, &record(op::CHUNK, &chunk)].concat()).unwrap();
}

#[test]
fn damages_are_counted_and_the_first_are_listed() {
    let folder = memory_folder();
    let path = folder.path().join("none.mcap");
    for (channels, listed) in [(vec![7; 10_000], 1), ((0..10_000).collect(), 100)] {
        of_no_channel(&path, &channels);
        let told = info(&path).unwrap();
        assert_eq!((told.damage_count, told.damages.len()), (10_000, listed));
        let to = folder.path().join(format!("{listed}.mcap"));
        let told = recover(&path, &to, &mut |_, _| {}).unwrap();
        assert_eq!((told.damage_count, told.damages.len()), (10_000, listed));
    }
}

/// Each chunk seems to have all that follow in it, and to end where no record begins.
#[test]
fn nested_records_are_not_read_as_often_as_there_are_bytes() {
    const CHUNKS: usize = 10_000;
    const BYTES: u64 = 64;
    let folder = memory_folder();
    let path = folder.path().join("nested.mcap");
    let mut bytes = mcap::MAGIC.to_vec();
    for number in 0..CHUNKS as u64 {
        let len = (CHUNKS as u64 - number) * BYTES - 9 - 5;
        // One byte more than its body says it has: its end is not to be trusted.
        let packed = len - 40 - 1;
        let head =
            [&[op::CHUNK][..], &len.to_le_bytes(), &[0; 16], &packed.to_le_bytes(), &1_u32.to_le_bytes(), &[0; 4]];
        let mut chunk = [&head.concat()[..], &packed.to_le_bytes()].concat();
        chunk.resize(BYTES as usize, 0);
        bytes.extend(chunk);
    }
    std::fs::write(&path, bytes).unwrap();
    let told = recover(&path, &folder.path().join("new.mcap"), &mut |_, _| {}).unwrap();
    assert!(told.messages == 0 && told.damage_count > 2 && told.damage_count < 200, "{told:?}");
}

/// Each of these claims to be longer than the file, which would be read to its end for each of them.
#[test]
fn records_that_claim_much_do_not_have_the_file_read_as_often() {
    const TIMES: usize = 10_000;
    const CLAIMED: u64 = 100 << 20;
    let folder = memory_folder();
    // Of no bytes: its body is forty zeroes.
    let chunk = [&[op::CHUNK][..], &CLAIMED.to_le_bytes(), &[0; 40]].concat();
    let index = [&record(op::MESSAGE_INDEX, &[0; 6])[..], &[op::SCHEMA], &CLAIMED.to_le_bytes()].concat();
    for (case, bytes) in [("chunks", chunk), ("schemas", index)] {
        let [path, to] = ["mcap", "new"].map(|kind| folder.path().join(case).with_extension(kind));
        std::fs::write(&path, [mcap::MAGIC, &bytes.repeat(TIMES)].concat()).unwrap();
        let told = recover(&path, &to, &mut |_, _| {}).unwrap();
        assert!(told.messages == 0 && told.damage_count > 2 && told.damage_count < 200, "{case}: {told:?}");
    }
}
