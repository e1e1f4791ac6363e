//! Recordings for tests.

use crate::disk::Disk;
use crate::read::contents::{Contents, Item};
use crate::{ChannelId, ChannelSpec, Message, Options, Session, Status, Writer};
use rohrpost_schema::Type;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A folder in memory: a disk would take most of the time of tests for syncing.
pub(super) fn memory_folder() -> tempfile::TempDir {
    tempfile::Builder::new().prefix("rohrpost-test-").tempdir_in("/dev/shm").unwrap()
}

/// A message with all that is recorded of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Said {
    pub(super) topic: String,
    pub(super) arrival_ns: u64,
    pub(super) stamp_ns: u64,
    pub(super) epoch: u64,
    pub(super) sequence: u32,
    pub(super) data: Vec<u8>,
}

impl Said {
    pub(super) fn message(&self) -> Message<'_> {
        let Self { arrival_ns, stamp_ns, epoch, sequence, .. } = *self;
        Message { arrival_ns, stamp_ns, epoch, sequence, data: &self.data }
    }

    /// The channel of the topic, which is added if it is not there.
    pub(super) fn channel(&self, writer: &mut Writer) -> ChannelId {
        let (name, item) = self.topic.split_once('/').unwrap();
        channel(writer, name, item)
    }

    /// Records it.
    pub(super) fn write(&self, writer: &mut Writer) {
        let channel = self.channel(writer);
        writer.write(channel, &self.message()).unwrap();
    }
}

/// A channel of bytes.
pub(super) fn channel(writer: &mut Writer, name: &str, item: &str) -> ChannelId {
    channel_of(writer, name, item, &Type::Bytes)
}

pub(super) fn channel_of(writer: &mut Writer, name: &str, item: &str, ty: &Type) -> ChannelId {
    writer.channel(&ChannelSpec { name, item, ty, texts: BTreeMap::new() }).unwrap()
}

/// The messages of `count`, of three channels in turn.
pub(super) fn said(count: u32, data_bytes: usize) -> Vec<Said> {
    let one = |number: u32| Said {
        topic: format!("laser.{}/scan", number % 3),
        arrival_ns: 1_000 + u64::from(number) * 10,
        stamp_ns: 995 + u64::from(number) * 10,
        epoch: 1,
        sequence: number / 3,
        data: noise(number, data_bytes),
    };
    (0..count).map(one).collect()
}

/// Bytes that compress badly, as those of sensors.
pub(super) fn noise(seed: u32, len: usize) -> Vec<u8> {
    let mut state = u64::from(seed) * 2 + 1;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    };
    (0..len).map(|_| next()).collect()
}

/// Small periods, no space left to others.
pub(super) fn options(folder: &Path) -> Options {
    Options {
        flush: Duration::from_millis(5),
        sync: Duration::from_millis(10),
        retry: Duration::from_millis(5),
        leave_bytes: 0,
        ..Options::new(folder, "base")
    }
}

pub(super) fn session() -> Session {
    Session {
        node: "base".into(),
        versions: BTreeMap::from([("rohrpost".into(), "0.1.0".into())]),
        configuration: BTreeMap::from([("robot.toml".into(), "system = \"demo\"\n".into())]),
    }
}

/// Records, and ends the recording. Those that were not taken.
pub(super) fn record(disk: Box<dyn Disk>, options: Options, all: &[Said]) -> (Status, Vec<Said>) {
    let mut writer = Writer::start_on(disk, options, session()).unwrap();
    let mut refused = Vec::new();
    for said in all {
        let channel = said.channel(&mut writer);
        if writer.write(channel, &said.message()).is_err() {
            refused.push(said.clone());
        }
    }
    let (status, _) = writer.finish();
    (status, refused)
}

/// Waits until it is so.
pub(super) fn until(what: &str, is_so: impl Fn() -> bool) {
    for _ in 0..60_000 {
        if is_so() {
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("not within a minute: {what}");
}

/// All of a file but what it repeats, and what is wrong with it.
pub(super) fn read(path: &Path) -> (Vec<Said>, usize) {
    let mut contents = Contents::open(path).unwrap();
    let (mut all, mut damages) = (Vec::new(), 0);
    while let Some(item) = contents.next().unwrap() {
        match item {
            Item::Message(found) if found.channel.is_repeated() => {}
            Item::Message(found) => all.push(Said {
                topic: found.channel.topic.clone(),
                arrival_ns: found.header.log_time,
                stamp_ns: found.header.publish_time,
                epoch: found.channel.epoch().unwrap(),
                sequence: found.header.sequence,
                data: contents.data(&found).to_vec(),
            }),
            Item::Damaged(..) => damages += 1,
            Item::Metadata(_) | Item::Attachment(_) => {}
        }
    }
    (all, damages)
}

/// A recording's files, in order.
pub(super) fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// Cuts so many bytes off a file: without the last twenty it has no end, as if its recorder was killed.
pub(super) fn cut_off(path: &Path, bytes: u64) {
    let file = std::fs::File::options().write(true).open(path).unwrap();
    file.set_len(file.metadata().unwrap().len() - bytes).unwrap();
}

/// A closed file of these messages.
pub(super) fn file_of(folder: &Path, stem: &str, all: &[Said]) -> PathBuf {
    let options = Options { stem: stem.into(), ..options(folder) };
    let (status, refused) = record(Box::new(crate::disk::RealDisk), options, all);
    assert!(refused.is_empty() && status.problem.is_none(), "{status:?}");
    folder.join(format!("{stem}-0001.mcap"))
}
