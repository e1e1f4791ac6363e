//! The system and its nodes: its computers, and the tool instances of each.

use crate::reader::{Item, Section, is_word, nearest};
use std::net::IpAddr;
use std::ops::RangeInclusive;

/// One robot or station.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct System {
    /// Its name.
    pub name: String,
    /// First byte of the names of its mailboxes, 1..=254.
    pub id: u8,
}

/// One computer of a system.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Node {
    /// Its name: `main` of `[nodes.main]`.
    pub name: String,
    /// How it reaches the other nodes.
    pub reach: Reach,
    /// Where the other nodes of its LAN reach it; there if there are several.
    pub address: Option<IpAddr>,
    /// Permission bits of its shared-memory directory.
    pub mode: u32,
    /// Instances of class `tool` on this node, at least two: the first is launch's, programs run by hand take the
    /// others.
    pub tools: RangeInclusive<u8>,
    /// Line in the file.
    pub line: usize,
}

/// How a node and the others reach each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reach {
    /// By datagrams, on the LAN of the system.
    Lan,
    /// Through the TCP router alone, from wherever it is.
    Tcp,
}

/// Value of the key `network` of a node.
const LAN: &str = "lan";
const TCP: &str = "tcp";

/// Those of some nodes that are on the LAN: they come first.
pub(crate) fn on_lan(nodes: &[Node]) -> &[Node] {
    &nodes[..nodes.iter().take_while(|node| node.reach == Reach::Lan).count()]
}

/// The place of the node with this name in the file, or what is wrong with the name.
pub(crate) fn place(nodes: &[Node], name: &str) -> Result<u8, String> {
    let names = || nodes.iter().map(|node| node.name.as_str());
    let place = names().zip(0..).find(|(known, _)| *known == name).map(|(_, place)| place);
    place.ok_or_else(|| match nearest(name, names()) {
        Some(known) => format!("there is no node `{name}`; did you mean `{known}`?"),
        None => format!("there is no node `{name}`; the nodes are {}", names().collect::<Vec<_>>().join(", ")),
    })
}

impl System {
    pub(crate) fn read(section: Option<Section<'_>>) -> Self {
        let mut system = Self { name: "robot".into(), id: 1 };
        let Some(section) = section else { return system };
        if let Some(name) = section.required("name", "name = \"robot\"").and_then(|item| item.text("robot")) {
            system.name = name.into();
        }
        // 0 means one's own system, 255 all systems.
        if let Some(id) = section.required("id", "id = 1").and_then(|item| item.whole(1..=254, 1)) {
            system.id = id;
        }
        section.finish();
        system
    }
}

impl Node {
    /// The instance of class `tool` under which launch takes commands.
    pub fn launch_instance(&self) -> u8 {
        *self.tools.start()
    }

    /// Those that programs run by hand take.
    pub fn tools_by_hand(&self) -> RangeInclusive<u8> {
        self.tools.start().saturating_add(1)..=*self.tools.end()
    }

    pub(crate) fn read_all(section: Option<Section<'_>>) -> Vec<Self> {
        let Some(section) = section else { return Vec::new() };
        let items = section.entries();
        if items.is_empty() {
            section.report("no node; add one, such as `[nodes.main]`");
        }
        let on_lan = items.iter().filter(|item| !item.has("network", TCP)).count();
        let mut nodes: Vec<Self> = Vec::new();
        for item in &items {
            let alone = Alone { on_lan: on_lan == 1, at_all: items.len() == 1 };
            let node = Self::read(item, alone, &nodes);
            nodes.extend(node);
        }
        // So those of the LAN have the first places, by which they call each other.
        nodes.sort_by_key(|node| node.reach == Reach::Tcp);
        nodes
    }

    fn read(item: &Item<'_>, alone: Alone, earlier: &[Self]) -> Option<Self> {
        let name = item.key.clone();
        if !is_word(&name) {
            item.report(format!("`{name}` is no node name; use lower-case letters, digits and `-`, a letter first"));
        }
        let section = item.section(&format!("node `{name}`"))?;
        let reach = section.or("network", Reach::Lan, |item| item.choice(&[(LAN, Reach::Lan), (TCP, Reach::Tcp)]));
        let address = match (section.get("address"), reach) {
            (Some(item), Reach::Tcp) => {
                item.report(
                    "`address` is where others on the LAN reach a node, and with `network = \"tcp\"` nobody does; drop \
                     one of both",
                );
                None
            }
            (Some(item), Reach::Lan) => read_address(&item, earlier),
            (None, Reach::Lan) if !alone.on_lan => {
                section.report(format!(
                    "`address` is missing: with several nodes the others must know where this one is; write for \
                     example `address = \"10.77.0.{}\"`, or `network = \"tcp\"` if it reaches them through the TCP \
                     router alone",
                    earlier.len() + 1
                ));
                None
            }
            (None, _) => None,
        };
        let mode = section.or("mode", 0o700, read_mode);
        let tools = match section.get("tools") {
            Some(item) => read_tools(&item, earlier),
            None if alone.at_all => Some(0..=63),
            None => {
                section.report(format!(
                    "`tools` is missing: with several nodes each needs tool instances of its own; write `tools = {}`",
                    free_tools(earlier)
                ));
                None
            }
        };
        section.finish();
        Some(Self { name, reach, address, mode, tools: tools.unwrap_or(0..=63), line: item.line })
    }
}

