//! A disk that is really full, or read-only: typed errors, counted losses, and on it goes when there is room.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;
#[path = "../../../mailbox/tests/common/small_memory.rs"]
mod small_memory;

use common::{Running, busy_options, channels, files, in_role, recover_all, session, tell, with_message};
use rohrpost_recording::{DiskError, Options, Status, Writer};
use small_memory::{may_mount, with_small_memory};
use std::ffi::CString;
use std::io;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A chunk of a megabyte must fit, and some files.
const DISK_BYTES: u64 = DISK_PAGES as u64 * 4096;
const DISK_PAGES: usize = 1024;

/// Mounts that disk once more, with or without writing.
fn remount(place: &Path, flags: libc::c_ulong) {
    let place = CString::new(place.as_os_str().as_bytes()).unwrap();
    // SAFETY: strings that live as long as the call, or null where that is allowed.
    let told = unsafe {
        libc::mount(std::ptr::null(), place.as_ptr(), std::ptr::null(), libc::MS_REMOUNT | flags, std::ptr::null())
    };
    assert_eq!(told, 0, "{}", io::Error::last_os_error());
}

#[test]
fn role() {
    let Some((role, folder)) = common::role() else { return };
    match role.as_str() {
        "fill" => fill(&folder),
        "leave" => leave(&folder),
        "read-only" => read_only(&folder),
        other => panic!("no role {other}"),
    }
    tell("well");
}

/// Runs a role on a small disk.
fn on_a_small_disk(role: &str) {
    if !may_mount() {
        return rohrpost_test_report::skipped("recording to a full disk; no mounts are allowed here");
    }
    let folder = tempfile::tempdir().unwrap();
    let mut command = in_role(role, folder.path());
    with_small_memory(&mut command, folder.path(), DISK_PAGES);
    let mut running = Running::start(command);
    assert_eq!(running.hear().as_deref(), Some("well"));
    assert!(running.child.wait().unwrap().success());
}

fn until(what: &str, writer: &Writer, is_so: impl Fn(&Status) -> bool) -> Status {
    for _ in 0..60_000 {
        let status = writer.status();
        if is_so(&status) {
            return status;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("not within a minute: {what}: {:?}", writer.status());
}

/// Records from a number on until the problem comes; the number behind the last one that was taken.
fn until_it_fails(writer: &mut Writer, first: u32) -> u32 {
    let channels = channels(writer);
    let mut number = first;
    while writer.status().problem.is_none() {
        with_message(number, |channel, message| writer.write(channels[channel], message)).unwrap();
        number += 1;
        // What waits when the disk is full must fit it once there is room.
        let waits = |status: Status| status.waiting > 300 && status.problem.is_none();
        while waits(writer.status()) {
            std::thread::sleep(Duration::from_micros(200));
        }
    }
    number
}

/// Moves files to another place, as a person does that makes room; not the newest one, which may be written.
fn make_room(folder: &Path, to: &Path) {
    let files = files(folder);
    move_files(&files[..files.len() - 1], to);
}

fn move_files(files: &[PathBuf], to: &Path) {
    for path in files {
        std::fs::copy(path, to.join(path.file_name().unwrap())).unwrap();
        std::fs::remove_file(path).unwrap();
    }
}

#[test]
fn a_full_disk_is_told_and_recording_goes_on_when_there_is_room() {
    on_a_small_disk("fill");
}

fn fill(folder: &Path) {
    let away = tempfile::tempdir().unwrap();
    let mut writer = Writer::start(busy_options(folder), session()).unwrap();
    let number = until_it_fails(&mut writer, 0);
    let status = writer.status();
    let error = status.problem.clone().unwrap().error;
    assert!(matches!(error, DiskError::Full { .. }), "{error}");
    assert!(error.to_string().contains("the disk or the user's quota is full"), "{error}");
    assert!(status.failures.full >= 1 && status.is_running && status.lost == 0, "{status:?}");
    // It is tried again and again, and leaves no files that have nothing.
    let tries = status.failures.full + 5;
    until("tried again", &writer, |status| status.failures.full > tries);
    // One more may be there while it is tried.
    let kept = status.files_closed + status.files_torn;
    assert!(files(folder).len() as u64 <= kept + 1, "{:?}", files(folder));
    make_room(folder, away.path());
    until("all is written", &writer, |status| status.written == u64::from(number) && status.problem.is_none());
    let number = until_it_fails(&mut writer, number);
    make_room(folder, away.path());
    let (status, told) = writer.finish();
    told.unwrap();
    assert_eq!((status.written, status.lost, status.waiting), (u64::from(number), 0, 0));
    move_files(&files(folder), away.path());
    assert_eq!(recover_all(away.path()).0, number);
}

#[test]
fn what_is_to_stay_free_stays_free() {
    on_a_small_disk("leave");
}

fn leave(folder: &Path) {
    let leave_bytes = 256 << 10;
    let mut writer = Writer::start(Options { leave_bytes, ..busy_options(folder) }, session()).unwrap();
    let number = until_it_fails(&mut writer, 0);
    let status = writer.status();
    let error = status.problem.clone().unwrap().error;
    assert!(matches!(error, DiskError::Low { .. }), "{error}");
    assert_eq!((status.failures.full, status.files_torn), (0, 0), "{status:?}");
    let used: u64 = files(folder).iter().map(|path| path.metadata().unwrap().len()).sum();
    assert!(used > DISK_BYTES / 2 && used <= DISK_BYTES - leave_bytes + (64 << 10), "{used}");
    // What waits when it ends is lost, and counted.
    let (status, told) = writer.finish();
    assert!(matches!(told, Err(DiskError::Low { .. })));
    assert_eq!(status.written + status.lost, u64::from(number));
    assert!(status.lost > 0 && status.waiting == 0, "{status:?}");
    let away = tempfile::tempdir().unwrap();
    move_files(&files(folder), away.path());
    let (found, reports) = recover_all(away.path());
    assert_eq!(u64::from(found), status.written);
    assert!(reports.iter().all(|report| report.was_closed), "{reports:?}");
}

#[test]
fn a_disk_that_becomes_read_only_is_told() {
    on_a_small_disk("read-only");
}

fn read_only(folder: &Path) {
    remount(folder, libc::MS_RDONLY);
    let mut writer = Writer::start(busy_options(folder), session()).unwrap();
    let status = until("it is told", &writer, |status| status.problem.is_some());
    let error = status.problem.unwrap().error;
    assert!(matches!(error, DiskError::ReadOnly { .. }), "{error}");
    let channels = channels(&mut writer);
    with_message(0, |channel, message| writer.write(channels[channel], message)).unwrap();
    remount(folder, 0);
    until("it goes on", &writer, |status| status.written == 1 && status.problem.is_none());
    let (status, told) = writer.finish();
    told.unwrap();
    assert!(status.failures.read_only >= 1 && status.lost == 0);
    assert_eq!(recover_all(folder).0, 1);
}
