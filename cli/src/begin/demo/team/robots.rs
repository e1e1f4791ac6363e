//! The robots of a team's demo: their files, and what they say of their team.

use crate::begin::check;
use crate::begin::demo::copy::write_map;
use crate::look::newest;
use crate::terminal::Failure;
use rohrpost::interfaces::{TeamInterface, TeamObjectId, TeamRefusal, TeamState};
use rohrpost::wire::{append, from_bytes};
use rohrpost::{Name, ToolLink};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Node, node_directory};
use std::net::Ipv4Addr;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use toml_edit::{DocumentMut, value};

/// The file of the first robot.
const TEAM: &str = include_str!("../../../../../config/demo-team.toml");
/// The function of a team's module that makes up an intruder.
const ADD_FAKE: u16 = 16;
/// Timeout for a module's answer.
const PATIENCE: Duration = Duration::from_millis(500);
/// Beats of the greatest age of a fresh robot, 7.5, rounded up.
pub(super) const AGE_BEATS: u32 = 8;

/// Writes the file of each robot, and reads it as a user's.
pub(super) fn installations(count: u8, folder: &Path) -> Result<Vec<Arc<Installation>>, Failure> {
    write_map(folder)?;
    (1..=count).map(|id| Ok(Arc::new(installation(id, folder)?))).collect()
}

/// The only node of a robot.
pub(super) fn name(id: u8) -> String {
    format!("robot{id}")
}

pub(super) fn address(id: u8) -> Ipv4Addr {
    Ipv4Addr::new(10, 77, 0, id)
}

fn installation(id: u8, folder: &Path) -> Result<Installation, Failure> {
    let mut document: DocumentMut = TEAM.parse()?;
    let node = name(id);
    document["system"]["name"] = value(&node);
    document["system"]["id"] = value(i64::from(id));
    document["team"]["address"] = value(address(id).to_string());
    let nodes = document["nodes"].as_table_mut().ok_or("no [nodes]")?;
    let own = nodes.remove(&name(1)).unwrap_or_default();
    nodes.insert(&node, own);
    let modules = document["module"].as_array_of_tables_mut().ok_or("no [[module]]")?;
    for settings in modules.iter_mut().filter_map(|module| module.get_mut("settings")?.as_inline_table_mut()) {
        if let Some(seed) = settings.get_mut("seed") {
            *seed = i64::from(id).into();
        }
    }
    let file = folder.join(format!("{node}.toml"));
    std::fs::write(&file, document.to_string())?;
    let mut installation = check::load(&file)?;
    installation.shown = format!("built-in demo-team.toml of {node}").into();
    Ok(installation)
}

/// A robot, as a tool on its computer has it.
pub(super) struct TeamRobot {
    pub(super) id: u8,
    pub(super) node: String,
    /// The part of the network in which it is.
    pub(super) part: usize,
    installation: Arc<Installation>,
    module: Name,
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

    /// Makes up an intruder, which the others are to hear of.
    pub(super) fn make_up(&mut self, x_m: f64) -> Result<(), Failure> {
        let Some(tool) = &mut self.tool else { return Ok(()) };
        let write = |body: &mut Vec<u8>| append(body, &(x_m, f64::from(self.id)));
        let read = |bytes: &[u8]| from_bytes::<Result<TeamObjectId, TeamRefusal>>(bytes);
        tool.call(self.module, ADD_FAKE, TeamInterface::hash(), write, read)??;
        Ok(())
    }

    /// From now on.
    pub(super) fn begin_to_count(&mut self) {
        self.look();
        self.since = self.state.as_ref().map_or((0, 0), |state| (state.incarnation, state.counter));
    }

    /// In which beat, counted from then, the robot knew its group, and in which that all views are equal; `None` as
    /// long as it does not.
    pub(super) fn agrees_since(&self, all: &[u8]) -> Option<[u32; 2]> {
        let state = self.state.as_ref().filter(|state| state.differs_ms.is_none())?;
        let fresh = state.members.iter().filter(|member| member.fresh).map(|member| member.robot);
        let mut group: Vec<u8> = fresh.chain([state.robot]).collect();
        group.sort_unstable();
        let ends = (Some(&state.leader), Some(&state.group));
        let (run, counter) = self.since;
        let before = if state.incarnation == run { counter } else { 0 };
        let since = [state.settled, state.views_settled].map(|number| number.saturating_sub(before));
        (group == all && ends == (all.first(), all.last())).then_some(since)
    }
}
