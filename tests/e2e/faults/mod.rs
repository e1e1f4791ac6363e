//! A network with every fault: real routers and modules in network namespaces; what is reported, lost, counted and run.
//!
//! Each file is a fault. The nodes are `base` (probe.0 and the collector of lines), `arm` (probe.1) and, where three
//! are needed, `desk` (probe.2); the test takes part on each as a tool. One lab at a time: each has its own processes,
//! and the computer may be busy.

mod accounts;
mod buffer;
mod calls;
mod flow;
mod frozen;
mod killed;
mod link;
mod master;
mod sealed;
mod strangers;
mod twice;

use crate::harness::{OUTPUT, PATIENCE, Place, lab, probe, until, wait};
use crate::network::{Network, at, nodes};
use rohrpost::interface::DataPort;
use rohrpost::interfaces::{LinkState, Links, PeerLink, RouterInterface};
use rohrpost::schema::Data;
use rohrpost::{CallError, Fault, Name};
use rohrpost_config::Installation;
use rohrpost_testbed::stalls::Stalls;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Nodes and their addresses.
const NODES: [(&str, &str); 3] = [("base", "10.78.0.1"), ("arm", "10.78.0.2"), ("desk", "10.78.0.3")];
/// Older packages are not run; seed 002 has this under "at most once".
const TRANSIT_MAX: Duration = Duration::from_secs(2);
/// "At once", in time in which the computer runs; a call that is not answered takes [`PATIENCE`].
const AT_ONCE: Duration = Duration::from_secs(5);
/// The collector's file.
const LOG: &str = "[output]\nfile = \"robot.log\"\n";

static TURN: Mutex<()> = Mutex::new(());

/// Nodes of a system, each in its namespace.
struct Field {
    // Dropped in this order.
    network: Network,
    stalls: Stalls,
    _turn: MutexGuard<'static, ()>,
}

impl Deref for Field {
    type Target = Network;

    fn deref(&self) -> &Network {
        &self.network
    }
}

impl Field {
    /// So many nodes, none of them launched, with further keys of `[network]`. None, with a report, where namespaces
    /// are not permitted.
    fn new(nodes: usize, network: &str) -> Option<Self> {
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let lab = lab(NODES[..nodes].iter().copied(), "faults of networks")?;
        let place = Place::new();
        let config = configure(&place, "test", nodes, network, &[&at("base", OUTPUT), LOG]);
        Some(Self { network: Network::new(place, config, Some(lab)), stalls: Stalls::watch(), _turn: turn })
    }

    /// `base` and `arm`, at work.
    fn launched() -> Option<Self> {
        let mut field = Self::new(2, "")?;
        field.launch(&["base", "arm"]);
        Some(field)
    }

