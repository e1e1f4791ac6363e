//! What is read of a computer: files below a root directory, and the few facts that no file holds.

use super::lan::LanView;
use super::protection::Protection;
use rohrpost::interfaces::ControlState;
use rohrpost_config::{FIFO_MAX, Installation, Module, Node as NodeConfig, Program, Scheduling, find_program};
use rohrpost_launch::survey::Standing;
use rohrpost_mailbox::sys::{self, Room};
use rohrpost_mailbox::{Node, NodeError, SystemClock, base_directory, monotonic_ns, realtime_ns, saturating_sum};
use std::path::{Path, PathBuf};

const BRIDGE: &str = "rohrpost-gui-bridge";

/// What a configuration needs; without one, what any configuration may need.
pub(super) struct Needs {
    /// Highest SCHED_FIFO priority that is requested.
    pub(super) priority: u8,
    /// Bytes of mailboxes and of the streams that the configuration names.
    pub(super) memory: u64,
    pub(super) gui: bool,
    /// The viewer's bridge, if the configuration has it.
    pub(super) bridge: Option<PathBuf>,
    pub(super) processes: usize,
    /// What supervises motors there.
    pub(super) supervisors: Vec<Supervisor>,
    /// Modules with several nodes, of which it is one.
    pub(super) seats: Vec<Seat>,
    /// The configuration's file.
    pub(super) from: Option<PathBuf>,
}

impl Default for Needs {
    fn default() -> Self {
        Self {
            priority: FIFO_MAX,
            memory: 0,
            gui: false,
            bridge: None,
            processes: 1,
            supervisors: Vec::new(),
            seats: Vec::new(),
            from: None,
        }
    }
}

impl Needs {
    pub(super) fn of(installation: &Installation, node: &NodeConfig) -> Self {
        let modules = || installation.modules_on(&node.name);
        let priority = |module: &Module| match installation.scheduling(module.name.class()) {
            Scheduling::Fifo { priority } => priority,
            Scheduling::Normal { .. } => 0,
        };
        Self {
            priority: modules().map(priority).max().unwrap_or(0),
            memory: installation.memory_on(&node.name),
            gui: !installation.gui.show.is_empty(),
            bridge: modules().find_map(|module| bridge_of(installation, module)),
            processes: modules().count(),
            supervisors: Vec::new(),
            seats: Vec::new(),
            from: Some(installation.path.clone()),
        }
    }
}

/// A wormhole of the configuration, on this node.
pub(super) struct Supervisor {
    pub(super) module: String,
    /// Priority under SCHED_FIFO; none: the normal scheduler.
    pub(super) fifo: Option<u8>,
    /// What it says, or why it does not; none while its node does not run.
    pub(super) says: Option<Result<ControlState, String>>,
}

/// A module with several nodes, as one of them sees it.
pub(super) struct Seat {
    pub(super) module: String,
    /// The node that sees it.
    pub(super) node: String,
    /// The node that grants its lease.
    pub(super) witness: String,
    /// The node that is known to hold its lease.
    pub(super) holder: Option<String>,
    /// How it stands at `node`, and its last error; none while that does not run.
    pub(super) here: Option<(Standing, String)>,
}

/// The path of a module's program, if that is the bridge.
fn bridge_of(installation: &Installation, module: &Module) -> Option<PathBuf> {
    let Program::Command(words) = &module.program else { return None };
    let program = words.first().filter(|program| is_bridge(Path::new(program)))?;
    find_program(program, &installation.folder, &beside())
}

/// The folder of this program.
fn beside() -> PathBuf {
    std::env::current_exe().ok().and_then(|path| Some(path.parent()?.to_owned())).unwrap_or_default()
}

/// A computer.
pub(super) struct Machine {
    root: PathBuf,
    pub(super) asked: KernelFacts,
}

/// Facts that no file holds.
pub(super) struct KernelFacts {
    /// Whether a thread got the required scheduling, or why not.
    pub(super) fifo: Result<(), String>,
    /// The directory of all nodes.
    pub(super) base: PathBuf,
    /// Free and total space of its file system.
    pub(super) room: Option<Room>,
    pub(super) nodes: Vec<NodeFound>,
    pub(super) bridge: Option<Bridge>,
    pub(super) viewer: Option<PathBuf>,
    /// The network of a configuration with several nodes.
    pub(super) lan: Option<LanView>,
    pub(super) protection: Protection,
    /// The computer's clock, ns since 1970.
    pub(super) wall_ns: u64,
}

/// The program that draws.
pub(super) struct Bridge {
    pub(super) path: PathBuf,
    /// Its process, if one of this user's nodes runs it.
    pub(super) pid: Option<u32>,
}

pub(super) struct NodeFound {
    pub(super) path: PathBuf,
    pub(super) seen: NodeDirectory,
    pub(super) streams: StreamsFound,
    /// How far the computer's clock was set away from its system time, ns.
    pub(super) clock_set_by_ns: Option<i64>,
}

#[derive(Default)]
pub(super) struct StreamsFound {
    pub(super) number: usize,
    /// Memory that they take.
    pub(super) bytes: u64,
}

pub(super) enum NodeDirectory {
    /// A launch with this process id runs it.
    Launched(u32),
    /// Processes run in it without a launch.
    InUse,
    /// No process uses it.
    Dead,
    /// It was created by a program with another layout version.
    OtherVersion(u32),
    /// Another user made it.
    Foreign(String),
    /// It cannot be read.
    Unreadable(String),
}

