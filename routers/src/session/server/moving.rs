//! Names that move from node to node with their module. Nobody registers them: launch of the TCP router's node knows
//! which node has each, and a node is the client that hosts the name of its client, `tcp.I`.

use crate::moving::MovingNames;
use crate::session::frame::Range;
use rohrpost_mailbox::Name;
use std::sync::Arc;

/// The names that move, and the clients of the nodes that they move between.
#[derive(Clone, Debug, Default)]
pub struct MovingHosts {
    /// Where each is now.
    pub names: Arc<MovingNames>,
    /// Name of each node's client, by its place on the LAN.
    pub clients: Vec<Name>,
}

impl MovingHosts {
    /// Name of the client of the node that has a name: `None` if it does not move, `Some(None)` if nobody has it.
    pub(super) fn client_of(&self, name: Name) -> Option<Option<Name>> {
        let node = self.names.node_of(name)?;
        Some(node.and_then(|node| self.clients.get(usize::from(node)).copied()))
    }

    /// The names, each with all its mailboxes.
    pub(super) fn ranges(&self) -> impl Iterator<Item = Range> {
        self.names.ranges().map(|(first, last)| Range { first, last })
    }
}
