//! Another folder on a disk that makes files and takes no byte, as a full one does.

use super::disks::{DiskStep, TestDisk};
use super::support::{Said, files, memory_folder, options, read, said, session};
use crate::{DiskError, LossCause, OrderError, Writer, info};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering::Relaxed};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(60);

#[test]
fn a_folder_on_a_full_disk_is_refused_and_the_present_file_goes_on() {
    let around = memory_folder();
    let (good, full) = (around.path().join("good"), around.path().join("full"));
    std::fs::create_dir(&good).unwrap();
    std::fs::create_dir(&full).unwrap();
    let writes = Arc::new(AtomicI64::new(0));
    let (there, left) = (full.clone(), writes.clone());
    // It takes so many writes more in one of its folders.
    let disk = TestDisk::new(move |step, path| match step {
        DiskStep::Write(_) if path.starts_with(&there) && left.fetch_sub(1, Relaxed) <= 0 => {
            Err((io::ErrorKind::StorageFull.into(), 0))
        }
        _ => Ok(()),
    });
    let mut writer = Writer::start_on(Box::new(disk), options(&good), session()).unwrap();
    let all: Vec<Said> = said(12, 100).into_iter().filter(|one| one.topic == "laser.0/scan").collect();
    let channel = all[0].channel(&mut writer);
    all[0].write(&mut writer);
    let (first, moved) = (good.join("base-0001.mcap"), full.join("base-0001.mcap"));
    let refused = writer.move_to(full.clone()).unwrap().wait(PATIENCE).unwrap();
    assert!(matches!(refused, Err(OrderError::Disk(DiskError::Full { .. }))), "{refused:?}");
    let status = writer.status();
    assert!(status.problem.is_none() && status.file.as_ref() == Some(&first), "{status:?}");
    assert_eq!((status.files_closed, status.files_torn, files(&full).len()), (0, 0, 0));
    all[1].write(&mut writer);
    writer.count_lost(channel, LossCause::Recorder, 5);
    // Numbers of the good folder go on, too.
    let second = writer.rotate().unwrap().wait(PATIENCE).unwrap().unwrap().file;
    assert_eq!(second, good.join("base-0002.mcap"));
    all[2].write(&mut writer);
    writer.count_lost(channel, LossCause::Recorder, 2);
    writes.store(i64::MAX, Relaxed);
    let told = writer.move_to(full.clone()).unwrap().wait(PATIENCE).unwrap().unwrap();
    assert_eq!((told.closed, &told.file), (Some(second.clone()), &moved));
    assert_eq!(writer.status().file.as_ref(), Some(&moved));
    all[3].write(&mut writer);
    writer.count_lost(channel, LossCause::Recorder, 1);
    let (status, told) = writer.finish();
    told.unwrap();
    assert_eq!((status.written, status.lost, status.files_closed), (4, 8, 3), "{status:?}");
    assert_eq!(read(&first).0, all[..2]);
    assert_eq!([&second, &moved].map(|path| read(path).0), [&all[2..3], &all[3..]]);
    assert_eq!(info(&moved).unwrap().session["file"], "1");
    let lost: u64 = [&first, &second, &moved].map(|path| info(path).unwrap().lost).iter().sum();
    assert_eq!(lost, 8, "each loss is told by one file");
}
