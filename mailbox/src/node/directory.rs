//! A node's directory in shared memory and what all its processes share: the table of participants.
//!
//! ```text
//! /dev/shm/rohrpost-UID/INSTALLATION.NODE/     mode 0700
//!     node           this page: epochs, participants (their bells, states, process ids)
//!     children       what launch knows of its modules (it writes it, not this crate)
//!     config         where the configuration is that launch runs (launch writes it, not this crate)
//!     time           system time (see `system_time`)
//!     traffic.3      what participant 3 sends (see `traffic`)
//!     routes         which names are on other nodes, and which mailbox leads there (see `routes`)
//!     bell.3         a pipe that wakes participant 3, while it watches descriptors (see `doorbell`)
//!     01c80000.mbx   a mailbox: its name in hexadecimal (see `layout`)
//!     01c80000.about what its owner says of it (see `about`)
//!     01c80000.1.ring  a stream: the name of its writer's mailbox, and its number (see `stream`)
//! ```
//!
//! A participant is one user of mailboxes, mostly a process. It lives as long as it holds the lock on its byte of the
//! file `node`: the kernel drops that lock with the process, whatever killed it.

use crate::memory::files::{Directory, allocate, remove_if_empty};
use crate::memory::layout::{MAGIC, VERSION};
use crate::memory::mapping::{Located, Mapping, Shared, Use};
use crate::name::Name;
use crate::node::entry::{Entry, PARTICIPANTS_MAX, ParticipantInfo};
use crate::node::error::{NodeError, REGISTRY_PATIENCE};
use crate::node::lock::{self, AllHeld, Held};
use crate::slots::word::Claimant;
use crate::step::step;
use crate::wake::doorbell;
use std::fs::File;
use std::io;
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// The file of the page.
const FILE: &str = "node";
/// Lock bytes above the participants': of the process that launched the node, and of the one that changes the registry.
const LAUNCH_BYTE: u64 = 1 << 20;
const REGISTRY_BYTE: u64 = LAUNCH_BYTE + 1;
/// Between two tries: as long as making a mailbox takes, then longer and longer.
const REGISTRY_PAUSE: Duration = Duration::from_micros(50);
const REGISTRY_PAUSE_MAX: Duration = Duration::from_millis(1);

/// The file `node`.
#[repr(C)]
pub(crate) struct NodePage {
    magic: AtomicU64,
    version: AtomicU32,
    /// Raised with every new, every taken over and every gone mailbox, when its file is there or gone.
    pub(crate) registry_epoch: AtomicU32,
    /// Raised whenever somebody's death was noticed: receivers then look for what the dead left.
    pub(crate) deaths: AtomicU32,
    /// The last one that was given out.
    incarnations: AtomicU32,
    launch_pid: AtomicU32,
    padding: [AtomicU32; 9],
    entries: [Entry; PARTICIPANTS_MAX],
}

// SAFETY: made of atomics alone.
unsafe impl Shared for NodePage {}

const _: () = assert!(size_of::<Entry>() == 64 && size_of::<NodePage>() == 64 + PARTICIPANTS_MAX * 64);

/// Where the directories of this user's nodes lie: `$ROHRPOST_DIR`, or else below /dev/shm.
pub fn base_directory() -> PathBuf {
    match std::env::var_os("ROHRPOST_DIR") {
        Some(path) => path.into(),
        None => format!("/dev/shm/rohrpost-{}", nix::unistd::getuid()).into(),
    }
}

/// Removes the directory around this user's nodes if it is empty and our own to choose; one that `$ROHRPOST_DIR` names
/// stays.
pub fn remove_base_if_empty() {
    if std::env::var_os("ROHRPOST_DIR").is_none() {
        remove_if_empty(&base_directory());
    }
}

/// The directory of a node.
pub fn node_directory(installation: &str, node: &str) -> PathBuf {
    base_directory().join(format!("{installation}.{node}"))
}

/// A node's shared memory, opened by this process.
pub struct Node {
    directory: Directory,
    /// Holds no lock, so that it can ask about all.
    file: File,
    /// Device and number of the file, by which it is known again.
    identity: (u64, u64),
    page: Located<NodePage>,
}

