//! The robots of a team's demo: what they say of their team, and the end of their programs.

use crate::look::newest;
use crate::terminal::Failure;
use rohrpost::interfaces::{PayloadBeats, PayloadInterface, TeamInterface, TeamState};
use rohrpost::{Name, ToolLink};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Node, node_directory};
use std::sync::Arc;
use std::time::Duration;

/// Timeout for a module's answer.
const PATIENCE: Duration = Duration::from_millis(500);
/// Beats of the greatest age of a fresh robot, 7.5, rounded up.
pub(super) const AGE_BEATS: u32 = 8;

/// A robot, as a tool on its computer has it.
pub(super) struct TeamRobot {
    pub(super) id: u8,
    pub(super) node: String,
    /// The part of the network in which it is.
    pub(super) part: usize,
    installation: Arc<Installation>,
    module: Name,
    payload: Name,
    tool: Option<ToolLink>,
    state: Option<TeamState>,
    /// Run and number of its newest hello when beats began to be counted.
    since: (u32, u32),
}

/// Takes part on the computers of all robots.
pub(super) fn join(installations: &[Arc<Installation>]) -> Result<Vec<TeamRobot>, Failure> {
    let robot = |installation: &Arc<Installation>| {
        let node = installation.nodes.first().map(|node| node.name.clone()).unwrap_or_default();
        let mut robot = TeamRobot {
            id: installation.system.id,
            node,
            part: 0,
            module: installation.classes.parse_module("team.0")?,
            payload: installation.classes.parse_module("payload.0")?,
            installation: installation.clone(),
            tool: None,
            state: None,
            since: (0, 0),
        };
        robot.come_back()?;
        Ok(robot)
    };
    installations.iter().map(robot).collect()
}

impl TeamRobot {
    /// The robot runs, perhaps again.
    pub(super) fn come_back(&mut self) -> Result<(), Failure> {
        let node = Node::open(&node_directory(&self.installation.name, &self.node))?;
        self.tool = Some(ToolLink::join(&self.installation, &node, &self.node, PATIENCE)?);
        Ok(())
    }

    /// The robot is about to be killed.
    pub(super) fn die(&mut self) {
        self.tool.take().into_iter().for_each(ToolLink::close);
        self.state = None;
    }

    pub(super) fn leave(mut self) {
        self.die();
    }

    pub(super) fn is_alive(&self) -> bool {
        self.tool.is_some()
    }

    /// Asks for the newest state; one that does not answer now is asked again.
    pub(super) fn look(&mut self) {
        let Some(tool) = &mut self.tool else { return };
        if let Ok((_, state)) = newest(tool, self.module, TeamInterface::STATE) {
            self.state = Some(state);
        }
    }

    /// Kills the process of its payload; launch starts it again.
    pub(super) fn kill_payload(&self) -> Result<(), Failure> {
        let node = Node::open(&node_directory(&self.installation.name, &self.node))?;
        let participants = node.participants();
        let payload = participants.iter().find(|participant| participant.module == self.module);
        if let Some(process) = payload.and_then(|payload| node.process_of(payload).ok().flatten()) {
            process.kill()?;
        }
        Ok(())
    }

    /// How late its beats were.
    pub(super) fn beats(&mut self) -> Option<PayloadBeats> {
        let tool = self.tool.as_mut()?;
        newest(tool, self.payload, PayloadInterface::STATE).ok().map(|(_, state)| state.beats)
    }

    /// From now on.
    pub(super) fn begin_to_count(&mut self) {
        self.look();
        self.since = self.state.as_ref().map_or((0, 0), |state| (state.incarnation, state.counter));
    }

    /// In which beat, counted from then, the robot knew its group, and in which that all views are equal, if they are;
    /// `None` as long as it does not know its group.
    pub(super) fn agrees_since(&self, all: &[u8]) -> Option<(u32, Option<u32>)> {
        let state = self.state.as_ref()?;
        let fresh = state.members.iter().filter(|member| member.fresh).map(|member| member.robot);
        let mut group: Vec<u8> = fresh.chain([state.robot]).collect();
        group.sort_unstable();
        let ends = (Some(&state.leader), Some(&state.group));
        let (run, counter) = self.since;
        let before = if state.incarnation == run { counter } else { 0 };
        let views = state.differs_ms.is_none().then(|| state.views_settled.saturating_sub(before));
        let is_right = group == all && ends == (all.first(), all.last());
        is_right.then(|| (state.settled.saturating_sub(before), views))
    }
}
