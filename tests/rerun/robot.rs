//! A robot that measures itself: `source` sends beats, and everything that a bridge draws; `sink` reports their delay.
//!
//! Both are this test program itself, started by launch with the one test [`module`] to run.

use super::load::on_one_processor;
use super::programs::bridge;
use rohrpost::common::GET_DATA;
use rohrpost::macro_support::{append, from_bytes};
use rohrpost::serde::{Deserialize, de::DeserializeOwned};
use rohrpost::types::{LaserScan, OccupancyGrid, Odometry, Pose, Twist};
use rohrpost::{Context, Module, ModuleError, Name, Rate, Received, Subscription, ToolLink};
use rohrpost_config::Installation;
use rohrpost_mailbox::{MailboxInfo, ModuleState, Node, monotonic_ns, node_directory};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Limit of all waits, long enough for a busy computer.
pub(crate) const PATIENCE: Duration = Duration::from_secs(60);
const BEAT: Duration = Duration::from_millis(5);
/// Rows of data that are sent in a beat while there is a flood.
const FLOOD: u64 = 8;

/// Not a test: what launch starts. Run as a test it ends at once.
#[test]
fn module() {
    let Some(name) = std::env::var_os("ROHRPOST_MODULE") else { return };
    let is_source = name.to_string_lossy().starts_with("source");
    let run = || if is_source { rohrpost::run::<Source>() } else { rohrpost::run::<Sink>() };
    let code = on_one_processor(run);
    std::process::exit(i32::from(code != std::process::ExitCode::SUCCESS));
}

