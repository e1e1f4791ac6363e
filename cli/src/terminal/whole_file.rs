//! Files that a user names for a command's output: written whole or not at all.

use std::fs::{File, metadata};
use std::io::{self, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

const MODE: u32 = 0o644;

/// Replaces a file, or makes it: a reader, also after a power cut, finds the old one or the new one. A symbolic link
/// stays, and what is no file, such as a pipe, is written to.
pub(crate) fn write_whole(path: &Path, text: &str) -> Result<(), String> {
    let advice = "name a file in a folder that is there and that you may write to";
    replace(path, text).map_err(|error| format!("{} cannot be written: {error}; {advice}", path.display()))
}

fn replace(path: &Path, text: &str) -> io::Result<()> {
    // The target of a symbolic link, so that the link stays.
    let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let there = metadata(&path).ok();
    if there.as_ref().is_some_and(|there| !there.is_file()) {
        return File::options().write(true).open(&path)?.write_all(text.as_bytes());
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let opened = File::open(folder)?;
    let mut file = tempfile::Builder::new().prefix(".rohrpost-").tempfile_in(folder)?;
    file.write_all(text.as_bytes())?;
    let permissions = there.map_or_else(|| PermissionsExt::from_mode(MODE), |there| there.permissions());
    file.as_file().set_permissions(permissions)?;
    file.as_file().sync_all()?;
    file.persist(&path).map_err(|error| error.error)?;
    opened.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{read_dir, read_to_string, set_permissions, write};
    use std::os::unix::fs::symlink;

    #[test]
    fn a_file_is_replaced_whole_and_keeps_its_mode_and_its_link() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link, new] = ["file", "link", "new"].map(|name| folder.path().join(name));
        write(&file, "before").unwrap();
        set_permissions(&file, PermissionsExt::from_mode(0o600)).unwrap();
        symlink("file", &link).unwrap();
        write_whole(&link, "after").unwrap();
        write_whole(&new, "made").unwrap();
        assert_eq!((read_to_string(&file).unwrap(), read_to_string(&new).unwrap()), ("after".into(), "made".into()));
        assert!(link.is_symlink());
        let mode = |path| metadata(path).unwrap().permissions().mode() & 0o777;
        assert_eq!((mode(&file), mode(&new)), (0o600, MODE));
        write_whole(Path::new("/dev/null"), "to nobody").unwrap();
        let nowhere = folder.path().join("no/such/folder");
        assert!(write_whole(&nowhere, "x").unwrap_err().starts_with(nowhere.to_str().unwrap()));
        assert!(write_whole(folder.path(), "x").unwrap_err().contains("cannot be written: "));
        assert_eq!(read_dir(folder.path()).unwrap().count(), 3, "nothing else is left");
    }
}
