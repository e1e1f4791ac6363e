//! Damaged files are read as far as they are right; no input panics, and none takes much memory.

use super::support::{Said, file_of, memory_folder, read, said};
use crate::format::op;
use crate::read::contents::{Contents, Item};
use crate::{Selection, cut, info, merge, recover};
use proptest::prelude::*;
use std::path::Path;
use std::sync::OnceLock;

/// A closed file of some chunks.
fn sample() -> &'static (Vec<Said>, Vec<u8>) {
    static SAMPLE: OnceLock<(Vec<Said>, Vec<u8>)> = OnceLock::new();
    SAMPLE.get_or_init(|| {
        let folder = memory_folder();
        let all = said(400, 9_000);
        let bytes = std::fs::read(file_of(folder.path(), "base", &all)).unwrap();
        (all, bytes)
    })
}

/// Whether these are some of all, in their order.
fn is_part(found: &[Said], all: &[Said]) -> bool {
    let mut rest = all.iter();
    found.iter().all(|one| rest.any(|other| other == one))
}

fn try_all(folder: &Path, bytes: &[u8]) -> Option<(crate::Recovered, Vec<Said>)> {
    let path = folder.join("bad.mcap");
    std::fs::write(&path, bytes).unwrap();
    let _ = info(&path);
    let selection = Selection { from_ns: Some(2_000), ..Selection::default() };
    let _ = cut(&path, &folder.join("part.mcap"), &selection, &mut |_, _| {});
    let _ = merge(&[path.clone(), path.clone()], &folder.join("merged.mcap"), &mut |_, _| {});
    let to = folder.join("good.mcap");
    let report = recover(&path, &to, &mut |_, _| {}).ok()?;
    let (found, damages) = read(&to);
    assert_eq!((found.len() as u64, damages), (report.messages, 0));
    assert!(info(&to).unwrap().is_closed);
    Some((report, found))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn of_a_damaged_file_only_what_was_written_is_recovered(
        at in prop::collection::vec((any::<prop::sample::Index>(), 1..=255_u8), 1..6),
        keep in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let (all, bytes) = sample();
        let mut bytes = bytes.clone();
        for (at, flip) in at {
            let at = at.index(bytes.len());
            bytes[at] ^= flip;
        }
        if let Some(keep) = keep {
            bytes.truncate(keep.index(bytes.len()));
        }
        let folder = memory_folder();
        if let Some((report, found)) = try_all(folder.path(), &bytes) {
            let checked = &found[..found.len() - report.unchecked as usize];
            prop_assert!(is_part(checked, all), "{report:?}");
        }
    }

    #[test]
    fn zeroes_and_noise_in_a_file_make_nothing_up(
        from in any::<prop::sample::Index>(),
        noise in prop::collection::vec(prop_oneof![Just(0_u8), any::<u8>()], 1..5_000),
    ) {
        let (all, bytes) = sample();
        let mut bytes = bytes.clone();
        let from = from.index(bytes.len());
        let end = bytes.len().min(from + noise.len());
        bytes[from..end].copy_from_slice(&noise[..end - from]);
        let folder = memory_folder();
        if let Some((report, found)) = try_all(folder.path(), &bytes) {
            let checked = &found[..found.len() - report.unchecked as usize];
            prop_assert!(is_part(checked, all), "{report:?}");
        }
    }

    #[test]
    fn records_of_any_bytes_do_not_panic(
        records in prop::collection::vec((1..20_u8, prop::collection::vec(any::<u8>(), 0..80)), 0..20),
    ) {
        let mut bytes = mcap::MAGIC.to_vec();
        for (op, body) in records {
            bytes.push(op);
            bytes.extend((body.len() as u64).to_le_bytes());
            bytes.extend(body);
        }
        let folder = memory_folder();
        try_all(folder.path(), &bytes);
        bytes.extend(mcap::MAGIC);
        let folder = memory_folder();
        try_all(folder.path(), &bytes);
    }
}

/// Also where a chunk has data that look like records, and what is behind it is damaged.
#[test]
fn a_thread_that_reads_ahead_reads_the_same() {
    let record = |op: u8, body: &[u8]| [&[op][..], &(body.len() as u64).to_le_bytes(), body].concat();
    let chunk = |records: &[u8]| {
        let len = (records.len() as u64).to_le_bytes();
        let sum = crc32fast::hash(records).to_le_bytes();
        record(op::CHUNK, &[&[0; 16][..], &len, &sum, &[0; 4], &len, records].concat())
    };
    let message = |sequence: u32, data: &[u8]| {
        record(op::MESSAGE, &[&[0; 2][..], &sequence.to_le_bytes(), &[0; 16], data].concat())
    };
    let channel = record(op::CHANNEL, &[&[0; 4][..], &1_u32.to_le_bytes(), b"a", &[0; 8]].concat());
    let index = record(op::MESSAGE_INDEX, &[0; 6]);
    let nested = chunk(&message(99, &[]));
    let first = chunk(&[channel, message(1, &nested)].concat());
    let folder = memory_folder();
    let path = folder.path().join("nested.mcap");
    for between in [&[][..], &index] {
        let bytes = [mcap::MAGIC, &first, between, &[0; 20], &chunk(&message(2, &[]))].concat();
        std::fs::write(&path, bytes).unwrap();
        for is_ahead in [false, true] {
            let mut contents = Contents::open(&path).unwrap();
            if is_ahead {
                contents.read_ahead().unwrap();
            }
            let (mut numbers, mut damages) = (Vec::new(), 0);
            while let Some(item) = contents.next().unwrap() {
                match item {
                    Item::Message(found) => numbers.push(found.header.sequence),
                    Item::Damaged(..) => damages += 1,
                    Item::Metadata(_) | Item::Attachment(_) => {}
                }
            }
            assert_eq!((numbers, damages), (vec![1, 2], 1), "{} bytes between, {is_ahead}", between.len());
        }
    }
}

#[test]
fn a_damaged_chunk_costs_its_own_messages_alone() {
    let (all, bytes) = sample();
    let folder = memory_folder();
    let path = folder.path().join("base.mcap");
    std::fs::write(&path, bytes).unwrap();
    let mut frames = crate::read::frames::Frames::open(&path).unwrap();
    let chunks = crate::read::index::Index::read(&mut frames).unwrap().chunks;
    assert!(chunks.len() > 3);
    let mut bytes = bytes.clone();
    let bad = &chunks[2];
    bytes[(bad.chunk_start_offset + bad.chunk_length / 2) as usize] ^= 1;
    let (report, found) = try_all(folder.path(), &bytes).unwrap();
    assert_eq!((report.damage_count, report.unchecked, report.was_closed), (1, 0, true));
    assert_eq!(report.damages[0].0, bad.chunk_start_offset);
    let gone: Vec<&Said> = all.iter().filter(|said| !found.contains(said)).collect();
    assert!(gone.len() < all.len() / 2 && !gone.is_empty());
    let is_of_chunk = |said: &&Said| (bad.message_start_time..=bad.message_end_time).contains(&said.arrival_ns);
    assert_eq!(gone.len(), all.iter().filter(is_of_chunk).count());
}
