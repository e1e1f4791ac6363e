//! What runs on a node and what it does, read from shared memory: looking changes nothing.
//!
//! ```text
//!  this node:      shared memory ──▶ Survey
//!  another node:   shared memory ──▶ Survey ──form──▶ pages of its launch (`launch::look`) ──distant──▶ Survey
//! ```
//!
//! A package that goes to another node is counted by its sender there, and once more by the router that delivers it
//! here under the sender's name: such a flow is a *hop* ([`is_hop`]). A sum over several nodes leaves hops out, but for
//! those from nodes that do not answer. It is also received twice, first in the transit mailbox of its own node's
//! router: of such mailboxes only the losses are in [`Survey::classes`].

mod distant;
mod form;
mod standing;
mod streams;
mod usage;

pub use crate::launcher::Scope;
pub use distant::{Distant, LookFailure, look_at_all};
pub use form::Snapshot;
pub use standing::{Standing, Working};
pub use streams::StreamSurvey;
pub use usage::Usage;

use crate::launcher::{ChildState, known_children};
use rohrpost_config::{Installation, ROUTER, TCP};
use rohrpost_mailbox::sys::{Scheduling, scheduling_of};
use rohrpost_mailbox::{
    ClassTraffic, FlowInfo, InspectError, Latency, Loss, MailboxDetail, MailboxInfo, Name, Node, NodeError,
    ParticipantInfo, ProcessError, SlotInfo, local, monotonic_ns, saturating_sum,
};
use std::time::Duration;

/// A node at one moment.
///
/// ```no_run
/// use rohrpost_launch::survey::Survey;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let installation = rohrpost_config::Installation::load("robot.toml".as_ref())?;
/// let directory = rohrpost_modules::runtime::find_running().pop().ok_or("no node runs")?;
/// let node = rohrpost_mailbox::Node::open(&directory)?;
/// for module in Survey::new(&node, &installation, "base")?.modules {
///     println!("{} is {}", installation.classes.format(module.name), module.standing().word());
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default)]
pub struct Survey {
    /// The node's name.
    pub node: String,
    /// When it was made, ns of that node's monotonic clock; so are all other times in it.
    pub at_ns: u64,
    /// Modules, in the order of the configuration, then those it does not name.
    pub modules: Vec<ModuleSurvey>,
    /// All mailboxes, in order of their names.
    pub mailboxes: Vec<MailboxInfo>,
    /// All streams, in order of their names and numbers.
    pub streams: Vec<StreamSurvey>,
    /// What all mailboxes together did, most urgent class first.
    pub classes: Vec<ClassTraffic>,
    /// What everybody sends and publishes.
    pub flows: Vec<FlowInfo>,
}

/// A module at one moment.
#[derive(Clone, Debug, Default)]
pub struct ModuleSurvey {
    /// The module's node.
    pub node: String,
    /// When it was looked at, ns of that node's monotonic clock; none when the node does not answer.
    pub at_ns: Option<u64>,
    /// The module's name, local id 0.
    pub name: Name,
    /// Further names of its process.
    pub aliases: Vec<Name>,
    /// The module's process, as the node's table has it; none when it does not run.
    pub process: Option<ParticipantInfo>,
    /// What that takes of its computer; none until [`Survey::ask_kernel`], and if it has ended since.
    pub usage: Option<Usage>,
    /// How it really is scheduled; likewise.
    pub scheduling: Option<Scheduling>,
    /// Which part of its own code runs, if that has not come back for long.
    pub working: Option<Working>,
    /// For how long the part of its own code that runs has not come back; none: none runs.
    pub in_turn: Option<Duration>,
    /// What its launch knows of it; none if no launch says anything.
    pub child: Option<ChildState>,
    /// Why it is in error, if launch does not know it and it was asked itself.
    pub error: Option<String>,
    /// Packages that its mailboxes received so far.
    pub received: u64,
    /// Bytes of their bodies.
    pub bytes_in: u64,
    /// Packages that its mailboxes lost so far, for any cause for which somebody misses them ([`Loss::is_missed`]).
    pub lost: u64,
    /// Packages by cause, in the order of [`Loss::ALL`]: those lost, and those that a newer one replaced.
    pub losses: [u64; Loss::ALL.len()],
    /// How long packages waited in its mailboxes.
    pub waited: Latency,
    /// Packages that its process sent since it began; not those that were refused.
    pub sent: u64,
    /// Bytes of their bodies.
    pub bytes_out: u64,
    /// Packages that wait for it.
    pub depth: u32,
}

