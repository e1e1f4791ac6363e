//! The LAN of an installation: the nodes' places there, and the node of each name.

use crate::classes::ROUTER;
use crate::installation::Installation;
use crate::keys::Keys;
use crate::module::Module;
use rohrpost_mailbox::Name;
use rohrpost_network::{Route, Security};

const UNPROTECTED: &str =
    "security = \"none\": packages between nodes are neither sealed nor signed; use a network that nobody else reaches";

impl Installation {
    /// The security note on the LAN, which `check` and every start print; none if nothing goes over it.
    pub fn security_text(&self) -> Option<String> {
        let network = self.network?;
        Some(match (network.security, &self.keys) {
            (Security::Keys, Some(folder)) => {
                format!(
                    "security = \"keys\": what passes between nodes is sealed with {}",
                    Keys::file(folder).display()
                )
            }
            _ => UNPROTECTED.into(),
        })
    }

    /// The place of a node in the file, from 0: its number among routers.
    pub fn node_index(&self, node: &str) -> Option<u8> {
        self.nodes.iter().position(|known| known.name == node).and_then(|index| u8::try_from(index).ok())
    }

    /// The place of a node on the LAN, which is its place among all nodes; none if it is not there.
    pub fn lan_index(&self, node: &str) -> Option<u8> {
        self.node_index(node).filter(|index| usize::from(*index) < self.lan_nodes().len())
    }

    /// The router of a node; none if it is not on the LAN, or alone there.
    pub fn router_of(&self, node: &str) -> Option<Name> {
        let class = self.classes.id(ROUTER).filter(|_| self.network.is_some())?;
        self.lan_index(node).map(|index| Name::new(self.system.id, class.0, index, rohrpost_mailbox::local::COMMANDS))
    }

    /// All names that lie on other nodes of the LAN than this one: their modules, aliases and tools, each with all its
    /// mailboxes, except [those that move](Self::moving_names). Sorted by name; no two overlap.
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
            let stays = |module: &&Module| !module.has_standby();
            let names = self.modules_on(&other.name).filter(stays).flat_map(Module::names);
            routes.extend(names.map(|name| whole(name, name)));
        }
        routes.sort_by_key(|route| route.first);
        routes
    }
}
