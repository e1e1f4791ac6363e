//! The folder of a node: which bundle is current, and the way back.

use crate::bundle::{Bundle, Difference, MANIFEST_FILE, OpenError};
use crate::digest::Sha256;
use crate::disk::{self, At, FileError};
use crate::key::{KeyError, Trusted};
use crate::path::spellings;
use crate::state::{Kept, STATE_BYTES_MAX, State, StateError, TrialState};
use serde::{Deserialize, Serialize};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Folder of whole bundles in a node's folder.
pub(crate) const BUNDLES: &str = "bundles";
const STAGING: &str = "staging";
const CURRENT: &str = "current";
const STATE: &str = "state.toml";
const PUSH_LOCK: &str = "push.lock";
const STATE_LOCK: &str = "state.lock";
const LAUNCH_LOCK: &str = "launch.lock";
/// Others hold the lock of the state for moments; a command waits for it so long.
pub(crate) const STATE_PATIENCE: Duration = Duration::from_secs(5);
/// Digits of a digest.
const NAME_BYTES: usize = 64;
/// How often a lock is tried while a command waits for it.
const LOCK_LOOK: Duration = Duration::from_millis(10);

/// The folder of a node, such as `/var/lib/rohrpost`.
#[derive(Clone, Debug)]
pub struct NodeFolder {
    root: PathBuf,
}

/// Why a node's folder cannot be read or changed.
#[derive(Debug, thiserror::Error)]
pub enum NodeFolderError {
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
    /// A bundle in it.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// A key.
    #[error(transparent)]
    Key(#[from] KeyError),
    /// What the node remembers.
    #[error("{}: {error}", path.display())]
    State {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: StateError,
    },
    /// The link to the current bundle.
    #[error("{}: no link to a bundle, such as `bundles/…`; remove it, and push a bundle", .0.display())]
    Current(PathBuf),
    /// There is no bundle.
    #[error("{}: no bundle there; `rohrpost bundle push BUNDLE --to {}` brings one", .0.display(), .0.display())]
    Empty(PathBuf),
    /// Another push.
    #[error("{}: another push is under way there; wait for its end", .0.display())]
    Pushing(PathBuf),
    /// Another command holds the state for long.
    #[error("{}: another command changes something there; try again when it has ended", .0.display())]
    Busy(PathBuf),
    /// Another launch.
    #[error(
        "{}: a launch runs from this folder already; another node on this computer needs a folder of its own",
        .0.display()
    )]
    Launched(PathBuf),
    /// There is no older bundle.
    #[error("there is no bundle before version {0} on this node")]
    NothingBefore(u64),
    /// The bundle to go back to is damaged.
    #[error("version {version} is not as its manifest says, and stays unused:{}", lines(differences))]
    Damaged {
        /// Version of the bundle.
        version: u64,
        /// Files that differ.
        differences: Vec<Difference>,
    },
}

/// Each on a line of its own.
pub(crate) fn lines(differences: &[Difference]) -> String {
    differences.iter().map(|difference| format!("\n  {difference}")).collect()
}

/// What `rohrpost bundle check` says of a node. Programs read it as JSON.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NodeReport {
    /// Name of the installation.
    pub installation: String,
    /// Version of the current bundle.
    pub version: u64,
    /// Digest of the current bundle.
    pub bundle: String,
    /// How far its trial is: "due", "running", "passed", "failed".
    pub trial: String,
    /// Versions of the bundles before, the newest first.
    pub before: Vec<u64>,
    /// Signature and files that are not right; empty if all are.
    pub problems: Vec<String>,
}

impl NodeFolder {
    /// A node's folder, whether or not it is there yet.
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    /// The node's folder and the bundle in it that a file lies in, and the path of the file there; `None` if it lies in
    /// no bundle. Links to the bundle are followed. Links in it are not: a bundle has none.
    ///
    /// # Errors
    /// A bundle that cannot be read, or of which the name is not the digest of its manifest.
    pub fn containing(file: &Path) -> Result<Option<(Self, Bundle, PathBuf)>, OpenError> {
        let is_bundle = |folder: &&Path| {
            let parent = folder.parent().and_then(Path::file_name);
            named(folder).is_some() && parent.is_some_and(|name| name == BUNDLES)
        };
        for file in spellings(file) {
            let Some(folder) = file.ancestors().find(is_bundle) else { continue };
            let Some(root) = folder.parent().and_then(Path::parent) else { continue };
            // Where bundles are made is no node: nothing is launched by its manifest there.
            if root.join(CURRENT).is_symlink() {
                let bundle = open_named(&folder.canonicalize().at("read", folder)?)?;
                let file = bundle.folder().join(file.strip_prefix(folder).unwrap_or(&file));
                return Ok(Some((Self::new(root), bundle, file)));
            }
        }
        Ok(None)
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.root
    }

