//! Makes a bundle of files.

use crate::bundle::{Bundle, MANIFEST_FILE, OpenError, SIGNATURE_FILE};
use crate::digest::Sha256;
use crate::disk::{self, At, FileError};
use crate::key::SigningKey;
use crate::manifest::{FileEntry, Manifest, ManifestError};
use crate::path::FilePath;
use std::fs::{self, File, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// One file that goes into a bundle.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Ingredient {
    /// Path in the bundle.
    pub path: FilePath,
    /// Where the file is now. A symbolic link is followed.
    pub source: PathBuf,
}

/// What a bundle is made of.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// Name of the installation.
    pub installation: String,
    /// Version; `None`: one more than the highest in the folder.
    pub version: Option<u64>,
    /// How long all modules must stay up.
    pub trial: Duration,
    /// The file that launch is given.
    pub configuration: FilePath,
    /// All files, each path once.
    pub files: Vec<Ingredient>,
}

/// Why no bundle was made.
#[derive(Debug, thiserror::Error)]
pub enum MakeError {
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
    /// What the manifest would say.
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    /// An earlier bundle.
    #[error("{0}; to count versions without it, remove its folder, or say --version")]
    Earlier(OpenError),
    /// A version that is not higher.
    #[error("version {version} is not higher than version {newest} of {}; nodes would refuse it", folder.display())]
    NotHigher {
        /// The version.
        version: u64,
        /// The highest that there is.
        newest: u64,
        /// Folder of the bundles.
        folder: PathBuf,
    },
}

/// Makes a bundle in a folder of bundles, which is made if it is not there: all or nothing.
///
/// # Errors
/// A file that cannot be read or written, or what [`Manifest::new`] refuses.
pub fn make(recipe: &Recipe, key: &SigningKey, folder: &Path) -> Result<Bundle, MakeError> {
    disk::make_folder(folder)?;
    let newest = Bundle::newest(folder).map_err(MakeError::Earlier)?.map_or(0, |bundle| bundle.manifest().version());
    let version = recipe.version.unwrap_or(newest + 1);
    if version <= newest {
        return Err(MakeError::NotHigher { version, newest, folder: folder.to_owned() });
    }
    let staging = tempfile::Builder::new().prefix(".making-").tempdir_in(folder).at("made", folder)?;
    let files = recipe.files.iter().map(|file| copy(file, staging.path())).collect::<Result<Vec<_>, FileError>>()?;
    let manifest = Manifest::new(&recipe.installation, version, recipe.trial, recipe.configuration.clone(), files)?;
    let text = manifest.text();
    let signature = key.sign(text.as_bytes()).text();
    for (name, text) in [(MANIFEST_FILE, &text), (SIGNATURE_FILE, &signature)] {
        disk::write(&mut text.as_bytes(), &staging.path().join(name), false)?;
    }
    // A temporary folder is for its owner alone.
    fs::set_permissions(staging.path(), Permissions::from_mode(0o755)).at("written", staging.path())?;
    disk::sync_tree(staging.path())?;
    let made = folder.join(Sha256::of(text.as_bytes()).to_string());
    disk::rename(&staging.keep(), &made)?;
    Bundle::open(&made).map_err(MakeError::Earlier)
}

fn copy(file: &Ingredient, staging: &Path) -> Result<FileEntry, FileError> {
    let source = &file.source;
    let mut open = File::open(source).at("read", source)?;
    let permissions = open.metadata().at("read", source)?.permissions();
    let executable = permissions.mode() & 0o111 != 0;
    let (size, sha256) = disk::write(&mut open, &file.path.below(staging), executable)?;
    Ok(FileEntry { path: file.path.clone(), size, sha256, executable })
}