impl Node {
    /// Opens a node, making its directory with this mode (0o700 unless configured otherwise) if there is none.
    ///
    /// # Errors
    /// When the directory cannot be made or is not ours to trust.
    pub fn create(path: &Path, mode: u32) -> Result<Arc<Self>, NodeError> {
        let directory = Directory::make(path, mode).map_err(|error| NodeError::of(path, error))?;
        Self::open_file(directory, |directory| directory.open_or_make(FILE))
    }

    /// Opens a node that is there.
    ///
    /// # Errors
    /// [`NodeError::Missing`] when nobody has made it; [`NodeError::Foreign`] when another user has, and
    /// `$ROHRPOST_DIR` does not lead there.
    pub fn open(path: &Path) -> Result<Arc<Self>, NodeError> {
        let directory = Directory::open(path).map_err(|error| NodeError::of_node(path, error))?;
        Self::open_file(directory, |directory| directory.open_file(FILE))
    }

    fn open_file(
        directory: Directory,
        open: impl FnOnce(&Directory) -> io::Result<File>,
    ) -> Result<Arc<Self>, NodeError> {
        let path = directory.path();
        let failed = |error| NodeError::of(path, error);
        let file = open(&directory).map_err(|error| NodeError::of_node(path, error))?;
        // Only its maker needs the registry to itself; another may have made it before this one had the registry.
        let maker = if is_whole(path, &file)? { None } else { Some(RegistryLock::take(&directory)?) };
        let bytes = size_of::<NodePage>();
        if maker.is_some() && !is_whole(path, &file)? && file.metadata().map_err(failed)?.len() < bytes as u64 {
            allocate(&file, bytes).map_err(failed)?;
        }
        let page = Mapping::new(&file, bytes, Use::Share).map_err(failed)?.locate(0);
        let there = file.metadata().map_err(failed)?;
        let node = Self { page, identity: (there.dev(), there.ino()), file, directory };
        if maker.is_some() {
            node.check_in()?;
        }
        Ok(Arc::new(node))
    }

    /// Writes the magic number, unless somebody else just has; under the registry's lock.
    fn check_in(&self) -> Result<(), NodeError> {
        let page = self.page();
        if page.magic.load(Ordering::Acquire) != MAGIC {
            // New, or its maker died on the way. Seconds make a first incarnation that no earlier incarnation of the
            // node has used, if the clock ran on meanwhile.
            let seconds = crate::clock::realtime_ns() / 1_000_000_000;
            page.incarnations.store(seconds as u32, Ordering::Relaxed);
            page.version.store(VERSION, Ordering::Relaxed);
            step!("node: before magic");
            page.magic.store(MAGIC, Ordering::Release);
        }
        // A process of another version may have made it between the look before and the lock.
        match page.version.load(Ordering::Relaxed) {
            VERSION => Ok(()),
            other => Err(NodeError::Version(self.path().into(), other)),
        }
    }

    /// Its directory.
    pub fn path(&self) -> &Path {
        self.directory.path()
    }

    pub(crate) fn directory(&self) -> &Directory {
        &self.directory
    }

    /// Device and number of its file `node`.
    pub(crate) fn identity(&self) -> (u64, u64) {
        self.identity
    }

    pub(crate) fn page(&self) -> &NodePage {
        &self.page
    }

    pub(crate) fn entry(&self, index: u16) -> &Entry {
        &self.page().entries[usize::from(index) % PARTICIPANTS_MAX]
    }

    /// Whether this use of an entry has ended. An answer of false may be late by moments, never an answer of true.
    pub(crate) fn is_dead(&self, claimant: Claimant) -> bool {
        if usize::from(claimant.participant) >= PARTICIPANTS_MAX {
            return true;
        }
        let same = || self.entry(claimant.participant).incarnation.load(Ordering::Acquire) == claimant.incarnation;
        // A lock that cannot be asked about counts as held: taking a slot from the living is the worse mistake.
        !same() || !lock::is_locked(&self.file, u64::from(claimant.participant)).unwrap_or(true)
    }

