//! Writes files that belong together: all are completely on the disk before the first gets its name.

use super::CertificateError;
use rohrpost_config::KeysError;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

/// Permissions of a file.
pub(super) const SECRET: u32 = 0o600;
pub(super) const PUBLIC: u32 = 0o644;

/// A file that will be written.
pub(super) struct Written {
    pub(super) path: PathBuf,
    pub(super) text: String,
    /// Its permissions.
    pub(super) mode: u32,
}

impl Written {
    /// Its temporary name.
    fn beside(&self) -> PathBuf {
        let mut beside = self.path.clone().into_os_string();
        beside.push(".new");
        beside.into()
    }

    /// Writes it under its temporary name. Nothing that has this name is touched: it may be a user's.
    fn write(&self) -> Result<(), CertificateError> {
        let (beside, failed) = (self.beside(), |error| CertificateError::File(self.path.clone(), error));
        let opened = OpenOptions::new().write(true).create_new(true).mode(self.mode).open(&beside);
        let mut file = opened.map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => KeysError::Left(beside.clone()).into(),
            _ => failed(error),
        })?;
        let written = file.write_all(self.text.as_bytes()).and_then(|()| file.sync_all());
        written.inspect_err(|_| _ = fs::remove_file(&beside)).map_err(failed)
    }
}

/// Moves the files into the folder in this order, after `before`; they replace older ones. If they cannot be written,
/// nothing changes.
pub(super) fn put(
    folder: &Path,
    files: &[Written],
    before: impl FnOnce() -> Result<(), CertificateError>,
) -> Result<(), CertificateError> {
    if files.is_empty() {
        return Ok(());
    }
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |error| CertificateError::File(path, error)
    };
    fs::create_dir_all(folder).map_err(failed(folder))?;
    let mut made = Vec::new();
    let written = files.iter().try_for_each(|file| {
        file.write()?;
        made.push(file.beside());
        Ok(())
    });
    written.and_then(|()| before()).inspect_err(|_| {
        for beside in made {
            let _ = fs::remove_file(beside);
        }
    })?;
    for file in files {
        fs::rename(file.beside(), &file.path).map_err(failed(&file.path))?;
    }
    // Otherwise a crash of the computer may lose the names.
    File::open(folder).and_then(|folder| folder.sync_all()).map_err(failed(folder))
}
