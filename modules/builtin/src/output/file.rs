//! The collector's file. A line is one write, as soon as it comes: nothing is kept back that a killed collector could
//! lose.

use super::sink::{SinkChange, SinkHealth};
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// So often it looks whether its file still has its name: somebody may have moved or removed it.
const LOOK: Duration = Duration::from_secs(1);

pub(super) struct LogFile {
    path: PathBuf,
    /// A file is put aside before it becomes larger, bytes.
    size_max: u64,
    /// Files put aside that are kept.
    kept: u32,
    open: Option<Open>,
    /// When it is looked at again.
    look_at: Option<Instant>,
    health: SinkHealth,
}

struct Open {
    file: File,
    len: u64,
    /// Whether the last line has no end: its writer was killed, or the disk was full.
    torn: bool,
}

impl LogFile {
    /// Opens a file, or begins one.
    pub(super) fn open(path: &Path, size_max: u64, kept: u32) -> io::Result<Self> {
        let open = Some(Open::at(path)?);
        Ok(Self { path: path.to_owned(), size_max, kept, open, look_at: None, health: SinkHealth::default() })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a line, which has no end yet. When there is no room it goes on without, and tries again every second.
    pub(super) fn write(&mut self, line: &str, now: Instant) -> Option<SinkChange> {
        let Self { path, size_max, kept, open, look_at, health } = self;
        if look_at.is_none_or(|at| now >= at) {
            *look_at = Some(now + LOOK);
            open.take_if(|file| !file.is_at(path));
        }
        health.put(now, || {
            // Opened anew also after a failure: it may have been moved out of the way.
            let mut file = match open.take() {
                Some(file) => file,
                None => Open::at(path)?,
            };
            let len = line.len() as u64 + 1;
            if file.len > 0 && file.len + len > *size_max {
                // Else it was moved or removed a moment ago, and those put aside must not move up for nothing.
                if file.is_at(path) {
                    put_aside(path, *kept)?;
                }
                file = Open::at(path)?;
            }
            file.append(line)?;
            *open = Some(file);
            Ok(())
        })
    }
}

impl Open {
    fn at(path: &Path) -> io::Result<Self> {
        let mut file = File::options().create(true).read(true).append(true).open(path)?;
        let len = file.metadata()?.len();
        let mut last = [b'\n'];
        if len > 0 {
            file.seek(SeekFrom::End(-1))?;
            file.read_exact(&mut last)?;
        }
        Ok(Self { file, len, torn: last != [b'\n'] })
    }

    /// Whether it is what stands at this path.
    fn is_at(&self, path: &Path) -> bool {
        let there = fs::metadata(path).and_then(|there| Ok((there, self.file.metadata()?)));
        there.is_ok_and(|(there, own)| (there.dev(), there.ino()) == (own.dev(), own.ino()))
    }

