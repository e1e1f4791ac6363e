//! What the arena's referee says, and the end of a run.

use crate::look::newest;
use crate::terminal::Failure;
use crate::terminal::units::counted;
use rohrpost::interfaces::{ArenaCounts, ArenaInterface, ArenaState};
use rohrpost::{Name, ToolLink};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Node, node_directory};
use std::time::Duration;

/// Timeout for an answer.
const PATIENCE: Duration = Duration::from_millis(500);

/// The arena, as a tool on its node has it.
pub(crate) struct Referee {
    pub(crate) tool: ToolLink,
    pub(crate) arena: Name,
    pub(crate) state: ArenaState,
}

impl Referee {
    /// Takes part on the arena's node.
    pub(crate) fn join(installation: &Installation) -> Result<Self, Failure> {
        let name = installation.nodes.first().map(|node| node.name.clone()).unwrap_or_default();
        let node = Node::open(&node_directory(&installation.name, &name))?;
        let tool = ToolLink::join(installation, &node, &name, PATIENCE)?;
        let arena = installation.classes.parse_module("arena.0")?;
        Ok(Self { tool, arena, state: ArenaState::default() })
    }

    /// Asks for the newest state; one that does not answer now is asked again.
    pub(crate) fn look(&mut self) {
        if let Ok((_, state)) = newest(&mut self.tool, self.arena, ArenaInterface::STATE) {
            self.state = state;
        }
    }

    /// Whether no robot did what robots must not.
    pub(crate) fn is_well(&self) -> bool {
        let ArenaCounts { touches_towards, two_in_cell, swaps, .. } = self.state.counts;
        !self.state.robots.is_empty() && touches_towards + two_in_cell + swaps == 0
    }

    /// Whether there are intruders, and robots are in all entrances of each that they can reach.
    pub(crate) fn is_blocked(&self) -> bool {
        let intruders = &self.state.intruders;
        !intruders.is_empty() && intruders.iter().all(|intruder| intruder.open.is_empty())
    }

    /// What robots touched, and what is open.
    pub(crate) fn verdict(&self) -> String {
        let ArenaCounts { touches_towards, touches, two_in_cell, swaps } = self.state.counts;
        let open: usize = self.state.intruders.iter().map(|intruder| intruder.open.len()).sum();
        let entrances = match (self.state.intruders.len(), open) {
            (0, _) => "no intruder".into(),
            (_, 0) => "all reachable entrances held".to_owned(),
            (_, open) => format!("{} open", counted(open as u64, "reachable entrance")),
        };
        format!(
            "{touches_towards} touches by robots that moved towards what they touched, of {touches} in all; two in one \
             cell: {two_in_cell}; swaps: {swaps}; {entrances}"
        )
    }
}
