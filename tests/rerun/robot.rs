//! A robot that measures itself, and its configuration. Its modules are in `modules`.

use super::launched::Launched;
use super::modules::{BEAT, Mark, ReceivingInterface, SendingInterface, Times};
use super::programs::bridge;
use rohrpost::common::GET_DATA;
use rohrpost::serde::de::DeserializeOwned;
use rohrpost::types::LaserScan;
use rohrpost::wire::{append, from_bytes};
use rohrpost::{Name, ToolLink};
use rohrpost_config::Installation;
use rohrpost_mailbox::{MailboxInfo, ModuleState, Node, StreamId, StreamInfo, node_directory};
pub(crate) use rohrpost_testbed::report::{PATIENCE, until, wait};
use std::path::Path;
use std::sync::Arc;
use tempfile::TempDir;

/// The robot, running, with a bridge that draws.
pub(crate) struct Robot {
    launched: Launched,
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
        let launched = Launched::start(memory.path(), "robot.toml");
        let base = node_directory(&installation.name, "main");
        let path = memory.path().join("nodes").join(base.file_name().unwrap());
        let node = wait("the node", || Node::open(&path).ok().filter(|node| node.launcher() == Some(launched.pid())));
        until("all modules are on", || {
            let on = node.participants().into_iter().filter(|p| p.state == Some(ModuleState::On)).count();
            on == 4
        });
        let tool = ToolLink::join(&installation, &node, "main", PATIENCE).unwrap();
        Self { launched, tool, node, installation, memory }
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

    /// Time of the newest scan that was published, ns since 1970. Each subscriber with `Rate::Each` has been sent it.
    pub(crate) fn newest_scan_ns(&mut self) -> u64 {
        let (source, scan) = (self.name("source.0"), SendingInterface::SCAN.number);
        let write = |body: &mut Vec<u8>| append(body, &(scan,));
        let (stamp_ns, _): (u64, LaserScan) =
            self.tool.call(source, GET_DATA, SendingInterface::hash(), write, |bytes| from_bytes(bytes)).unwrap();
        stamp_ns
    }

    /// The stream of pictures, which the bridge alone reads.
    pub(crate) fn pictures(&self) -> StreamInfo {
        let id = StreamId { name: self.name("source.0"), number: SendingInterface::PICTURE.number };
        self.node.inspect_stream(id).unwrap().unwrap()
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
        String::from_utf8_lossy(&self.launched.tool(arguments).stdout).into_owned()
    }

    pub(crate) fn folder(&self) -> &Path {
        self.memory.path()
    }
}

/// No real-time scheduling, so that it runs where that is not allowed, and so that the bridge's load has an effect.
fn configuration(drawing: &str, settings: &str) -> String {
    let me = std::env::current_exe().unwrap();
    let program = format!("[{me:?}, \"--exact\", \"modules::module\", \"--nocapture\"]");
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
[module.stream.picture]
record = "110 KiB"
keep = 2
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
    {{ from = "source.0", data = "picture", rate = 5.0 }},
]
"#
    )
}
