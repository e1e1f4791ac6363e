//! A place of its own for each test: shared memory, files, processes. Everything is removed when the place is dropped.

use crate::probe::ProbingInterface;
use crate::process::{Running, Said};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rohrpost::serde::Serialize;
use rohrpost::wire::append;
use rohrpost::{Name, ToolLink};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Node, NodeError, ParticipantInfo, local, node_directory};
use rohrpost_modules::runtime::ClientError;
use rohrpost_routers::lab::{Lab, LabError, NodeSpec};
use rohrpost_testbed::report::skipped;
use std::fmt::Debug;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// The command under test.
const ROHRPOST: &str = env!("CARGO_BIN_EXE_rohrpost");
/// Limit of all waits, long enough for a busy computer.
pub(crate) const PATIENCE: Duration = Duration::from_secs(60);

/// Head of all configurations: no real-time scheduling, so that tests run beside each other.
const HEAD: &str = r#"
[system]
name = "robot"
id = 1
[classes]
router = { id = 250 }
probe = { id = 96 }
output = { id = 32, text = "Collects what modules say" }
tool = { id = 16 }
[scheduling]
real-time-from = 256
"#;

/// Waits until there is a value, and fails with the name of what was awaited.
pub(crate) fn wait<T>(what: impl Debug, mut look: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(start.elapsed() < PATIENCE, "waited {PATIENCE:?} in vain: {what:?}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The `--timeout` of commands on a busy computer, longer than the usual second; unless a test sets its own.
pub(crate) fn patient<'a>(arguments: &[&'a str]) -> Vec<&'a str> {
    const PATIENT: [&str; 2] = ["--timeout", "20"];
    let is_said = arguments.iter().any(|word| word.starts_with("--timeout"));
    match arguments {
        ["call" | "ping" | "send" | "status", ..] if !is_said => [&arguments[..1], &PATIENT, &arguments[1..]].concat(),
        ["param", _, ..] if !is_said => [&arguments[..2], &PATIENT, &arguments[2..]].concat(),
        _ => arguments.to_vec(),
    }
}

/// Whether a test was skipped for lack of network namespaces.
#[track_caller]
pub(crate) fn lacks_namespaces(said: &str) -> bool {
    let lacks = said.contains("network namespaces cannot be made here");
    if lacks {
        skipped(said);
    }
    lacks
}