impl Survey {
    /// Looks at a node.
    ///
    /// # Errors
    /// When its directory cannot be read.
    pub fn new(node: &Node, installation: &Installation, node_name: &str) -> Result<Self, NodeError> {
        let mailboxes: Vec<MailboxInfo> = node.mailboxes()?.into_iter().filter_map(|name| node.look_at(name)).collect();
        let participants = node.participants();
        let flows = node.traffic();
        let at_ns = monotonic_ns();
        let survey = |name, aliases| {
            let mut module = ModuleSurvey {
                node: node_name.into(),
                at_ns: Some(at_ns),
                ..survey(name, aliases, &participants, &mailboxes, &flows)
            };
            module.working = Working::of(&module, node, installation, at_ns);
            module.in_turn = module.process.as_ref().and_then(|process| process.in_hand).map(|turn| turn.lasts(at_ns));
            module
        };
        let mut modules: Vec<ModuleSurvey> =
            installation.modules_for(node_name).map(|module| survey(module.name, module.aliases.clone())).collect();
        for participant in participants.iter().filter(|p| p.module != Name::NONE) {
            if modules.iter().all(|module| module.name != participant.module) {
                modules.push(survey(participant.module, Vec::new()));
            }
        }
        add_children(&mut modules, installation, known_children(node));
        let classes = sum_of_ends(installation, &mailboxes);
        let streams = streams::look(node, node_name, at_ns)?;
        Ok(Self { node: node_name.into(), at_ns, modules, mailboxes, streams, classes, flows })
    }

    /// A survey of no more than is asked for.
    ///
    /// # Errors
    /// When the node's directory cannot be read.
    pub fn within(scope: Scope, node: &Node, installation: &Installation, node_name: &str) -> Result<Self, NodeError> {
        Ok(Self::new(node, installation, node_name)?.reduced(scope))
    }

    fn reduced(mut self, scope: Scope) -> Self {
        match scope {
            Scope::All => {}
            Scope::Mailboxes => self.flows.clear(),
            Scope::Modules => {
                self.flows.clear();
                self.mailboxes.clear();
                self.streams.clear();
            }
            Scope::Streams => {
                let Self { node, at_ns, streams, .. } = self;
                return Self { node, at_ns, streams, ..Self::default() };
            }
            Scope::Module(raw) => self.reduce_to(Name::from_raw(raw).module()),
        }
        self
    }

    fn reduce_to(&mut self, name: Name) {
        let is_own = |other: Name| other.module() == name;
        self.streams.retain(|stream| is_own(stream.info.id.name));
        self.flows.retain(|flow| is_own(flow.from) || is_own(flow.to));
        let flows = &self.flows;
        let is_sent_to = |mailbox: Name| flows.iter().any(|flow| is_own(flow.from) && flow.to == mailbox);
        self.mailboxes.retain(|mailbox| is_own(mailbox.name) || is_sent_to(mailbox.name));
        self.modules.retain(|module| module.name == name || module.aliases.contains(&name));
    }

    /// Several nodes as one, in this order; of each node of `silent`, which do not answer, the modules that the
    /// configuration names. What routers delivered for nodes that answer is left out: it is among what these sent.
    pub fn joined(surveys: Vec<Self>, silent: &[&str], installation: &Installation) -> Self {
        let node = surveys.first().map(|first| first.node.clone()).unwrap_or_default();
        let mut all = Self { node, at_ns: monotonic_ns(), ..Self::default() };
        for survey in surveys {
            let node = survey.node;
            all.modules.extend(survey.modules);
            all.mailboxes.extend(survey.mailboxes);
            all.streams.extend(survey.streams);
            add(&mut all.classes, &survey.classes);
            let counts = |flow: &FlowInfo| !is_hop(installation, &node, flow) || is_of(installation, flow.from, silent);
            all.flows.extend(survey.flows.into_iter().filter(counts));
        }
        for node in silent {
            let modules = installation.modules_on(node);
            let unseen = modules.map(|module| survey(module.name, module.aliases.clone(), &[], &[], &[]));
            all.modules.extend(unseen.map(|module| ModuleSurvey { node: (*node).into(), ..module }));
        }
        all.mailboxes.sort_by_key(|mailbox| mailbox.name);
        all.streams.sort_by_key(|stream| stream.info.id);
        all.classes.sort_by_key(|class| std::cmp::Reverse(class.class));
        all
    }

