//! A new file in the making: until it is whole, it is called `NAME.part`.

use crate::error::{DiskError, RewriteError, Shown};
use std::io;
use std::path::{Path, PathBuf};

/// So many names are tried: what has the others is a user's, or interrupted commands left it.
const NAMES_MAX: u32 = 100;

/// The temporary name of a new file. It was made under this name, which nothing had before. Dropped before
/// [`finish`](Self::finish), it goes, and the file with it.
pub struct PartFile {
    part: PathBuf,
    to: PathBuf,
    is_renamed: bool,
}

impl PartFile {
    /// Makes a temporary file beside `to`. `make` makes a file, and refuses to if there is one of this name.
    ///
    /// ```
    /// use rohrpost_recording::PartFile;
    ///
    /// let folder = tempfile::tempdir()?;
    /// let to = folder.path().join("a.txt");
    /// std::fs::write(folder.path().join("a.txt.part"), "a user's")?;
    /// let (part, _file) = PartFile::create(&to, |path| std::fs::File::create_new(path))?;
    /// assert_eq!(part.path(), folder.path().join("a.txt.2.part"));
    /// part.finish()?;
    /// assert!(to.exists() && folder.path().join("a.txt.part").exists());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`RewriteError::Exists`] if `to` is there, and [`RewriteError::Disk`].
    pub fn create<T>(to: &Path, mut make: impl FnMut(&Path) -> io::Result<T>) -> Result<(Self, T), RewriteError> {
        if to.symlink_metadata().is_ok() {
            return Err(RewriteError::Exists(Shown(to.to_owned())));
        }
        let mut taken = None;
        for part in Self::names(to) {
            match make(&part) {
                Ok(file) => return Ok((Self { part, to: to.to_owned(), is_renamed: false }, file)),
                Err(error) => {
                    let is_taken = error.kind() == io::ErrorKind::AlreadyExists;
                    taken = Some(DiskError::new("make the file", &part, error));
                    if !is_taken {
                        break;
                    }
                }
            }
        }
        let none = || DiskError::new("make the file", to, io::ErrorKind::AlreadyExists.into());
        Err(taken.unwrap_or_else(none).into())
    }

    /// Names that a new file may have until it is whole, in the order in which they are tried.
    pub fn names(to: &Path) -> impl Iterator<Item = PathBuf> {
        (1..=NAMES_MAX).map(|number| {
            let mut part = to.as_os_str().to_owned();
            part.push(if number == 1 { ".part".to_owned() } else { format!(".{number}.part") });
            part.into()
        })
    }

    /// Where it is until then.
    pub fn path(&self) -> &Path {
        &self.part
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// [`RewriteError::Exists`] if another file has got the name meanwhile, which stays, and [`RewriteError::Disk`].
    pub fn finish(mut self) -> Result<(), RewriteError> {
        // Unlike a rename, a link replaces nothing; not every file system of a stick has it.
        match std::fs::hard_link(&self.part, &self.to) {
            Ok(()) => {}
            Err(_) if self.to.symlink_metadata().is_ok() => return Err(RewriteError::Exists(Shown(self.to.clone()))),
            Err(_) => {
                let renamed = std::fs::rename(&self.part, &self.to);
                renamed.map_err(|error| DiskError::new("give the file its name", &self.to, error))?;
                self.is_renamed = true;
            }
        }
        Ok(())
    }
}

impl Drop for PartFile {
    fn drop(&mut self) {
        if !self.is_renamed {
            let _ = std::fs::remove_file(&self.part);
        }
    }
}
