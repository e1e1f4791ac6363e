//! The TCP router, section `[tcp]`: packages that neither a node nor its LAN can deliver go through one server.
//!
//! With the section each node has a client of the server, a module without a `[[module]]`: `tcp.0` on the first node of
//! the file, `tcp.1` on the second, and so on. The server itself, `tcp.255`, runs on the node that `server` names; if
//! none does, another installation runs it.

use crate::classes::{ClassTable, TCP};
use crate::module::{Lines, Module, TCP_CLIENT, TCP_ROUTER};
use crate::node::{Node, Reach};
use crate::reader::Section;
use crate::restart::{Restart, RestartPolicy};
use crate::scheduling::{Scheduling, SchedulingRule};
use rohrpost_mailbox::{Name, Priority, local};
use rohrpost_network::{NODES_MAX, Tdma, level};
use std::net::{IpAddr, SocketAddr};
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::time::Duration;

const PORT: u16 = 21_119;
const CLIENTS: u16 = 256;
const CLIENTS_MAX: u16 = 4096;
const QUOTA: u64 = 1 << 20;
/// Two largest packages, so that the second does not push the first out.
const QUOTAS: RangeInclusive<u64> = 128 << 10..=64 << 20;
const BULK_BELOW: u8 = 16;
/// Usual smallest size of a LAN, in prefix bits.
const LAN_BITS_V4: u32 = 24;
const LAN_BITS_V6: u32 = 64;
/// Letters of a part of a domain name (RFC 1035).
const LABEL_MAX: usize = 63;
/// Instance of the TCP router: above the clients of the nodes, of which there are at most 64.
pub const TCP_SERVER: u8 = u8::MAX;

/// Address of the TCP router, and its limits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tcp {
    /// Where clients reach it.
    pub address: SocketAddr,
    /// The folder of certificates, relative to the file's; none: nothing is sealed.
    pub certificates: Option<PathBuf>,
    /// The node of this system that it runs on; none: another installation runs it.
    pub server: Option<String>,
    /// Clients at a time.
    pub clients: u16,
    /// Bytes of packages that wait for one connection.
    pub quota_bytes: usize,
    /// Classes below this id are not real time.
    pub bulk_below: u8,
}

impl Tcp {
    /// Security note that `check` and each start of a client or the server print.
    pub const UNPROTECTED: &str = "security = \"none\": packages to and from the TCP router are neither sealed nor \
                                   signed, and any computer that reaches its port may take part; use a \
         network that nobody else reaches";

    /// Security note of `check`.
    pub fn security_text(&self) -> String {
        match &self.certificates {
            None => Self::UNPROTECTED.into(),
            Some(folder) => {
                format!(
                    "security = \"tls\": TLS 1.3 to the TCP router, both ends with a certificate in {}",
                    folder.display()
                )
            }
        }
    }

    /// The level of a priority in a connection's queue, as in the routers of the LAN: 0 goes first.
    pub fn level(&self, priority: Priority) -> u8 {
        level(priority, self.bulk_below)
    }