/// A network of nodes with these addresses. None, with a report of what is skipped, where namespaces are not permitted.
#[track_caller]
pub(crate) fn lab<'a>(nodes: impl IntoIterator<Item = (&'a str, &'a str)>, what: &str) -> Option<Lab> {
    let spec = |(name, address): (&str, &str)| NodeSpec { name: name.into(), address: address.parse().unwrap() };
    match Lab::new(&nodes.into_iter().map(spec).collect::<Vec<_>>(), 1500) {
        Ok(lab) => Some(lab),
        Err(LabError::NotAllowed(error)) => {
            skipped(&format!("{what} (network namespaces: {error})"));
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// What a configuration says as a module's program: a test of this binary, by its path, that is none when it is run as
/// one. On one processor alone its name would stand before the first line that it prints, if it had one thread.
pub(crate) fn program(test: &str) -> String {
    let me = std::env::current_exe().unwrap();
    format!("[{me:?}, \"--exact\", {test:?}, \"--nocapture\", \"--test-threads\", \"2\"]")
}

/// A table's line in a configuration: a probe with these settings and other keys.
pub(crate) fn probe(name: &str, settings: &str, keys: &str) -> String {
    let program = program("probe::module");
    format!(
        "[[module]]\nname = \"{name}\"\nprogram = {program}\nsettings = {{ record = \"record\", {settings} }}\n{keys}\n"
    )
}

/// Classes of modules that are recorded and replayed, for configurations that have such.
pub(crate) const RECORDED_CLASSES: &str = "
[classes.motor]
id = 200
[classes.odometry]
id = 160
[classes.laser]
id = 150
[classes.pilot]
id = 140
[classes.seer]
id = 110
[classes.feeder]
id = 100
[classes.mapper]
id = 95
[classes.logd]
id = 24
";

/// A simulated robot with streams, one of them of pictures; first of a configuration, since classes are before modules.
pub(crate) fn simulated() -> String {
    let map = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/building.map");
    format!(
        "{RECORDED_CLASSES}[classes.camera]\nid = 112\n[[module]]\nname = \"motor.0\"\nbuiltin = \"sim\"\n\
         aliases = [\"odometry.0\", \"laser.0\", \"camera.0\"]\nsettings = {{ map = {map:?}, camera-rate-hz = 2 }}\n\
         [module.stream.image]\nrecord = \"1 MiB\"\nkeep = 4\n"
    )
}

/// Sections of a configuration with several nodes.
pub(crate) const NETWORK: &str = "[network]\nsecurity = \"none\"\n[time]\nsource = \"master\"\n";

pub(crate) const OUTPUT: &str = "[[module]]\nname = \"output.0\"\nbuiltin = \"output\"\n";

/// Whether a process of this number runs. A zombie does not, and holds no resources.
pub(crate) fn runs(pid: u32) -> bool {
    // Threads die one by one, and the first may be a zombie while another still holds the files.
    let threads = std::fs::read_dir(format!("/proc/{pid}/task")).into_iter().flatten().flatten();
    threads.map(|thread| state(&thread.path().join("stat"))).any(|state| !matches!(state, 'Z' | 'X'))
}

/// State of a process or thread: the letter after the name, which may contain anything; `X` if there is none.
pub(crate) fn state(stat: &Path) -> char {
    let text = std::fs::read_to_string(stat).unwrap_or_default();
    text.rsplit_once(") ").and_then(|(_, rest)| rest.chars().next()).unwrap_or('X')
}

/// Stops a process as Ctrl-Z does, and waits until it is stopped.
pub(crate) fn halt(pid: u32) {
    signal(pid, Signal::SIGSTOP);
    wait(format!("{pid} stands"), || (state(Path::new(&format!("/proc/{pid}/stat"))) == 'T').then_some(()));
}

pub(crate) fn signal(pid: u32, signal: Signal) {
    kill(Pid::from_raw(pid as i32), signal).unwrap();
}

/// The place of one test's processes.
pub(crate) struct Place {
    /// Configurations and records.
    folder: TempDir,
    /// Shared memory.
    memory: TempDir,
}

impl Place {
    pub(crate) fn new() -> Self {
        let shared = Path::new("/dev/shm");
        let temp = std::env::temp_dir();
        let builder = || {
            let mut builder = tempfile::Builder::new();
            builder.prefix("rohrpost-e2e-");
            builder
        };
        let memory = builder().tempdir_in(shared).or_else(|_| builder().tempdir_in(&temp)).unwrap();
        Self { folder: builder().tempdir().unwrap(), memory }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Directory of nodes.
    pub(crate) fn memory(&self) -> &Path {
        self.memory.path()
    }

    /// Writes a configuration of one node, called `test`.
    pub(crate) fn config(&self, modules: &[&str]) -> PathBuf {
        self.config_of("test", "[nodes.main]", modules)
    }

    pub(crate) fn config_of(&self, installation: &str, nodes: &str, modules: &[&str]) -> PathBuf {
        let file = self.path(&format!("{installation}.toml"));
        let text = format!("installation = \"{installation}\"\n{HEAD}{nodes}\n{}", modules.concat());
        std::fs::write(&file, text).unwrap();
        file
    }

    /// Lines of the probes' record.
    pub(crate) fn record(&self) -> Vec<String> {
        let text = std::fs::read_to_string(self.path("record")).unwrap_or_default();
        text.lines().map(str::to_owned).collect()
    }

    /// Lines of the record with `what`, after the module's name.
    pub(crate) fn recorded(&self, what: &str) -> usize {
        self.record().iter().filter(|line| line.split_once(' ').is_some_and(|(_, rest)| rest == what)).count()
    }

    /// Numbers that probes counted, in order.
    pub(crate) fn counted(&self) -> Vec<u32> {
        self.record().iter().filter_map(|line| line.split_once("count ")?.1.parse().ok()).collect()
    }

    pub(crate) fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(ROHRPOST);
        command.args(arguments).env("ROHRPOST_DIR", self.memory()).current_dir(self.folder.path());
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Runs a command to its end, with retries for `echo`, which has a fixed timeout of a second.
    pub(crate) fn say(&self, arguments: &[&str]) -> Said {
        let began = Instant::now();
        loop {
            let said = self.say_at_once(&patient(arguments));
            let is_early = arguments.first() == Some(&"echo") && said.err.contains("no answer from ");
            if !is_early || began.elapsed() > PATIENCE {
                return said;
            }
        }
    }

    /// Runs it without retries.
    pub(crate) fn say_at_once(&self, arguments: &[&str]) -> Said {
        Running::start(self.command(arguments)).said()
    }

    /// The same, from a node of this configuration.
    pub(crate) fn say_at(&self, config: &Path, node: &str, arguments: &[&str]) -> Said {
        let (command, rest) = arguments.split_first().unwrap();
        self.say(&[&[*command, "--config", config.to_str().unwrap(), "--node", node], rest].concat())
    }

    /// Starts `rohrpost launch`.
    pub(crate) fn launch(&self, config: &Path) -> Running {
        Running::start(self.command(&["launch", config.to_str().unwrap()]))
    }

    /// Starts it and waits until all modules are on.
    pub(crate) fn launched(&self, modules: &[&str]) -> (Running, Robot) {
        let config = self.config(modules);
        let mut launch = self.launch(&config);
        let robot = self.robot(&config, "main", &mut launch);
        robot.wait_on(&mut launch);
        (launch, robot)
    }

    /// Waits until a node exists.
    pub(crate) fn robot(&self, config: &Path, node_name: &str, launch: &mut Running) -> Robot {
        let installation = Installation::load(config).unwrap();
        let base = node_directory(&installation.name, node_name);
        let path = self.memory().join(base.file_name().unwrap());
        let node = wait(format!("no node at {}", path.display()), || {
            launch.assert_runs();
            Node::open(&path).ok().filter(|node| node.launcher() == Some(launch.pid()))
        });
        Robot { installation, node, node_name: node_name.into() }
    }

    /// A running node, however it was launched.
    pub(crate) fn robot_at(&self, config: &Path, node_name: &str) -> Robot {
        let installation = Installation::load(config).unwrap();
        let base = node_directory(&installation.name, node_name);
        let node = Node::open(&self.memory().join(base.file_name().unwrap())).unwrap();
        Robot { installation, node, node_name: node_name.into() }
    }

    /// Nothing of any node is left.
    #[track_caller]
    pub(crate) fn assert_empty(&self) {
        let left: Vec<PathBuf> =
            std::fs::read_dir(self.memory()).into_iter().flatten().map(|entry| entry.unwrap().path()).collect();
        assert!(left.is_empty(), "left over: {left:?}");
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        for entry in std::fs::read_dir(self.memory()).into_iter().flatten().flatten() {
            let Ok(node) = Node::open(&entry.path()) else { continue };
            for left in node.participants().iter().filter(|left| left.pid != std::process::id()) {
                // The number of one in another pid namespace is a stranger's here.
                let _ = node.process_of(left).ok().flatten().map(|process| process.kill());
            }
        }
    }
}

/// A running node, seen by a test that takes part as a tool.
pub(crate) struct Robot {
    pub(crate) installation: Installation,
    pub(crate) node: Arc<Node>,
    node_name: String,
}

impl Robot {
    pub(crate) fn name(&self, module: &str) -> Name {
        self.installation.classes.parse_name(module).unwrap().module()
    }

    pub(crate) fn tool(&self, timeout: Duration) -> ToolLink {
        self.tool_if_there(timeout).unwrap_or_else(|| panic!("the node is gone: {}", self.node.path().display()))
    }

    /// The same of a node that may end meanwhile: none when it is gone.
    pub(crate) fn tool_if_there(&self, timeout: Duration) -> Option<ToolLink> {
        match ToolLink::join(&self.installation, &self.node, &self.node_name, timeout) {
            Err(ClientError::Node(NodeError::Io(_, error))) if error.kind() == ErrorKind::NotFound => None,
            joined => Some(joined.unwrap()),
        }
    }

    /// Sends a probe a command, once; waiting for its answer would repeat it.
    pub(crate) fn begin(&self, tool: &mut ToolLink, module: &str, function: u16, arguments: &impl Serialize) -> u32 {
        let write = |body: &mut Vec<u8>| append(body, arguments);
        tool.link.begin(self.name(module), function, ProbingInterface::hash(), PATIENCE, write).unwrap()
    }

    /// The module's process.
    pub(crate) fn process(&self, module: &str) -> Option<ParticipantInfo> {
        let name = self.name(module);
        self.node.participants().into_iter().find(|p| p.module == name && p.pid != 0)
    }

    pub(crate) fn state(&self, module: &str) -> &'static str {
        self.process(module).and_then(|p| p.state).map_or("none", rohrpost_mailbox::ModuleState::name)
    }

    pub(crate) fn pid(&self, module: &str) -> u32 {
        self.process(module).unwrap_or_else(|| panic!("{module} does not run")).pid
    }

    /// Processes of all modules.
    pub(crate) fn pids(&self) -> Vec<u32> {
        let modules = self.node.participants().into_iter().filter(|p| p.state.is_some());
        modules.map(|p| p.pid).filter(|pid| *pid != std::process::id()).collect()
    }

    pub(crate) fn wait_on(&self, launch: &mut Running) {
        let mut on = 0;
        for module in self.installation.modules_on(&self.node_name) {
            let is_on = module.start == rohrpost_config::Start::On;
            on += u64::from(is_on);
            let (name, state) = (self.installation.classes.format(module.name), if is_on { "on" } else { "off" });
            wait(format!("{name} is not {state}"), || {
                launch.assert_runs();
                (self.state(&name) == state).then_some(())
            });
        }
        // Launch takes the first place of a tool. Before all modules have answered, a stop would be a failed start.
        let tools = self.installation.node(&self.node_name).unwrap().tools.clone();
        let replies = Name::new(self.installation.system.id, 16, *tools.start(), local::REPLIES);
        wait("launch has heard from all", || {
            let heard = self.node.look_at(replies)?.classes.iter().map(|class| class.received).sum::<u64>();
            (heard >= on).then_some(())
        });
        // A module that has answered still holds the package for a moment; and a busy one may have been asked twice.
        for module in self.installation.modules_on(&self.node_name) {
            let name = self.installation.classes.format(module.name);
            if name.starts_with("probe.") {
                wait(format!("{name} is done"), || (self.waiting(&name) == 0).then_some(()));
            }
        }
    }

    /// Packages that wait in a module's command mailbox.
    pub(crate) fn waiting(&self, module: &str) -> u32 {
        self.node.look_at(self.name(module)).map_or(0, |mailbox| mailbox.depth)
    }

    /// Waits until the module runs in another process than this one, and answers.
    pub(crate) fn wait_restarted(&self, module: &str, old_pid: u32) -> ParticipantInfo {
        wait(format!("{module} is not on again"), || {
            self.process(module).filter(|p| p.pid != old_pid && p.state == Some(rohrpost_mailbox::ModuleState::On))
        })
    }
}
