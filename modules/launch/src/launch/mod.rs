//! Launch: starts the modules of one node, watches over them, and stops them.
//!
//! ```text
//!           spawn            state ≠ starting          on
//! Waiting ─────────▶ Starting ───────────────▶ Ready ──────▶ Running ──▶ ended ── policy ──▶ Ended, Failed
//!    ▲                                                           │           │ backoff
//!    ├───────────────────────────────────────────────────────────│───────────┘
//!    ├── restart, start ── Stopping ◀── told to, from any ───────┘
//!    │                        └── stop ──▶ Stopped
//!    └── restart, start, if its program is there by now ── LeftOut
//! ```
//!
//! One thread turns round and round: it looks after each module, moves the calls on that switch modules on, and answers
//! tools (`serve`). Nothing in it waits for a module. It sleeps on launch's mailboxes; signals ring the same bell. If
//! launch dies, the kernel tells each module (`rohrpost_modules::runtime`), which goes to its safe state and ends; one
//! that cannot is ended by the next launch.

mod child;
mod end;
mod error;
mod events;
mod health;
mod leases;
mod leftovers;
mod look;
mod orphans;
mod policy;
mod printed;
mod program;
mod repeats;
mod serve;
mod silence;
mod start;
mod take;
mod time;

pub use error::{LaunchError, LeaseError, NotStarted};
pub use events::{Event, events, stop_flag};
pub use orphans::reap_orphans;
pub use program::Permit;

use crate::launcher::{Known, Phase};
use crate::survey::Survey;
use child::Child;
use end::LaunchShutdown;
use events::Bell;
use leases::Leases;
use look::Looks;
use program::Program;
use rohrpost_config::{Installation, Module, Node as NodeConfig};
use rohrpost_mailbox::{LaunchLock, Name, Node, NodeError, node_directory, remove_base_if_empty, wait_any};
use rohrpost_modules::common::OutputLevel;
use rohrpost_modules::launch_support::{OutputProxy, Relay};
use rohrpost_modules::runtime::{ClientError, ToolLink};
use serve::{Counter, Orders};
use start::UnderWay;
use std::ops::Range;
use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};
use take::take_node;
use time::NodeTime;

/// Modules answer launch within this time.
const PATIENCE: Duration = Duration::from_secs(2);
/// While a module is being switched on, its call is looked at so often; an answer wakes launch sooner.
const LOOK_SWITCHING: Duration = Duration::from_millis(50);
/// While all modules are being stopped, it is looked so often which one may be told next.
const LOOK_ENDING: Duration = Duration::from_millis(20);
/// How often launch looks whether the computer's clock was set.
const LOOK_CLOCK: Duration = Duration::from_secs(1);
/// By then no thread of launch's holds its place on the node any more.
const LET_GO: Duration = Duration::from_secs(1);
/// Notes that are kept for queries; the oldest go first.
const NOTES_MAX: usize = 1000;

/// A node that is launched. The thread that begins it must live as long as its modules: the kernel takes that thread's
/// end for launch's, and tells them so.
pub struct Launch {
    installation: Arc<Installation>,
    node_name: String,
    node: Arc<Node>,
    children: Vec<Child>,
    /// The call under way of each child.
    calls: Vec<UnderWay>,
    tool: ToolLink,
    counter: Counter,
    /// What it saw for tools on other nodes.
    looks: Looks,
    /// What it knows of its modules, for tools on this node.
    known: Known,
    bell: Bell,
    lock: LaunchLock,
    time: NodeTime,
    /// Of modules with several nodes.
    leases: Leases,
    /// What it says itself, in order with what it passes on of its modules.
    output: Option<OutputProxy>,
    /// Events to show, oldest first.
    notes: Vec<String>,
}

