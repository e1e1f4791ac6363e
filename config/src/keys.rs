//! The folder with an installation's keys, and the file in it with those that seal datagrams: the same on all its
//! nodes, and readable by its owner alone.
//!
//! ```text
//! keys/udp.keys
//! # Keys of a Rohrpost installation …
//! key 2 7d2f…      64 digits; the newest first
//! key 1 03c9…      while keys are changed: the older one
//! ```

use std::fmt;
use std::fs::{DirBuilder, File, OpenOptions, Permissions};
use std::io::{self, Read, Write};
use std::num::NonZeroU8;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// Bytes of a key.
pub const KEY_BYTES: usize = 32;
/// The folder, beside the configuration unless that names another.
pub(crate) const FOLDER: &str = "keys";
/// The file in it.
const FILE: &str = "udp.keys";
/// Keys that are valid at a time.
const KEYS_MAX: usize = 2;
/// A longer file is no such file; it is not read further.
const FILE_BYTES_MAX: u64 = 4096;
/// Permissions that others than the owner must not have.
const OTHERS: u32 = 0o077;
const PREAMBLE: &str = "\
# Keys of a Rohrpost installation. All its nodes need this very file, and nobody else may read it.
# `rohrpost keys rotate` adds a key, `rohrpost keys finish` drops the older one when all nodes have both.
";

/// A key and its number. Printed, it shows the number alone.
#[derive(Clone, PartialEq, Eq)]
pub struct Key {
    /// Precedes the sealed content.
    pub id: NonZeroU8,
    /// The secret.
    pub bytes: [u8; KEY_BYTES],
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "key {}", self.id)
    }
}

/// The keys that are valid: one, or two while they are changed.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Keys {
    /// New incarnations of routers seal with it first.
    pub newest: Key,
    /// Still valid.
    pub older: Option<Key>,
}

/// Why there are no keys in a file.
#[derive(Debug, thiserror::Error)]
pub enum KeysError {
    /// The file itself.
    #[error("{path}: keys cannot be read ({1}); copy this folder from the first computer of the installation. On that \
             one, and there alone, `rohrpost keys new {folder}` makes it", path = .0.display(), folder = folder_of(.0))]
    Read(PathBuf, io::Error),
    /// Others may read it.
    #[error("{path}: others than its owner may read these keys (mode {1:o}); run `chmod 600 {path}`, and if others \
             could log in here, change the keys", path = .0.display())]
    Open(PathBuf, u32),
    /// What is in it.
    #[error("{}:{line}: {why}", path.display())]
    Wrong {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What is wrong, and what would be right; never the key itself.
        why: String,
    },
    /// It could not be written.
    #[error("{path}: keys cannot be written ({1})", path = .0.display())]
    Write(PathBuf, io::Error),
    /// A temporary file from an earlier write exists.
    #[error("{path}: this was left when keys were written and the computer stopped, or they are being written now; if \
             not, remove it", path = .0.display())]
    Left(PathBuf),
    /// There is one already.
    #[error("{path}: there are keys already; `rohrpost keys rotate` changes them", path = .0.display())]
    Exists(PathBuf),
    /// Two are valid already.
    #[error(
        "keys {newest} and {older} are both valid; when all nodes have both, `rohrpost keys finish` drops key {older}"
    )]
    Rotating {
        /// Id of the newer key.
        newest: NonZeroU8,
        /// Number of the older one.
        older: NonZeroU8,
    },
    /// One is valid.
    #[error("key {0} is the only one; `rohrpost keys rotate` adds another")]
    NotRotating(NonZeroU8),
}

/// Opens a regular file that only its owner may read. The open file is checked, since the name may lead elsewhere by
/// now. Clients in other languages have the same rule, and the same words.
///
/// # Errors
/// [`KeysError::Open`], and what `failed` makes of what the system says.
pub fn open_secret<E: From<KeysError>>(path: &Path, failed: impl Fn(io::Error) -> E) -> Result<File, E> {
    // A pipe of this name would be waited for, for ever.
    let file = OpenOptions::new().read(true).custom_flags(libc::O_NONBLOCK).open(path).map_err(&failed)?;
    let metadata = file.metadata().map_err(&failed)?;
    if !metadata.is_file() {
        return Err(failed(io::Error::new(io::ErrorKind::InvalidInput, "it is no regular file")));
    }
    let mode = metadata.permissions().mode() & 0o7777;
    if mode & OTHERS == 0 { Ok(file) } else { Err(KeysError::Open(path.to_owned(), mode).into()) }
}

