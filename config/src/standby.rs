//! Modules with several nodes: one of these runs the module at a time, and the others stand by.
//!
//! The file says the order of choice (`nodes`) and which node grants the lease (`witness`). Everywhere else in this
//! crate such a module is on its first node; [`Installation::seen_from`] is how a process of another node reads the
//! file, and [`Installation::at_holders`] how a tool does.

use crate::installation::Installation;
use crate::module::{Module, Program, REPLAY};
use crate::module_nodes::Standby;
use crate::reader::Reader;
use crate::units::duration_text;
use rohrpost_mailbox::Name;
use std::time::Duration;

/// The file of a node's directory in which launch says where the names of such modules are: [`holder_line`]s.
pub const HOLDERS_FILE: &str = "holders";
/// Most modules with several nodes: one command of a node asks for the leases of all.
pub const MOVING_MODULES_MAX: usize = 16;
/// How often each node asks for the lease, without time slots.
const ASK_EVERY: Duration = Duration::from_millis(150);
/// In time slots a question and its answer take at most so many cycles.
const ASK_EVERY_CYCLES: u32 = 2;
/// A lease has room for so many questions.
const ASKS: u32 = 6;
/// So long a process needs at most to be off, and in time slots so many cycles if these are shorter.
const OFF: Duration = Duration::from_millis(100);
const OFF_CYCLES: u32 = 4;
/// The longest cycle in which two cycles of silence are still no end of a lease.
const CYCLE_MAX: Duration = Duration::from_millis(150);
/// Builtins of which each node, or the installation, has its own.
const OWN_OF_NODE: [&str; 2] = ["output", REPLAY];

/// Times of the leases of an installation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeaseTimes {
    /// So long a lease lasts.
    pub lease: Duration,
    /// How often each candidate asks for it.
    pub ask_every: Duration,
    /// So long a process needs at most to be off.
    pub off: Duration,
}

impl LeaseTimes {
    /// Times of the leases in time slots with such a cycle, counted in cycles; none: without time slots.
    pub fn of(cycle: Option<Duration>) -> Self {
        let Some(cycle) = cycle else {
            return Self { lease: ASK_EVERY * ASKS, ask_every: ASK_EVERY, off: OFF };
        };
        let (ask_every, off) = (cycle * ASK_EVERY_CYCLES, OFF.min(cycle * OFF_CYCLES));
        Self { lease: ask_every * ASKS + off, ask_every, off }
    }
}

/// A line of [`HOLDERS_FILE`]: a name as a number, and the place of its node on the LAN.
pub fn holder_line(name: Name, node: u8) -> String {
    format!("{} {node}\n", name.raw())
}

/// The lines of [`HOLDERS_FILE`]. What is no line is passed over: another process wrote it.
pub fn holders(text: &str) -> impl Iterator<Item = (Name, u8)> {
    let line = |line: &str| {
        let (name, node) = line.split_once(' ')?;
        Some((Name::from_raw(name.parse().ok()?), node.parse().ok()?))
    };
    text.lines().filter_map(line)
}

impl Module {
    /// Whether several nodes may run it, one at a time.
    pub fn has_standby(&self) -> bool {
        self.nodes.len() > 1
    }
}

impl Installation {
    /// The installation as a process of this node reads it: a module with several nodes, of which this is one, is here.
    #[must_use]
    pub fn seen_from(mut self, node: &str) -> Self {
        for module in self.modules.iter_mut().filter(|module| module.nodes.iter().any(|own| own == node)) {
            node.clone_into(&mut module.node);
        }
        self
    }

    /// The installation with each of these modules at the node that holds its lease, where the text of a
    /// [`HOLDERS_FILE`] says it.
    #[must_use]
    pub fn at_holders(mut self, text: &str) -> Self {
        for (name, node) in holders(text) {
            let Some(node) = self.lan_nodes().get(usize::from(node)).map(|node| node.name.clone()) else { continue };
            let module = self.modules.iter_mut().find(|module| module.name == name && module.nodes.contains(&node));
            module.into_iter().for_each(|module| node.clone_into(&mut module.node));
        }
        self
    }

    /// The modules that a node may run: its own, and those for which it stands by.
    pub fn modules_for<'a>(&'a self, node: &'a str) -> impl Iterator<Item = &'a Module> {
        self.modules.iter().filter(move |module| module.node == node || module.nodes.iter().any(|own| own == node))
    }

    /// The modules with several nodes.
    pub fn modules_with_standby(&self) -> impl Iterator<Item = &Module> {
        self.modules.iter().filter(|module| module.has_standby())
    }

    /// The names that go from node to node with their module.
    pub fn moving_names(&self) -> Vec<Name> {
        self.modules_with_standby().flat_map(Module::names).collect()
    }

