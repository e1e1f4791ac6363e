//! Two nodes with real routers between them, as launch would start them.

use super::ends::{Module, await_way};
use super::records::{self, RECORDS};
use super::router::{ROUTER, Router, RouterSpec, SYSTEM, end_all, make_keys, router_of};
use super::wire::{Wire, address};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{End, Meetings, OrFail, Placement, Scheduling, Scratch, settle};
use rohrpost_mailbox::{Class, Name, StreamShape};
use std::fs;
use std::path::{Path, PathBuf};

const INSTALLATION: &str = "bench-lan";
/// Class of the modules that are timed, and of those that flood.
const BENCH: Class = Class(200);
const FLOOD: Class = Class(100);
/// The turn before the first one.
const INTRODUCING: u8 = u8::MAX;

/// What differs between cases.
#[derive(Clone, Copy, Debug)]
pub struct Network {
    /// Largest IP packet, bytes.
    pub mtu: u16,
    /// Most that a router sends, bytes a second.
    pub rate: &'static str,
    /// How much one sender may have waiting in its node's router.
    pub quota: &'static str,
    /// Whether what passes is sealed.
    pub sealed: bool,
    /// The stream that each node writes and the other has as a replica; none: there are no streams.
    pub records: Option<StreamShape>,
}

/// Of a current Ethernet.
pub const ETHERNET: u16 = 1_500;

/// An Ethernet with routers that may send more than the computer can do, so that this is not in the way.
pub const UNPACED: Network = Network { mtu: ETHERNET, rate: "64 GiB", quota: "1 MiB", sealed: false, records: None };

/// Two nodes, until this is dropped.
pub struct Nodes {
    scratch: Scratch,
    routers: Vec<Router>,
}

impl Nodes {
    /// Starts both routers and waits until they take packages of each other.
    ///
    /// # Errors
    /// What a router failed with; [`Failure::Skipped`] when the command is not there.
    pub fn start(wire: &Wire, network: &Network, command: Result<PathBuf, Failure>) -> Result<Self, Failure> {
        let command = command?;
        let mut nodes = Self { scratch: Scratch::new()?, routers: Vec::new() };
        let config = nodes.scratch.directory().join("bench-lan.toml");
        let text = configuration(network);
        fs::write(&config, text).or_fail("configuration")?;
        if network.sealed {
            make_keys(&command, &nodes.scratch.directory().join("keys"))?;
        }
        for end in [End::Ping, End::Pong] {
            let scratch = nodes.scratch.directory();
            let spec = spec(end, &command, &config, &scratch);
            let router = Router::start(&spec, || {
                wire.enter(end)?;
                // Pinned; the router sets its own scheduling.
                settle(end, Placement::TwoCores, Scheduling::Normal)
            })?;
            nodes.routers.push(router);
        }
        nodes.routers.iter_mut().try_for_each(Router::await_ready)?;
        for (from, to) in [(End::Ping, End::Pong), (End::Pong, End::Ping)] {
            let (from_directory, to_directory) = (nodes.directory(from), nodes.directory(to));
            await_way([&from_directory, &to_directory], [flood(from, INTRODUCING), flood(to, INTRODUCING)])?;
            if let Some(shape) = network.records {
                records::begin(&from_directory, &to_directory, index(from), shape)?;
            }
        }
        Ok(nodes)
    }

    /// Opens an end of a ping-pong, in the process that will use it.
    ///
    /// # Errors
    /// As [`Module::between`].
    pub fn module(&self, end: End, turn: u8, bytes: usize, meetings: &mut Meetings) -> Result<Module, Failure> {
        let other = bench(end.other(), turn);
        Module::between(&self.directory(end), [bench(end, turn), other], bytes, meetings)
    }

    /// The directory of an end's node.
    pub fn directory(&self, end: End) -> PathBuf {
        spec(end, Path::new(""), Path::new(""), &self.scratch.directory()).directory()
    }
}

impl Drop for Nodes {
    fn drop(&mut self) {
        end_all(&mut self.routers);
    }
}

fn spec<'a>(end: End, command: &'a Path, config: &'a Path, scratch: &'a Path) -> RouterSpec<'a> {
    RouterSpec {
        command,
        config,
        installation: INSTALLATION,
        node: end.node().into(),
        program: "router",
        module: router_of(index(end)),
        scratch,
    }
}

/// Of the node in the configuration, and so of its router.
pub fn index(end: End) -> u8 {
    u8::from(end == End::Pong)
}

/// The mailbox of a timed module at this end. Each turn has one of its own, so that it holds nothing of an earlier
/// turn.
pub fn bench(end: End, turn: u8) -> Name {
    Name::new(SYSTEM, BENCH.0, index(end), turn)
}

/// The mailbox of a flooding one.
pub fn flood(end: End, turn: u8) -> Name {
    Name::new(SYSTEM, FLOOD.0, index(end), turn)
}

fn configuration(network: &Network) -> String {
    let Network { mtu, rate, quota, sealed, records } = network;
    let security = if *sealed { "keys" } else { "none" };
    let [near, far] = [End::Ping, End::Pong].map(address);
    let modules = [("bench", End::Ping), ("bench", End::Pong), ("flood", End::Ping), ("flood", End::Pong)];
    let modules = modules.map(|(class, end)| {
        let (instance, node) = (index(end), end.node());
        // Never launched: the processes of a turn take their place.
        format!(
            "[[module]]\nname = \"{class}.{instance}\"\nnode = \"{node}\"\nprogram = \"{class}\"\noptional = true\n"
        )
    });
    let replica =
        |shape: StreamShape, from: End, to: End| records::entries(index(from), from.node(), &[to.node()], shape);
    let replicas =
        records.map(|shape| [replica(shape, End::Ping, End::Pong), replica(shape, End::Pong, End::Ping)].concat());
    format!(
        r#"installation = "{INSTALLATION}"
[system]
name = "bench"
id = {SYSTEM}
[classes]
router = {{ id = {router}, text = "Carries packages between nodes" }}
bench = {{ id = {bench}, text = "Is timed" }}
flood = {{ id = {flood}, text = "Floods" }}
records = {{ id = {records}, text = "Writes records" }}
tool = {{ id = 16, text = "Tools" }}
[nodes.near]
address = "{near}"
tools = [0, 63]
[nodes.far]
address = "{far}"
tools = [64, 127]
[network]
security = "{security}"
mtu = {mtu}
rate = "{rate}"
quota = "{quota}"
[time]
source = "master"
{modules}{replicas}"#,
        router = ROUTER.0,
        bench = BENCH.0,
        flood = FLOOD.0,
        records = RECORDS.0,
        modules = modules.concat(),
        replicas = replicas.unwrap_or_default(),
    )
}