impl Keys {
    /// Their file in a folder.
    pub fn file(folder: &Path) -> PathBuf {
        folder.join(FILE)
    }

    /// The first key of an installation. `bytes` come from a cryptographic source of random numbers.
    pub fn first(bytes: [u8; KEY_BYTES]) -> Self {
        Self { newest: Key { id: NonZeroU8::MIN, bytes }, older: None }
    }

    /// Adds a key; the one before stays valid.
    ///
    /// # Errors
    /// [`KeysError::Rotating`]
    pub fn rotated(self, bytes: [u8; KEY_BYTES]) -> Result<Self, KeysError> {
        let older = match self.older {
            None => self.newest,
            Some(older) => return Err(KeysError::Rotating { newest: self.newest.id, older: older.id }),
        };
        let id = older.id.checked_add(1).unwrap_or(NonZeroU8::MIN);
        Ok(Self { newest: Key { id, bytes }, older: Some(older) })
    }

    /// Drops the older key.
    ///
    /// # Errors
    /// [`KeysError::NotRotating`]
    pub fn finished(self) -> Result<Self, KeysError> {
        match self.older {
            Some(_) => Ok(Self { older: None, ..self }),
            None => Err(KeysError::NotRotating(self.newest.id)),
        }
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`KeysError::Read`], [`KeysError::Open`] and [`KeysError::Wrong`]
    pub fn load(path: &Path) -> Result<Self, KeysError> {
        let failed = |error| KeysError::Read(path.to_owned(), error);
        let file = open_secret(path, failed)?;
        let mut text = String::new();
        file.take(FILE_BYTES_MAX).read_to_string(&mut text).map_err(failed)?;
        Self::parse(&text).map_err(|(line, why)| KeysError::Wrong { path: path.to_owned(), line, why })
    }

