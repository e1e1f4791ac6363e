//! Files that an earlier run could not close: whole files are made of them, in a thread of its own. They stay as they
//! are.

use nix::sys::statvfs::statvfs;
use rohrpost::output::errno_of;
use rohrpost_recording::{PartFile, is_being_written, is_closed, recover as recovered, recovered_path};
use std::ffi::OsStr;
use std::io;
use std::path::{Path, PathBuf};

/// Folders below folders that are looked through. Log control leads no deeper.
pub(super) const FOLDERS_DEEP: usize = 8;

/// Begins. What is there now is looked at, and no file that comes later. Of the disk so much is left as recordings
/// leave.
///
/// # Errors
/// When there is no thread.
pub(super) fn recover(directory: &Path, stem: &str, leave_bytes: u64) -> io::Result<()> {
    let Found { files, others } = find(directory, stem);
    for other in others {
        tracing::warn!("{} is passed over: it is no regular file, and a recording is one", other.display());
    }
    if files.is_empty() {
        return Ok(());
    }
    let work = move || files.iter().filter(|file| is_leftover(file)).for_each(|file| make_whole(file, leave_bytes));
    std::thread::Builder::new().name("recovering".into()).spawn(work).map(drop)
}

/// Files of recordings of a stem, in order, also in folders that log control led to; none of a folder that cannot be
/// read, which the writer will tell.
pub(super) fn files(directory: &Path, stem: &str) -> Vec<PathBuf> {
    find(directory, stem).files
}

/// What has the name of a file of a recording.
#[derive(Default)]
struct Found {
    files: Vec<PathBuf>,
    /// Pipes, links and the like: reading them may wait for ever, or lead elsewhere.
    others: Vec<PathBuf>,
}

fn find(directory: &Path, stem: &str) -> Found {
    let mut found = Found::default();
    collect(directory, stem, FOLDERS_DEEP, &mut found);
    found.files.sort();
    found.others.sort();
    found
}

/// Links are not followed: what they lead to is there by its own name, or outside.
fn collect(directory: &Path, stem: &str, deep: usize, found: &mut Found) {
    for entry in std::fs::read_dir(directory).into_iter().flatten().flatten() {
        let path = entry.path();
        // It went meanwhile.
        let Ok(kind) = entry.file_type() else { continue };
        if kind.is_dir() {
            if deep > 0 {
                collect(&path, stem, deep - 1, found);
            }
        } else if path.file_name().and_then(OsStr::to_str).is_some_and(|name| is_file(name, stem)) {
            if kind.is_file() { &mut found.files } else { &mut found.others }.push(path);
        }
    }
}

/// `STEM-0001.mcap`, and not what was recovered of it.
fn is_file(name: &str, stem: &str) -> bool {
    let number = name.strip_prefix(stem).and_then(|rest| rest.strip_prefix('-')?.strip_suffix(".mcap"));
    number.is_some_and(|number| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()))
}

/// Whether its writer did not close it, and nothing was made of it yet. A file without a beginning has nothing in it.
/// Another recorder may make its files in a folder below.
fn is_leftover(file: &Path) -> bool {
    // In this order: a writer that ends meanwhile closes it.
    !recovered_path(file).exists() && !is_being_written(file) && matches!(is_closed(file), Ok(false))
}

fn make_whole(file: &Path, leave_bytes: u64) {
    let name = file.display();
    if !has_room_for(file, leave_bytes) {
        tracing::error!(
            "{name} was not closed, and a whole file has no room beside it; make some, then `rohrpost record recover`"
        );
        return;
    }
    remove_unfinished(&recovered_path(file));
    match recovered(file, &recovered_path(file), &mut |_, _| {}) {
        Ok(made) => tracing::info!(
            "{name} was not closed: {} messages of it are in {}",
            made.messages,
            made.path.file_name().unwrap_or_default().to_string_lossy()
        ),
        Err(error) => tracing::error!(errno = errno_of(&error), "{name} was not closed, and is not recovered: {error}"),
    }
}

/// Removes what recoveries of this file have left that were cut off themselves. These names are the recorder's own; one
/// that is being written stays.
fn remove_unfinished(whole: &Path) {
    for part in PartFile::names(whole) {
        let is_file = part.symlink_metadata().is_ok_and(|its| its.is_file());
        if is_file && !is_being_written(&part) {
            let _ = std::fs::remove_file(part);
        }
    }
}

/// Whether its disk can take the file once more. What cannot be asked is tried.
fn has_room_for(file: &Path, leave_bytes: u64) -> bool {
    let (Ok(its), Ok(disk)) = (file.metadata(), statvfs(file)) else { return true };
    disk.blocks_available().saturating_mul(disk.fragment_size()) >= its.len().saturating_add(leave_bytes)
}