    /// A number that is later than all that this node gave out before; they count upwards, wrap, and are never 0.
    /// Participants have one each, from when they joined. That says nothing of the order in which they then have a
    /// name, so an owner that must be told from earlier owners of a name asks for one of its own, once the name's
    /// mailbox is its own.
    pub fn next_incarnation(&self) -> u32 {
        self.page().incarnations.fetch_add(1, Ordering::AcqRel).wrapping_add(1).max(1)
    }

    /// The last number that was given out.
    pub fn last_incarnation(&self) -> u32 {
        self.page().incarnations.load(Ordering::Acquire)
    }

    /// From now on gives out only numbers after this one, of another node: a module that moves between them then has
    /// later numbers than it had there. One that this node has passed already changes nothing.
    pub fn pass_incarnation(&self, number: u32) {
        let pass = |last: u32| (number.wrapping_sub(last).cast_signed() > 0).then_some(number);
        let _ = self.page().incarnations.fetch_update(Ordering::AcqRel, Ordering::Acquire, pass);
    }

    /// Tells all receivers that somebody died, so that they look for what was left. Sleeping needs no timeout because a
    /// process that sees another end (launch, above all) calls this.
    pub fn announce_death(&self) {
        self.page().deaths.fetch_add(1, Ordering::AcqRel);
        doorbell::ring_all(self);
    }

    /// Changes with every new, taken over and gone mailbox. One that was not there when the number, read *before*
    /// looking, was this is still not there while it is the same: one load, and no system call.
    pub fn registry_epoch(&self) -> u32 {
        // ORDERING: Acquire; a reader that sees the number raised finds the file. Pairs with the raise after it was
        // renamed or unlinked.
        self.page().registry_epoch.load(Ordering::Acquire)
    }

    pub(crate) fn raise_registry_epoch(&self) {
        self.page().registry_epoch.fetch_add(1, Ordering::AcqRel);
    }

    /// All participants alive, but for those that are joining or leaving just now.
    pub fn participants(&self) -> Vec<ParticipantInfo> {
        self.living().map(|(_, participant)| participant).collect()
    }

    /// The same, with their places in the table.
    pub(crate) fn living(&self) -> impl Iterator<Item = (Claimant, ParticipantInfo)> + '_ {
        // A participant that joins or leaves just now has no process id here; as a number to signal, 0 would be our own
        // group. Asked first, and once more with the lock seen held: the lock is a system call, most places are empty.
        let used = |index: &u16| self.entry(*index).pid.load(Ordering::Relaxed) != 0;
        let alive = |index: &u16| lock::is_locked(&self.file, u64::from(*index)).unwrap_or(false);
        let all = (0..PARTICIPANTS_MAX as u16).filter(used).filter(alive);
        let here = all.map(|index| (index, self.entry(index).read())).filter(|(_, participant)| participant.pid != 0);
        here.map(|(index, found)| (Claimant { participant: index, incarnation: found.incarnation }, found))
    }

    /// The last that this process said of what it does as this module, also if it has died since; none when it has left
    /// in order, or another has taken its place in the table.
    pub fn last_word_of(&self, module: Name, pid: u32) -> Option<ParticipantInfo> {
        // An earlier process may have had the number; perhaps before the computer, and its clock, began anew.
        let its = self.page().entries.iter().map(Entry::read).filter(|p| p.module == module && p.pid == pid);
        its.reduce(|last, next| if next.joined_after(last.incarnation) { next } else { last })
    }

    /// Process id of the launch that runs this node now.
    pub fn launcher(&self) -> Option<u32> {
        let held = lock::is_locked(&self.file, LAUNCH_BYTE).unwrap_or(false);
        held.then(|| self.page().launch_pid.load(Ordering::Acquire))
    }

    /// Makes this process the node's launch, for as long as the result lives.
    ///
    /// # Errors
    /// [`NodeError::Launched`] names the process that is it already.
    pub fn launch_lock(self: &Arc<Self>) -> Result<LaunchLock, NodeError> {
        let failed = |error| NodeError::of(self.path(), error);
        let file = open_once_more(&self.directory)?;
        let Some(held) = Held::try_take(file, LAUNCH_BYTE).map_err(failed)? else {
            return Err(NodeError::Launched(self.path().into(), self.page().launch_pid.load(Ordering::Acquire)));
        };
        self.check_present(&held.file)?;
        self.page().launch_pid.store(std::process::id(), Ordering::Release);
        Ok(LaunchLock { _held: held })
    }

    /// Whether `file`, just opened by its name, is the one that this node has mapped: the directory may have been
    /// removed. Asked when its lock is held; until then somebody may be removing it.
    pub(crate) fn check_present(&self, file: &File) -> Result<(), NodeError> {
        let failed = |error| NodeError::of(self.path(), error);
        let there = file.metadata().map_err(failed)?;
        let present = (there.dev(), there.ino()) == self.identity && there.nlink() > 0;
        if present { Ok(()) } else { Err(NodeError::Missing(self.path().into())) }
    }

    /// Takes the launch's place and every participant's; none when somebody has one of them. So nobody can join or
    /// launch until the result is dropped.
    pub(crate) fn keep_all_out(&self) -> Result<Option<AllHeld>, NodeError> {
        let failed = |error| NodeError::of(self.path(), error);
        let held = AllHeld(open_once_more(&self.directory)?);
        // The launch's first: on a node that runs nothing else is taken, not even for a moment in which somebody wants
        // to join.
        for byte in std::iter::once(LAUNCH_BYTE).chain(0..PARTICIPANTS_MAX as u64) {
            if !lock::try_lock(&held.0, byte).map_err(failed)? {
                return Ok(None);
            }
        }
        Ok(Some(held))
    }
}

