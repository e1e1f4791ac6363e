//! An installation as its file describes it, read and checked as a whole.

use crate::access::{Access, AccessRule};
use crate::classes::ClassTable;
use crate::errors::{Errors, Problem};
use crate::exact::JOURNAL;
use crate::flow::Flow;
use crate::gui::Gui;
use crate::module::Module;
use crate::node::{self, Node, System};
use crate::output::{Level, Output};
use crate::record::{Recording, Sampling};
use crate::replica::Replica;
use crate::saved::Saved;
use crate::scheduling::{Scheduling, SchedulingRule};
use crate::sources::Origins;
use crate::tcp::Tcp;
use crate::team::Team;
use crate::time::{ClockSetPolicy, TimeSource};
use rohrpost_mailbox::{Class, Name, saturating_sum};
use rohrpost_network::{Network, Tdma};
use std::path::{Path, PathBuf};

/// Content of one configuration file. It exists only if everything in the file is right.
#[derive(Clone, Debug)]
pub struct Installation {
    /// Its name.
    pub name: String,
    /// The file, as it was named to [`load`](Self::load).
    pub path: PathBuf,
    /// The file as messages name it: [`path`](Self::path), unless that is a copy of another file, line by line.
    pub shown: PathBuf,
    /// Folder of the file: relative paths in the file start here.
    pub folder: PathBuf,
    /// The file's text; with what it includes and with variables, the text that it resolved to.
    pub text: String,
    pub(crate) origins: Origins,
    /// The system it describes.
    pub system: System,
    /// The classes.
    pub classes: ClassTable,
    /// The nodes, at least one: in the order of the file, but nodes that are not on the LAN come last.
    pub nodes: Vec<Node>,
    /// The modules, in the order of their start: the routers, if there are several nodes, the modules of `[tcp]` and
    /// `[team]`, then those of the file.
    pub modules: Vec<Module>,
    /// How nodes reach each other; none if there is one only.
    pub network: Option<Network>,
    /// The folder with the keys that seal datagrams between nodes; none if nothing is sealed.
    pub keys: Option<PathBuf>,
    /// The time slots; none if each node sends as packages come.
    pub tdma: Option<Tdma>,
    /// The TCP router beyond the LAN; none if nothing goes there.
    pub tcp: Option<Tcp>,
    /// The way to other systems without a server; none if there is none.
    pub team: Option<Team>,
    /// Where system time comes from.
    pub time: TimeSource,
    /// What happens when the computer's clock was set since system time began.
    pub when_set: ClockSetPolicy,
    /// Which classes may command which, or which modules.
    pub access: Access,
    /// What the output service keeps.
    pub output: Output,
    /// What the GUI draws.
    pub gui: Gui,
    /// What is recorded; none if nothing is.
    pub record: Option<Recording>,
    /// Regular traffic between modules.
    pub flows: Vec<Flow>,
    /// Streams that other nodes have, too.
    pub replicas: Vec<Replica>,
    /// Where values of parameters are saved, if anywhere.
    pub parameters: Option<PathBuf>,
    /// What is saved there.
    pub saved: Option<Saved>,
    pub(crate) scheduling: SchedulingRule,
}

impl Installation {
    /// Whether each record of a stream is recorded out of shared memory, so that a journal may name it. The recorder
    /// takes those of modules on its node but its own; `*` are those of the file.
    pub fn records_each(&self, from: Name, stream: &str) -> bool {
        let (Some(record), Some(module)) = (&self.record, self.module(from)) else { return false };
        let has_recorder = |own: &Module| own.is_recorder() && own.node == module.node && own.name != module.name;
        let entry = record.in_place(from, stream).filter(|entry| entry.sampling == Sampling::Each);
        entry.is_some_and(|entry| entry.from.is_some() || module.is_in_file()) && self.modules.iter().any(has_recorder)
    }

    /// The module with a name, as its own or as an alias. The name may be that of any of the module's mailboxes.
    pub fn module(&self, name: Name) -> Option<&Module> {
        self.modules.iter().find(|module| module.names().any(|own| own == name.module()))
    }

    /// The module that records what `[record]` says.
    pub fn recorder(&self) -> Option<&Module> {
        self.modules.iter().find(|module| module.is_recorder())
    }

    /// The modules of a node, in the order of their start.
    pub fn modules_on(&self, node: &str) -> impl Iterator<Item = &Module> {
        self.modules.iter().filter(move |module| module.node == node)
    }