impl Machine {
    /// This computer.
    pub(super) fn this(needs: &Needs, lan: Option<LanView>, protection: Protection) -> Self {
        let base = base_directory();
        let program = |name| find_program(name, Path::new("."), &beside());
        let asked = KernelFacts {
            fifo: try_fifo(needs.priority),
            room: room_of_nodes(&base),
            nodes: nodes(&base),
            bridge: bridge(&base, needs.bridge.clone().or_else(|| program(BRIDGE))),
            viewer: program("rerun"),
            lan,
            protection,
            wall_ns: realtime_ns(),
            base,
        };
        Self { root: "/".into(), asked }
    }

    /// A recorded computer.
    #[cfg(test)]
    pub(super) fn at(root: &Path, asked: KernelFacts) -> Self {
        Self { root: root.into(), asked }
    }

    /// A file's content, without surrounding white space.
    pub(super) fn read(&self, path: &str) -> Option<String> {
        let text = std::fs::read_to_string(self.root.join(path.trim_start_matches('/'))).ok()?;
        Some(text.trim().to_owned())
    }

    pub(super) fn folder(&self, path: &str) -> PathBuf {
        self.root.join(path.trim_start_matches('/'))
    }

    pub(super) fn number(&self, path: &str) -> Option<u64> {
        self.read(path)?.parse().ok()
    }

    pub(super) fn exists(&self, path: &str) -> bool {
        self.root.join(path.trim_start_matches('/')).exists()
    }

    /// Names in a folder that consist of this prefix and a number, sorted by the number.
    pub(super) fn numbered(&self, folder: &str, begin: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.root.join(folder.trim_start_matches('/'))).into_iter().flatten();
        let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
        let number = |name: &String| name.strip_prefix(begin).and_then(|rest| rest.parse::<u32>().ok());
        let mut names: Vec<String> = names.filter(|name| number(name).is_some()).collect();
        names.sort_by_key(number);
        names
    }

    /// A value from a file with lines `key: value`.
    pub(super) fn field(&self, path: &str, key: &str) -> Option<String> {
        let text = self.read(path)?;
        text.lines().find_map(|line| Some(line.strip_prefix(key)?.strip_prefix(':')?.trim().to_owned()))
    }

    /// A soft limit of this process; none where it is unlimited.
    pub(super) fn limit(&self, name: &str) -> Option<Limit> {
        let text = self.read("/proc/self/limits")?;
        let soft =
            text.lines().find_map(|line| line.strip_prefix(name)?.split_whitespace().next().map(str::to_owned))?;
        Some(soft.parse().map_or(Limit::None, Limit::Of))
    }
}

/// Room of the file system of all nodes. The first launch creates their directory; until then its future place counts.
pub(crate) fn room_of_nodes(base: &Path) -> Option<Room> {
    let there = base.ancestors().find(|path| path.exists()).unwrap_or(Path::new("/"));
    sys::room(there).ok()
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Limit {
    None,
    Of(u64),
}

/// Tries it for a moment in a separate thread: only the kernel knows the sum of limits, capabilities and control
/// groups.
fn try_fifo(priority: u8) -> Result<(), String> {
    if priority == 0 {
        return Ok(());
    }
    let tried = std::thread::spawn(move || sys::schedule(sys::Scheduling::Fifo(priority))).join();
    tried.map_err(|_| String::from("the thread that tried has panicked"))?.map_err(|error| error.to_string())
}

fn nodes(base: &Path) -> Vec<NodeFound> {
    let found = |path: PathBuf| NodeFound {
        seen: seen(&path),
        streams: streams(&path),
        clock_set_by_ns: clock_set_by_ns(&path),
        path,
    };
    directories(base).into_iter().map(found).collect()
}

/// None of a node that cannot be read.
fn clock_set_by_ns(path: &Path) -> Option<i64> {
    let node = Node::open(path).ok()?;
    SystemClock::open(&node).record()?.clock_set_by(monotonic_ns(), realtime_ns())
}

/// Without those that cannot be read.
fn streams(path: &Path) -> StreamsFound {
    let Ok(node) = Node::open(path) else { return StreamsFound::default() };
    let all = node.streams().unwrap_or_default().into_iter();
    let sizes: Vec<u64> =
        all.filter_map(|id| Some(node.inspect_stream(id).ok()??.shape.segment_bytes() as u64)).collect();
    StreamsFound { number: sizes.len(), bytes: saturating_sum(sizes) }
}

fn directories(base: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(base).into_iter().flatten();
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    paths
}

/// The running bridge; else the one that would be started.
fn bridge(base: &Path, found: Option<PathBuf>) -> Option<Bridge> {
    let pids = directories(base).into_iter().filter_map(|path| Node::open(&path).ok());
    let pids = pids.flat_map(|node| node.participants()).map(|participant| participant.pid).filter(|pid| *pid != 0);
    let running = pids.filter_map(|pid| Some((std::fs::read_link(format!("/proc/{pid}/exe")).ok()?, pid)));
    // The launch that started it may have a different PATH from this program's.
    let running = running.map(|(path, pid)| Bridge { path, pid: Some(pid) }).find(|bridge| is_bridge(&bridge.path));
    running.or_else(|| found.map(|path| Bridge { path, pid: None }))
}

fn is_bridge(program: &Path) -> bool {
    // The kernel marks a program that was replaced since it started.
    program.file_name().and_then(|name| name.to_str()).is_some_and(|name| name.trim_end_matches(" (deleted)") == BRIDGE)
}

fn seen(path: &Path) -> NodeDirectory {
    match Node::open(path) {
        Ok(node) => match node.launcher() {
            Some(pid) => NodeDirectory::Launched(pid),
            None if node.participants().is_empty() => NodeDirectory::Dead,
            None => NodeDirectory::InUse,
        },
        Err(NodeError::Version(_, version)) => NodeDirectory::OtherVersion(version),
        Err(error @ NodeError::Foreign(..)) => NodeDirectory::Foreign(error.to_string()),
        Err(error) => NodeDirectory::Unreadable(error.to_string()),
    }
}
