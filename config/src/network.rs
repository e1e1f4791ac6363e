//! The network between the nodes of a system, section `[network]`: how routers send, and the node of each name.
//!
//! It exists exactly when there are several nodes. Then each node has a router, a module without a `[[module]]`:
//! `router.0` on the first node of the file, `router.1` on the second, and so on.

use crate::classes::{ClassTable, ROUTER};
use crate::keys;
use crate::module::{Lines, Module};
use crate::node::Node;
use crate::reader::Section;
use crate::restart::{Restart, RestartPolicy};
use crate::units::rate_text;
use rohrpost_mailbox::Name;
use rohrpost_network::{NODES_MAX, Network, PAYLOAD_MAX, Security, Tdma};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Required choice of a file with several nodes.
const CHOICES: &str = "write `security = \"keys\"` (what passes between nodes is sealed; `rohrpost keys new` makes \
                       what it takes), or `security = \"none\"` (it is neither sealed nor signed, and anyone on the \
                       network may read and send)";
const PORT: u16 = 21_117;
const MTU: u16 = 1500;
const MTUS: RangeInclusive<u16> = 576..=65_535;
/// Every link with IPv6 carries datagrams of this size (RFC 8200).
const MTU_V6_MIN: u16 = 1280;
const RATE: u64 = 100 << 20;
/// At the least rate a largest package takes a second, two thirds of the longest wait of a package.
const RATES: RangeInclusive<u64> = 64 << 10..=64 << 30;
const QUOTA: u64 = 256 << 10;
/// Two largest packages, so that a sender's second one does not push the first out.
const QUOTAS: RangeInclusive<u64> = 128 << 10..=64 << 20;
const BULK_BELOW: u8 = 16;

/// `nodes` are those of the LAN, `tdma` the time slots in which they send, if they do.
pub(crate) fn read(section: Section<'_>, nodes: &[Node], tdma: Option<&Tdma>) -> Network {
    if nodes.len() == 1 {
        section.report(
            "there is one node on the LAN, so nothing goes over that; drop this section, or add the other nodes",
        );
    }
    let security = read_security(&section);
    let port = section.whole_or("port", 1024..=65_532, PORT);
    let is_v6 = nodes.iter().filter_map(|node| node.address).any(|address| address.is_ipv6());
    let least = if is_v6 { MTU_V6_MIN } else { *MTUS.start() };
    let mtu = section.whole_or("mtu", least..=*MTUS.end(), MTU);
    // The readers of the slots and of the keys' folder validate these.
    let _ = (section.get("mode"), section.get("keys"));
    let rate = section.or("rate", RATE, |item| match tdma {
        None => item.size(RATES, "100 MiB"),
        Some(tdma) => {
            let link = rate_text(tdma.link_bytes_s * 8);
            item.report(format!(
                "`rate`: with time slots a node sends what its slots hold at the `link` of [tdma], {link}; drop `rate`"
            ));
            None
        }
    });
    let quota = section.or("quota", QUOTA, |item| item.size(QUOTAS, "256 KiB"));
    let bulk_below = section.whole_or("bulk-below", 0..=255, BULK_BELOW);
    section.finish();
    let around = Network::around_bytes(is_v6, security);
    Network {
        security,
        port,
        mtu,
        datagram_bytes_max: (usize::from(mtu) - around).min(PAYLOAD_MAX - security.tag_bytes()),
        rate_bytes_s: tdma.map_or(rate, |tdma| tdma.link_bytes_s),
        quota_bytes: quota as usize,
        bulk_below,
    }
}

/// The part that must be equal at both ends of the wire.
pub(crate) fn lan_text(network: &Network) -> String {
    let sealed = if network.security == Security::Keys { " sealed" } else { "" };
    format!("port {} mtu {}{sealed}", network.port, network.mtu)
}

/// A required key without a likely value: so an error names both.
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

/// Validates that there are no more nodes than have a number, those beyond the LAN included.
pub(crate) fn validate_count(file: &Section<'_>, nodes: &[Node]) {
    if let Some(node) = nodes.get(NODES_MAX) {
        file.reader.report(node.line, format!("[nodes]: there are {}; a system has at most {NODES_MAX}", nodes.len()));
    }
}

/// Validates what several nodes of a LAN need beside `[network]`: addresses that can reach each other, and the class of
/// routers.
pub(crate) fn validate(file: &Section<'_>, nodes: &[Node], classes: &ClassTable) {
    if nodes.len() < 2 {
        return;
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

/// The routers of the nodes of a LAN, which have no `[[module]]`; their messages name the line of the node.
pub(crate) fn routers(nodes: &[Node], classes: &ClassTable, system: u8) -> Vec<(Module, Lines)> {
    let Some(class) = classes.id(ROUTER).filter(|_| nodes.len() > 1) else { return Vec::new() };
    // Without it the node is cut off, so launch never gives it up: the pauses grow, so that the limit is never reached.
    // The first pause is short, since packages that peers send meanwhile soon are too old.
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
