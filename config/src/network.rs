//! The network between the nodes of a system, section `[network]`: how routers send, and which name lies on which node.
//!
//! It is there exactly when there are several nodes. Then each node has a router, a module that no `[[module]]` describes: `router.0`
//! on the first node of the file, `router.1` on the second, and so on.

use crate::classes::{ClassTable, ROUTER};
use crate::installation::Installation;
use crate::keys::{self, Keys};
use crate::mailbox::MailboxSpec;
use crate::module::{Lines, Module, Restart, RestartPolicy};
use crate::node::Node;
use crate::reader::Section;
use crate::tdma::Tdma;
use crate::units::rate_text;
use rohrpost_mailbox::{BODY_BYTES_MAX, Full, Name, Priority};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Most nodes of a system.
pub const NODES_MAX: usize = 64;
/// Level of what is not real time; the real-time levels 0..=30 go before it.
pub const LEVEL_NOT_REAL_TIME: u8 = 31;
/// The mailbox in which a router takes what goes to other nodes: slots for the largest body each. What has waited longer than its
/// `max_age` is dropped, and its caller not told: only a stopped router leaves it there for so long, and the caller's next try gets through,
/// where an answer would end its call. A participant has a sender into it, and so a claim, for
/// each mailbox of another node that it sends to.
pub const TRANSIT: MailboxSpec = MailboxSpec {
    slots: 64,
    size: BODY_BYTES_MAX as u32,
    full: Full::Displace,
    max_age: Some(Duration::from_secs(2)),
    claims: u8::MAX,
};
/// Where there are time slots, a router looks so often between two of them whether half of that mailbox is full; then it takes all.
pub const TRANSIT_LOOK: Duration = Duration::from_micros(1500);

/// Behind what is sealed.
const TAG_BYTES: usize = 16;
/// What a file with several nodes must say.
const CHOICES: &str = "write `security = \"keys\"` (what passes between nodes is sealed; `rohrpost keys new` makes what it takes), or \
                       `security = \"none\"` (it is neither sealed nor signed, and anyone on the network may read and send)";
const PORT: u16 = 21_117;
const MTU: i64 = 1500;
const MTUS: RangeInclusive<i64> = 576..=65_535;
/// Every link that carries IPv6 carries datagrams so large (RFC 8200).
const MTU_V6_MIN: i64 = 1280;
/// Heads of IP and UDP, in bytes.
const HEADS_V4: usize = 20 + 8;
const HEADS_V6: usize = 40 + 8;
/// Most that UDP over IPv4 carries, in bytes.
const PAYLOAD_MAX: usize = 65_507;
const RATE: u64 = 100 << 20;
/// A largest package at the least takes a second, two thirds of what a package may wait.
const RATES: RangeInclusive<u64> = 64 << 10..=64 << 30;
const QUOTA: u64 = 256 << 10;
/// Two largest packages, so that a sender's second one does not push the first out.
const QUOTAS: RangeInclusive<u64> = 128 << 10..=64 << 20;
const BULK_BELOW: u8 = 16;

/// Whether what routers say to each other is sealed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Security {
    /// Neither sealed nor signed, and the file says so in words.
    None,
    /// Sealed with the keys in [`Installation::keys`].
    Keys,
}

impl Security {
    /// As the file writes it.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Keys => "keys",
        }
    }

    /// Bytes behind what each datagram says.
    pub const fn tag_bytes(self) -> usize {
        match self {
            Self::None => 0,
            Self::Keys => TAG_BYTES,
        }
    }
}

/// How the routers of an installation send.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Network {
    /// Whether it is sealed.
    pub security: Security,
    /// UDP port of packages; time has the next one, and packages that are not real time the one behind that.
    pub port: u16,
    /// Largest IP packet that every link carries, in bytes.
    pub mtu: u16,
    /// Largest datagram, in bytes behind the heads of IP and UDP, and without what seals it.
    pub datagram_bytes_max: usize,
    /// Bytes a second that a router sends at most, the heads of IP and UDP and what seals counted; with time slots those that the link carries.
    pub rate_bytes_s: u64,
    /// Bytes of one sender's packages that its node's router keeps waiting.
    pub quota_bytes: usize,
    /// Classes below this id are not real time.
    pub bulk_below: u8,
}

/// Mailbox names of another node: all from the first to the last, by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Route {
    /// First of them.
    pub first: Name,
    /// Last of them.
    pub last: Name,
    /// The node, by its place in the file.
    pub node: u8,
}

