//! Folders that log control may name: those below the configured one, wherever links lead.

use super::leftovers::FOLDERS_DEEP;
use std::fs::{DirBuilder, Permissions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, PermissionsExt};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why files are not made in a folder.
#[derive(Debug, Error)]
pub(super) enum FolderError {
    #[error("{}: is no folder that files can be made in: {}", .0.display(), .1)]
    Io(PathBuf, io::Error),
    #[error(
        "{} is not below {}, where this recorder makes its files; name a folder below it", .0.display(), .1.display()
    )]
    Outside(PathBuf, PathBuf),
    #[error(
        "{} is too deep: files that are not closed would not be found there after a restart; name one that is at most \
         {} folders below {}", .0.display(), FOLDERS_DEEP, .1.display()
    )]
    TooDeep(PathBuf, PathBuf),
    #[error("{}: is no folder", .0.display())]
    NoFolder(PathBuf),
}

/// Makes a folder with these permissions, whatever the umask says, and none above it.
pub(super) fn make(folder: &Path, mode: u32) -> io::Result<()> {
    DirBuilder::new().mode(mode).create(folder)?;
    // A disk without permissions gives each folder the same.
    let _ = std::fs::set_permissions(folder, Permissions::from_mode(mode));
    Ok(())
}

/// The folder of this name below `root`, without links. It is made, with these permissions, if the one above it exists.
///
/// What is put in its place later, is checked with each file (`Options::root`).
pub(super) fn below(root: &Path, name: &str, mode: u32) -> Result<PathBuf, FolderError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |error| FolderError::Io(path, error)
    };
    let root = root.canonicalize().map_err(failed(root))?;
    let wanted = root.join(name);
    let inside = |path: PathBuf| match path.strip_prefix(&root).map(|rest| rest.components().count()) {
        Ok(0..=FOLDERS_DEEP) => Ok(path),
        Ok(_) => Err(FolderError::TooDeep(wanted.clone(), root.clone())),
        Err(_) => Err(FolderError::Outside(wanted.clone(), root.clone())),
    };
    let found = match wanted.canonicalize() {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let (Some(above), Some(name)) = (wanted.parent(), wanted.file_name()) else {
                return Err(FolderError::Io(wanted, error));
            };
            // The one above is inside, before anything is made; then a new folder is, too.
            let made = inside(inside(above.canonicalize().map_err(failed(above))?)?.join(name))?;
            make(&made, mode).map_err(failed(&made))?;
            made
        }
        found => found.map_err(failed(&wanted))?,
    };
    let found = inside(found)?;
    if found.is_dir() { Ok(found) } else { Err(FolderError::NoFolder(found)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn a_folder_has_the_permissions_of_its_node_whatever_the_umask_says() {
        let place = tempfile::tempdir().unwrap();
        for mode in [0o700, 0o770, 0o777] {
            let made = below(place.path(), &format!("{mode:o}"), mode).unwrap();
            assert_eq!(made.metadata().unwrap().permissions().mode() & 0o777, mode);
        }
    }

    #[test]
    fn folders_below_the_root_are_taken_and_no_others() {
        let place = tempfile::tempdir().unwrap();
        let place = place.path().canonicalize().unwrap();
        let (root, away) = (place.join("root"), place.join("away"));
        for folder in [&root, &away, &root.join("there"), &root.join("a b"), &place.join("rootless")] {
            std::fs::create_dir(folder).unwrap();
        }
        std::fs::write(root.join("file"), "").unwrap();
        symlink(&away, root.join("out")).unwrap();
        symlink("../away", root.join("relative-out")).unwrap();
        symlink("there", root.join("in")).unwrap();
        symlink(away.join("missing"), root.join("dangling")).unwrap();
        symlink(&root, place.join("link")).unwrap();
        let absolute = root.join("there").display().to_string();
        for (name, wanted) in [
            ("there", Some("there")),
            ("a b", Some("a b")),
            (".", Some("")),
            ("new", Some("new")),
            ("new/newer/", Some("new/newer")),
            ("in", Some("there")),
            ("there/../new", Some("new")),
            (&absolute, Some("there")),
            ("..", None),
            ("../away", None),
            ("../fresh", None),
            ("../rootless", None),
            ("/tmp", None),
            ("out", None),
            ("out/fresh", None),
            ("relative-out", None),
            ("dangling", None),
            ("file", None),
            ("file/below", None),
            ("one/two", None),
            ("nul\0", None),
        ] {
            // Through a link to the root, as a configuration may name it.
            let found = below(&place.join("link"), name, 0o700);
            assert_eq!(found.as_deref().ok(), wanted.map(|wanted| root.join(wanted)).as_deref(), "{name}: {found:?}");
        }
        assert_eq!(std::fs::read_dir(&away).unwrap().count(), 0, "nothing is made outside");
        assert!(!place.join("fresh").exists());
        assert!(below(&place.join("gone"), "there", 0o700).is_err());
    }
}