/// The node that is meant: the one named, or the only one.
///
/// ```
/// # use rohrpost_launch::{LaunchError, choose_node};
/// fn name(installation: &rohrpost_config::Installation) -> Result<&str, LaunchError> {
///     Ok(&choose_node(installation, None)?.name)
/// }
/// ```
///
/// # Errors
/// [`LaunchError::WhichNode`] and [`LaunchError::NoNode`].
pub fn choose_node<'a>(installation: &'a Installation, name: Option<&str>) -> Result<&'a NodeConfig, LaunchError> {
    let names = || installation.nodes.iter().map(|node| node.name.as_str()).collect::<Vec<_>>().join(", ");
    match (name, &installation.nodes[..]) {
        (Some(name), _) => installation.node(name).ok_or_else(|| LaunchError::NoNode(name.into(), names())),
        (None, [only]) => Ok(only),
        (None, _) => Err(LaunchError::WhichNode(names())),
    }
}

impl Launch {
    /// Makes the node and starts its modules one after the other, each when the one before is ready; then switches them
    /// on. The collector of output is switched on as soon as it is ready. `executable` is the `rohrpost` command, which
    /// holds the built-in modules; `resolved` is laid beside the mailboxes as `node.json`: what the configuration
    /// resolved to, for programs.
    ///
    /// # Errors
    /// When the node runs already, a program is missing, or a module does not become ready. Then nothing is left
    /// running.
    pub fn begin(
        installation: Arc<Installation>,
        node_name: &str,
        executable: PathBuf,
        events: Receiver<Event>,
        resolved: &[u8],
    ) -> Result<Self, LaunchError> {
        let permit: Permit = Arc::new(|_| Ok(()));
        Self::begin_keeping(installation, node_name, executable, events, resolved, |_| Vec::new(), &permit)
    }

    /// Starts as above, and keeps what `keep` gives for a module: sockets, say. Each process of that module has them
    /// ([`kept`](rohrpost_modules::runtime::kept)), so what waits in them outlives it. Each start
    /// of a program is permitted by `permit`.
    ///
    /// # Errors
    /// As for [`Launch::begin`].
    pub fn begin_keeping(
        installation: Arc<Installation>,
        node_name: &str,
        executable: PathBuf,
        events: Receiver<Event>,
        resolved: &[u8],
        keep: impl Fn(&Module) -> Vec<OwnedFd>,
        permit: &Permit,
    ) -> Result<Self, LaunchError> {
        let installation = Arc::new(Arc::unwrap_or_clone(installation).seen_from(node_name));
        let usual_nice = program::hurry();
        let beside = executable.parent().map(PathBuf::from).unwrap_or_default();
        let missing = installation.missing_programs(node_name, &beside);
        let fatal: Vec<String> = missing.iter().filter(|p| !p.optional).map(ToString::to_string).collect();
        if !fatal.is_empty() {
            return Err(LaunchError::Programs(fatal.join("\n")));
        }
        let mode = installation.node(node_name).map_or(0o700, |node| node.mode);
        let (node, lock) = take_node(&node_directory(&installation.name, node_name), mode)?;
        let mut notes = leftovers::end(&node, &installation, node_name)?;
        notes.extend(missing.iter().map(ToString::to_string));
        let time = NodeTime::begin(&node, &installation, node_name)?;
        leftovers::note_config(&node, &installation, node_name, resolved)?;
        let tool = ToolLink::join_as_launch(&installation, &node, node_name, PATIENCE)?;
        let leases = Leases::begin(&installation, &node, node_name)?;
        let counter = Counter::open(&tool.link, &installation).map_err(ClientError::from)?;
        let bell = Bell::listen(events, tool.link.participant())?;
        let relay = Relay::new(tool.link.participant(), tool.link.me());
        let mut children = Vec::new();
        for module in installation.modules_on(node_name) {
            let mut kept = keep(module);
            kept.extend(leases.kept_for(module.name).map_err(LeaseError::from)?);
            let program = Program::new(module, &installation, &executable, kept, usual_nice, permit);
            let is_missing = missing.iter().any(|missing| missing.module == module.name);
            children.push(Child::new(module, &installation, program, &relay, is_missing));
        }
        let output = relay.voice(&installation, tool.link.me());
        // It holds launch's place on the node, which is to be given back if the start fails.
        drop(relay);
        let node_name = node_name.to_owned();
        let calls = vec![UnderWay::default(); children.len()];
        let (looks, known) = (Looks::default(), Known::default());
        let mut launch = Self {
            installation,
            node_name,
            node,
            children,
            calls,
            tool,
            counter,
            looks,
            known,
            bell,
            lock,
            time,
            leases,
            output,
            notes,
        };
        match launch.start_all() {
            Ok(()) => Ok(launch),
            Err(error) => Err(error.with(launch.stop())),
        }
    }

