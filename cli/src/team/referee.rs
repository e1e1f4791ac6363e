//! What the arena's referee says, and the end of a run.

use crate::look::newest;
use crate::terminal::Failure;
use crate::terminal::units::counted;
use rohrpost::interfaces::{ArenaConduct, ArenaCounts, ArenaInterface, ArenaRefusal, ArenaState, TeamCell};
use rohrpost::wire::{append, from_bytes};
use rohrpost::{Name, ToolLink};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Node, node_directory};
use std::fmt;
use std::time::Duration;

/// The function of an arena that adds an intruder.
const ADD_INTRUDER: u16 = 16;
/// Timeout for an answer.
const PATIENCE: Duration = Duration::from_millis(500);

/// The arena, as a tool on its node has it.
pub(crate) struct ArenaReferee {
    tool: ToolLink,
    arena: Name,
    pub(crate) state: ArenaState,
}

impl ArenaReferee {
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

    /// Puts an intruder that stands into a cell.
    pub(crate) fn add_intruder(&mut self, cell: TeamCell) -> Result<(), Failure> {
        let write = |body: &mut Vec<u8>| append(body, &(cell, ArenaConduct::Stands));
        let read = |bytes: &[u8]| from_bytes::<Result<u32, ArenaRefusal>>(bytes);
        self.tool.call(self.arena, ADD_INTRUDER, ArenaInterface::hash(), write, read)??;
        Ok(())
    }

    /// Leaves the arena's node; what the referee said last.
    pub(crate) fn leave(self) -> Verdict {
        self.tool.close();
        Verdict(self.state)
    }

    /// Whether there are intruders, and robots are in all entrances of each that they can reach.
    pub(crate) fn is_blocked(&self) -> bool {
        is_blocked(&self.state)
    }

    /// What the referee says now.
    pub(crate) fn verdict(&self) -> String {
        told(&self.state)
    }
}

/// What a referee said last.
pub(crate) struct Verdict(ArenaState);

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&told(&self.0))
    }
}

impl Verdict {
    /// Whether no robot did what robots must not.
    pub(crate) fn is_well(&self) -> bool {
        let ArenaCounts { two_in_cell, swaps, .. } = self.0.counts;
        self.has_no_touch() && two_in_cell + swaps == 0
    }

    /// Whether no robot touched what it moved towards. Cells are shared by those that hear each other alone.
    pub(crate) fn has_no_touch(&self) -> bool {
        !self.0.robots.is_empty() && self.0.counts.touches_towards == 0
    }

    /// Whether there are intruders, and robots are in all entrances of each that they can reach.
    pub(crate) fn is_blocked(&self) -> bool {
        is_blocked(&self.0)
    }
}

fn is_blocked(state: &ArenaState) -> bool {
    !state.intruders.is_empty() && state.intruders.iter().all(|intruder| intruder.open.is_empty())
}

/// What robots touched, and what is open.
fn told(state: &ArenaState) -> String {
    let ArenaCounts { touches_towards, touches, two_in_cell, swaps } = state.counts;
    let open: usize = state.intruders.iter().map(|intruder| intruder.open.len()).sum();
    let entrances = match (state.intruders.len(), open) {
        (0, _) => "no intruder".into(),
        (_, 0) => "all reachable entrances held".to_owned(),
        (_, open) => format!("{} open", counted(open as u64, "reachable entrance")),
    };
    format!(
        "{touches_towards} touches by robots that moved towards what they touched, of {touches} in all; two in one \
         cell: {two_in_cell}; swaps: {swaps}; {entrances}"
    )
}
