//! Two nodes with real routers between them, as launch would start them.

use super::wire::{Wire, address, name_of};
use crate::Failure;
use crate::harness::{Child, End, Placement, Scheduling, Scratch, settle};
use nix::sys::signal::Signal;
use rohrpost_mailbox::{Class, Name, Node, local, node_directory};
use std::fs;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const INSTALLATION: &str = "bench-lan";
const SYSTEM: u8 = 1;
/// Class of the modules that are timed, and of those that flood.
const BENCH: Class = Class(200);
const FLOOD: Class = Class(100);
const ROUTER: Class = Class(250);
/// Reading a configuration and making a mailbox takes milliseconds, on a busy computer a second.
const READY_WITHIN: Duration = Duration::from_secs(20);
/// Within this a router that is told to end has told its peers.
const ENDS_WITHIN: Duration = Duration::from_secs(5);
const LOOK_EACH: Duration = Duration::from_millis(5);

/// What differs between cases.
#[derive(Clone, Copy, Debug)]
pub struct Network {
    /// Largest IP packet, bytes.
    pub mtu: u16,
    /// Most that a router sends, bytes a second.
    pub rate: &'static str,
    /// How much one sender may have waiting in its node's router.
    pub quota: &'static str,
}

/// More than the computer can do, so that it is not in the way.
pub const UNPACED: &str = "64 GiB";

/// Two nodes, until this is dropped.
pub struct Nodes {
    scratch: Scratch,
    routers: Vec<Child>,
}

impl Nodes {
    /// Starts both routers and waits until they take packages.
    ///
    /// # Errors
    /// What a router failed with; [`Failure::Skipped`] when the command is not there.
    pub fn start(wire: &Wire, network: &Network, command: Result<PathBuf, Failure>) -> Result<Self, Failure> {
        let command = command?;
        let mut nodes = Self { scratch: Scratch::new()?, routers: Vec::new() };
        let config = nodes.scratch.directory().join("bench-lan.toml");
        let text = configuration(network);
        fs::write(&config, text).map_err(|error| Failure::of("configuration", error))?;
        for end in [End::Ping, End::Pong] {
            let router = Child::start(|| {
                wire.enter(end)?;
                // Pinned; how it is scheduled the router knows itself.
                settle(end, Placement::TwoCores, Scheduling::Normal)?;
                let log = fs::File::create(nodes.log(end)).map_err(|error| Failure::of("router's log", error))?;
                let error = Command::new(&command)
                    .args(["router", "--config"])
                    .arg(&config)
                    .args(["--name", &format!("router.{}", index(end))])
                    .env("ROHRPOST_DIR", nodes.scratch.directory())
                    .stdin(Stdio::null())
                    .stdout(Stdio::null())
                    .stderr(log)
                    .exec();
                Err(Failure::of("rohrpost router", error))
            })?;
            nodes.routers.push(router);
        }
        nodes.await_ready()?;
        Ok(nodes)
    }

    /// The directory of an end's node.
    pub fn directory(&self, end: End) -> PathBuf {
        let file = node_directory(INSTALLATION, name_of(end));
        self.scratch.directory().join(file.file_name().unwrap_or_default())
    }

    /// What the router of a node says.
    fn log(&self, end: End) -> PathBuf {
        self.scratch.directory().join(format!("router-{}.log", name_of(end)))
    }

    /// Until each router's mailbox for others' packages is there, which it makes last.
    fn await_ready(&mut self) -> Result<(), Failure> {
        let give_up = Instant::now() + READY_WITHIN;
        for end in [End::Ping, End::Pong] {
            let transit = Name::new(SYSTEM, ROUTER.0, index(end), local::TRANSIT);
            while !has_mailbox(&self.directory(end), transit) {
                if self.routers[usize::from(index(end))].has_ended()? || Instant::now() > give_up {
                    let said = fs::read_to_string(self.log(end)).unwrap_or_default();
                    let node = name_of(end);
                    return Err(Failure::Failed(format!("the router of node `{node}` did not get ready: {said}")));
                }
                std::thread::sleep(LOOK_EACH);
            }
        }
        Ok(())
    }
}

impl Drop for Nodes {
    fn drop(&mut self) {
        self.routers.iter_mut().for_each(|router| router.signal(Signal::SIGTERM));
        let give_up = Instant::now() + ENDS_WITHIN;
        for router in &mut self.routers {
            // One that does not end is killed when it is dropped.
            while !router.has_ended().unwrap_or(true) && Instant::now() < give_up {
                std::thread::sleep(LOOK_EACH);
            }
        }
    }
}

fn has_mailbox(directory: &Path, name: Name) -> bool {
    Node::open(directory).is_ok_and(|node| node.look_at(name).is_some())
}

/// Of the node in the configuration, and so of its router.
fn index(end: End) -> u8 {
    u8::from(end == End::Pong)
}

/// The mailbox of a timed module at this end. Each turn has one of its own, so that nothing of the last one is in it.
pub fn bench(end: End, turn: u8) -> Name {
    Name::new(SYSTEM, BENCH.0, index(end), turn)
}

/// The mailbox of a flooding one.
pub fn flood(end: End, turn: u8) -> Name {
    Name::new(SYSTEM, FLOOD.0, index(end), turn)
}

fn configuration(network: &Network) -> String {
    let Network { mtu, rate, quota } = network;
    let [near, far] = [End::Ping, End::Pong].map(address);
    let modules = [("bench", End::Ping), ("bench", End::Pong), ("flood", End::Ping), ("flood", End::Pong)];
    let modules = modules.map(|(class, end)| {
        let (instance, node) = (index(end), name_of(end));
        // Nobody launches them: the processes of a turn are them.
        format!(
            "[[module]]\nname = \"{class}.{instance}\"\nnode = \"{node}\"\nprogram = \"{class}\"\noptional = true\n"
        )
    });
    format!(
        r#"installation = "{INSTALLATION}"
[system]
name = "bench"
id = {SYSTEM}
[classes]
router = {{ id = {router}, text = "Carries packages between nodes" }}
bench = {{ id = {bench}, text = "Is timed" }}
flood = {{ id = {flood}, text = "Floods" }}
tool = {{ id = 16, text = "Tools" }}
[nodes.near]
address = "{near}"
tools = [0, 63]
[nodes.far]
address = "{far}"
tools = [64, 127]
[network]
security = "none"
mtu = {mtu}
rate = "{rate}"
quota = "{quota}"
[time]
source = "master"
{modules}"#,
        router = ROUTER.0,
        bench = BENCH.0,
        flood = FLOOD.0,
        modules = modules.concat(),
    )
}