    /// `tdma` are the time slots in which the nodes of the LAN send, if they do.
    pub(crate) fn read(section: Section<'_>, nodes: &[Node], tdma: Option<&Tdma>) -> Self {
        let security = section.required("security", "security = \"tls\"");
        let is_sealed = security.and_then(|item| item.choice(&[("none", false), ("tls", true)]));
        let certificates = certificates(&section, is_sealed);
        let address = section.required("address", "address = \"192.168.0.1\"").and_then(|item| {
            let text = item.text("192.168.0.1")?;
            let address =
                text.parse::<IpAddr>().ok().filter(|address| !address.is_unspecified() && !address.is_multicast());
            if address.is_none() {
                item.report(format!(
                    "`address` \"{text}\" is not the IP address of one computer; write numbers, such as `address = \
                     \"192.168.0.1\"`: a robot must not wait for a name server"
                ));
            }
            if let Some((address, tdma)) = address.zip(tdma).filter(|(address, _)| is_on_lan(*address, nodes)) {
                item.report(format!("`address` {address} {}", beside_slots(tdma)));
            }
            address
        });
        let port = section.whole_or("port", 1024..=65_535, PORT);
        let server = section.get("server").and_then(|item| {
            let name = item.text("base")?;
            let known: Vec<String> = nodes.iter().map(|node| format!("`{}`", node.name)).collect();
            if !nodes.iter().any(|node| node.name == name) {
                item.report(format!(
                    "`server` is \"{name}\", and there is no such node; write one of {}, or drop `server` if another \
                     installation runs the TCP router",
                    known.join(", ")
                ));
            }
            Some(name.to_owned())
        });
        let clients = section.whole_or("clients", 1..=CLIENTS_MAX, CLIENTS);
        let quota_bytes = section.or("quota", QUOTA, |item| item.size(QUOTAS, "1 MiB")) as usize;
        let bulk_below = section.whole_or("bulk-below", 0..=255, BULK_BELOW);
        section.finish();
        let address = SocketAddr::new(address.unwrap_or(IpAddr::from([127, 0, 0, 1])), port);
        Self { address, certificates, server, clients, quota_bytes, bulk_below }
    }
}

/// The folder of certificates: there exactly when sessions are sealed.
fn certificates(section: &Section<'_>, is_sealed: Option<bool>) -> Option<PathBuf> {
    const EXAMPLE: &str = "certificates = \"certificates\"";
    match (section.get("certificates"), is_sealed?) {
        (Some(item), true) => item.text("certificates").map(PathBuf::from),
        (None, true) => {
            section.report(format!(
                "`certificates` is missing; write for example `{EXAMPLE}`, the folder that `rohrpost keys new` fills"
            ));
            None
        }
        (Some(item), false) => {
            item.report(
                "`certificates` are of no use with `security = \"none\"`; write `security = \"tls\"`, or drop this",
            );
            None
        }
        (None, false) => None,
    }
}

/// Whether an address is among those of the nodes: in the smallest network that holds all of these, and is no larger
/// than usual ones.
fn is_on_lan(address: IpAddr, nodes: &[Node]) -> bool {
    let bits = |address: IpAddr| match address {
        IpAddr::V4(v4) => (u128::from(v4.to_bits()) << 96, LAN_BITS_V4),
        IpAddr::V6(v6) => (v6.to_bits(), LAN_BITS_V6),
    };
    let same_kind = nodes.iter().filter_map(|node| node.address).filter(|node| node.is_ipv4() == address.is_ipv4());
    let all: Vec<u128> = same_kind.map(|node| bits(node).0).collect();
    let Some(first) = all.first() else { return false };
    let (own, longest) = bits(address);
    let shared = all.iter().map(|other| (first ^ other).leading_zeros()).min().unwrap_or(0);
    (first ^ own).leading_zeros() >= shared.min(longest)
}

/// The mistake of an address on a network with time slots, and its remedy.
fn beside_slots(tdma: &Tdma) -> String {
    let right = match &tdma.tunnel {
        Some(tunnel) => format!(
            "write that of the TCP router's node in the tunnel of [tdma], {} for the first node of the file, or one on \
             another network",
            tunnel.address(0)
        ),
        None => "give [tdma] a `tunnel` and write an address in it, or one on another network".into(),
    };
    format!("is on the network of the time slots, and what goes there outside of slots disturbs them; {right}")
}

