//! A disk that fails at any operation: all messages are in exactly one file, or counted as lost; and files say so.

use super::beginning::beginning;
use super::disks::{Faults, TestDisk};
use super::support::{Said, channel, files, memory_folder, options, read, record, said, session, until};
use crate::{DiskError, LossCause, Message, Options, Rotation, WriteError, Writer, info, recover, recovered_path};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;

/// All messages of all files, each made whole, and the losses that they tell.
fn found(folder: &Path) -> (Vec<Said>, u64) {
    let (mut all, mut lost) = (Vec::new(), 0);
    for path in files(folder) {
        let to = recovered_path(&path);
        recover(&path, &to, &mut |_, _| {}).unwrap();
        all.extend(read(&to).0);
        lost += info(&to).unwrap().lost;
    }
    (all, lost)
}

#[test]
fn each_message_is_in_one_file_or_counted_as_lost() {
    for seed in 0..60_u64 {
        let faults = Faults {
            create: [0, 100, 500][seed as usize % 3],
            write: [20, 100, 300, 0][seed as usize % 4],
            sync: [0, 200][seed as usize % 2],
            free: [0, 50][seed as usize / 2 % 2],
        };
        let folder = memory_folder();
        let all = said(2_000, 1_000);
        let rotation = Rotation { bytes_max: 300 << 10, ..Rotation::default() };
        let options = Options { rotation, queue_chunks: 1, retry: Duration::from_millis(1), ..options(folder.path()) };
        let (status, refused) = record(faults.disk(seed), options, &all);
        let (kept, told) = found(folder.path());
        let replay = format!("seed {seed}, {faults:?}, {status:?}");
        assert_eq!(status.waiting, 0, "{replay}");
        assert_eq!(kept.len() as u64, status.written, "{replay}");
        assert_eq!(status.written + status.lost, all.len() as u64, "{replay}");
        assert!(status.lost >= refused.len() as u64, "{replay}");
        assert!(status.synced + status.unsure == status.written, "{replay}");
        let mut rest = all.iter();
        assert!(kept.iter().all(|one| rest.any(|other| other == one)), "order, nothing twice; {replay}");
        // What no file could tell: losses behind the last file that could be written.
        assert!(told <= status.lost, "{told}; {replay}");
        if status.problem.is_none() {
            assert_eq!(told, status.lost, "{replay}");
        }
    }
}

/// Records to a disk with so much free space, and what sets that.
fn on_small_disk(free_bytes: u64, options: Options) -> (Writer, Arc<AtomicU64>) {
    let disk = TestDisk::new(|_, _| Ok(()));
    let free = disk.free_bytes.clone();
    free.store(free_bytes, Relaxed);
    (Writer::start_on(Box::new(disk), options, session()).unwrap(), free)
}

#[test]
fn what_is_to_stay_free_stays_free_and_recording_goes_on_when_there_is_room() {
    let folder = memory_folder();
    let (mut writer, free) = on_small_disk(1 << 30, Options { leave_bytes: 1 << 20, ..options(folder.path()) });
    let channel = channel(&mut writer, "laser.0", "scan");
    let data = [7; 1_000];
    let message = |sequence| Message { arrival_ns: 5, stamp_ns: 5, epoch: 1, sequence, data: &data };
    writer.write(channel, &message(0)).unwrap();
    until("the first is written", || writer.status().written == 1);
    free.store(1 << 20, Relaxed);
    writer.write(channel, &message(1)).unwrap();
    until("the problem is told", || writer.status().problem.is_some());
    let status = writer.status();
    let error = status.problem.unwrap().error;
    assert!(matches!(error, DiskError::Low { free_bytes: 1_048_576, leave_bytes: 1_048_576, .. }), "{error}");
    assert_eq!((status.files_closed, status.files_torn, status.waiting, status.lost), (1, 0, 1, 0));
    assert!(status.failures.low >= 1 && status.is_running);
    let first = info(&files(folder.path())[0]).unwrap();
    assert_eq!((first.is_closed, first.closed_because.as_deref()), (true, Some("low space")));
    free.store(1 << 30, Relaxed);
    until("the second is written", || writer.status().written == 2);
    assert!(writer.status().problem.is_none());
    let (status, told) = writer.finish();
    told.unwrap();
    assert_eq!((status.files_closed, status.lost), (2, 0));
    assert_eq!(found(folder.path()).0.len(), 2);
}