    /// Asks the kernel what the processes of this node take and how they are scheduled. On another computer, and in
    /// another pid namespace, their numbers mean others, so it is not asked.
    pub fn ask_kernel(&mut self, node: &Node) {
        if !are_here(node, self.modules.iter().filter_map(|module| module.process.as_ref())) {
            return;
        }
        for module in &mut self.modules {
            let pid = module.process.as_ref().map(|process| process.pid);
            module.usage = pid.and_then(Usage::of);
            module.scheduling = pid.and_then(|pid| scheduling_of(pid).ok());
        }
    }

    /// The module of this name, or with this alias: where it runs, if other nodes stand by.
    pub fn module(&self, name: Name) -> Option<&ModuleSurvey> {
        let name = name.module();
        let its = || self.modules.iter().filter(|module| module.name == name || module.aliases.contains(&name));
        its().find(|module| module.standing() != Standing::StandsBy).or_else(|| its().next())
    }

    /// Packages a second that a module received since `earlier`.
    ///
    /// ```
    /// # use rohrpost_launch::survey::Survey;
    /// fn is_idle(before: &Survey, now: &Survey, module: rohrpost_mailbox::Name) -> bool {
    ///     now.received_per_s(before, module) < 1.0
    /// }
    /// ```
    pub fn received_per_s(&self, earlier: &Self, name: Name) -> f64 {
        let (Some(now), Some(before)) = (self.module(name), earlier.module(name)) else { return 0.0 };
        let (Some(now_ns), Some(before_ns)) = (now.at_ns, before.at_ns) else { return 0.0 };
        let seconds = now_ns.saturating_sub(before_ns) as f64 / 1e9;
        if seconds > 0.0 { now.received.saturating_sub(before.received) as f64 / seconds } else { 0.0 }
    }
}

/// Adds what launch knows of its modules.
fn add_children(modules: &mut [ModuleSurvey], installation: &Installation, children: Vec<ChildState>) {
    for child in children {
        let is_it = |module: &&mut ModuleSurvey| installation.classes.format(module.name) == child.module;
        if let Some(module) = modules.iter_mut().find(is_it) {
            module.child = Some(child);
        }
    }
}

fn survey(
    name: Name,
    aliases: Vec<Name>,
    participants: &[ParticipantInfo],
    mailboxes: &[MailboxInfo],
    flows: &[FlowInfo],
) -> ModuleSurvey {
    let own = |mailbox: &&MailboxInfo| mailbox.name.module() == name || aliases.contains(&mailbox.name.module());
    let own: Vec<&MailboxInfo> = mailboxes.iter().filter(own).collect();
    let classes = || own.iter().flat_map(|mailbox| &mailbox.classes);
    let process = participants.iter().find(|participant| participant.module == name).cloned();
    // Not by its incarnation alone: threads that send take part on their own.
    let pid = process.as_ref().map(|process| process.pid);
    let sends = |flow: &&FlowInfo| Some(flow.pid) == pid && !flow.is_publication();
    let mut waited = Latency::default();
    classes().for_each(|class| waited.add(&class.latency));
    ModuleSurvey {
        name,
        aliases,
        process,
        received: saturating_sum(classes().map(|class| class.received)),
        bytes_in: saturating_sum(classes().map(|class| class.body_bytes)),
        lost: saturating_sum(classes().map(ClassTraffic::lost_in_all)),
        losses: Loss::ALL.map(|cause| saturating_sum(classes().map(|class| class.lost(cause)))),
        waited,
        sent: saturating_sum(flows.iter().filter(sends).map(|flow| flow.packages)),
        bytes_out: saturating_sum(flows.iter().filter(sends).map(|flow| flow.bytes)),
        depth: own.iter().fold(0, |depth, mailbox| depth.saturating_add(mailbox.depth)),
        ..ModuleSurvey::default()
    }
}

/// Adds up all mailboxes, class by class.
pub fn sum(mailboxes: &[MailboxInfo]) -> Vec<ClassTraffic> {
    let mut classes: Vec<ClassTraffic> = Vec::new();
    mailboxes.iter().for_each(|mailbox| add(&mut classes, &mailbox.classes));
    classes.sort_by_key(|class| std::cmp::Reverse(class.class));
    classes
}