    /// Public keys that the node trusts.
    ///
    /// # Errors
    /// As [`Trusted::load`].
    pub fn trusted(&self) -> Result<Trusted, KeyError> {
        Trusted::load(&self.root.join("trusted"))
    }

    /// The current bundle.
    ///
    /// # Errors
    /// [`NodeFolderError::Empty`] without one, or when it cannot be read.
    pub fn bundle(&self) -> Result<Bundle, NodeFolderError> {
        let current = self.current()?.ok_or_else(|| NodeFolderError::Empty(self.root.clone()))?;
        Ok(Bundle::open(&self.bundle_folder(current))?)
    }

    /// The configuration of the current bundle.
    ///
    /// # Errors
    /// As for [`bundle`](Self::bundle).
    pub fn configuration(&self) -> Result<PathBuf, NodeFolderError> {
        Ok(self.bundle()?.manifest().configuration().below(&self.root.join(CURRENT)))
    }

    /// Reads all files of the current bundle.
    ///
    /// # Errors
    /// As for [`bundle`](Self::bundle).
    pub fn report(&self) -> Result<NodeReport, NodeFolderError> {
        let (bundle, state) = (self.bundle()?, self.state()?);
        let (manifest, digest) = (bundle.manifest(), bundle.digest());
        let mut problems: Vec<String> = Vec::new();
        if self.current()? != Some(digest) {
            problems.push("manifest.toml was changed: its digest is not the name of the bundle".into());
        }
        problems.extend(bundle.verify_signature(&self.trusted()?).err().map(|error| error.to_string()));
        problems.extend(bundle.differences()?.iter().map(ToString::to_string));
        Ok(NodeReport {
            installation: manifest.installation().to_owned(),
            version: manifest.version(),
            bundle: digest.to_string(),
            trial: state.of(digest).map_or(TrialState::Due, |kept| kept.trial).name().to_owned(),
            before: state.behind(digest).map(|kept| kept.version).collect(),
            problems,
        })
    }

    /// Makes the bundle before the current one current; returns both versions. That bundle is verified first.
    ///
    /// # Errors
    /// [`NodeFolderError::NothingBefore`], [`NodeFolderError::Damaged`], and what the disk says.
    pub fn back(&self) -> Result<(u64, u64), NodeFolderError> {
        let current = self.bundle()?;
        let (digest, version) = (current.digest(), current.manifest().version());
        let before = self.state()?.behind(digest).next().ok_or(NodeFolderError::NothingBefore(version))?;
        self.verify(before)?;
        let _lock = self.lock_state(STATE_PATIENCE)?;
        // That took its time.
        if self.current()? != Some(digest) {
            return Err(NodeFolderError::Busy(self.root.clone()));
        }
        self.switch(before.bundle)?;
        Ok((version, before.version))
    }

    /// The nearest bundle behind another that is trusted and whole. Reads all its files.
    pub(crate) fn whole_behind(&self, bundle: Sha256) -> Result<Option<Kept>, NodeFolderError> {
        Ok(self.state()?.behind(bundle).find(|kept| self.verify(*kept).is_ok()))
    }

    /// Whether a bundle is trusted and whole.
    fn verify(&self, Kept { bundle, version, .. }: Kept) -> Result<(), NodeFolderError> {
        let bundle = open_named(&self.bundle_folder(bundle))?;
        bundle.verify_signature(&self.trusted()?)?;
        let mut differences = bundle.differences()?;
        differences.retain(|difference| !difference.is_harmless());
        if differences.is_empty() { Ok(()) } else { Err(NodeFolderError::Damaged { version, differences }) }
    }

    /// Name of the current bundle, if there is one.
    pub(crate) fn current(&self) -> Result<Option<Sha256>, NodeFolderError> {
        let path = self.root.join(CURRENT);
        let target = match fs::read_link(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(error) if error.kind() == ErrorKind::InvalidInput => return Err(NodeFolderError::Current(path)),
            read => read.at("read", &path)?,
        };
        let name = target.to_str().and_then(|target| target.strip_prefix(BUNDLES)?.strip_prefix('/'));
        name.and_then(Sha256::parse).map(Some).ok_or(NodeFolderError::Current(path))
    }

    /// The one step that changes what the node runs. Holds the lock of the state.
    pub(crate) fn switch(&self, to: Sha256) -> Result<(), FileError> {
        disk::link(&format!("{BUNDLES}/{to}"), &self.root.join(CURRENT))
    }

