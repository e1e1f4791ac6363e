//! The way to other systems without a server, section `[team]`: one multicast group, or peers by system and address.
//!
//! With the section each node with an address there has a router of the team, a module without a `[[module]]`:
//! `team-router.0` on the first node of the file, `team-router.1` on the second, and so on.

mod hosts;
mod roster;

pub use hosts::{TEAM_PEERS_MAX, TeamPeer, hosts};
pub use roster::{RosterMistake, TeamHost, roster};

use crate::classes::{ClassTable, TEAM_ROUTER};
use crate::errors::Errors;
use crate::keys::Keys;
use crate::module::{Lines, Module};
use crate::node::Node;
use crate::reader::{Item, Section};
use crate::restart::{Restart, RestartPolicy};
use crate::scheduling::{Scheduling, SchedulingRule};
use crate::units::count_text;
use hosts::Peers;
use rohrpost_mailbox::{Name, local};
use rohrpost_network::NODES_MAX;
use std::net::{IpAddr, Ipv4Addr, SocketAddrV4};
use std::path::{Path, PathBuf};
use std::time::Duration;

const PORT: u16 = 21_121;
const KEYS: &str = "team-keys";
const GROUP: &str = "group = \"239.77.0.1:21121\"";
/// Required choice of the section.
const CHOICES: &str = "write `security = \"keys\"` (what systems send to each other is sealed with keys that all of \
                       them have; `rohrpost keys new team-keys` makes them), or `security = \"none\"` (it is neither \
                       sealed nor signed, and anyone on the network may read and send)";

/// The way to other systems without a server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Team {
    /// Where datagrams go.
    pub reach: TeamReach,
    /// The folder with the keys of the team; none: nothing is sealed.
    pub keys: Option<PathBuf>,
    /// The UDP port of each node.
    pub port: u16,
    /// Nodes with a router of the team, each with the address of the interface that it uses.
    addresses: Vec<(String, IpAddr)>,
}

/// How the other systems are reached.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TeamReach {
    /// By one multicast group, so that nobody needs to be known beforehand.
    Group(Ipv4Addr),
    /// By the addresses of those that are known.
    Peers {
        /// The file that lists them, if they do not stand in the section.
        hosts: Option<PathBuf>,
        /// All of them, by system; empty before the file has been read.
        peers: Vec<TeamPeer>,
    },
}

impl Team {
    /// Reads the file of hosts that the section names, if it names one. `own`: the system that reads.
    pub(crate) fn read_hosts(&mut self, own: u8) -> Result<(), Errors> {
        if let TeamReach::Peers { hosts: Some(path), peers } = &mut self.reach {
            *peers = hosts::read(path, own, self.port)?;
        }
        Ok(())
    }

    /// Security note that `check` and each start of a router print where nothing is sealed.
    pub const UNPROTECTED: &str = "[team], security = \"none\": what systems send to each other is neither sealed nor \
                                   signed, and any computer that reaches the network may take part; use a network \
                                   that nobody else reaches";

    /// Security note of `check`.
    pub fn security_text(&self) -> String {
        let sealed = |folder: &PathBuf| {
            let file = Keys::file(folder);
            format!("[team], security = \"keys\": what systems send to each other is sealed with {}", file.display())
        };
        self.keys.as_ref().map_or(Self::UNPROTECTED.into(), sealed)
    }

    /// The address of the interface that a node uses; none: it has no router of the team.
    pub fn address_of(&self, node: &str) -> Option<IpAddr> {
        self.addresses.iter().find(|(name, _)| name == node).map(|(_, address)| *address)
    }

    /// The peers that are known beforehand, by system; none with a group.
    pub fn peers(&self) -> &[TeamPeer] {
        match &self.reach {
            TeamReach::Group(_) => &[],
            TeamReach::Peers { peers, .. } => peers,
        }
    }

