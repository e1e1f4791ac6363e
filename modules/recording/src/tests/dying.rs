//! A recorder that dies at each step that it does with the disk: what it had told to be written is there.
//!
//! From that step on nothing reaches the disk any more, as of a process that is killed there.

use super::support::{files, memory_folder, options, read, said, session};
use crate::disk::{Disk, DiskFile, RealDisk};
use crate::{ChannelSpec, LossCause, Mark, Message, Options, PendingOrder, Rotation, Status, Writer};
use crate::{info, is_closed, recover, recovered_path};
use rohrpost_schema::Type;
use std::collections::BTreeMap;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering::Relaxed};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(60);

/// A disk that takes so many steps more.
#[derive(Clone)]
struct DyingDisk(Arc<AtomicI64>);

impl DyingDisk {
    /// Steps that are left before this one; below zero: it is dead.
    fn step(&self) -> i64 {
        self.0.fetch_sub(1, Relaxed) - 1
    }

    fn lives(&self) -> io::Result<()> {
        if self.step() >= 0 { Ok(()) } else { Err(io::Error::from_raw_os_error(5)) }
    }
}

struct DyingFile(Box<dyn DiskFile>, DyingDisk);

impl Disk for DyingDisk {
    fn create(&mut self, path: &Path, mode: u32) -> io::Result<Box<dyn DiskFile>> {
        self.lives()?;
        Ok(Box::new(DyingFile(RealDisk.create(path, mode)?, self.clone())))
    }

    fn free_bytes(&mut self, _: &Path) -> io::Result<u64> {
        Ok(u64::MAX)
    }

    fn sync_folder(&mut self, _: &Path) -> io::Result<()> {
        self.lives()
    }

    fn remove(&mut self, path: &Path) -> io::Result<()> {
        self.lives()?;
        RealDisk.remove(path)
    }
}

impl DiskFile for DyingFile {
    /// The last one is done by half.
    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self.1.step() {
            0.. => self.0.write_all(bytes),
            -1 => self.0.write_all(&bytes[..bytes.len() / 2]).and(Err(io::Error::from_raw_os_error(5))),
            _ => Err(io::Error::from_raw_os_error(5)),
        }
    }

    fn sync(&mut self) -> io::Result<()> {
        self.1.lives()
    }

    fn truncate(&mut self, len: u64) -> io::Result<()> {
        self.1.lives()?;
        self.0.truncate(len)
    }

    fn has_name(&mut self) -> io::Result<bool> {
        Ok(true)
    }
}

/// Such messages do not come to the recorder.
fn is_lost(number: usize) -> bool {
    number % 7 == 3
}

/// Records, rotates and sets marks; then how it went, and the marks that were told to be set.
fn record_until_dead(disk: DyingDisk, folder: &Path) -> (Status, Vec<String>) {
    let rotation = Rotation { bytes_max: 40_000, ..Rotation::default() };
    let ms = Duration::from_millis(1);
    let options = Options { rotation, flush: ms, sync: ms, retry: ms, ..options(folder) };
    let mut writer = Writer::start_on(Box::new(disk), options, session()).unwrap();
    let mut orders: Vec<(Option<String>, PendingOrder)> = Vec::new();
    let mut wait_for = |told: &mut Vec<String>, text: Option<String>, pending: PendingOrder| {
        if matches!(pending.wait(ms), Some(Ok(_))) {
            told.extend(text);
        } else {
            orders.push((text, pending));
        }
    };
    let mut told = Vec::new();
    for (number, one) in said(240, 1_000).iter().enumerate() {
        let (name, item) = one.topic.split_once('/').unwrap();
        let spec = ChannelSpec { name, item, ty: &Type::Bytes, texts: BTreeMap::new() };
        let channel = writer.channel(&spec).unwrap();
        let (arrival_ns, stamp_ns, epoch, sequence) = (one.arrival_ns, one.stamp_ns, one.epoch, one.sequence);
        if is_lost(number) {
            writer.count_lost(channel, LossCause::Recorder, 1);
        } else {
            writer.write(channel, &Message { arrival_ns, stamp_ns, epoch, sequence, data: &one.data }).unwrap();
        }
        if number % 40 == 20 {
            let text = number.to_string();
            let mark = Mark { time_ns: 1, epoch: 1, text: text.as_str().into() };
            let pending = writer.mark(mark).unwrap();
            wait_for(&mut told, Some(text), pending);
        }
        if number % 80 == 30 {
            let pending = writer.rotate().unwrap();
            wait_for(&mut told, None, pending);
        }
    }
    let status = writer.finish().0;
    for (text, pending) in orders {
        if matches!(pending.wait(PATIENCE), Some(Ok(_))) {
            told.extend(text);
        }
    }
    (status, told)
}

/// Of numbers from 0 on, how many are not there.
fn missing(numbers: impl Iterator<Item = u32>) -> u64 {
    let (count, last) = numbers.fold((0, 0), |(count, _), number| (count + 1, u64::from(number) + 1));
    last - count
}

#[test]
fn whatever_step_is_its_last_all_that_was_told_to_be_written_is_there() {
    let mut all = said(240, 1_000);
    let mut number = 0..;
    all.retain(|_| number.next().is_some_and(|number| !is_lost(number)));
    let mut steps = 0;
    loop {
        let folder = memory_folder();
        let disk = DyingDisk(Arc::new(AtomicI64::new(steps)));
        let (status, told) = record_until_dead(disk.clone(), folder.path());
        let has_died = disk.0.load(Relaxed) < 0;
        let (mut kept, mut marks, mut lost) = (Vec::new(), Vec::new(), BTreeMap::new());
        let files = files(folder.path());
        for (at, path) in files.iter().enumerate() {
            let Ok(closed) = is_closed(path) else {
                assert_eq!(at + 1, files.len(), "{steps}: only the last one has no beginning");
                continue;
            };
            assert!(closed || at + 1 == files.len(), "{steps}: only the last one is open");
            recover(path, &recovered_path(path), &mut |_, _| {}).unwrap();
            kept.extend(read(&recovered_path(path)).0);
            let told = info(&recovered_path(path)).unwrap();
            marks.extend(told.marks.into_iter().map(|mark| mark.text.to_string()));
            for channel in told.channels {
                *lost.entry(channel.topic.to_string()).or_default() += channel.lost;
            }
        }
        assert!(kept == all[..kept.len()], "{steps}: in order, nothing twice, nothing made up");
        assert!(kept.len() as u64 >= status.written, "{steps}: {} are there; {status:?}", kept.len());
        assert!(told.iter().all(|text| marks.contains(text)), "{steps}: {told:?} of {marks:?}");
        for (topic, lost) in &lost {
            let missing = missing(kept.iter().filter(|said| said.topic == *topic).map(|said| said.sequence));
            let is_right = if has_died { missing <= *lost } else { missing == *lost };
            assert!(is_right, "{steps}: {topic}: {missing} are missing, {lost} counted");
        }
        if !has_died {
            assert_eq!((kept.len(), told.len()), (all.len(), 6), "{status:?}");
            break;
        }
        steps += 1;
    }
    assert!(steps > 30, "{steps} steps are few");
}