    /// Bytes of shared memory that the mailboxes, streams, replicas and journals of a node take, as far as the file
    /// names them.
    pub fn memory_on(&self, node: &str) -> u64 {
        let others = self.replica_memory_on(node).chain([self.journals_on(node)]);
        saturating_sum(self.modules_on(node).map(Module::memory).chain(others))
    }

    /// Bytes of these that its journals take.
    pub fn journals_on(&self, node: &str) -> u64 {
        let is_exact = |module: &&Module| self.record.as_ref().is_some_and(|record| record.is_exact(module.name));
        saturating_sum(self.modules_on(node).filter(is_exact).map(|_| JOURNAL.memory()))
    }

    /// The nodes that are on the LAN, or the only one; they come first in [`nodes`](Self::nodes).
    pub fn lan_nodes(&self) -> &[Node] {
        node::on_lan(&self.nodes)
    }

    /// The node of a name.
    pub fn node(&self, name: &str) -> Option<&Node> {
        self.nodes.iter().find(|node| node.name == name)
    }

    /// The node that a module, an alias or a tool belongs to; none for names that the file does not know.
    pub fn node_of(&self, name: Name) -> Option<&str> {
        let is_tool = name.class() == self.classes.tool() && name.system() == self.system.id;
        let tools = || self.nodes.iter().find(|node| is_tool && node.tools.contains(&name.instance()));
        self.module(name).map(|module| module.node.as_str()).or_else(|| Some(tools()?.name.as_str()))
    }

    /// The name that launch of a node sends from.
    pub fn launch_of(&self, node: &Node) -> Name {
        Name::new(self.system.id, self.classes.tool().0, node.launch_instance(), 0)
    }

    /// The level from which on a module sends lines at its start; an alias has the level of its module.
    pub fn output_level(&self, module: Name) -> Level {
        let names = |own: &Name| self.module(module).is_some_and(|module| module.names().any(|name| name == *own));
        let own = self.output.levels.iter().find(|(name, _)| *name == module.module() || names(name));
        own.map_or(self.output.level, |(_, level)| *level)
    }

    /// The rule of `[access]` that forbids the owner of this name to command the other one, if there is one. Launch may
    /// command all on its node: it switches modules on and off, whatever the rules say.
    pub fn access_against(&self, from: Name, to: Name) -> Option<&AccessRule> {
        let rule = self.access.against(from, to)?;
        let is_launch = |node: &Node| self.launch_of(node) == from.module() && self.node_of(to) == Some(&node.name);
        (!self.nodes.iter().any(is_launch)).then_some(rule)
    }

    /// How a module's process is scheduled: as its class says. The recorder gives way to no ordinary program, though
    /// its class may be below all that it records: it would lose what those send while another program computes.
    pub fn scheduling_of(&self, module: &Module) -> Scheduling {
        match self.scheduling(module.name.class()) {
            Scheduling::Normal { .. } if module.is_recorder() => Scheduling::Normal { nice: 0 },
            by_class => by_class,
        }
    }

    /// How the processes of a class are scheduled.
    pub fn scheduling(&self, class: Class) -> Scheduling {
        self.scheduling.of(class)
    }

    /// Classes from this id run in real time; 256 if none does.
    pub fn real_time_from(&self) -> u16 {
        self.scheduling.real_time_from
    }

    /// The UDP port of what is not real time, if that is separate. In time slots all goes through one port, by level.
    pub fn rest_port(&self) -> Option<u16> {
        self.network.filter(|_| self.tdma.is_none()).map(|network| network.rest_port())
    }

    /// The UDP port of parts of replicas, if any go by the LAN.
    pub fn replica_port(&self) -> Option<u16> {
        let is_any = self.replicas.iter().any(|replica| self.hop_by_lan(replica).is_some());
        self.network.filter(|_| is_any).map(|network| network.replica_port())
    }

    /// The file and the line in it that a line of the text comes from.
    pub fn place(&self, line: usize) -> (PathBuf, usize) {
        self.origins.place(&self.path, line)
    }

    /// The files that the file includes.
    pub fn included(&self) -> impl Iterator<Item = PathBuf> {
        self.origins.included().map(|file| self.folder.join(file))
    }

    /// Mistakes in lines of the text, found by others.
    pub fn errors(&self, problems: Vec<Problem>) -> Errors {
        Errors::new(&self.path, problems).with_origins(&self.origins)
    }

    /// A path of the file as the process sees it: relative ones start from the file's folder.
    pub fn resolve(&self, path: impl AsRef<Path>) -> PathBuf {
        self.folder.join(path)
    }
}