    /// The node that grants a module's lease: the one that the file names, else that of the wormhole, else that of the
    /// motor. A node that cannot reach the motor cannot drive.
    pub fn witness_of<'a>(&'a self, module: &'a Module) -> Option<&'a str> {
        let is_wormhole = |other: &&Module| other.program == Program::Builtin("wormhole".into());
        let motor = self.classes.id("motor");
        let is_motor = |other: &&Module| motor.is_some_and(|class| other.names().any(|name| name.class() == class));
        let of = |is: &dyn Fn(&&Module) -> bool| Some(self.modules.iter().find(is)?.nodes.first()?.as_str());
        module.witness.as_deref().or_else(|| of(&is_wormhole)).or_else(|| of(&is_motor))
    }

    /// Times of the leases.
    pub fn lease_times(&self) -> LeaseTimes {
        LeaseTimes::of(self.tdma.as_ref().map(|tdma| tdma.cycle))
    }

    /// The modules for which a node stands by.
    pub(crate) fn stands_by(&self, node: &str) -> Vec<Name> {
        let is_second = |module: &&Module| module.nodes.iter().skip(1).any(|other| other == node);
        self.modules.iter().filter(is_second).map(|module| module.name).collect()
    }

    /// What is lost with which node or cut, for each module with several nodes.
    pub(crate) fn standby_text(&self, module: &Module) -> Option<String> {
        let [first, others @ ..] = &module.nodes[..] else { return None };
        let how = match module.standby {
            Standby::Hot => "ready and off until then",
            Standby::Cold => "not started until then",
        };
        let witness = self.witness_of(module).filter(|_| !others.is_empty())?;
        let LeaseTimes { lease, .. } = self.lease_times();
        let soon = duration_text(lease);
        let then = others.join(", then ");
        Some(format!(
            "on {first}, else on {then}, {how}; a node that dies, or cannot reach {witness}, is off within {soon}, and \
             the next begins; without {witness}, which grants the lease, it stops everywhere within {soon}, and nobody \
             takes over"
        ))
    }
}

/// Rules for modules with several nodes.
pub(crate) fn validate(installation: &Installation, reader: &Reader<'_>) {
    if let Some(module) = installation.modules_with_standby().nth(MOVING_MODULES_MAX) {
        let why = format!("there are more than {MOVING_MODULES_MAX} modules with several nodes; give some one `node`");
        reader.report(module.line, why);
    }
    for module in installation.modules.iter() {
        let name = installation.classes.format(module.name);
        let report = |why: String| reader.report(module.line, format!("module `{name}`: {why}"));
        if !module.has_standby() {
            if module.witness.is_some() {
                report("`witness` grants nothing to a module with one node; write `nodes`, or drop it".into());
            }
            continue;
        }
        for problem in problems(installation, module) {
            report(problem);
        }
    }
}

fn problems(installation: &Installation, module: &Module) -> Vec<String> {
    let mut problems = Vec::new();
    let is_beyond = |node: &str| installation.lan_index(node).is_none();
    if let Some(beyond) = module.nodes.iter().find(|node| is_beyond(node)) {
        problems.push(format!("node `{beyond}` is not on the LAN, where names move; drop it from `nodes`"));
    }
    match installation.witness_of(module) {
        None => problems.push(
            "there is neither a wormhole nor a motor, so nothing says which node grants the lease; write `witness = ` \
             and a node that the module is of no use without"
                .into(),
        ),
        Some(witness) if is_beyond(witness) => {
            problems.push(format!("its witness `{witness}` is not on the LAN; write `witness = ` and a node that is"));
        }
        Some(_) => {}
    }
    if installation.tcp.as_ref().is_some_and(|tcp| tcp.server.is_none()) {
        problems.push(
            "the TCP router of another installation does not know which node has it; let `server` of [tcp] name a node \
             of this one, or give it one `node`"
                .into(),
        );
    }
    let is_of_node = matches!(&module.program, Program::Builtin(name) if OWN_OF_NODE.contains(&name.as_str()));
    if is_of_node || module.is_recorder() {
        problems.push("what it keeps stays on its node; give it one `node`".into());
    }
    let names = || module.names();
    if installation.flows.iter().any(|flow| names().any(|name| [flow.from, flow.to].contains(&name))) {
        problems
            .push("a [[flow]] is planned from node to node, and it moves; drop the flow, or give it one `node`".into());
    }
    if installation.replicas.iter().any(|replica| names().any(|name| name == replica.from)) {
        problems
            .push("a [[replica]] of its streams has one origin, and it moves; drop it, or give it one `node`".into());
    }
    if installation.record.as_ref().is_some_and(|record| record.is_exact(module.name)) {
        problems.push("its runs are recorded for exact replay, on one node; give it one `node`, or drop that".into());
    }
    let cycle = installation.tdma.as_ref().map(|tdma| tdma.cycle).filter(|cycle| *cycle > CYCLE_MAX);
    if let Some(cycle) = cycle {
        let (cycle, most) = (duration_text(cycle), duration_text(CYCLE_MAX));
        problems.push(format!("its lease needs cycles of at most {most}, and they last {cycle}; give it one `node`"));
    }
    problems
}