    pub(crate) fn state(&self) -> Result<State, NodeFolderError> {
        let path = self.root.join(STATE);
        let bytes = match disk::read(&path, STATE_BYTES_MAX) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(State::default()),
            read => read.at("read", &path)?,
        };
        State::parse(&bytes).map_err(|error| NodeFolderError::State { path, error })
    }

    /// Holds the lock of the state.
    pub(crate) fn write_state(&self, state: &State) -> Result<(), FileError> {
        disk::replace(&self.root.join(STATE), state.text().as_bytes())
    }

    pub(crate) fn bundle_folder(&self, bundle: Sha256) -> PathBuf {
        self.root.join(BUNDLES).join(bundle.to_string())
    }

    pub(crate) fn staging(&self) -> PathBuf {
        self.root.join(STAGING)
    }

    /// One push at a time: held until the end of it.
    pub(crate) fn lock_push(&self) -> Result<File, NodeFolderError> {
        let (file, path) = self.lock_file(PUSH_LOCK)?;
        match file.try_lock() {
            Ok(()) => Ok(file),
            Err(TryLockError::WouldBlock) => Err(NodeFolderError::Pushing(self.root.clone())),
            Err(TryLockError::Error(error)) => Err(error).at("locked", &path).map_err(NodeFolderError::from),
        }
    }

    /// Held for moments.
    pub(crate) fn lock_state(&self, patience: Duration) -> Result<File, NodeFolderError> {
        let until = Instant::now() + patience;
        let (file, path) = self.lock_file(STATE_LOCK)?;
        loop {
            match file.try_lock() {
                Ok(()) => return Ok(file),
                Err(TryLockError::WouldBlock) if Instant::now() < until => std::thread::sleep(LOCK_LOOK),
                Err(TryLockError::WouldBlock) => return Err(NodeFolderError::Busy(self.root.clone())),
                Err(TryLockError::Error(error)) => {
                    return Err(error).at("locked", &path).map_err(NodeFolderError::from);
                }
            }
        }
    }

    /// A launch of this bundle runs as long as the file is open: no other one begins, and the bundle stays. Holds the
    /// lock of the state.
    pub(crate) fn lock_launch(&self, bundle: Sha256) -> Result<File, NodeFolderError> {
        let (mut file, path) = self.lock_file(LAUNCH_LOCK)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(NodeFolderError::Launched(self.root.clone())),
            Err(TryLockError::Error(error)) => return Err(error).at("locked", &path).map_err(NodeFolderError::from),
        }
        // On a full disk a robot starts, too. Then its bundle is not known, and all stay.
        let _ = file.set_len(0).and_then(|()| file.write_all(bundle.to_string().as_bytes()));
        Ok(file)
    }

    fn lock_file(&self, name: &str) -> Result<(File, PathBuf), FileError> {
        let path = self.root.join(name);
        // Each user that may open it could hold it.
        let file = OpenOptions::new().create(true).truncate(false).read(true).write(true).mode(0o600).open(&path);
        Ok((file.at("opened", &path)?, path))
    }

    /// Renames bundles out of their places that are neither remembered nor run: no part of a bundle is ever in such a
    /// place. Holds the locks of push and state. What it returns is to be removed when that of the state is free.
    pub(crate) fn set_aside(&self, state: &State) -> Result<Vec<PathBuf>, NodeFolderError> {
        let needed: Vec<Sha256> = state.order().iter().map(|kept| kept.bundle).chain(self.current()?).collect();
        let (launch, path) = self.lock_file(LAUNCH_LOCK)?;
        let is_launched = launch.try_lock().is_err();
        let name = disk::read(&path, NAME_BYTES).ok().and_then(|name| String::from_utf8(name).ok());
        let launched = name.and_then(|name| Sha256::parse(&name));
        let is_needed =
            |bundle: &Sha256| needed.contains(bundle) || is_launched && launched.is_none_or(|name| name == *bundle);
        let mut aside = Vec::new();
        for path in disk::entries(&self.root.join(BUNDLES))? {
            if let Some(bundle) = named(&path).filter(|bundle| !is_needed(bundle)) {
                let place = self.staging().join(bundle.to_string());
                disk::rename(&path, &place)?;
                aside.push(place);
            }
        }
        Ok(aside)
    }
}

/// Opens a bundle that a node has: its folder has the digest of the manifest as its name.
fn open_named(folder: &Path) -> Result<Bundle, OpenError> {
    let bundle = Bundle::open(folder)?;
    if named(folder) != Some(bundle.digest()) {
        let error = std::io::Error::other("its digest is not the name of the folder: it was changed");
        return Err(FileError { path: folder.join(MANIFEST_FILE), doing: "trusted", error }.into());
    }
    Ok(bundle)
}

/// The digest that is the name of a folder.
fn named(folder: &Path) -> Option<Sha256> {
    folder.file_name().and_then(|name| Sha256::parse(name.to_str()?))
}
