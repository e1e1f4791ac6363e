//! Another folder on a disk that makes files and takes no byte, as a full one does.

use super::support::{Said, files, memory_folder, options, read, said, session};
use crate::disk::{Disk, DiskFile, RealDisk};
use crate::{ChannelSpec, DiskError, LossCause, Message, OrderError, Writer, info};
use rohrpost_schema::Type;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering::Relaxed};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(60);

/// Takes so many writes more in one of its folders.
struct FullDisk {
    folder: PathBuf,
    writes: Arc<AtomicI64>,
}

struct FullFile(Box<dyn DiskFile>, Arc<AtomicI64>);

impl Disk for FullDisk {
    fn create(&mut self, path: &Path, mode: u32) -> io::Result<Box<dyn DiskFile>> {
        let file = RealDisk.create(path, mode)?;
        Ok(if path.starts_with(&self.folder) { Box::new(FullFile(file, self.writes.clone())) } else { file })
    }

    fn free_bytes(&mut self, _: &Path) -> io::Result<u64> {
        Ok(u64::MAX)
    }

    fn sync_folder(&mut self, folder: &Path) -> io::Result<()> {
        RealDisk.sync_folder(folder)
    }

    fn remove(&mut self, path: &Path) -> io::Result<()> {
        RealDisk.remove(path)
    }
}

impl DiskFile for FullFile {
    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.1.fetch_sub(1, Relaxed) <= 0 {
            return Err(io::Error::from(io::ErrorKind::StorageFull));
        }
        self.0.write_all(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.0.sync()
    }

    fn truncate(&mut self, len: u64) -> io::Result<()> {
        self.0.truncate(len)
    }

    fn has_name(&mut self) -> io::Result<bool> {
        self.0.has_name()
    }
}

#[test]
fn a_folder_on_a_full_disk_is_refused_and_the_present_file_goes_on() {
    let around = memory_folder();
    let (good, full) = (around.path().join("good"), around.path().join("full"));
    std::fs::create_dir(&good).unwrap();
    std::fs::create_dir(&full).unwrap();
    let writes = Arc::new(AtomicI64::new(0));
    let disk = FullDisk { folder: full.clone(), writes: writes.clone() };
    let mut writer = Writer::start_on(Box::new(disk), options(&good), session()).unwrap();
    let spec = ChannelSpec { name: "laser.0", item: "scan", ty: &Type::Bytes, texts: BTreeMap::new() };
    let channel = writer.channel(&spec).unwrap();
    let all: Vec<Said> = said(12, 100).into_iter().filter(|one| one.topic == "laser.0/scan").collect();
    let write = |writer: &mut Writer, one: &Said| {
        let Said { arrival_ns, stamp_ns, epoch, sequence, .. } = *one;
        writer.write(channel, &Message { arrival_ns, stamp_ns, epoch, sequence, data: &one.data }).unwrap();
    };
    write(&mut writer, &all[0]);
    let (first, moved) = (good.join("base-0001.mcap"), full.join("base-0001.mcap"));
    let refused = writer.move_to(full.clone()).unwrap().wait(PATIENCE).unwrap();
    assert!(matches!(refused, Err(OrderError::Disk(DiskError::Full { .. }))), "{refused:?}");
    let status = writer.status();
    assert!(status.problem.is_none() && status.file.as_ref() == Some(&first), "{status:?}");
    assert_eq!((status.files_closed, status.files_torn, files(&full).len()), (0, 0, 0));
    write(&mut writer, &all[1]);
    writer.count_lost(channel, LossCause::Recorder, 5);
    // Numbers of the good folder go on, too.
    let second = writer.rotate().unwrap().wait(PATIENCE).unwrap().unwrap().file;
    assert_eq!(second, good.join("base-0002.mcap"));
    write(&mut writer, &all[2]);
    writer.count_lost(channel, LossCause::Recorder, 2);
    writes.store(i64::MAX, Relaxed);
    let told = writer.move_to(full.clone()).unwrap().wait(PATIENCE).unwrap().unwrap();
    assert_eq!((told.closed, &told.file), (Some(second.clone()), &moved));
    assert_eq!(writer.status().file.as_ref(), Some(&moved));
    write(&mut writer, &all[3]);
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