/// Keys that a node may leave out, since nothing uses them.
#[derive(Clone, Copy)]
struct Alone {
    /// No other node is on its LAN.
    on_lan: bool,
    /// There is no other node.
    at_all: bool,
}

fn read_mode(item: &Item<'_>) -> Option<u32> {
    let text = item.text("0700")?;
    let mode = u32::from_str_radix(text, 8).ok().filter(|mode| *mode <= 0o777 && mode & 0o700 == 0o700);
    if mode.is_none() {
        item.report(format!(
            "`mode` \"{text}\" would lock its owner out or is not octal; write \"0700\" (only this user) or \"0770\" \
             (its group)"
        ));
    }
    mode
}

/// An address that the others reach: of one computer alone, of the same family as theirs.
fn read_address(item: &Item<'_>, earlier: &[Node]) -> Option<IpAddr> {
    let text = item.text("192.168.0.1")?;
    let Ok(address) = text.parse::<IpAddr>() else {
        item.report(format!(
            "`address` \"{text}\" is no IP address; write numbers, such as `address = \"192.168.0.1\"` or \"fd00::1\": \
             a robot must not wait for a name server"
        ));
        return None;
    };
    let why = match address {
        _ if address.is_unspecified() || address.is_multicast() => Some("is not that of one computer"),
        IpAddr::V4(v4) if v4.is_broadcast() => Some("is not that of one computer"),
        IpAddr::V6(v6) if v6.is_unicast_link_local() => {
            Some("needs an interface beside it; give the node one from fd00::/8")
        }
        IpAddr::V6(v6) if v6.to_ipv4_mapped().is_some() => Some("is an IPv4 address in disguise; write that one"),
        _ => None,
    };
    if let Some(why) = why {
        item.report(format!("`address` \"{text}\" {why}"));
    }
    if let Some(other) = earlier.iter().find(|node| node.address == Some(address)) {
        item.report(format!("`address` \"{text}\" is that of node `{}`; each node has its own", other.name));
    }
    let differs = |node: &&Node| node.address.is_some_and(|other| other.is_ipv4() != address.is_ipv4());
    if let Some(other) = earlier.iter().find(differs) {
        let (own, theirs) = if address.is_ipv4() { ("IPv4", "IPv6") } else { ("IPv6", "IPv4") };
        item.report(format!(
            "`address` \"{text}\" is {own} and that of node `{}` {theirs}, which cannot reach each other; take one \
             kind for all",
            other.name
        ));
    }
    Some(address)
}

fn read_tools(item: &Item<'_>, earlier: &[Node]) -> Option<RangeInclusive<u8>> {
    let bounds = item.list("[0, 63]")?;
    let [first, last] = &bounds[..] else {
        item.report(format!(
            "`tools` has {} numbers; write the first and the last instance, `tools = [0, 63]`",
            bounds.len()
        ));
        return None;
    };
    let (first, last) = (first.whole(0..=255, 0)?, last.whole(0..=255, 63)?);
    if first > last {
        item.report(format!("`tools` ends before it begins; write `tools = [{last}, {first}]`"));
        return None;
    }
    if first == last {
        let (low, high) = if last == u8::MAX { (first - 1, last) } else { (first, last + 1) };
        item.report(format!(
            "`tools` [{first}, {last}] is one instance: launch takes the first, and programs run by hand need another; \
             write `tools = [{low}, {high}]` or more"
        ));
    }
    if let Some(other) = earlier.iter().find(|node| *node.tools.start() <= last && first <= *node.tools.end()) {
        item.report(format!(
            "`tools` [{first}, {last}] overlaps those of node `{}`, [{}, {}], and a tool instance is on one node; \
             write for example `tools = {}`",
            other.name,
            other.tools.start(),
            other.tools.end(),
            free_tools(earlier)
        ));
    }
    Some(first..=last)
}

/// A range that no earlier node has, as the file writes it.
fn free_tools(earlier: &[Node]) -> String {
    let last = earlier.iter().map(|node| *node.tools.end()).max();
    match last {
        Some(255) => "[...]` and take smaller ranges on the others, such as `[0, 63]".into(),
        Some(last) => format!("[{}, {}]", last + 1, last.saturating_add(64)),
        None => "[0, 63]".into(),
    }
}
