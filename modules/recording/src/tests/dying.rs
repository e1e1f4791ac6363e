//! A recorder that dies at each step that it does with the disk: what it had told to be written is there.
//!
//! From that step on nothing reaches the disk any more, as of a process that is killed there.

use super::disks::{DiskStep, TestDisk, broken};
use super::support::{files, memory_folder, options, read, said, session};
use crate::{LossCause, Mark, Options, PendingOrder, Rotation, Status, Writer};
use crate::{info, is_closed, recover, recovered_path};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering::Relaxed};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(60);

/// A disk that takes so many steps more; below zero it is dead. The last write is done by half.
fn dying_disk(steps: &Arc<AtomicI64>) -> TestDisk {
    let steps = steps.clone();
    TestDisk::new(move |step, _| match (step, step == DiskStep::Free || steps.fetch_sub(1, Relaxed) > 0) {
        (_, true) => Ok(()),
        (DiskStep::Write(bytes), false) if steps.load(Relaxed) == -1 => Err((broken(), bytes / 2)),
        (_, false) => Err((broken(), 0)),
    })
}

/// Such messages do not come to the recorder.
fn is_lost(number: usize) -> bool {
    number % 7 == 3
}

/// Records, rotates and sets marks; then how it went, and the marks that were told to be set.
fn record_until_dead(disk: TestDisk, folder: &Path) -> (Status, Vec<String>) {
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
        if is_lost(number) {
            let channel = one.channel(&mut writer);
            writer.count_lost(channel, LossCause::Recorder, 1);
        } else {
            one.write(&mut writer);
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
        let left = Arc::new(AtomicI64::new(steps));
        let (status, told) = record_until_dead(dying_disk(&left), folder.path());
        let has_died = left.load(Relaxed) < 0;
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