    /// Writes a file that does not exist yet, in one step, and its folder, if that does not exist either.
    ///
    /// # Errors
    /// [`KeysError::Exists`], [`KeysError::Left`] and [`KeysError::Write`]
    pub fn create(&self, path: &Path) -> Result<(), KeysError> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.exists());
        let made = folder.map_or(Ok(()), |folder| DirBuilder::new().recursive(true).mode(0o700).create(folder));
        made.map_err(|error| KeysError::Write(path.to_owned(), error))?;
        self.put(path, |beside| {
            // Unlike a rename, this replaces no existing file.
            std::fs::hard_link(beside, path)?;
            std::fs::remove_file(beside)
        })
    }

    /// Replaces a file in one step: a concurrent reader gets the old keys or the new ones. A symbolic link to it stays
    /// as it is.
    ///
    /// # Errors
    /// [`KeysError::Left`] and [`KeysError::Write`]
    pub fn replace(&self, path: &Path) -> Result<(), KeysError> {
        let file = path.canonicalize().map_err(|error| KeysError::Write(path.to_owned(), error))?;
        self.put(&file, |beside| std::fs::rename(beside, &file))
    }

    /// Writes them to a temporary file beside another; `name` then gives it that one's name.
    fn put(&self, path: &Path, name: impl FnOnce(&Path) -> io::Result<()>) -> Result<(), KeysError> {
        let failed = |error: io::Error| match error.kind() {
            io::ErrorKind::AlreadyExists => KeysError::Exists(path.to_owned()),
            _ => KeysError::Write(path.to_owned(), error),
        };
        let mut beside = path.as_os_str().to_owned();
        beside.push(".new");
        let beside = PathBuf::from(beside);
        let mut file = new_file(&beside).map_err(|error| match error.kind() {
            // Another process made it: it must not be removed.
            io::ErrorKind::AlreadyExists => KeysError::Left(beside.clone()),
            _ => failed(error),
        })?;
        self.write(&mut file).and_then(|()| name(&beside)).map_err(|error| {
            let _ = std::fs::remove_file(&beside);
            failed(error)
        })?;
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // Else the name may be lost if the computer stops now.
        File::open(folder).and_then(|folder| folder.sync_all()).map_err(failed)
    }

    fn write(&self, file: &mut File) -> io::Result<()> {
        // The umask may have removed permissions, not added any.
        file.set_permissions(Permissions::from_mode(0o600))?;
        file.write_all(self.text().as_bytes())?;
        file.sync_all()
    }

    fn text(&self) -> String {
        let line = |key: &Key| {
            let digits: String = key.bytes.iter().map(|byte| format!("{byte:02x}")).collect();
            format!("key {} {digits}\n", key.id)
        };
        let keys: String = [Some(&self.newest), self.older.as_ref()].into_iter().flatten().map(line).collect();
        PREAMBLE.to_owned() + &keys
    }

    /// The line that is wrong, and why.
    fn parse(text: &str) -> Result<Self, (usize, String)> {
        let mut keys: Vec<Key> = Vec::new();
        let lines = || text.lines().zip(1..).map(|(text, line)| (text.trim(), line));
        for (text, line) in lines().filter(|(text, _)| !text.is_empty() && !text.starts_with('#')) {
            let key = key(text).ok_or_else(|| {
                (line, "no key; a line is `key`, a number from 1 to 255, and 64 hexadecimal digits".to_owned())
            })?;
            if keys.iter().any(|other| other.id == key.id) {
                return Err((line, format!("a second key {}; each has a number of its own", key.id)));
            }
            if keys.iter().any(|other| other.bytes == key.bytes) {
                return Err((
                    line,
                    format!("key {} is the same as another; a new one is made by `rohrpost keys rotate`", key.id),
                ));
            }
            if keys.len() == KEYS_MAX {
                return Err((line, "a third key; two are valid at a time, the newest first".into()));
            }
            keys.push(key);
        }
        let mut keys = keys.into_iter();
        match keys.next() {
            Some(newest) => Ok(Self { newest, older: keys.next() }),
            None => Err((
                lines().count().max(1),
                "no key in it; copy the file from the first computer of the installation".into(),
            )),
        }
    }
}

fn folder_of(file: &Path) -> std::path::Display<'_> {
    file.parent().unwrap_or(file).display()
}

/// A new file, for its owner alone from its first moment on.
fn new_file(path: &Path) -> io::Result<File> {
    OpenOptions::new().write(true).create_new(true).mode(0o600).open(path)
}