/// While no byte can be written, 29 bytes of a pose after each picture of 230 kB.
#[test]
fn what_finds_no_room_is_blamed_on_the_disk_that_fails_and_poses_find_room_beside_pictures() {
    let folder = memory_folder();
    let options = Options { leave_bytes: 1, queue_chunks: 4, ..options(folder.path()) };
    let (mut writer, free) = on_small_disk(0, options);
    let [pictures, poses] = ["camera.0", "mapper.0"].map(|name| channel(&mut writer, name, "item"));
    let (picture, pose) = (vec![7; 230_400], [7; 29]);
    let message = |sequence, data| Message { arrival_ns: 5, stamp_ns: 5, epoch: 1, sequence, data };
    writer.write(poses, &message(0, &pose)).unwrap();
    until("the problem is told", || writer.status().problem.is_some());
    let mut refused = 0;
    for sequence in 1..200 {
        if let Err(error) = writer.write(pictures, &message(sequence, &picture)) {
            assert_eq!(error, WriteError::Full(LossCause::Disk));
            refused += 1;
        }
        writer.write(poses, &message(sequence, &pose)).unwrap();
    }
    assert!(refused > 150, "{refused}");
    free.store(1 << 30, Relaxed);
    until("what waits is written", || writer.status().waiting == 0);
    let (status, told) = writer.finish();
    told.unwrap();
    assert_eq!((status.written + refused, status.losses[LossCause::Disk], status.lost), (399, refused, refused));
    assert_eq!((status.channels[1].written, status.channels[1].lost), (200, 0));
    let told = info(files(folder.path()).last().unwrap()).unwrap();
    assert_eq!((told.lost, told.losses), (refused, status.losses));
}

#[test]
fn a_removed_folder_is_noticed_and_a_new_one_is_used() {
    let around = memory_folder();
    let folder = around.path().join("recordings");
    let mut writer = Writer::start(options(&folder), session()).unwrap();
    until("it is not there", || writer.status().problem.is_some());
    let error = writer.status().problem.unwrap().error;
    assert!(matches!(error, DiskError::Gone { .. }), "{error}");
    let channel = channel(&mut writer, "laser.0", "scan");
    let message = |sequence| Message { arrival_ns: 5, stamp_ns: 5, epoch: 1, sequence, data: &[1] };
    writer.write(channel, &message(0)).unwrap();
    std::fs::create_dir(&folder).unwrap();
    until("the first is written", || writer.status().written == 1);
    until("and synced", || writer.status().synced == 1);
    std::fs::remove_dir_all(&folder).unwrap();
    until("it is gone", || writer.status().problem.is_some());
    assert_eq!(writer.status().unsure, 1, "the file took it, and is gone");
    std::fs::create_dir(&folder).unwrap();
    writer.write(channel, &message(1)).unwrap();
    until("the second is written", || writer.status().written == 2);
    let (status, told) = writer.finish();
    told.unwrap();
    assert_eq!((status.synced, status.unsure, status.lost), (1, 1, 0));
    assert_eq!(found(&folder).0.len(), 1);
}

#[test]
fn what_no_disk_took_is_what_the_next_recording_begins_with() {
    let folder = memory_folder();
    let (mut writer, free) = on_small_disk(1 << 30, Options { leave_bytes: 1 << 20, ..options(folder.path()) });
    let scans = channel(&mut writer, "laser.0", "scan");
    let message = |sequence: u32| {
        let arrival_ns = 10_000_000_000 * u64::from(sequence);
        Message { arrival_ns, stamp_ns: arrival_ns, epoch: 1, sequence, data: b"scan" }
    };
    writer.write(scans, &message(1)).unwrap();
    until("the first is written", || writer.status().written == 1);
    free.store(0, Relaxed);
    writer.write(scans, &message(2)).unwrap();
    until("the problem is told", || writer.status().problem.is_some());
    let newest = writer.take_newest();
    let (status, _) = writer.finish();
    assert_eq!((status.written, status.lost), (1, 1));
    let mut writer = Writer::start_behind(newest, options(folder.path()), session()).unwrap();
    let [other, _] = ["laser.1", "laser.0"].map(|name| channel(&mut writer, name, "scan"));
    writer.write(other, &message(3)).unwrap();
    writer.finish().1.unwrap();
    let numbers: Vec<u32> = beginning(files(folder.path()).last().unwrap()).0.iter().map(|its| its.0.3).collect();
    assert_eq!(numbers, [2]);
}