    /// Moves the leases on.
    fn step_leases(&mut self) {
        let note = self.leases.step(&mut self.children, &mut self.tool, &self.node, Instant::now());
        self.note(note);
    }

    /// Moves one module on.
    fn step(&mut self, index: usize) {
        let note = self.children[index].step(&self.node, Instant::now());
        self.note(note);
    }

    /// Removes what those leave that have ended, or were told to stay so, and answers tools: a tool that is told that a
    /// module is stopped finds no mailbox of it.
    fn serve(&mut self, ending: bool) {
        reap_orphans(|ended| self.children.iter().any(|child| child.started() == Some(ended)));
        // At the end all goes at once, with the node.
        if !ending {
            (0..self.children.len()).for_each(|index| self.remove_left_mailboxes(index));
        }
        let now = Instant::now();
        self.known.write(&self.node, self.children.iter().map(|child| child.state(now)).collect());
        let (children, installation, node) = (&mut self.children[..], &*self.installation, &*self.node);
        let (looks, notes, time) = (&mut self.looks, &mut self.notes, &mut self.time);
        let (leases, node_name) = (&mut self.leases, &*self.node_name);
        let orders = Orders { children, installation, node, node_name, looks, notes, time, leases, ending };
        self.counter.serve(orders, &mut self.tool.link);
    }

    /// A module is not started again: its mailboxes go. While somebody else holds the registry, that is tried again
    /// later.
    fn remove_left_mailboxes(&mut self, index: usize) {
        let child = &mut self.children[index];
        if !child.has_left_mailboxes() {
            return;
        }
        let Some(module) = self.installation.module(child.name()) else { return };
        let removed = leftovers::remove_mailboxes(&self.node, module);
        if matches!(removed, Err(NodeError::Busy(_))) {
            return;
        }
        child.mailboxes_are_gone();
        let note = removed.err().map(|error| format!("mailboxes of {} are left: {error}", child.text()));
        self.note(note);
    }

    /// That the computer's clock was set is a line for the terminal and one for the collector of output.
    fn look_at_clock(&mut self) {
        let Some(news) = self.time.look() else { return };
        if let Some(output) = &self.output {
            output.say(OutputLevel::Warn, output.now_ns(), news.clone(), None);
        }
        self.note(Some(news));
    }

    fn note(&mut self, note: Option<String>) {
        self.notes.extend(note);
        let excess = self.notes.len().saturating_sub(NOTES_MAX);
        self.notes.drain(..excess);
    }

    /// Sleeps until there is something to do for launch or for one of these children, at most for `period`.
    fn sleep(&mut self, children: Range<usize>, period: Duration) {
        // Late answers must not wait for ever in front of its sleep.
        self.tool.link.collect();
        let now = Instant::now();
        let looks = self.children[children].iter().filter_map(|child| child.look_again(now));
        let switching = self.calls.iter().any(|calls| calls.switch.is_some()).then_some(LOOK_SWITCHING);
        let period = looks.chain(switching).chain(self.leases.due_in()).fold(period, Duration::min);
        let mailboxes = &mut [self.counter.commands(), self.tool.link.replies()];
        wait_any(mailboxes, now.checked_add(period), || self.bell.was_rung());
    }

