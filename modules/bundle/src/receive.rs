//! A node receives a bundle: from a folder, or from a stream.

use crate::bundle::{Bundle, Difference, MANIFEST_FILE, OpenError, SIGNATURE_FILE};
use crate::digest::Sha256;
use crate::disk::{self, At, FileError};
use crate::key::KeyError;
use crate::manifest::FileEntry;
use crate::node::{BUNDLES, NodeFolder, NodeFolderError, STATE_PATIENCE, lines};
use crate::path::FilePath;
use nix::fcntl::{AT_FDCWD, RenameFlags, renameat2};
use std::collections::HashMap;
use std::fs;
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};

/// Where a bundle comes from.
pub trait Source {
    /// Bytes of the manifest and of the signature. Asked first.
    ///
    /// # Errors
    /// When they do not come.
    fn head(&mut self) -> io::Result<(Vec<u8>, Vec<u8>)>;

    /// Says which files of the manifest will be asked, by index and in this order. Asked once.
    ///
    /// # Errors
    /// When that cannot be said.
    fn want(&mut self, files: &[usize]) -> io::Result<()>;

    /// Content of the next of them.
    ///
    /// # Errors
    /// When it does not come.
    fn file(&mut self, file: &FileEntry) -> io::Result<Box<dyn Read + '_>>;
}

/// A bundle in a folder of this computer, such as one on a USB stick.
#[derive(Debug)]
pub struct FolderSource<'b>(pub &'b Bundle);

impl Source for FolderSource<'_> {
    fn head(&mut self) -> io::Result<(Vec<u8>, Vec<u8>)> {
        Ok((self.0.manifest_bytes().to_owned(), self.0.signature().text().into_bytes()))
    }

    fn want(&mut self, _: &[usize]) -> io::Result<()> {
        Ok(())
    }

    fn file(&mut self, file: &FileEntry) -> io::Result<Box<dyn Read + '_>> {
        Ok(Box::new(disk::open(&file.path.below(self.0.folder()))?.take(file.size)))
    }
}

/// What receiving has done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Received {
    /// Version of the bundle, which is current now.
    pub version: u64,
    /// Digest of the bundle.
    pub bundle: Sha256,
    /// Whether another one, or none, was current before.
    pub is_new: bool,
    /// The file that launch is to be given.
    pub configuration: PathBuf,
    /// Files that came from the source.
    pub files_sent: usize,
    /// Files of the bundle.
    pub files: usize,
}

/// Why a node has not taken a bundle. The current bundle is as it was.
#[derive(Debug, thiserror::Error)]
pub enum ReceiveError {
    /// The node's folder.
    #[error(transparent)]
    Node(#[from] NodeFolderError),
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
    /// The manifest or its signature.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The signature, or the node's keys.
    #[error(transparent)]
    Key(#[from] KeyError),
    /// The source.
    #[error("{what} did not come ({error})")]
    Source {
        /// What was to come.
        what: String,
        /// What the source says.
        error: io::Error,
    },
    /// A lower version than the node had.
    #[error(
        "version {version} is older than version {newest}, which this node has had; `rohrpost bundle back` goes back"
    )]
    Older {
        /// The version.
        version: u64,
        /// The highest version of the node.
        newest: u64,
    },
    /// Two bundles of one version.
    #[error("version {0} is there already, with other files; make the bundle with a higher --version")]
    SameVersion(u64),
    /// A bundle of another robot.
    #[error("it is for the installation `{bundle}`, and this node has bundles of `{node}`; name another folder")]
    OtherInstallation {
        /// Installation of the bundle.
        bundle: String,
        /// Installation of the node.
        node: String,
    },
    /// A file is not what was signed.
    #[error("`{0}` came with other content than the manifest says; it was changed, or damaged on its way")]
    Content(FilePath),
    /// Files on the disk are not what was written.
    #[error("the disk does not hold what was written:{}", lines(.0))]
    Disk(Vec<Difference>),
}

impl NodeFolder {
    /// Receives a bundle and makes it current.
    ///
    /// # Errors
    /// Anything that keeps the bundle from being whole, trusted and newer; the current bundle stays.
    pub fn receive(&self, source: &mut impl Source) -> Result<Received, ReceiveError> {
        let trusted = self.trusted()?;
        let staging = self.staging();
        [&staging, &self.path().join(BUNDLES)].into_iter().try_for_each(|folder| disk::make_folder(folder))?;
        let _push = self.lock_push()?;
        let what = "the manifest".to_owned();
        let (manifest, signature) = source.head().map_err(|error| ReceiveError::Source { what, error })?;
        let digest = Sha256::of(&manifest);
        let staged = Bundle::from_bytes(&staging.join(digest.to_string()), manifest, &signature)?;
        staged.verify_signature(&trusted)?;
        self.check_version(&staged)?;
        for other in disk::entries(&staging)?.iter().filter(|other| *other != staged.folder()) {
            disk::remove(other)?;
        }
        let files_sent = self.complete(&staged, source).inspect_err(|error| {
            // What cannot be completed here must not keep the robot's disk full.
            if let ReceiveError::File(FileError { error, .. }) = error
                && matches!(error.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded)
            {
                let _ = disk::remove(staged.folder());
            }
        })?;
        let is_new = self.make_current(&staged)?;
        let manifest = staged.manifest();
        Ok(Received {
            version: manifest.version(),
            bundle: digest,
            is_new,
            configuration: manifest.configuration().below(&self.path().join("current")),
            files_sent,
            files: manifest.files().len(),
        })
    }