fn key(line: &str) -> Option<Key> {
    let mut words = line.split_whitespace();
    let (word, id, digits) = (words.next()?, words.next()?, words.next()?);
    if word != "key" || words.next().is_some() || digits.len() != 2 * KEY_BYTES || !digits.is_ascii() {
        return None;
    }
    let mut bytes = [0; KEY_BYTES];
    for (byte, at) in bytes.iter_mut().zip((0..).step_by(2)) {
        let two = &digits[at..at + 2];
        // Else a sign would pass for a digit.
        *byte = two.bytes().all(|digit| digit.is_ascii_hexdigit()).then(|| u8::from_str_radix(two, 16).ok())??;
    }
    Some(Key { id: id.parse().ok()?, bytes })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(newest: u8, older: Option<u8>) -> Keys {
        let key = |id| Key { id: NonZeroU8::new(id).unwrap(), bytes: [id; KEY_BYTES] };
        Keys { newest: key(newest), older: older.map(key) }
    }

    #[test]
    fn what_is_written_is_read_and_nobody_else_reads_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.keys");
        for keys in [keys(1, None), keys(2, Some(1))] {
            let written = if path.exists() { keys.replace(&path) } else { keys.create(&path) };
            written.unwrap();
            assert_eq!(Keys::load(&path).unwrap(), keys);
            assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        }
        assert!(matches!(keys(3, None).create(&path), Err(KeysError::Exists(_))));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside it");
    }

    #[test]
    fn what_a_crash_left_is_named_and_stays() {
        let folder = tempfile::tempdir().unwrap();
        let (path, left) = (folder.path().join("robot.keys"), folder.path().join("robot.keys.new"));
        std::fs::write(&left, "half").unwrap();
        let said = keys(1, None).create(&path).unwrap_err().to_string();
        assert!(said.contains("robot.keys.new") && said.contains("remove it") && !path.exists(), "{said}");
        std::fs::remove_file(&left).unwrap();
        keys(1, None).create(&path).unwrap();
        std::fs::write(&left, "half").unwrap();
        let said = keys(2, Some(1)).replace(&path).unwrap_err().to_string();
        assert!(said.contains("robot.keys.new") && said.contains("remove it"), "{said}");
        assert_eq!(
            (std::fs::read_to_string(&left).unwrap(), Keys::load(&path).unwrap()),
            ("half".into(), keys(1, None))
        );
    }

    #[test]
    fn a_link_to_the_keys_stays_one() {
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (folder.path().join("robot.keys"), folder.path().join("link"));
        keys(1, None).create(&path).unwrap();
        std::os::unix::fs::symlink(&path, &link).unwrap();
        keys(2, Some(1)).replace(&link).unwrap();
        assert!(link.is_symlink());
        assert_eq!(Keys::load(&path).unwrap(), keys(2, Some(1)));
    }

    #[test]
    fn a_file_that_others_may_read_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.keys");
        keys(1, None).create(&path).unwrap();
        for mode in [0o640, 0o604, 0o660, 0o666] {
            std::fs::set_permissions(&path, Permissions::from_mode(mode)).unwrap();
            let said = Keys::load(&path).unwrap_err().to_string();
            assert!(said.contains("chmod 600") && said.contains(&format!("{mode:o}")), "{said}");
        }
        std::fs::set_permissions(&path, Permissions::from_mode(0o400)).unwrap();
        assert_eq!(Keys::load(&path).unwrap(), keys(1, None));
        std::fs::remove_file(&path).unwrap();
        nix::unistd::mkfifo(&path, nix::sys::stat::Mode::S_IRWXU).unwrap();
        let said = Keys::load(&path).unwrap_err().to_string();
        assert!(said.contains("it is no regular file"), "a pipe is not waited for: {said}");
    }

    #[test]
    fn keys_are_changed_in_two_steps() {
        let both = keys(1, None).rotated([2; KEY_BYTES]).unwrap();
        assert_eq!(both, keys(2, Some(1)));
        assert!(both.clone().rotated([3; KEY_BYTES]).unwrap_err().to_string().contains("finish"));
        assert_eq!(both.finished().unwrap(), keys(2, None));
        assert!(keys(2, None).finished().unwrap_err().to_string().contains("rotate"));
        assert_eq!(keys(255, None).rotated([1; KEY_BYTES]).unwrap(), keys(1, Some(255)), "numbers begin anew");
    }

    #[test]
    fn what_is_wrong_names_the_line_and_never_the_key() {
        let good = "ab".repeat(KEY_BYTES);
        for (text, line, why) in [
            (String::new(), 1, "no key in it"),
            (format!("# only\n# comments {good}\n"), 2, "no key in it"),
            (format!("\nkey 0 {good}"), 2, "1 to 255"),
            (format!("key 256 {good}"), 1, "1 to 255"),
            (format!("key 1 {}", &good[1..]), 1, "64 hexadecimal digits"),
            (format!("key 1 +a{}", &good[2..]), 1, "64 hexadecimal digits"),
            (format!("key 1 {good} {good}"), 1, "64 hexadecimal digits"),
            (format!("key 1 {}ä", &good[2..]), 1, "64 hexadecimal digits"),
            (format!("key 1 {good}\nkey 1 {}", "cd".repeat(KEY_BYTES)), 2, "a second key 1"),
            (format!("key 1 {good}\nkey 2 {good}"), 2, "the same"),
            (format!("key 1 {good}\nkey 2 {}\nkey 3 {}", "01".repeat(32), "02".repeat(32)), 3, "a third key"),
        ] {
            let (at, said) = Keys::parse(&text).unwrap_err();
            assert!(at == line && said.contains(why) && !said.contains("abab"), "{text}: {at}: {said}");
        }
        assert!(!format!("{:?}", keys(7, None)).contains("7, 7"));
    }
}
