//! A bundle on the disk, and how its files differ from its manifest.

use crate::digest::Sha256;
use crate::disk::{self, At, FileError};
use crate::key::{KEY_BYTES_MAX, KeyError, Signature, Trusted};
use crate::manifest::{FileEntry, MANIFEST_BYTES_MAX, Manifest, ManifestError};
use crate::path::lexical;
use rohrpost_config::{Installation, resolved_text};
use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::io::ErrorKind;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// File of the manifest.
pub(crate) const MANIFEST_FILE: &str = "manifest.toml";
/// File of its signature.
pub(crate) const SIGNATURE_FILE: &str = "manifest.sig";

/// A bundle's folder with a manifest and a signature that were read. Whether they are right is asked by
/// [`verify_signature`](Self::verify_signature) and [`differences`](Self::differences).
#[derive(Clone, Debug)]
pub struct Bundle {
    folder: PathBuf,
    manifest_bytes: Vec<u8>,
    manifest: Manifest,
    signature: Signature,
}

/// Why a folder is no bundle.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
    /// The manifest.
    #[error("{}: {error}", path.display())]
    Manifest {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: ManifestError,
    },
    /// The signature.
    #[error("{}: no signature; `ed25519`, a public key and a signature in one line are right", .0.display())]
    Signature(PathBuf),
}

/// A file of a bundle's folder that is not as the manifest says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// Path from the bundle's folder on; of a file that the manifest does not have, as far as it is text.
    pub path: String,
    /// What differs.
    pub kind: DifferenceKind,
}

/// How a file differs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DifferenceKind {
    /// No such file.
    Missing,
    /// Other bytes than in the manifest.
    Changed,
    /// A program that cannot be executed, or the reverse.
    Executable,
    /// The manifest does not have it.
    Extra,
    /// Parameters that a robot has saved since.
    Saved,
    /// A symbolic link, a pipe, or a folder in place of a file.
    NotAFile,
    /// The system refuses to read it.
    Unreadable(String),
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let how = match &self.kind {
            DifferenceKind::Missing => "is missing",
            DifferenceKind::Changed => "was changed: its content is not that of the manifest",
            DifferenceKind::Executable => "has another permission to be executed than in the manifest",
            DifferenceKind::Extra => "is not in the manifest",
            DifferenceKind::Saved => "has other parameters than in the manifest, which were saved here",
            DifferenceKind::NotAFile => "is no regular file",
            DifferenceKind::Unreadable(why) => return write!(f, "{} cannot be read: {why}", self.path),
        };
        write!(f, "{} {how}", self.path)
    }
}

impl Difference {
    /// Whether a robot may make this difference as it runs: its modules write files, and parameters are saved.
    pub fn is_harmless(&self) -> bool {
        matches!(self.kind, DifferenceKind::Extra | DifferenceKind::Saved)
    }
}

impl Bundle {
    /// Reads manifest and signature of a folder.
    ///
    /// # Errors
    /// What is wrong with either.
    pub fn open(folder: &Path) -> Result<Self, OpenError> {
        let read = |name: &str, most| {
            let path = folder.join(name);
            disk::read(&path, most).at("read", &path)
        };
        let (manifest, signature) = (read(MANIFEST_FILE, MANIFEST_BYTES_MAX)?, read(SIGNATURE_FILE, KEY_BYTES_MAX)?);
        Self::from_bytes(folder, manifest, &signature)
    }

    /// The bundle with the highest version in a folder of bundles.
    ///
    /// # Errors
    /// A bundle that cannot be read.
    pub fn newest(folder: &Path) -> Result<Option<Self>, OpenError> {
        let is_bundle = |path: &PathBuf| path.file_name().and_then(|name| Sha256::parse(name.to_str()?)).is_some();
        let paths = disk::entries(folder)?.into_iter().filter(is_bundle);
        let bundles = paths.map(|path| Self::open(&path)).collect::<Result<Vec<_>, _>>()?;
        Ok(bundles.into_iter().max_by_key(|bundle| bundle.manifest.version()))
    }

