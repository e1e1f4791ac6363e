//! One bit of a file is wrong, any one: messages of the chunk that it is in are lost, and no others.

use super::support::{Said, memory_folder, options, read, said, session};
use crate::format::op;
use crate::read::contents::{Contents, Item};
use crate::read::frames::{Frames, Step};
use crate::{ChannelSpec, Message, Session, Writer, recover};
use rohrpost_schema::Type;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use std::time::Duration;

const CHUNKS: usize = 10;
/// One of each channel.
const IN_CHUNK: usize = 3;

/// A file of ten chunks, as it is when its recorder is killed behind them, and as it is when it was closed.
fn samples(folder: &Path) -> (Vec<Said>, [Vec<u8>; 2]) {
    let all = said((CHUNKS * IN_CHUNK) as u32, 4);
    let mut writer = Writer::start(options(folder), Session { configuration: BTreeMap::new(), ..session() }).unwrap();
    let channels: Vec<_> = (0..IN_CHUNK)
        .map(|number| {
            let name = format!("laser.{number}");
            let spec = ChannelSpec { name: &name, item: "scan", ty: &Type::Bytes, texts: BTreeMap::new() };
            writer.channel(&spec).unwrap()
        })
        .collect();
    for (number, said) in all.iter().enumerate() {
        let Said { arrival_ns, stamp_ns, epoch, sequence, .. } = *said;
        let message = Message { arrival_ns, stamp_ns, epoch, sequence, data: &said.data };
        writer.write(channels[number % IN_CHUNK], &message).unwrap();
        while number % IN_CHUNK == IN_CHUNK - 1 && writer.status().written <= number as u64 {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    let path = folder.join("base-0001.mcap");
    let killed = std::fs::read(&path).unwrap();
    writer.finish().1.unwrap();
    (all, [killed, std::fs::read(&path).unwrap()])
}

/// Where the chunks with messages are, and numbers of their messages.
fn chunks(path: &Path, all: &[Said]) -> Vec<(Range<u64>, Vec<usize>)> {
    let (mut frames, mut contents) = (Frames::open(path).unwrap(), Contents::open(path).unwrap());
    let mut chunks = Vec::new();
    loop {
        let begins = frames.at();
        match frames.step().unwrap() {
            Step::Record(op::CHUNK) => {}
            Step::Record(_) => continue,
            _ => return chunks,
        }
        contents.open_chunk(begins).unwrap();
        let mut numbers = Vec::new();
        while let Some(item) = contents.next_in_chunk().unwrap() {
            let Item::Message(found) = item else { panic!("{item:?}") };
            numbers.extend(all.iter().position(|said| said.arrival_ns == found.header.log_time));
        }
        if !numbers.is_empty() {
            chunks.push((begins..frames.at(), numbers));
        }
    }
}

#[test]
fn one_wrong_bit_costs_messages_of_its_chunk_alone() {
    let folder = memory_folder();
    let (all, samples) = samples(folder.path());
    for (case, bytes) in ["killed", "closed"].into_iter().zip(samples) {
        let folder = memory_folder();
        let [path, to] = ["bad.mcap", "good.mcap"].map(|name| folder.path().join(name));
        std::fs::write(&path, &bytes).unwrap();
        let chunks = chunks(&path, &all);
        assert_eq!(chunks.len(), CHUNKS, "{case}");
        let mut lost_chunks = 0;
        for at in 0..bytes.len() {
            let mut bad = bytes.clone();
            bad[at] ^= 1 << (at % 8);
            std::fs::write(&path, &bad).unwrap();
            let case = format!("{case}, bit {} of byte {at} of {}", at % 8, bytes.len());
            let told = recover(&path, &to, &mut |_, _| {}).unwrap_or_else(|error| panic!("{case}: {error}"));
            let (found, damages) = read(&to);
            assert_eq!((found.len() as u64, damages), (told.messages, 0), "{case}");
            let may_go = chunks.iter().find(|(range, _)| range.contains(&(at as u64))).map(|(_, numbers)| numbers);
            let stays = |number: &usize| may_go.is_none_or(|may_go| !may_go.contains(number));
            let left: Vec<&Said> = (0..all.len()).filter(stays).map(|number| &all[number]).collect();
            if found.len() == all.len() {
                assert!(found.iter().eq(&all), "{case}: {told:?}");
            } else {
                assert!(found.iter().eq(left), "{case}: {told:?}");
                assert!(told.damage_count > 0, "{case}: it is told");
                lost_chunks += 1;
            }
            std::fs::remove_file(&to).unwrap();
        }
        assert!(lost_chunks > CHUNKS, "{case}: {lost_chunks}");
    }
}
