//! Digests by which routers and modules notice that they were started from different files.
//!
//! The hash is over a canonical text of what must be equal, not over the file: comments, order and spelling do not
//! count. SipHash-2-4 with a fixed key gives the same on every node, compiler and release, which std's hasher does not
//! promise.

use crate::installation::Installation;
use crate::network;
use crate::node::Reach;
use crate::tdma;
use siphasher::sip::SipHasher24;
use std::fmt::Write;
use std::hash::Hasher;

/// Digests of an installation. A difference is a mistake to report, naming both.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Digest {
    /// Equal wherever packages are exchanged: the classes, by id and name.
    pub common: u64,
    /// Equal inside a system: its nodes, which of them are on the LAN, their tool instances, the node of each module,
    /// and the agreements of routers: port, MTU, masters of time and their interval, the time slots and their tunnel,
    /// the replicas.
    pub system: u64,
}

impl std::fmt::Display for Digest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:016x}-{:016x}", self.common, self.system)
    }
}

impl Digest {
    /// Both parts in one: what the datagrams of routers carry.
    pub fn lan(&self) -> u64 {
        hash(&format!("rohrpost lan 1\n{self}\n"))
    }
}

impl Installation {
    /// The digests of what must be equal elsewhere.
    pub fn digest(&self) -> Digest {
        Digest { common: hash(&self.common_text()), system: hash(&self.system_text()) }
    }

    fn common_text(&self) -> String {
        let mut text = String::from("rohrpost common 1\n");
        for entry in self.classes.iter() {
            // Writing into a String cannot fail.
            let _ = writeln!(text, "class {} {}", entry.class.0, entry.name);
        }
        text
    }

    fn system_text(&self) -> String {
        let mut lines = Vec::new();
        for node in &self.nodes {
            let address = node.address.map_or("-".into(), |address| address.to_string());
            let beyond = if node.reach == Reach::Tcp { " beyond" } else { "" };
            lines.push(format!("node {} {address:?} {} {}{beyond}", node.name, node.tools.start(), node.tools.end()));
        }
        for module in &self.modules {
            let mut names: Vec<String> = module.names().skip(1).map(|name| name.to_string()).collect();
            names.sort();
            let witness = self.witness_of(module).filter(|_| module.has_standby());
            let witness = witness.map_or(String::new(), |witness| format!(" witness {witness}"));
            let nodes = module.nodes.join(" ");
            lines.push(format!("module {} on {nodes} aliases {}{witness}", module.name, names.join(" ")));
        }
        // The order of the nodes is their index on the wire.
        if let Some(network) = &self.network {
            let order: Vec<&str> = self.lan_nodes().iter().map(|node| node.name.as_str()).collect();
            if let Some(tdma) = &self.tdma {
                lines.push(tdma::lan_text(tdma));
            }
            lines.push(format!(
                "network {} order {} time {}",
                network::lan_text(network),
                order.join(" "),
                self.time.lan_text()
            ));
        }
        lines.extend(self.replica_text());
        lines.sort();
        format!("rohrpost system 1\nsystem {} {:?}\n{}\n", self.system.id, self.system.name, lines.join("\n"))
    }
}

fn hash(text: &str) -> u64 {
    // `write`, not `Hash`: how `str` feeds a hasher may change with the compiler.
    let mut hasher = SipHasher24::new();
    hasher.write(text.as_bytes());
    hasher.finish()
}