    /// Takes manifest and signature as they are to lie in a folder.
    pub(crate) fn from_bytes(folder: &Path, manifest_bytes: Vec<u8>, signature: &[u8]) -> Result<Self, OpenError> {
        let manifest = Manifest::parse(&manifest_bytes)
            .map_err(|error| OpenError::Manifest { path: folder.join(MANIFEST_FILE), error })?;
        let signature = Signature::parse(signature).ok_or_else(|| OpenError::Signature(folder.join(SIGNATURE_FILE)))?;
        Ok(Self { folder: folder.to_owned(), manifest_bytes, manifest, signature })
    }

    /// Folder of the bundle.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// What the bundle has.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Exact bytes of the manifest: what was signed.
    pub fn manifest_bytes(&self) -> &[u8] {
        &self.manifest_bytes
    }

    /// Signature of the manifest.
    pub fn signature(&self) -> &Signature {
        &self.signature
    }

    /// Digest of the manifest: the name of the bundle.
    pub fn digest(&self) -> Sha256 {
        Sha256::of(&self.manifest_bytes)
    }

    /// Whether it is signed with one of these keys.
    ///
    /// # Errors
    /// [`KeyError::Unknown`] and [`KeyError::Mismatch`].
    pub fn verify_signature(&self, trusted: &Trusted) -> Result<(), KeyError> {
        trusted.verify(&self.manifest_bytes, &self.signature)
    }

    /// Reads all files, and names each that is not as the manifest says; none if all are.
    ///
    /// # Errors
    /// A folder that cannot be listed.
    pub fn differences(&self) -> Result<Vec<Difference>, FileError> {
        let mut missing: BTreeMap<&str, &FileEntry> =
            self.manifest.files().iter().map(|file| (file.path.as_str(), file)).collect();
        let mut found = Vec::new();
        let mut folders = vec![self.folder.clone()];
        while let Some(folder) = folders.pop() {
            for path in disk::entries(&folder)? {
                let name = path.strip_prefix(&self.folder).unwrap_or(&path).to_string_lossy().into_owned();
                let there = fs::symlink_metadata(&path).at("read", &path)?;
                let entry = missing.remove(name.as_str());
                let kind = match entry {
                    Some(file) => difference(&path, file),
                    None if there.is_dir() => {
                        folders.push(path);
                        None
                    }
                    None if name == MANIFEST_FILE || name == SIGNATURE_FILE => None,
                    None => Some(DifferenceKind::Extra),
                };
                found.extend(kind.map(|kind| Difference { path: name, kind }));
            }
        }
        let missing = missing.into_keys().map(str::to_owned);
        found.extend(missing.map(|path| Difference { path, kind: DifferenceKind::Missing }));
        let saved = self.saved_parameters();
        let is_saved = |found: &&mut Difference| {
            found.kind == DifferenceKind::Changed && saved.as_deref() == Some(Path::new(&found.path))
        };
        found.iter_mut().filter(is_saved).for_each(|found| found.kind = DifferenceKind::Saved);
        found.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(found)
    }

    /// Path in the bundle at which a robot saves parameters, as the configuration says.
    fn saved_parameters(&self) -> Option<PathBuf> {
        let configuration = self.manifest.configuration();
        let text = resolved_text(&configuration.below(&self.folder)).ok()?;
        let saved = Installation::parse(&text, configuration.as_str().as_ref()).ok()?.parameters?;
        Some(lexical(&saved)).filter(|saved| saved != Path::new(configuration.as_str()))
    }

    /// How one file of the manifest differs.
    pub(crate) fn difference(&self, file: &FileEntry) -> Option<DifferenceKind> {
        difference(&file.path.below(&self.folder), file)
    }
}

fn difference(path: &Path, file: &FileEntry) -> Option<DifferenceKind> {
    match fs::symlink_metadata(path) {
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            return Some(DifferenceKind::Missing);
        }
        Err(error) => return Some(DifferenceKind::Unreadable(error.to_string())),
        Ok(there) if !there.is_file() => return Some(DifferenceKind::NotAFile),
        Ok(there) if there.len() != file.size => return Some(DifferenceKind::Changed),
        Ok(there) if (there.permissions().mode() & 0o111 != 0) != file.executable => {
            return Some(DifferenceKind::Executable);
        }
        Ok(_) => {}
    }
    match disk::hash(path) {
        Ok(found) if found == (file.size, file.sha256) => None,
        Ok(_) => Some(DifferenceKind::Changed),
        Err(error) => Some(DifferenceKind::Unreadable(error.to_string())),
    }
}