impl Network {
    /// What `check` says of it, and each start of a router.
    pub const UNPROTECTED: &str = "security = \"none\": packages between nodes are neither sealed nor signed; use a network that nobody else reaches";

    /// UDP port of time.
    pub fn time_port(&self) -> u16 {
        self.port + 1
    }

    /// UDP port of packages that are not real time, where there are no time slots.
    pub fn rest_port(&self) -> u16 {
        self.port + 2
    }

    /// In which of a router's queues a package waits: 0 goes first, 30 is the last real-time level, [`LEVEL_NOT_REAL_TIME`] goes when all
    /// others are empty. The highest four bits of the priority count, as in RTnet (seed 002, 4.2); each of its 16 levels takes two of ours,
    /// so that there is room for what routers themselves have to say.
    pub fn level(&self, priority: Priority) -> u8 {
        level(priority, self.bulk_below)
    }

    /// What each datagram takes besides what it says: the heads of IP and UDP before it, and what seals it behind it.
    pub fn around_bytes(is_v6: bool, security: Security) -> usize {
        let heads = if is_v6 { HEADS_V6 } else { HEADS_V4 };
        heads + security.tag_bytes()
    }

    /// `nodes` are those of the LAN, `tdma` the time slots in which they send, if they do.
    pub(crate) fn read(section: Section<'_>, nodes: &[Node], tdma: Option<&Tdma>) -> Self {
        if nodes.len() == 1 {
            section.report(
                "there is one node on the LAN, so nothing goes over that; drop this section, or add the other nodes",
            );
        }
        let security = read_security(&section);
        let port = section.get("port").and_then(|item| item.whole(1024..=65_533, PORT.into()));
        let is_v6 = nodes.iter().filter_map(|node| node.address).any(|address| address.is_ipv6());
        let least = if is_v6 { MTU_V6_MIN } else { *MTUS.start() };
        let mtu = section.get("mtu").and_then(|item| item.whole(least..=*MTUS.end(), MTU)).unwrap_or(MTU) as usize;
        // Whoever reads the slots has judged it, and whoever looks for the keys their folder.
        let _ = (section.get("mode"), section.get("keys"));
        let rate = section.get("rate").and_then(|item| match tdma {
            None => item.size(RATES, "100 MiB"),
            Some(tdma) => {
                let link = rate_text(tdma.link_bytes_s * 8);
                item.report(format!(
                    "`rate`: with time slots a node sends what its slots hold at the `link` of [tdma], {link}; drop `rate`"
                ));
                None
            }
        });
        let quota = section.get("quota").and_then(|item| item.size(QUOTAS, "256 KiB"));
        let bulk = section.get("bulk-below").and_then(|item| item.whole(0..=255, BULK_BELOW.into()));
        section.finish();
        let around = Self::around_bytes(is_v6, security);
        Self {
            security,
            port: port.map_or(PORT, |port| port as u16),
            mtu: mtu as u16,
            datagram_bytes_max: (mtu - around).min(PAYLOAD_MAX - security.tag_bytes()),
            rate_bytes_s: tdma.map_or(rate.unwrap_or(RATE), |tdma| tdma.link_bytes_s),
            quota_bytes: quota.unwrap_or(QUOTA) as usize,
            bulk_below: bulk.map_or(BULK_BELOW, |bulk| bulk as u8),
        }
    }

    /// What must be equal at both ends of the wire.
    pub(crate) fn lan_text(&self) -> String {
        let sealed = if self.security == Security::Keys { " sealed" } else { "" };
        format!("port {} mtu {}{sealed}", self.port, self.mtu)
    }
}

/// The level of a priority, if classes below `bulk_below` are not real time.
pub(crate) fn level(priority: Priority, bulk_below: u8) -> u8 {
    if priority.0 < bulk_below { LEVEL_NOT_REAL_TIME } else { (15 - (priority.0 >> 4)) * 2 }
}

/// It must be said. What would be right is not known: so an error names both.
fn read_security(section: &Section<'_>) -> Security {
    let Some(item) = section.get("security") else {
        section.report(format!("`security` is missing; {CHOICES}"));
        return Security::None;
    };
    item.choice(&[Security::Keys, Security::None].map(|security| (security.as_str(), security)))
        .unwrap_or(Security::None)
}