    fn check_version(&self, bundle: &Bundle) -> Result<(), ReceiveError> {
        let (state, manifest) = (self.state()?, bundle.manifest());
        let version = manifest.version();
        match state.newest() {
            Some((newest, _)) if version < newest => return Err(ReceiveError::Older { version, newest }),
            Some((newest, name)) if version == newest && name != bundle.digest() => {
                return Err(ReceiveError::SameVersion(version));
            }
            _ => {}
        }
        let there = self.bundle().ok().map(|there| there.manifest().installation().to_owned());
        match there.filter(|node| node != manifest.installation()) {
            Some(node) => Err(ReceiveError::OtherInstallation { bundle: manifest.installation().to_owned(), node }),
            None => Ok(()),
        }
    }

    /// Puts the bundle whole into its place, unless it is there; how many files the source has sent.
    fn complete(&self, staged: &Bundle, source: &mut impl Source) -> Result<usize, ReceiveError> {
        let place = self.bundle_folder(staged.digest());
        let told = |error| ReceiveError::Source { what: "an answer".into(), error };
        if Bundle::open(&place).is_ok_and(|there| is_same_and_whole(&there, staged)) {
            source.want(&[]).map_err(told)?;
            return Ok(0);
        }
        let known = self.known_files()?;
        let mut wanted = Vec::new();
        for (index, file) in staged.manifest().files().iter().enumerate() {
            if staged.difference(file).is_some() {
                let path = file.path.below(staged.folder());
                disk::remove(&path)?;
                let near = known.get(&file.sha256).map(|near| take(near, &path, file)).transpose()?;
                if near != Some(true) {
                    wanted.push(index);
                }
            }
        }
        source.want(&wanted).map_err(told)?;
        for file in wanted.iter().map(|index| &staged.manifest().files()[*index]) {
            let failed = |error| ReceiveError::Source { what: format!("`{}`", file.path), error };
            let mut content = source.file(file).map_err(failed)?;
            if !put(&mut *content, &file.path.below(staged.folder()), file)? {
                return Err(ReceiveError::Content(file.path.clone()));
            }
        }
        self.install(staged, &place)?;
        Ok(wanted.len())
    }

    /// Files of the node's bundles by their digests, as their manifests say.
    fn known_files(&self) -> Result<HashMap<Sha256, PathBuf>, FileError> {
        let mut known = HashMap::new();
        for bundle in disk::entries(&self.path().join(BUNDLES))?.iter().filter_map(|path| Bundle::open(path).ok()) {
            let files = bundle.manifest().files().iter();
            known.extend(files.map(|file| (file.sha256, file.path.below(bundle.folder()))));
        }
        Ok(known)
    }

    /// Moves a bundle from staging to its place: whole, durable, verified from the disk.
    fn install(&self, staged: &Bundle, place: &Path) -> Result<(), ReceiveError> {
        let folder = staged.folder();
        let signature = staged.signature().text();
        for (name, bytes) in [(MANIFEST_FILE, staged.manifest_bytes()), (SIGNATURE_FILE, signature.as_bytes())] {
            disk::remove(&folder.join(name))?;
            disk::write(&mut &*bytes, &folder.join(name), false)?;
        }
        disk::sync_tree(folder)?;
        let differences = staged.differences()?;
        if !differences.is_empty() {
            disk::remove(folder)?;
            return Err(ReceiveError::Disk(differences));
        }
        if fs::symlink_metadata(place).is_err() {
            return Ok(disk::rename(folder, place)?);
        }
        // A damaged bundle, perhaps the current one: at each moment one of both is in the place.
        let exchanged = renameat2(AT_FDCWD, folder, AT_FDCWD, place, RenameFlags::RENAME_EXCHANGE);
        exchanged.map_err(io::Error::from).at("renamed", folder)?;
        [place, folder].into_iter().filter_map(Path::parent).try_for_each(disk::sync_folder)?;
        Ok(disk::remove(folder)?)
    }

    /// Whether another one was current.
    fn make_current(&self, bundle: &Bundle) -> Result<bool, ReceiveError> {
        let lock = self.lock_state(STATE_PATIENCE)?;
        let (mut state, current, digest) = (self.state()?, self.current()?, bundle.digest());
        let is_new = current != Some(digest);
        if is_new {
            state.accept(digest, bundle.manifest().version(), current);
            self.write_state(&state)?;
            self.switch(digest)?;
        }
        let aside = self.set_aside(&state)?;
        drop(lock);
        aside.iter().try_for_each(|bundle| disk::remove(bundle))?;
        Ok(is_new)
    }
}

/// Whether a bundle in its place is all that another one is to be. What a robot has written there stays.
fn is_same_and_whole(there: &Bundle, staged: &Bundle) -> bool {
    there.manifest_bytes() == staged.manifest_bytes()
        && there.signature() == staged.signature()
        && there.differences().is_ok_and(|differences| differences.iter().all(Difference::is_harmless))
}

/// Copies a file of another bundle; false, and nothing is left, if it cannot be read, or is not what its manifest says.
fn take(near: &Path, to: &Path, file: &FileEntry) -> Result<bool, FileError> {
    let Ok(near) = disk::open(near) else { return Ok(false) };
    put(&mut near.take(file.size + 1), to, file).or_else(|_| disk::remove(to).map(|()| false))
}

/// Writes a file; false, and nothing is left, if that was not the content of the manifest.
fn put(content: &mut dyn Read, to: &Path, file: &FileEntry) -> Result<bool, FileError> {
    let is_right = disk::write(content, to, file.executable)? == (file.size, file.sha256);
    if !is_right {
        disk::remove(to)?;
    }
    Ok(is_right)
}