    /// One write for the whole line: what is killed leaves all of it or none.
    fn append(&mut self, line: &str) -> io::Result<()> {
        let begin = if self.torn { "\n" } else { "" };
        let text = format!("{begin}{line}\n");
        if let Err(error) = self.file.write_all(text.as_bytes()) {
            // Half a line is none. If it cannot be taken back, it is ended before the next one.
            let _ = self.file.set_len(self.len);
            return Err(error);
        }
        self.len += text.len() as u64;
        self.torn = false;
        Ok(())
    }
}

/// `robot.log` becomes `robot.log.1`, that one `robot.log.2`, and the last goes.
fn put_aside(path: &Path, kept: u32) -> io::Result<()> {
    let numbered = |number: u32| {
        let mut name = OsString::from(path);
        name.push(format!(".{number}"));
        PathBuf::from(name)
    };
    if kept == 0 {
        return fs::remove_file(path);
    }
    for number in (1..kept).rev() {
        match fs::rename(numbered(number), numbered(number + 1)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
    }
    fs::rename(path, numbered(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;
    use std::time::Duration;

    fn read(path: &Path) -> String {
        fs::read_to_string(path).unwrap_or_default()
    }

    #[test]
    fn a_file_that_is_full_is_put_aside_and_so_many_are_kept() {
        for kept in [0, 1, 3] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("robot.log");
            let mut file = LogFile::open(&path, 30, kept).unwrap();
            for number in 0..20 {
                // Three of them are 30 bytes.
                assert!(file.write(&format!("line {number:04}"), Instant::now()).is_none());
                assert!(read(&path).len() <= 30);
            }
            assert_eq!(read(&path), "line 0018\nline 0019\n");
            let files = fs::read_dir(folder.path()).unwrap().count();
            assert_eq!(files, kept as usize + 1);
            for number in 1..=kept as usize {
                let first = 18 - 3 * number;
                let aside = read(&folder.path().join(format!("robot.log.{number}")));
                let lines: String = (first..first + 3).map(|line| format!("line {line:04}\n")).collect();
                assert_eq!(aside, lines, "{number} of {kept}");
            }
        }
    }

    #[test]
    fn what_was_there_stays_and_half_a_line_is_ended() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.log");
        for (before, after) in [("", "new\n"), ("old\n", "old\nnew\n"), ("old\nhal", "old\nhal\nnew\n")] {
            fs::write(&path, before).unwrap();
            let mut file = LogFile::open(&path, 1000, 1).unwrap();
            assert!(file.write("new", Instant::now()).is_none());
            assert_eq!(read(&path), after);
        }
        // Larger than a file may be by itself: it has one of its own.
        let mut file = LogFile::open(&path, 8, 1).unwrap();
        file.write(&"x".repeat(20), Instant::now());
        file.write("y", Instant::now());
        assert_eq!(read(&path), "y\n");
    }

    #[test]
    fn a_file_that_was_moved_or_removed_is_begun_anew() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.log");
        let aside = |number: u32| folder.path().join(format!("robot.log.{number}"));
        let mut file = LogFile::open(&path, 30, 2).unwrap();
        let start = Instant::now();
        assert!(file.write("first", start).is_none());

        fs::rename(&path, aside(1)).unwrap();
        assert!(file.write("meanwhile", start + LOOK / 2).is_none());
        assert!(file.write("second", start + LOOK).is_none());
        assert_eq!((read(&aside(1)).as_str(), read(&path).as_str()), ("first\nmeanwhile\n", "second\n"));

        fs::remove_file(&path).unwrap();
        assert!(file.write("third", start + 2 * LOOK).is_none());
        assert_eq!(read(&path), "third\n");

        // Full before it is noticed: what was put aside stays where it is.
        fs::remove_file(&path).unwrap();
        assert!(file.write("a line that fills the file", start + 2 * LOOK).is_none());
        assert_eq!(read(&path), "a line that fills the file\n");
        assert_eq!(read(&aside(1)), "first\nmeanwhile\n");
        assert!(!aside(2).exists());
    }

    #[test]
    fn a_full_disk_is_said_once_and_used_again_when_there_is_room() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.log");
        symlink("/dev/full", &path).unwrap();
        let mut file = LogFile::open(&path, 1000, 1).unwrap();
        let start = Instant::now();
        let second = Duration::from_secs(1);
        let Some(SinkChange::Fails(error)) = file.write("first", start) else { panic!("a full disk takes nothing") };
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        assert!(file.write("second", start + second / 2).is_none(), "it is not tried");
        assert!(file.write("third", start + second).is_none(), "it is tried, and said already");
        // There is room again.
        fs::remove_file(&path).unwrap();
        assert!(file.write("fourth", start + second * 3 / 2).is_none());
        let Some(SinkChange::Works(missing)) = file.write("fifth", start + 2 * second) else { panic!("there is room") };
        assert_eq!((missing, read(&path).as_str()), (4, "fifth\n"));
        assert!(file.write("sixth", start + 2 * second).is_none());
        assert_eq!(read(&path), "fifth\nsixth\n");
    }
}