fn add(sums: &mut Vec<ClassTraffic>, classes: &[ClassTraffic]) {
    for class in classes {
        match sums.iter_mut().find(|known| known.class == class.class) {
            Some(known) => known.add(class),
            None => sums.push(class.clone()),
        }
    }
}

/// Whether a name is one of these nodes' modules or tools.
fn is_of(installation: &Installation, name: Name, nodes: &[&str]) -> bool {
    node_of(installation, name).is_some_and(|node| nodes.contains(&node))
}

/// The node that a name is on: that of its module, or the one that hands out its instance of class `tool`. None for
/// what is in no configuration.
pub fn node_of(installation: &Installation, name: Name) -> Option<&str> {
    installation.node_of(name)
}

/// Traffic of all mailboxes, but of packages in transit only what was lost there: the others are received again where
/// they go.
fn sum_of_ends(installation: &Installation, mailboxes: &[MailboxInfo]) -> Vec<ClassTraffic> {
    let routers = [ROUTER, TCP].map(|class| installation.classes.id(class));
    let mut mailboxes = mailboxes.to_vec();
    let is_transit = |name: Name| routers.contains(&Some(name.class())) && name.local() == local::TRANSIT;
    for class in
        mailboxes.iter_mut().filter(|mailbox| is_transit(mailbox.name)).flat_map(|mailbox| &mut mailbox.classes)
    {
        (class.received, class.body_bytes, class.latency) = (0, 0, Latency::default());
    }
    sum(&mailboxes)
}

/// Whether a flow that was seen on this node is the last part of the way of packages that came from another one: a
/// router sends them under the name of their sender, which counts them itself on its own node.
pub fn is_hop(installation: &Installation, node: &str, flow: &FlowInfo) -> bool {
    node_of(installation, flow.from).is_some_and(|origin| origin != node)
}

/// A mailbox down to its slots.
#[derive(Clone, Debug)]
pub struct MailboxSnapshot {
    /// What it says of itself.
    pub detail: MailboxDetail,
    /// Processes in it that stand: by SIGSTOP, Ctrl-Z or a debugger.
    pub stopped: Vec<u32>,
}

impl MailboxSnapshot {
    /// Looks at a mailbox of a node on this computer.
    ///
    /// # Errors
    /// When there is no such mailbox, or what is there is none.
    pub fn new(node: &Node, name: Name) -> Result<Self, InspectError> {
        let detail = node.inspect(name)?;
        let fillers = detail.slots.iter().filter_map(|slot| match slot {
            SlotInfo::Filling { by, .. } => Some(by),
            _ => None,
        });
        let parties = fillers.chain(&detail.receiver).filter(|party| party.is_alive);
        let mut stopped: Vec<u32> = parties.filter_map(|party| party.pid).filter(|pid| is_stopped(*pid)).collect();
        stopped.sort_unstable();
        stopped.dedup();
        stopped.retain(|pid| are_here(node, node.participants().iter().filter(|there| there.pid == *pid)));
        Ok(Self { detail, stopped })
    }
}

/// Whether the numbers of these processes mean them here, too: not if they run in another pid namespace. The first that
/// the kernel tells of speaks for all.
fn are_here<'a>(node: &Node, mut processes: impl Iterator<Item = &'a ParticipantInfo>) -> bool {
    let told = processes.find_map(|process| match node.process_of(process) {
        Ok(Some(_)) => Some(true),
        Err(ProcessError::Elsewhere) => Some(false),
        Ok(None) | Err(ProcessError::Untold(_)) => None,
    });
    told.unwrap_or(true)
}

/// Whether a process stands: the letter after its name, which may hold anything, says so.
pub(crate) fn is_stopped(pid: u32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    stat.rsplit_once(") ").is_some_and(|(_, rest)| rest.starts_with(['T', 't']))
}

/// Whether the kernel writes a core dump of it (`CoreDumping` in proc_pid_status(5)).
pub(crate) fn is_dumping_core(pid: u32) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    status.lines().any(|line| line.split_whitespace().eq(["CoreDumping:", "1"]))
}

/// What a mailbox is for, by its local id.
pub fn purpose(local: u8) -> &'static str {
    match local {
        local::COMMANDS => "commands",
        local::REPLIES => "replies",
        local::DATA => "data",
        _ => "own",
    }
}