/// Waits until there is a value, and fails with the name of what was awaited.
#[track_caller]
pub(crate) fn wait<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(start.elapsed() < PATIENCE, "waited {PATIENCE:?} in vain: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// An event, as an entity of its own in a drawing.
#[rohrpost::data]
#[derive(Clone, Debug)]
pub(crate) enum Mark {
    /// The beginning.
    Begun(u64),
    /// The viewer was frozen for a while.
    Frozen(u64),
    /// The viewer was killed and another one started.
    Killed(u64),
    /// The same in a flood.
    Flooded(u64),
}

/// Delays of beats.
#[rohrpost::data]
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Times {
    /// Beats since the last question.
    pub(crate) beats: u64,
    /// From the time when a beat was due to its receipt, ns; the median.
    pub(crate) p50_ns: u64,
    /// Beats lost since the start.
    pub(crate) lost: u64,
}

/// Sends.
#[rohrpost::interface(class = "source")]
pub(crate) trait Sending {
    /// Sends a mark.
    #[command(16)]
    fn mark(&mut self, mark: Mark);

    /// Begins or ends a flood of other data.
    #[command(17)]
    fn flood(&mut self, on: bool);

    /// When the beat was due, on the monotonic clock.
    #[data(1)]
    fn beat() -> u64;

    #[data(2)]
    fn scan() -> LaserScan;

    #[data(3)]
    fn odometry() -> Odometry;

    #[data(4)]
    fn map() -> OccupancyGrid;

    #[data(5)]
    fn marks() -> Mark;

    #[data(6)]
    fn noise() -> Vec<u64>;
}

/// Receives.
#[rohrpost::interface(class = "sink")]
pub(crate) trait Receiving {
    /// Figures since the last question.
    #[command(16)]
    fn take(&mut self) -> Times;
}

#[derive(Deserialize)]
#[serde(crate = "rohrpost::serde", deny_unknown_fields, rename_all = "kebab-case")]
struct SourceSettings {
    /// Ask the viewer at this port before each beat, as a robot must never do: it shows that the test can fail.
    ask_viewer: Option<u16>,
}

struct Source {
    settings: SourceSettings,
    /// On the monotonic clock, which ticks go by too.
    began_ns: Option<u64>,
    beats: u64,
    mark: Option<Mark>,
    flood: bool,
}

impl Module for Source {
    type Settings = SourceSettings;
    type Interfaces = SendingInterface;

    fn new(settings: SourceSettings, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(BEAT);
        Ok(Self { settings, began_ns: None, beats: 0, mark: None, flood: false })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let Some(began_ns) = self.began_ns else {
            // Beats are due from here on: the first tick was late, and would set the grid of all others.
            self.began_ns = Some(monotonic_ns());
            context.set_period(BEAT);
            return Ok(());
        };
        let beat_ns = BEAT.as_nanos() as u64;
        let due_ns = began_ns + (monotonic_ns() - began_ns) / beat_ns * beat_ns;
        if let Some(port) = self.settings.ask_viewer {
            ask(port);
        }
        context.publish_now(SendingInterface::BEAT, &due_ns)?;
        self.beats += 1;
        let turn = self.beats as f32 * 0.01;
        if self.beats.is_multiple_of(5) {
            let ranges_m = (0..361).map(|beam| 3.0 + (turn + beam as f32 * 0.1).sin()).collect();
            let scan = LaserScan { start_rad: -1.5, step_rad: 0.01, range_max_m: 8.0, ranges_m, pose: None };
            context.publish_now(SendingInterface::SCAN, &scan)?;
            let pose = Pose { x_m: f64::from(turn.cos()), y_m: f64::from(turn.sin()), heading_rad: f64::from(turn) };
            context.publish_now(SendingInterface::ODOMETRY, &Odometry { pose, twist: Twist::default() })?;
        }
        if self.beats.is_multiple_of(20) {
            context.publish_now(SendingInterface::MAP, &patch(self.beats / 20))?;
        }
        if let Some(mark) = self.mark.take() {
            context.publish_now(SendingInterface::MARKS, &mark)?;
        }
        for _ in 0..if self.flood { FLOOD } else { 0 } {
            context.publish_now(SendingInterface::NOISE, &vec![self.beats; 60])?;
        }
        Ok(())
    }
}

/// One of 64 patches of a map, in turn.
fn patch(number: u64) -> OccupancyGrid {
    let (column, row) = (number % 8, number / 8 % 8);
    let origin = Pose { x_m: column as f64 * 3.2, y_m: row as f64 * 3.2, heading_rad: 0.0 };
    let cells = (0..64 * 64).map(|cell| if (cell + number).is_multiple_of(7) { 100 } else { 0 }).collect();
    OccupancyGrid { origin, resolution_m: 0.05, columns: 64, rows: 64, cells }
}

/// A call as a module would make it, with a module's timeout.
fn ask(port: u16) {
    let Ok(mut viewer) = TcpStream::connect(("127.0.0.1", port)) else { return };
    let _ = viewer.set_read_timeout(Some(4 * BEAT));
    let _ = viewer.write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n");
    let _ = viewer.read(&mut [0; 9]);
}

impl Sending for Source {
    fn mark(&mut self, mark: Mark) {
        self.mark = Some(mark);
    }

    fn flood(&mut self, on: bool) {
        self.flood = on;
    }
}

#[derive(Deserialize)]
#[serde(crate = "rohrpost::serde", deny_unknown_fields)]
struct SinkSettings {}

struct Sink {
    beat: Subscription<u64>,
    late_ns: Vec<u64>,
    expected: u32,
    lost: u64,
}

impl Module for Sink {
    type Settings = SinkSettings;
    type Interfaces = ReceivingInterface;

    fn new(_: SinkSettings, context: &mut Context) -> Result<Self, ModuleError> {
        let beat = context.subscribe(SendingInterface::BEAT, "source.0", Rate::Each)?;
        Ok(Self { beat, late_ns: Vec::new(), expected: 0, lost: 0 })
    }

    fn received(&mut self, _: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        if let Some(due_ns) = data.read(&self.beat)? {
            self.late_ns.push(monotonic_ns() - due_ns);
            self.lost += u64::from(data.head.sequence.wrapping_sub(self.expected));
            self.expected = data.head.sequence + 1;
        }
        Ok(())
    }
}

impl Receiving for Sink {
    fn take(&mut self) -> Times {
        self.late_ns.sort_unstable();
        let p50_ns = self.late_ns.get(self.late_ns.len() / 2).copied().unwrap_or(0);
        let beats = self.late_ns.len() as u64;
        self.late_ns.clear();
        Times { beats, p50_ns, lost: self.lost }
    }
}

/// The robot, running, with a bridge that draws.
pub(crate) struct Robot {
    launch: Child,
    tool: ToolLink,
    node: Arc<Node>,
    installation: Installation,
    memory: TempDir,
}

impl Robot {
    /// Starts it; `drawing` are the bridge's settings, `settings` the source's.
    pub(crate) fn start(drawing: &str, settings: &str) -> Self {
        let memory = tempfile::Builder::new().prefix("rohrpost-gui-").tempdir().unwrap();
        let config = memory.path().join("robot.toml");
        std::fs::write(&config, configuration(drawing, settings)).unwrap();
        let installation = Installation::load(&config).unwrap();
        let launch = Command::new(env!("CARGO_BIN_EXE_rohrpost"))
            .args(["launch", "robot.toml"])
            .env("ROHRPOST_DIR", memory.path().join("nodes"))
            .current_dir(memory.path())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let base = node_directory(&installation.name, "main");
        let path = memory.path().join("nodes").join(base.file_name().unwrap());
        let node = wait("the node", || Node::open(&path).ok().filter(|node| node.launcher() == Some(launch.id())));
        wait("all modules are on", || {
            let on = node.participants().into_iter().filter(|p| p.state == Some(ModuleState::On)).count();
            (on == 4).then_some(())
        });
        let tool = ToolLink::join(&installation, &node, "main", PATIENCE).unwrap();
        Self { launch, tool, node, installation, memory }
    }

    fn name(&self, module: &str) -> Name {
        self.installation.classes.parse_module(module).unwrap()
    }

    pub(crate) fn mark(&mut self, mark: &Mark) {
        let source = self.name("source.0");
        let hash = SendingInterface::hash();
        self.tool.call(source, 16, hash, |body| append(body, &(mark,)), |_| Ok(())).unwrap();
    }

    pub(crate) fn flood(&mut self, on: bool) {
        let source = self.name("source.0");
        self.tool.call(source, 17, SendingInterface::hash(), |body| append(body, &(on,)), |_| Ok(())).unwrap();
    }

    fn take(&mut self) -> Times {
        let sink = self.name("sink.0");
        self.tool.call(sink, 16, ReceivingInterface::hash(), |_| Ok(()), |bytes| from_bytes(bytes)).unwrap()
    }

    /// The median lateness of so many beats, ns.
    pub(crate) fn window(&mut self, beats: u64) -> u64 {
        self.take();
        // A computer that stalls for a window brings no beat in it.
        for _ in 0..10 {
            // Not asked meanwhile: asking is work, too.
            std::thread::sleep(BEAT * u32::try_from(beats).unwrap());
            let times = self.take();
            assert_eq!(times.lost, 0, "the robot has lost beats");
            if times.beats > 0 {
                return times.p50_ns;
            }
        }
        panic!("no beat came in ten windows");
    }

    /// A function of the bridge's that gives a structure of numbers.
    pub(crate) fn bridge<T: DeserializeOwned>(&mut self) -> T {
        let gui = self.name("gui.0");
        let hash = self.tool.describe(gui).unwrap().hash();
        self.tool.call(gui, 16, hash, |_| Ok(()), |bytes| from_bytes(bytes)).unwrap()
    }

    pub(crate) fn bridge_pid(&self) -> u32 {
        let gui = self.name("gui.0");
        self.node.participants().into_iter().find(|p| p.module == gui).unwrap().pid
    }

    /// Time of the newest published scan, ns since 1970: it has been sent to all subscribers of each scan.
    pub(crate) fn newest_scan_ns(&mut self) -> u64 {
        let (source, scan) = (self.name("source.0"), SendingInterface::SCAN.number);
        let write = |body: &mut Vec<u8>| append(body, &(scan,));
        let (stamp_ns, _): (u64, LaserScan) =
            self.tool.call(source, GET_DATA, SendingInterface::hash(), write, |bytes| from_bytes(bytes)).unwrap();
        stamp_ns
    }

    /// One of the bridge's mailboxes.
    pub(crate) fn bridge_mailbox(&self, local: u8) -> MailboxInfo {
        self.node.look_at(self.name("gui.0").with_local(local)).unwrap()
    }

    /// Data that a module missed.
    pub(crate) fn lost_by(&mut self, module: &str) -> u64 {
        let module = self.name(module);
        self.tool.status(module).unwrap().lost
    }

    /// Memory of the bridge, MiB.
    pub(crate) fn bridge_mib(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.bridge_pid())).unwrap();
        let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap();
        line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() / 1024
    }

    /// Nothing of the robot was lost, and none of its mailboxes was full; the bridge is on.
    pub(crate) fn assert_well(&mut self) {
        for name in self.node.mailboxes().unwrap() {
            let Some(mailbox) = self.node.look_at(name) else { continue };
            let lost: u64 = mailbox.classes.iter().map(rohrpost_mailbox::ClassTraffic::lost_in_all).sum();
            let name = self.installation.classes.format(name);
            assert_eq!(lost, 0, "{name} has lost packages: {:?}\n{}", mailbox.classes, self.said());
        }
        let gui = self.name("gui.0");
        let bridge = self.node.participants().into_iter().find(|p| p.module == gui).unwrap();
        assert_eq!((bridge.state, bridge.restarts), (Some(ModuleState::On), 0), "{}", self.said());
    }

    /// Lines of the modules.
    pub(crate) fn said(&self) -> String {
        self.say(&["log"])
    }

    /// A tool's output.
    pub(crate) fn say(&self, arguments: &[&str]) -> String {
        let mut tool = Command::new(env!("CARGO_BIN_EXE_rohrpost"));
        let output = tool.args(arguments).env("ROHRPOST_DIR", self.memory.path().join("nodes")).output().unwrap();
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    pub(crate) fn folder(&self) -> &Path {
        self.memory.path()
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        // Asked to end first, so that its modules end; then killed.
        let pid = nix::unistd::Pid::from_raw(self.launch.id() as i32);
        let _ = nix::sys::signal::kill(pid, nix::sys::signal::Signal::SIGTERM);
        let start = Instant::now();
        while self.launch.try_wait().is_ok_and(|ended| ended.is_none()) && start.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(10));
        }
        let _ = self.launch.kill();
        let _ = self.launch.wait();
    }
}

