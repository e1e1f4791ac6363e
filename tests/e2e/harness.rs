//! A place of its own for each test: shared memory, files, processes. Everything is removed when the place is dropped.

use crate::process::{Running, Said};
pub(crate) use crate::robot::Robot;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rohrpost::Module;
use rohrpost::serde::Deserialize;
use rohrpost_config::Installation;
use rohrpost_mailbox::{Node, node_directory};
use rohrpost_modules::runtime::{Start, run_started, tell_exit};
use rohrpost_routers::lab::{Lab, LabError, NodeSpec};
use rohrpost_testbed::report::skipped;
pub(crate) use rohrpost_testbed::report::{PATIENCE, until, wait};
use serde_json::Value;
use std::fmt::Debug;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::str::FromStr;
use std::sync::LazyLock;
use std::time::Instant;
use tempfile::TempDir;

/// The command under test.
pub(crate) const ROHRPOST: &str = env!("CARGO_BIN_EXE_rohrpost");

/// Head of all configurations: no real-time scheduling, so that tests run beside each other.
fn head_of(installation: &str, classes: &str) -> String {
    let classes: String =
        classes.split(", ").map(|class| format!("{} }}\n", class.replace(' ', " = { id = "))).collect();
    format!(
        "installation = \"{installation}\"\n[system]\nname = \"robot\"\nid = 1\n[classes]\n{classes}[scheduling]\n\
         real-time-from = 256\n"
    )
}