/// Held by the launch of a node.
pub struct LaunchLock {
    _held: Held,
}

/// Held while mailboxes are made, adopted, replaced or removed. Dropped by the kernel with its holder.
pub(crate) struct RegistryLock {
    file: File,
}

impl RegistryLock {
    pub(crate) fn take(directory: &Directory) -> Result<Self, NodeError> {
        Self::take_within(directory, REGISTRY_PATIENCE)
    }

    /// The same, with less patience; with none it is tried once.
    pub(crate) fn take_within(directory: &Directory, patience: Duration) -> Result<Self, NodeError> {
        let failed = |error| NodeError::of(directory.path(), error);
        let file = open_once_more(directory)?;
        let start = Instant::now();
        let mut pause = REGISTRY_PAUSE;
        while !lock::try_lock(&file, REGISTRY_BYTE).map_err(failed)? {
            if patience.is_zero() || start.elapsed() > patience {
                return Err(NodeError::Busy(directory.path().into()));
            }
            std::thread::sleep(pause);
            pause = (pause * 2).min(REGISTRY_PAUSE_MAX);
        }
        Ok(Self { file })
    }
}

impl Drop for RegistryLock {
    fn drop(&mut self) {
        let _ = lock::unlock(&self.file, REGISTRY_BYTE);
    }
}

/// Opens the file `node` again, to lock a byte of it.
pub(crate) fn open_once_more(directory: &Directory) -> Result<File, NodeError> {
    directory.open_file(FILE).map_err(|error| NodeError::of_node(directory.path(), error))
}

/// Whether a node's file is finished; false when it was just begun, or its maker died. Every version begins its files
/// with the magic number, which is written last, and its version.
fn is_whole(path: &Path, file: &File) -> Result<bool, NodeError> {
    let failed = |error| NodeError::of(path, error);
    let (there, mut magic, mut version) = (file.metadata().map_err(failed)?, [0; 8], [0; 4]);
    match there.len() {
        0 => return Ok(false),
        12.. => {}
        _ => return Err(NodeError::Damaged(path.into())),
    }
    file.read_exact_at(&mut magic, 0).map_err(failed)?;
    file.read_exact_at(&mut version, 8).map_err(failed)?;
    match (u64::from_ne_bytes(magic), u32::from_ne_bytes(version)) {
        (0, _) => Ok(false),
        (MAGIC, VERSION) if there.len() >= size_of::<NodePage>() as u64 => Ok(true),
        (MAGIC, other) if other != VERSION => Err(NodeError::Version(path.into(), other)),
        _ => Err(NodeError::Damaged(path.into())),
    }
}
