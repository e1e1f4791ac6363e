//! A running node, seen by a test that takes part as a tool.

use crate::harness::{PATIENCE, signal, until, wait};
use crate::probe::{COUNT, ProbingInterface};
use crate::process::Running;
use nix::sys::signal::Signal;
use rohrpost::common::GET_DATA;
use rohrpost::interface::DataPort;
use rohrpost::schema::Data;
use rohrpost::serde::Serialize;
use rohrpost::wire::{append, from_bytes};
use rohrpost::{CallError, Name, ToolLink};
use rohrpost_config::{Installation, Start};
use rohrpost_mailbox::{ModuleState, Node, NodeError, ParticipantInfo, local};
use rohrpost_modules::runtime::ClientError;
use std::io::ErrorKind;
use std::sync::Arc;
use std::time::Duration;

/// A node that runs.
pub(crate) struct Robot {
    pub(crate) installation: Installation,
    pub(crate) node: Arc<Node>,
    pub(crate) node_name: String,
}

impl Robot {
    pub(crate) fn name(&self, module: &str) -> Name {
        self.installation.classes.parse_name(module).unwrap().module()
    }

    pub(crate) fn tool(&self, timeout: Duration) -> ToolLink {
        self.tool_if_there(timeout).unwrap_or_else(|| panic!("the node is gone: {}", self.node.path().display()))
    }

    /// A tool on a node that may end meanwhile: none when it is gone.
    pub(crate) fn tool_if_there(&self, timeout: Duration) -> Option<ToolLink> {
        match ToolLink::join(&self.installation, &self.node, &self.node_name, timeout) {
            Err(ClientError::Node(NodeError::Io(_, error))) if error.kind() == ErrorKind::NotFound => None,
            joined => Some(joined.unwrap()),
        }
    }

    /// Sends a probe a command, once; waiting for its answer would repeat it.
    pub(crate) fn begin(&self, tool: &mut ToolLink, module: &str, function: u16, arguments: &impl Serialize) -> u32 {
        let write = |body: &mut Vec<u8>| append(body, arguments);
        tool.link.begin(self.name(module), function, ProbingInterface::hash(), PATIENCE, write).unwrap()
    }

    /// The result of a probe's counting, called by a tool that waits for so long.
    pub(crate) fn count(&self, module: &str, number: u32, timeout: Duration) -> Result<u64, CallError> {
        let mut tool = self.tool(timeout);
        let write = |body: &mut Vec<u8>| append(body, &(number,));
        let counted = tool.call(self.name(module), COUNT, ProbingInterface::hash(), write, |bytes| from_bytes(bytes));
        tool.close();
        counted
    }

    /// A module's newest data, and when they were published.
    pub(crate) fn newest<T: Data>(
        &self,
        tool: &mut ToolLink,
        module: &str,
        port: DataPort<T>,
    ) -> Result<(u64, T), CallError> {
        let write = |body: &mut Vec<u8>| append(body, &(port.number,));
        tool.call(self.name(module), GET_DATA, (port.hash)(), write, |bytes| from_bytes(bytes))
    }

    /// The module's process.
    pub(crate) fn process(&self, module: &str) -> Option<ParticipantInfo> {
        let name = self.name(module);
        self.node.participants().into_iter().find(|p| p.module == name && p.pid != 0)
    }

    pub(crate) fn state(&self, module: &str) -> &'static str {
        self.process(module).and_then(|p| p.state).map_or("none", ModuleState::name)
    }

    pub(crate) fn pid(&self, module: &str) -> u32 {
        self.process(module).unwrap_or_else(|| panic!("{module} does not run")).pid
    }

    /// Processes of all modules.
    pub(crate) fn pids(&self) -> Vec<u32> {
        let modules = self.node.participants().into_iter().filter(|p| p.state.is_some());
        modules.map(|p| p.pid).filter(|pid| *pid != std::process::id()).collect()
    }

    pub(crate) fn wait_on(&self, launch: &mut Running) {
        let mut on = 0;
        for module in self.installation.modules_on(&self.node_name) {
            let is_on = module.start == Start::On;
            on += u64::from(is_on);
            let (name, state) = (self.installation.classes.format(module.name), if is_on { "on" } else { "off" });
            until(format!("{name} is not {state}"), || {
                launch.assert_runs();
                self.state(&name) == state
            });
        }
        // Launch takes the first place of a tool. Before all modules have answered, a stop would be a failed start.
        let tools = self.installation.node(&self.node_name).unwrap().tools.clone();
        let replies = Name::new(self.installation.system.id, 16, *tools.start(), local::REPLIES);
        wait("launch has heard from all", || {
            let heard = self.node.look_at(replies)?.classes.iter().map(|class| class.received).sum::<u64>();
            (heard >= on).then_some(())
        });
        // A module that has answered still holds the package for a moment; and a busy one may have been asked twice.
        for module in self.installation.modules_on(&self.node_name) {
            let name = self.installation.classes.format(module.name);
            if name.starts_with("probe.") {
                until(format!("{name} is done"), || self.waiting(&name) == 0);
            }
        }
    }

    /// Packages that wait in a module's command mailbox.
    pub(crate) fn waiting(&self, module: &str) -> u32 {
        self.node.look_at(self.name(module)).map_or(0, |mailbox| mailbox.depth)
    }

    /// Kills a module's process, and waits until it runs in another one.
    pub(crate) fn kill(&self, module: &str) -> ParticipantInfo {
        let pid = self.pid(module);
        signal(pid, Signal::SIGKILL);
        self.wait_restarted(module, pid)
    }

    /// Waits until the module runs in another process than this one, and answers.
    pub(crate) fn wait_restarted(&self, module: &str, old_pid: u32) -> ParticipantInfo {
        wait(format!("{module} is not on again"), || {
            self.process(module).filter(|p| p.pid != old_pid && p.state == Some(ModuleState::On))
        })
    }
}