/// No real-time scheduling, so that it runs where that is not allowed, and so that the bridge's load has an effect.
fn configuration(drawing: &str, settings: &str) -> String {
    let me = std::env::current_exe().unwrap();
    let program = format!("[{me:?}, \"--exact\", \"robot::module\", \"--nocapture\"]");
    let bridge = bridge();
    format!(
        r#"
installation = "tortured"
[system]
name = "robot"
id = 1
[classes]
source = {{ id = 200 }}
sink = {{ id = 190 }}
gui = {{ id = 40 }}
output = {{ id = 32 }}
tool = {{ id = 16 }}
[scheduling]
real-time-from = 256
[nodes.main]
[[module]]
name = "output.0"
builtin = "output"
[[module]]
name = "source.0"
program = {program}
settings = {{ {settings} }}
[[module]]
name = "sink.0"
program = {program}
calls = ["source.0"]
settings = {{}}
[[module]]
name = "gui.0"
program = [{bridge:?}]
calls = ["source.0", {{ to = "output.0", although = "it reads earlier lines once, and waits for nobody" }}]
settings = {{ {drawing} }}
[module.mailbox.data]
slots = 256
size = "20 KiB"
[gui]
show = [
    {{ from = "source.0", data = "scan", rate = 0.0 }},
    {{ from = "source.0", data = "odometry" }},
    {{ from = "source.0", data = "map", rate = 0.0 }},
    {{ from = "source.0", data = "marks", rate = 0.0 }},
    {{ from = "source.0", data = "noise", rate = 0.0 }},
]
"#
    )
}