    /// What `explain` says, label by label.
    pub(crate) fn explained(&self) -> [(&'static str, String); 2] {
        let peers = |peers: &[TeamPeer]| count_text(peers.len(), "peer");
        let reach = match &self.reach {
            TeamReach::Group(group) => format!("UDP multicast to {group}, port {}", self.port),
            TeamReach::Peers { hosts: None, peers: all } => format!("UDP, port {}, to {}", self.port, peers(all)),
            TeamReach::Peers { hosts: Some(file), .. } => {
                format!("UDP, port {}, to the peers in {}", self.port, file.display())
            }
        };
        let node = |(name, address): &(String, IpAddr)| format!("{name} from {address}");
        let nodes: Vec<String> = self.addresses.iter().map(node).collect();
        let words = format!(
            "{reach}: packages for other systems, and for all, as well as the network carries them, none sent again; \
             {}",
            nodes.join(", ")
        );
        [("team", words), ("security", self.security_text())]
    }

    pub(crate) fn read(section: Section<'_>, system: u8, nodes: &[Node], folder: &Path) -> Self {
        let keys = keys(&section, folder);
        let addresses = section.required("address", "address = \"10.0.0.1\"");
        let addresses = addresses.map(|item| addresses_of(&item, nodes)).unwrap_or_default();
        let (group, peers) = (section.get("group"), section.get("peers"));
        let group = group.map(|item| (group_of(&item).unwrap_or((Ipv4Addr::UNSPECIFIED, PORT)), item));
        let port = match (&group, section.get("port")) {
            (Some(_), Some(item)) => {
                item.report("`port` is of no use beside `group`, which says it; drop it");
                PORT
            }
            (Some(((_, port), _)), None) => *port,
            (None, _) => section.whole_or("port", 1024..=65_535, PORT),
        };
        let reach = match (group, peers) {
            (Some(_), Some(peers)) => {
                peers.report("`peers` beside `group`: the group reaches all that listen to it; drop one of both");
                None
            }
            (Some(((group, _), item)), None) => {
                if let Some((_, v6)) = addresses.iter().find(|(_, address)| address.is_ipv6()) {
                    item.report(format!(
                        "`group` is of IPv4, and `address` {v6} is not; write the node's address of IPv4"
                    ));
                }
                Some(TeamReach::Group(group))
            }
            (None, Some(item)) => Some(peers_of(&item, system, port, folder)),
            (None, None) => {
                section.report(format!(
                    "neither `group` nor `peers` says which systems are reached; write for example `{GROUP}`, which \
                     reaches all systems on the network, or `peers = {{ 2 = \"10.0.0.2\" }}` where multicast does \
                     not pass"
                ));
                None
            }
        };
        // For `rohrpost team launch` alone, which reads it.
        section.get("launch");
        section.finish();
        let reach = reach.unwrap_or(TeamReach::Group(Ipv4Addr::UNSPECIFIED));
        Self { reach, keys, port, addresses }
    }
}

/// The folder with the keys; none: nothing is sealed.
fn keys(section: &Section<'_>, folder: &Path) -> Option<PathBuf> {
    let item = section.get("security");
    if item.is_none() {
        section.report(format!("`security` is missing; {CHOICES}"));
    }
    let is_sealed = item.and_then(|item| item.choice(&[("keys", true), ("none", false)]));
    match (section.get("keys"), is_sealed?) {
        (None, true) => Some(folder.join(KEYS)),
        (Some(item), true) => item.text(KEYS).map(|path| folder.join(path)),
        (Some(item), false) => {
            item.report("`keys` are of no use with `security = \"none\"`; write `security = \"keys\"`, or drop this");
            None
        }
        (None, false) => None,
    }
}

/// One address for the only node, or a table of nodes.
fn addresses_of(item: &Item<'_>, nodes: &[Node]) -> Vec<(String, IpAddr)> {
    if item.is_table() {
        let Some(section) = item.section("[team] address") else { return Vec::new() };
        return section.entries().iter().filter_map(|entry| address_in(entry, nodes)).collect();
    }
    let address = interface_address(item);
    match nodes {
        [node] => address.map(|address| (node.name.clone(), address)).into_iter().collect(),
        _ => {
            item.report(
                "`address` is one, and there are several nodes; write a table of those that take part, for example \
                 `address = { base = \"10.0.0.1\" }`",
            );
            Vec::new()
        }
    }
}

fn address_in(entry: &Item<'_>, nodes: &[Node]) -> Option<(String, IpAddr)> {
    if let Err(why) = crate::node::place(nodes, &entry.key) {
        entry.report(why);
    }
    Some((entry.key.clone(), interface_address(entry)?))
}

fn interface_address(item: &Item<'_>) -> Option<IpAddr> {
    let text = item.text("10.0.0.1")?;
    let is_one = |address: &IpAddr| !address.is_unspecified() && !address.is_multicast();
    let address = text.parse().ok().filter(is_one);
    if address.is_none() {
        item.report(format!(
            "`{}` \"{text}\" is not the IP address of one computer; write the one that this node has on the network \
             of the team, such as \"10.0.0.1\" (`ip addr` shows them)",
            item.key
        ));
    }
    address
}

fn group_of(item: &Item<'_>) -> Option<(Ipv4Addr, u16)> {
    let text = item.text("239.77.0.1:21121")?;
    let address = text.parse().ok().filter(|address: &SocketAddrV4| address.ip().is_multicast());
    let address = address.filter(|address| address.port() >= 1024);
    if address.is_none() {
        item.report(format!(
            "`group` \"{text}\" is no multicast address of IPv4 with a port from 1024 on; write for example `{GROUP}`"
        ));
    }
    address.map(|address| (*address.ip(), address.port()))
}

/// A table of systems, or the file that lists them.
fn peers_of(item: &Item<'_>, system: u8, port: u16, folder: &Path) -> TeamReach {
    if !item.is_table() {
        let hosts = item.text("hosts").map(|file| folder.join(file));
        return TeamReach::Peers { hosts, peers: Vec::new() };
    }
    let mut peers = Peers::new(system, port);
    for entry in item.section("[team] peers").map(|section| section.entries()).unwrap_or_default() {
        let texts = if entry.value.get_ref().is_array() {
            entry.texts("10.0.0.2")
        } else {
            entry.text("10.0.0.2").map(|text| (text, entry.line)).into_iter().collect()
        };
        for (text, line) in texts {
            if let Err(why) = peers.add(&entry.key, text) {
                entry.reader.report(line, format!("[team] `peers`: {why}"));
            }
        }
    }
    TeamReach::Peers { hosts: None, peers: peers.into_all() }
}

/// Validates what `[team]` needs beside it: its class, which must not be real time.
pub(crate) fn validate(file: &Section<'_>, classes: &ClassTable, scheduling: SchedulingRule) {
    let line = file.get("classes").map_or(file.line, |classes| classes.line);
    match classes.id(TEAM_ROUTER) {
        None => file.reader.report(
            line,
            "[classes]: class `team-router` is missing, and with [team] nodes have a router of the team; \
             add `team-router = { id = 65, text = \"Carries packages between systems\" }`",
        ),
        Some(class) if matches!(scheduling.of(class), Scheduling::Fifo { .. }) => file.reader.report(
            line,
            format!(
                "[classes]: class `team-router` has id {}, which is real time, and what comes from other systems must \
                 not keep this one waiting; give it an id below {}",
                class.0, scheduling.real_time_from
            ),
        ),
        Some(_) => {}
    }
}

/// The routers of the team, which have no `[[module]]`; their messages name the line of the node.
pub(crate) fn modules(team: Option<&Team>, nodes: &[Node], classes: &ClassTable, system: u8) -> Vec<(Module, Lines)> {
    let (Some(team), Some(class)) = (team, classes.id(TEAM_ROUTER)) else { return Vec::new() };
    // As for other routers, launch never gives it up: without it the system is alone.
    let restart = Restart {
        policy: RestartPolicy::Always,
        backoff: Duration::from_millis(50),
        at_most: 1000,
        within: Duration::from_secs(1),
    };
    let all = nodes.iter().take(NODES_MAX).zip(0..).filter(|(node, _)| team.address_of(&node.name).is_some());
    let name = |index| Name::new(system, class.0, index, local::COMMANDS);
    all.map(|(node, index)| Module::by_itself(name(index), node, TEAM_ROUTER, restart)).collect()
}