    /// Launches nodes, all at once, and waits until all modules are on and the routers hear each other.
    fn launch(&mut self, nodes: &[&'static str]) {
        self.launch_deaf(nodes);
        for node in nodes {
            for peer in self.nodes.iter().map(|(name, ..)| *name).filter(|name| name != node) {
                self.wait_for_state(node, peer, LinkState::Alive);
            }
        }
    }

    /// Launches nodes of which no router needs to be heard.
    fn launch_deaf(&mut self, nodes: &[&'static str]) {
        self.network.launch_from(&self.config.clone(), nodes);
    }

    /// Ends all; nothing is left.
    fn stop(self) {
        self.network.stop();
    }

    /// A router's process.
    fn router(&self, node: &str) -> u32 {
        self.robot(node).pid(&router_of(node))
    }

    /// Digest of the configuration that the nodes share.
    fn digest(&self) -> u64 {
        Installation::load(&self.config).unwrap().digest().lan()
    }

    /// A router's own report, at most half a second old.
    fn said<T: Data>(&self, node: &str, port: DataPort<T>) -> T {
        let robot = self.robot(node);
        wait(format!("{} of {node}", port.name), || {
            let mut tool = robot.tool(Duration::from_secs(2));
            let said = robot.newest(&mut tool, &router_of(node), port);
            tool.close();
            // A router that was just started has no report yet.
            said.ok().map(|(_, said)| said)
        })
    }

    fn links(&self, node: &str) -> Links {
        self.said(node, RouterInterface::LINKS)
    }

    /// A node, as another one's router sees it.
    fn peer(&self, node: &str, peer: &str) -> PeerLink {
        self.links(node).peers.into_iter().find(|link| link.node == peer).unwrap()
    }

    fn wait_for_state(&self, node: &str, peer: &str, state: LinkState) {
        until(format!("{peer} is {state:?} to {node}"), || self.peer(node, peer).state == state);
    }

    /// Datagrams that a node's kernel dropped because a buffer was full.
    fn dropped(&self, node: &str) -> u64 {
        let text = self.inside(node, || std::fs::read_to_string("/proc/thread-self/net/snmp").unwrap());
        let mut rows = text.lines().filter_map(|line| line.strip_prefix("Udp: "));
        let (names, values) = (rows.next().unwrap(), rows.next().unwrap());
        let at = names.split(' ').position(|name| name == "RcvbufErrors").unwrap();
        values.split(' ').nth(at).unwrap().parse().unwrap()
    }

    /// Lines of a module with all these words, in the collector's file.
    fn lines(&self, module: &str, words: &[&str]) -> Vec<String> {
        lines(&self.place.path("robot.log"), module, words)
    }

    /// Waits until a module has reported this so many times in all.
    fn wait_told(&self, module: &str, words: &[&str], times: usize) {
        until(format!("{module} says {words:?}"), || self.lines(module, words).len() >= times);
    }

    /// The result of counting on another node, if the answer comes within the timeout.
    fn count(&self, node: &str, module: &str, number: u32, timeout: Duration) -> Result<u64, CallError> {
        let mut calls = calls::Calls::new(self, node, module, timeout);
        calls.begin(number);
        calls.settle();
        calls.close().remove(0).1
    }

    /// Counts with new calls until one succeeds.
    fn wait_counted(&self, node: &str, module: &str, number: u32) {
        wait(format!("{module} counts for {node}"), || self.count(node, module, number, Duration::from_secs(2)).ok());
    }

    /// The fault of a call that is answered at once, despite a long timeout.
    fn fault(&self, node: &str, module: &str) -> Fault {
        let begun = Instant::now();
        let answer = self.count(node, module, NEVER, PATIENCE);
        assert!(self.stalls.ran(begun) < AT_ONCE, "answered after {:?}: {answer:?}", begun.elapsed());
        match answer {
            Err(CallError::Fault(_, fault)) => fault,
            other => panic!("no fault: {other:?}"),
        }
    }

    /// Numbers that a module has counted, in order.
    fn counted(&self, module: &str) -> Vec<u32> {
        let line = format!("{module} count ");
        self.place.record().iter().filter_map(|said| said.strip_prefix(&line)?.parse().ok()).collect()
    }
}

/// The number of calls that must not be run.
const NEVER: u32 = u32::MAX;

/// Writes a configuration of the first nodes, a probe on each.
fn configure(place: &Place, name: &str, count: usize, network: &str, further: &[&str]) -> PathBuf {
    let all = nodes(NODES[..count].iter().copied());
    let security = if network.contains("security") { "" } else { "security = \"none\"\n" };
    let sections = format!("{all}[network]\n{security}{network}\n[time]\nsource = \"master\"\ninterval = \"500 ms\"\n");
    let on = |(index, (node, ..)): (usize, &(&str, &str))| {
        probe(&format!("probe.{index}"), "rate-hz = 50.0", &format!("node = \"{node}\""))
    };
    let probes: String = NODES[..count].iter().enumerate().map(on).collect();
    place.config_of(name, &sections, &[&[probes.as_str()], further].concat())
}

fn router_of(node: &str) -> String {
    let index = NODES.iter().position(|(name, ..)| *name == node).unwrap();
    format!("router.{index}")
}

fn lines(log: &Path, module: &str, words: &[&str]) -> Vec<String> {
    let text = std::fs::read_to_string(log).unwrap_or_default();
    let has = |line: &&str| line.contains(module) && words.iter().all(|word| line.contains(word));
    text.lines().filter(has).map(str::to_owned).collect()
}

/// A mailbox of the test's own on a node, beside those of its probe: packages between two of them may have the class of
/// probes.
fn mailbox_on(node: &str) -> Name {
    let index = NODES.iter().position(|(name, ..)| *name == node).unwrap() as u8;
    Name::new(1, 96, index, 200)
}