/// Head of a configuration of these classes, `class id, class id`, of the installation `test`.
pub(crate) fn head(classes: &str) -> String {
    head_of("test", classes)
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

/// Objects that a tool has printed, one a line.
pub(crate) fn json_lines(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"))).collect()
}

/// All these words are in a text.
#[track_caller]
pub(crate) fn assert_has<const N: usize>(text: &str, words: [&str; N]) {
    let missing = words.into_iter().find(|words| !text.contains(words));
    assert_eq!(missing, None, "missing in:\n{text}");
}

/// Python with these arguments in a place, which writes nothing beside its sources.
pub(crate) fn python(place: &Place, arguments: &[&str]) -> Command {
    let mut command = Command::new("python3");
    command.arg("-B").args(arguments).current_dir(place.path("")).env("ROHRPOST_DIR", place.memory());
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// A file of this repository.
pub(crate) fn repository(path: &str) -> String {
    format!("{}/../{path}", env!("CARGO_MANIFEST_DIR"))
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

/// Tables of further classes, `class id, class id`.
pub(crate) fn classes(classes: &str) -> String {
    classes.split(", ").map(|class| format!("[classes.{}\n", class.replace(' ', "]\nid = "))).collect()
}

/// Classes of modules that are recorded and replayed, for configurations that have such.
pub(crate) static RECORDED_CLASSES: LazyLock<String> = LazyLock::new(|| {
    classes("motor 200, odometry 160, laser 150, pilot 140, seer 110, feeder 100, mapper 95, logd 24")
});

/// A simulated robot with streams, one of them of pictures; first of a configuration, since classes are before modules.
pub(crate) fn simulated() -> String {
    let map = repository("config/building.map");
    format!(
        "{}[classes.camera]\nid = 112\n[[module]]\nname = \"motor.0\"\nbuiltin = \"sim\"\n\
         aliases = [\"odometry.0\", \"laser.0\", \"camera.0\"]\nsettings = {{ map = {map:?}, camera-rate-hz = 2 }}\n\
         [module.stream.image]\nrecord = \"1 MiB\"\nkeep = 4\n",
        *RECORDED_CLASSES
    )
}

pub(crate) const OUTPUT: &str = "[[module]]\nname = \"output.0\"\nbuiltin = \"output\"\n";

/// How often a test does something: what the environment says, for a long run.
pub(crate) fn times<T: FromStr<Err: Debug>>(variable: &str, usually: T) -> T {
    std::env::var(variable).map_or(usually, |times| times.parse().unwrap())
}

/// What a module's program does that is this test program: launch, or an exact replay, runs it by one test alone. Run
/// as a test that ends at once.
pub(crate) fn run_if_launched<M: Module>() {
    if ["ROHRPOST_MODULE", "ROHRPOST_EXACT"].iter().any(|variable| std::env::var_os(variable).is_some()) {
        let ended = Start::from_environment().and_then(run_started::<M>);
        std::process::exit(tell_exit(ended).into());
    }
}

/// Settings of a module that has none.
#[derive(Deserialize)]
#[serde(crate = "rohrpost::serde", deny_unknown_fields)]
pub(crate) struct NoSettings {}

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
    until(format!("{pid} stands"), || state(Path::new(&format!("/proc/{pid}/stat"))) == 'T');
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

    /// A place with a node on which these modules are on.
    pub(crate) fn running(modules: &[&str]) -> (Self, Running, Robot) {
        let place = Self::new();
        let (launch, robot) = place.launched(modules);
        (place, launch, robot)
    }

    /// A place with a node on which these modules begin, without waiting until they are on.
    pub(crate) fn begun(modules: &[&str]) -> (Self, Running, Robot) {
        let place = Self::new();
        let config = place.config(modules);
        let mut launch = place.launch(&config);
        let robot = place.robot(&config, "main", &mut launch);
        (place, launch, robot)
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file; where it is.
    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let file = self.path(name);
        std::fs::write(&file, content).unwrap();
        file
    }

    /// Writes a program; where it is.
    pub(crate) fn program(&self, name: &str, code: impl AsRef<[u8]>) -> PathBuf {
        let file = self.write(name, code);
        std::fs::set_permissions(&file, PermissionsExt::from_mode(0o755)).unwrap();
        file
    }

    /// Copies a file of the repository here, under its own name.
    pub(crate) fn copy(&self, file: &str) {
        let name = Path::new(file).file_name().unwrap().to_str().unwrap();
        std::fs::copy(repository(file), self.path(name)).unwrap();
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
        let head = head_of(installation, "router 250, probe 96, output 32, tool 16");
        let text = format!("{head}{nodes}\n{}", modules.concat());
        self.write(&format!("{installation}.toml"), text)
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

    pub(crate) fn start(&self, arguments: &[&str]) -> Running {
        Running::start(self.command(arguments))
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
        self.start(arguments).said()
    }

    /// The same, from a node of this configuration.
    pub(crate) fn say_at(&self, config: &Path, node: &str, arguments: &[&str]) -> Said {
        let (command, rest) = arguments.split_at(if matches!(arguments[0], "param" | "stream") { 2 } else { 1 });
        self.say(&[command, &["--config", config.to_str().unwrap(), "--node", node], rest].concat())
    }

    /// Starts `rohrpost launch`.
    pub(crate) fn launch(&self, config: &Path) -> Running {
        self.start(&["launch", config.to_str().unwrap()])
    }

    /// Starts it and waits until all modules are on.
    pub(crate) fn launched(&self, modules: &[&str]) -> (Running, Robot) {
        self.launched_from(&self.config(modules))
    }

    /// Starts it with a configuration of one node and waits until all modules are on.
    pub(crate) fn launched_from(&self, config: &Path) -> (Running, Robot) {
        self.up(self.command(&["launch", config.to_str().unwrap()]), config, "main")
    }

    /// Starts a node by this command and waits until all its modules are on.
    pub(crate) fn up(&self, command: Command, config: &Path, node_name: &str) -> (Running, Robot) {
        let mut launch = Running::start(command);
        let robot = self.robot(config, node_name, &mut launch);
        robot.wait_on(&mut launch);
        (launch, robot)
    }

    /// Stops a launch, which leaves nothing of any node.
    #[track_caller]
    pub(crate) fn end(&self, launch: &mut Running) {
        launch.stop();
        self.assert_empty();
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