#[cfg(test)]
mod tests {
    use super::super::folder::below;
    use super::*;
    use rohrpost_recording::{Options, Session, Writer};
    use std::collections::BTreeMap;
    use std::time::Duration;

    #[test]
    fn what_is_to_be_left_free_is_left() {
        let file = tempfile::NamedTempFile::new().unwrap();
        assert!(has_room_for(file.path(), 0));
        assert!(!has_room_for(file.path(), u64::MAX));
        assert!(has_room_for(Path::new("/nowhere"), u64::MAX), "what is wrong with it, is told when it is tried");
    }

    #[test]
    fn files_in_folders_below_are_found_and_links_are_not_followed() {
        let place = tempfile::tempdir().unwrap();
        let below = place.path().join("run 1/deeper");
        std::fs::create_dir_all(&below).unwrap();
        std::os::unix::fs::symlink(&below, place.path().join("link")).unwrap();
        let wanted = [place.path().join("base-0002.mcap"), below.join("base-0001.mcap")];
        wanted.iter().for_each(|file| std::fs::write(file, "").unwrap());
        std::fs::write(below.join("arm-0001.mcap"), "").unwrap();
        assert_eq!(files(place.path(), "base"), wanted);
        assert!(files(&place.path().join("gone"), "base").is_empty());
    }

    #[test]
    fn a_pipe_among_recordings_is_named_and_waited_for_by_nobody() {
        let place = tempfile::tempdir().unwrap();
        let [pipe, file] = ["base-0001.mcap", "base-0002.mcap"].map(|name| place.path().join(name));
        nix::unistd::mkfifo(&pipe, nix::sys::stat::Mode::S_IRWXU).unwrap();
        std::fs::write(&file, "").unwrap();
        let found = find(place.path(), "base");
        assert_eq!((found.files, found.others), (vec![file], vec![pipe.clone()]));
        // It may come later than the look.
        assert!(!is_being_written(&pipe) && !is_leftover(&pipe));
        let told = recovered(&pipe, &recovered_path(&pipe), &mut |_, _| {}).unwrap_err().to_string();
        assert!(told.contains("base-0001.mcap: cannot read: it is no regular file"), "{told}");
    }

    #[test]
    fn files_are_found_wherever_log_control_leads() {
        let place = tempfile::tempdir().unwrap();
        let root = place.path().canonicalize().unwrap();
        let mut name = PathBuf::new();
        let led = |name: &Path| below(&root, name.to_str().unwrap(), 0o700);
        for _ in 0..FOLDERS_DEEP {
            name.push("deeper");
            std::fs::write(led(&name).unwrap().join("base-0001.mcap"), "").unwrap();
        }
        assert_eq!(files(&root, "base").len(), FOLDERS_DEEP);
        let deepest = root.join(&name);
        name.push("deeper");
        let refused = led(&name).unwrap_err().to_string();
        assert!(refused.contains("name one that is at most 8 folders below"), "{refused}");
        assert_eq!(std::fs::read_dir(&deepest).unwrap().count(), 1, "nothing is made there");
        // Nor if it is there, or is named otherwise.
        std::fs::create_dir(deepest.join("deeper")).unwrap();
        std::os::unix::fs::symlink(deepest.join("deeper"), root.join("link")).unwrap();
        assert!(led(&name).is_err() && led(Path::new("link")).is_err() && led(Path::new("link/..")).is_ok());
    }

    #[test]
    fn a_file_that_is_being_written_is_no_leftover() {
        let place = tempfile::tempdir().unwrap();
        let session = Session { node: "base".into(), versions: BTreeMap::new(), configuration: BTreeMap::new() };
        let options = Options { flush: Duration::from_millis(1), ..Options::new(place.path(), "base") };
        let writer = Writer::start(options, session).unwrap();
        let [file, killed] = ["base-0001.mcap", "base-0002.mcap"].map(|name| place.path().join(name));
        while !matches!(is_closed(&file), Ok(false)) {
            assert!(writer.status().problem.is_none());
            std::thread::yield_now();
        }
        // The same, without a writer.
        std::fs::copy(&file, &killed).unwrap();
        assert_eq!((is_leftover(&file), is_leftover(&killed)), (false, true));
        let told = recovered(&file, &recovered_path(&file), &mut |_, _| {}).unwrap_err().to_string();
        assert!(told.contains("a recorder writes it just now") && !recovered_path(&file).exists(), "{told}");
        drop(writer);
    }

    #[test]
    fn files_of_recordings_are_told_from_others() {
        for (name, is_one) in [
            ("base-0001.mcap", true),
            ("base-12345.mcap", true),
            ("base-0001.recovered.mcap", false),
            ("base-0001.recovered.mcap.part", false),
            ("base-.mcap", false),
            ("base-arm-0001.mcap", false),
            ("arm-0001.mcap", false),
            ("base-0001", false),
        ] {
            assert_eq!(is_file(name, "base"), is_one, "{name}");
        }
    }
}