    /// Watches for at most `period`, or until something happens; false when it is time to stop.
    pub fn watch(&mut self, period: Duration) -> bool {
        self.sleep(0..self.children.len(), period.min(LOOK_CLOCK));
        // First: what runs without its lease after a long sleep must not be started again.
        self.step_leases();
        for index in 0..self.children.len() {
            self.step(index);
            self.switch_on(index);
            self.ask_why(index);
        }
        self.look_at_clock();
        self.serve(false);
        self.bell.words() == 0
    }

    /// What happened since it was last asked.
    pub fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// Modules that failed for good or are in error, and why.
    pub fn failures(&self) -> Vec<String> {
        let failure = |child: &Child| match child.phase() {
            Phase::Failed => Some(format!("{} failed for good: {}", child.text(), child.last_end())),
            _ => child.present_error(&self.node),
        };
        self.children.iter().filter_map(failure).collect()
    }

    /// Modules that are in error, or are meant to be on and are not: what each is.
    pub fn not_on(&self) -> impl Iterator<Item = String> {
        self.children.iter().filter_map(|child| child.not_on(&self.node))
    }

    /// Where launch stands with a module.
    pub fn phase(&self, name: Name) -> Option<Phase> {
        self.children.iter().find(|child| child.name() == name).map(Child::phase)
    }

    /// Where launch stands with each module, by its name.
    pub fn phases(&self) -> impl Iterator<Item = (&str, Phase)> {
        self.children.iter().map(|child| (child.text(), child.phase()))
    }

    /// How often a module was started again.
    pub fn restarts(&self, name: Name) -> u32 {
        self.children.iter().find(|child| child.name() == name).map_or(0, Child::restarts)
    }

    /// Looks at the node.
    ///
    /// # Errors
    /// When its directory cannot be read.
    pub fn survey(&self) -> Result<Survey, NodeError> {
        let mut survey = Survey::new(&self.node, &self.installation, &self.node_name)?;
        survey.ask_kernel(&self.node);
        Ok(survey)
    }

    /// Launch's own link, for calls.
    pub fn tool(&mut self) -> &mut ToolLink {
        &mut self.tool
    }

    /// The configuration it runs.
    pub fn installation(&self) -> &Arc<Installation> {
        &self.installation
    }

    /// Stops all modules, the last first, and removes the node. What does not stop in its time is killed; all is killed
    /// at once when a second word to stop comes. Returns what there is to say about it.
    pub fn stop(mut self) -> Vec<String> {
        let mut ending = LaunchShutdown::begin(&mut self.children, self.bell.words(), Instant::now());
        loop {
            // A module keeps its lease until it is off, and then gives it back.
            self.step_leases();
            let now = Instant::now();
            for child in &mut self.children {
                self.notes.extend(child.step(&self.node, now));
            }
            let note = ending.step(&mut self.children, &self.node, self.bell.words(), now);
            self.note(note);
            if ending.is_over(&self.children) {
                break;
            }
            self.serve(true);
            self.sleep(0..self.children.len(), LOOK_ENDING);
        }
        let participant = Arc::downgrade(self.tool.link.participant());
        let Self { node, children, output, tool, counter, lock, time: _time, mut notes, .. } = self;
        // They hold a way to the collector.
        drop((children, output));
        counter.close();
        tool.close();
        // A thread that passes on a last line holds it for a moment; it never waits.
        let deadline = Instant::now() + LET_GO;
        while participant.strong_count() > 0 && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(1));
        }
        drop(lock);
        match node.remove_if_dead() {
            Ok(true) => remove_base_if_empty(),
            Ok(false) => notes.push(format!(
                "somebody still uses {}; `rohrpost clean` removes it when they have ended",
                node.path().display()
            )),
            Err(error) => notes.push(error.to_string()),
        }
        notes
    }
}
