//! One bit of a file is wrong, any one: messages of the chunk that it is in are lost, and no others.

use super::support::{Said, memory_folder, options, read, said, until};
use crate::format::op;
use crate::read::contents::{Contents, Item};
use crate::read::frames::{Frames, Step};
use crate::{Session, Writer, recover};
use std::ops::Range;
use std::path::Path;

const CHUNKS: usize = 10;
/// One of each channel.
const IN_CHUNK: usize = 2;
/// Each tries a part of the bytes.
const THREADS: usize = 2;

fn topic(number: usize) -> String {
    format!("a.{}/b", number % IN_CHUNK)
}

/// A file of ten chunks, as it is when its recorder is killed behind them, and as it is when it was closed.
fn samples(folder: &Path) -> (Vec<Said>, [Vec<u8>; 2]) {
    let all = said((CHUNKS * IN_CHUNK) as u32, 4);
    let all: Vec<Said> = (0..).zip(all).map(|(number, its)| Said { topic: topic(number), ..its }).collect();
    let mut writer = Writer::start(options(folder), Session::default()).unwrap();
    for (number, said) in all.iter().enumerate() {
        said.write(&mut writer);
        if number % IN_CHUNK == IN_CHUNK - 1 {
            until("the chunk is written", || writer.status().written > number as u64);
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

/// Where the chunks are, and what a file has.
struct Sample {
    case: &'static str,
    all: Vec<Said>,
    bytes: Vec<u8>,
    chunks: Vec<(Range<u64>, Vec<usize>)>,
}

impl Sample {
    /// Recovers the file with one bit of a byte turned; whether messages are lost.
    fn loses_with(&self, at: usize, folder: &Path) -> bool {
        let Self { all, bytes, chunks, .. } = self;
        let [path, to] = ["bad.mcap", "good.mcap"].map(|name| folder.join(name));
        let mut bad = bytes.clone();
        bad[at] ^= 1 << (at % 8);
        std::fs::write(&path, &bad).unwrap();
        let case = format!("{}, bit {} of byte {at} of {}", self.case, at % 8, bytes.len());
        let told = recover(&path, &to, &mut |_, _| {}).unwrap_or_else(|error| panic!("{case}: {error}"));
        let (found, damages) = read(&to);
        std::fs::remove_file(&to).unwrap();
        assert_eq!((found.len() as u64, damages), (told.messages, 0), "{case}");
        if found.len() == all.len() {
            assert!(found.iter().eq(all), "{case}: {told:?}");
            return false;
        }
        let may_go = chunks.iter().find(|(range, _)| range.contains(&(at as u64))).map(|(_, numbers)| numbers);
        let stays = |number: &usize| may_go.is_none_or(|may_go| !may_go.contains(number));
        assert!(found.iter().eq((0..all.len()).filter(stays).map(|number| &all[number])), "{case}: {told:?}");
        assert!(told.damage_count > 0, "{case}: it is told");
        true
    }
}

#[test]
fn one_wrong_bit_costs_messages_of_its_chunk_alone() {
    let folder = memory_folder();
    let (all, samples) = samples(folder.path());
    for (case, bytes) in ["killed", "closed"].into_iter().zip(samples) {
        let path = folder.path().join(case);
        std::fs::write(&path, &bytes).unwrap();
        let sample = Sample { case, all: all.clone(), chunks: chunks(&path, &all), bytes };
        assert_eq!(sample.chunks.len(), CHUNKS, "{case}");
        let part = |first: usize| {
            let folder = memory_folder();
            (first..sample.bytes.len()).step_by(THREADS).filter(|at| sample.loses_with(*at, folder.path())).count()
        };
        let lost: usize = std::thread::scope(|scope| {
            let parts: Vec<_> = (0..THREADS).map(|first| scope.spawn(move || part(first))).collect();
            parts.into_iter().map(|part| part.join().unwrap()).sum()
        });
        assert!(lost > CHUNKS, "{case}: {lost}");
    }
}