/// Validates what `[tcp]` needs beside it: its class, which must not be real time, so that it never delays what is.
pub(crate) fn validate(file: &Section<'_>, classes: &ClassTable, scheduling: SchedulingRule) {
    let line = file.get("classes").map_or(file.line, |classes| classes.line);
    match classes.id(TCP) {
        None => file.reader.report(
            line,
            "[classes]: class `tcp` is missing, and with [tcp] each node has a client of the TCP router; \
             add `tcp = { id = 64, text = \"Carries packages beyond the LAN\" }`",
        ),
        Some(class) if matches!(scheduling.of(class), Scheduling::Fifo { .. }) => file.reader.report(
            line,
            format!(
                "[classes]: class `tcp` has id {}, which is real time, and what goes beyond the LAN must not keep the \
                 LAN waiting; give it an id below {}",
                class.0, scheduling.real_time_from
            ),
        ),
        Some(_) => {}
    }
}

/// Validates the needs of nodes that are not on the LAN: a TCP router, and one that knows the time for them.
pub(crate) fn validate_nodes(file: &Section<'_>, tcp: Option<&Tcp>, nodes: &[Node]) {
    let is_beyond = |node: &&Node| node.reach == Reach::Tcp;
    validate_names(file, tcp, nodes);
    let Some(node) = nodes.iter().find(is_beyond) else { return };
    let Some(tcp) = tcp else {
        let what = format!(
            "node `{}`: `network = \"tcp\"`: the others are reached through the TCP router, and there is none; add \
             `[tcp]`, or drop `network` and write an `address`",
            node.name
        );
        return file.reader.report(node.line, what);
    };
    let server = nodes.iter().find(|node| tcp.server.as_ref() == Some(&node.name));
    if server.is_some_and(|server| !is_beyond(&server)) {
        return;
    }
    let homes: Vec<String> =
        nodes.iter().filter(|node| !is_beyond(node)).map(|node| format!("`{}`", node.name)).collect();
    let right = if homes.is_empty() {
        "drop `network` of the node that runs it".into()
    } else {
        format!("write one of {}", homes.join(", "))
    };
    let line = file.get("tcp").map_or(file.line, |tcp| tcp.line);
    file.reader.report(
        line,
        format!(
            "[tcp]: `server` names no node that is there without the TCP router, and node `{}`, with `network = \
             \"tcp\"`, has the time of that node; {right}",
            node.name
        ),
    );
}

/// A certificate names its node as a part of a domain name.
fn validate_names(file: &Section<'_>, tcp: Option<&Tcp>, nodes: &[Node]) {
    if tcp.is_none_or(|tcp| tcp.certificates.is_none()) {
        return;
    }
    for node in nodes.iter().filter(|node| node.name.len() > LABEL_MAX || node.name.ends_with('-')) {
        let what = format!(
            "[nodes]: `{}` fits in no certificate, of which `security = \"tls\"` in [tcp] makes use; take a name of \
             {LABEL_MAX} letters at most that does not end in `-`",
            node.name
        );
        file.reader.report(node.line, what);
    }
}

/// The clients of all nodes and the server, which have no `[[module]]`; their messages name the line of the node.
pub(crate) fn modules(tcp: Option<&Tcp>, nodes: &[Node], classes: &ClassTable, system: u8) -> Vec<(Module, Lines)> {
    let (Some(tcp), Some(class)) = (tcp, classes.id(TCP)) else { return Vec::new() };
    let name = |instance| Name::new(system, class.0, instance, local::COMMANDS);
    // As for routers, launch never gives it up: without it the node is cut off from what is beyond its LAN.
    let restart = Restart {
        policy: RestartPolicy::Always,
        backoff: Duration::from_millis(50),
        at_most: 1000,
        within: Duration::from_secs(1),
    };
    let server = nodes.iter().filter(|node| tcp.server.as_ref() == Some(&node.name));
    let server = server.map(|node| Module::by_itself(name(TCP_SERVER), node, TCP_ROUTER, restart));
    let clients = nodes
        .iter()
        .take(NODES_MAX)
        .zip(0..)
        .map(|(node, index)| Module::by_itself(name(index), node, TCP_CLIENT, restart));
    server.chain(clients).collect()
}