/// The folder with the keys; none if nothing is sealed.
pub(crate) fn keys_folder(file: &Section<'_>, security: Security, folder: &Path) -> Option<PathBuf> {
    let item = file.section("network", "[network]")?.get("keys");
    if security == Security::None {
        let mistake = "`keys` without `security = \"keys\"`: nothing would be sealed with them; write both, or neither";
        item.inspect(|item| item.report(mistake));
        return None;
    }
    let named = item.map_or(Some(keys::FOLDER), |item| item.text(keys::FOLDER));
    named.map(|path| folder.join(path))
}

/// Judges what several nodes of a LAN need beside `[network]`: addresses that can reach each other, and the class of routers.
pub(crate) fn judge(file: &Section<'_>, nodes: &[Node], classes: &ClassTable) {
    if nodes.len() < 2 {
        return;
    }
    if let Some(node) = nodes.get(NODES_MAX) {
        file.reader.report(node.line, format!("[nodes]: there are {}; a system has at most {NODES_MAX}", nodes.len()));
    }
    if file.get("network").is_none() {
        file.report(format!("section `[network]` is missing; with several nodes add it, and {CHOICES}"));
    }
    if classes.id(ROUTER).is_none() {
        let line = file.get("classes").map_or(file.line, |classes| classes.line);
        file.reader.report(
            line,
            "[classes]: class `router` is missing, and with several nodes each has a router; \
             add `router = { id = 250, text = \"Carries packages between nodes\" }`",
        );
    }
}

/// The routers of the nodes of a LAN, which no `[[module]]` describes; their messages name the line of the node.
pub(crate) fn routers(nodes: &[Node], classes: &ClassTable, system: u8) -> Vec<(Module, Lines)> {
    let Some(class) = classes.id(ROUTER).filter(|_| nodes.len() > 1) else { return Vec::new() };
    // Without it the node is cut off, so it is never given up: pauses grow, so that so many in a second cannot be. The first is short,
    // since what peers send meanwhile soon is too old.
    let restart = Restart {
        policy: RestartPolicy::Always,
        backoff: Duration::from_millis(10),
        at_most: 1000,
        within: Duration::from_secs(1),
    };
    let router = |(index, node): (usize, &Node)| {
        let name = Name::new(system, class.0, index as u8, rohrpost_mailbox::local::COMMANDS);
        Module::by_itself(name, node, ROUTER, restart)
    };
    nodes.iter().take(NODES_MAX).enumerate().map(router).collect()
}

impl Installation {
    /// What `check` and every start say of the security of the LAN; none if nothing goes over it.
    pub fn security_text(&self) -> Option<String> {
        let network = self.network?;
        Some(match (network.security, &self.keys) {
            (Security::Keys, Some(folder)) => {
                format!(
                    "security = \"keys\": what passes between nodes is sealed with {}",
                    Keys::file(folder).display()
                )
            }
            _ => Network::UNPROTECTED.into(),
        })
    }

    /// The place of a node in the file, from 0: what routers call it.
    pub fn node_index(&self, node: &str) -> Option<u8> {
        self.nodes.iter().position(|known| known.name == node).and_then(|index| u8::try_from(index).ok())
    }

    /// The place of a node on the LAN, which is that among all nodes; none if it is not there.
    pub fn lan_index(&self, node: &str) -> Option<u8> {
        self.node_index(node).filter(|index| usize::from(*index) < self.lan_nodes().len())
    }

    /// The router of a node; none if it is not on the LAN, or alone there.
    pub fn router_of(&self, node: &str) -> Option<Name> {
        let class = self.classes.id(ROUTER).filter(|_| self.network.is_some())?;
        self.lan_index(node).map(|index| Name::new(self.system.id, class.0, index, rohrpost_mailbox::local::COMMANDS))
    }

    /// All names that lie on other nodes of the LAN than this one: their modules, faces and tools, each with all its mailboxes. Sorted by name; no
    /// two overlap.
    pub fn routes_from(&self, node: &str) -> Vec<Route> {
        let mut routes = Vec::new();
        for (other, index) in self.lan_nodes().iter().zip(0..).filter(|(other, _)| other.name != node) {
            let whole = |first: Name, last: Name| Route {
                first: first.with_local(0),
                last: last.with_local(u8::MAX),
                node: index,
            };
            let tool = |instance: u8| Name::new(self.system.id, self.classes.tool().0, instance, 0);
            routes.push(whole(tool(*other.tools.start()), tool(*other.tools.end())));
            routes.extend(self.modules_on(&other.name).flat_map(Module::names).map(|name| whole(name, name)));
        }
        routes.sort_by_key(|route| route.first);
        routes
    }
}
