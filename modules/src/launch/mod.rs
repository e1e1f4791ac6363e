//! Launch: starts the modules of one node, watches over them, and stops them.
//!
//! ```text
//!           spawn            state ≠ starting          on
//! Waiting ─────────▶ Starting ───────────────▶ Ready ──────▶ Running ──▶ ended
//!    ▲  backoff                                                │           │ policy
//!    └──────────────────────────────────────────────────────────┴───────────┘──▶ Ended, Failed
//! ```
//!
//! If launch dies, the kernel tells each module (see `runtime::start`), which goes to its safe state and ends; one that
//! cannot is ended by the next launch.

mod child;
mod leftovers;

pub use child::Phase;
pub use leftovers::CONFIG_FILE;

use crate::call::CallError;
use crate::runtime::{ClientError, ToolLink};
use crate::survey::Survey;
use child::Child;
use rohrpost_config::{Installation, Node as NodeConfig, TimeSource as ConfiguredTime};
use rohrpost_mailbox::{
    LaunchLock, Name, Node, NodeError, TimeKeeper, TimeSource, node_directory, realtime_ns, remove_base_if_empty,
};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

/// Modules answer launch within this time.
const PATIENCE: Duration = Duration::from_secs(2);
/// While a module starts it is looked after so often, and while it is switched on: an answer takes moments.
const LOOK_STARTING: Duration = Duration::from_millis(5);
const LOOK_SWITCHING: Duration = Duration::from_millis(1);
/// Notes that are kept for who asks; the oldest go first.
const NOTES_MAX: usize = 1000;

/// A node that somebody else removes just now is taken at the next try, or the next but one.
const TAKE_MAX: usize = 20;

/// Why a node could not be launched.
#[derive(Debug, thiserror::Error)]
pub enum LaunchError {
    /// Several nodes, or another one.
    #[error("which node? the configuration has {0}; say --node NAME")]
    WhichNode(String),
    /// One that is not there.
    #[error("the configuration has no node `{0}`; it has {1}")]
    NoNode(String, String),
    /// The node.
    #[error(transparent)]
    Node(#[from] NodeError),
    /// Launch's own mailboxes.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// Signals.
    #[error("signal handlers: {0}")]
    Signals(std::io::Error),
    /// Programs that are not there.
    #[error("{0}")]
    Programs(String),
    /// A module of an earlier launch.
    #[error("module {0} of an earlier launch, process {1}, cannot be killed; end it by hand (is it another user's?)")]
    Leftover(String, u32),
    /// A module that would not start.
    #[error("module {0} did not become ready: {1}")]
    NotReady(String, String),
}

/// What wakes launch.
pub enum Event {
    /// End it all: a signal, or whoever runs launch.
    Stop,
    /// A child may have ended.
    Child,
}

/// A node that is launched. The thread that begins it must live as long as its modules: the kernel takes that thread's end
/// for launch's, and tells them so.
pub struct Launch {
    installation: Arc<Installation>,
    node_name: String,
    node: Arc<Node>,
    children: Vec<Child>,
    /// Of each child: the call that switches it on, while it is under way.
    switching: Vec<Option<u32>>,
    tool: ToolLink,
    lock: LaunchLock,
    _time: TimeKeeper,
    events: Receiver<Event>,
    /// What happened, for whoever shows it; oldest first.
    notes: Vec<String>,
}

/// The node that is meant: the one named, or the only one.
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
    /// Makes the node and starts its modules one after the other, each when the one before is ready; then switches them on.
    /// The collector of output is switched on as soon as it is ready.
    /// `executable` is the `rohrpost` command, which holds the built-in modules.
    ///
    /// # Errors
    /// When the node runs already, a program is missing, or a module does not become ready. Then nothing is left running.
    pub fn begin(
        installation: Arc<Installation>,
        node_name: &str,
        executable: PathBuf,
        events: Receiver<Event>,
    ) -> Result<Self, LaunchError> {
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
        let time = begin_time(&node, &installation)?;
        leftovers::note_config(&node, &installation, node_name)?;
        let tool = ToolLink::join(&installation, &node, node_name, PATIENCE)?;
        let children: Vec<Child> = installation
            .modules_on(node_name)
            .filter(|module| missing.iter().all(|program| program.module != module.name))
            .map(|module| Child::new(module, &installation, &executable))
            .collect();
        let node_name = node_name.to_owned();
        let switching = vec![None; children.len()];
        let mut launch =
            Self { installation, node_name, node, children, switching, tool, lock, _time: time, events, notes };
        match launch.start_all() {
            Ok(()) => Ok(launch),
            Err(error) => {
                launch.stop();
                Err(error)
            }
        }
    }

    fn start_all(&mut self) -> Result<(), LaunchError> {
        for index in 0..self.children.len() {
            self.children[index].spawn();
            loop {
                if self.told_to_stop(LOOK_STARTING) {
                    return Err(LaunchError::NotReady(self.children[index].text().into(), "told to stop".into()));
                }
                // Those that were started before may end meanwhile.
                (0..=index).for_each(|index| self.step(index));
                let child = &self.children[index];
                match child.phase() {
                    Phase::Ready | Phase::Ended => break,
                    Phase::Failed(why) => return Err(LaunchError::NotReady(child.text().into(), why.clone())),
                    _ => {}
                }
            }
            // At once: switched off, the collector would drop what the others say while they start.
            if Some(self.children[index].name().class()) == self.installation.classes.id(crate::output::CLASS) {
                self.switch_on(index);
            }
        }
        // One after the other, so that each finds those on that it needs.
        for index in 0..self.children.len() {
            self.switch_on(index);
            while self.switching[index].is_some() {
                if self.told_to_stop(LOOK_SWITCHING) {
                    return Err(LaunchError::NotReady(self.children[index].text().into(), "told to stop".into()));
                }
                (0..self.children.len()).for_each(|index| self.step(index));
                self.switch_on(index);
            }
        }
        Ok(())
    }

    /// Moves one module on.
    fn step(&mut self, index: usize) {
        let child = &mut self.children[index];
        let over = |child: &Child| matches!(child.phase(), Phase::Ended | Phase::Failed(_));
        let was_over = over(child);
        let note = child.step(&self.node, Instant::now());
        if !was_over && over(child) {
            self.give_up(index);
        }
        self.note(note);
    }

    /// A module is not started again: its mailboxes go.
    fn give_up(&mut self, index: usize) {
        let Some(module) = self.installation.module(self.children[index].name()) else { return };
        if let Err(error) = leftovers::remove_mailboxes(&self.node, module) {
            self.note(Some(error.to_string()));
        }
    }

    fn note(&mut self, note: Option<String>) {
        self.notes.extend(note);
        let excess = self.notes.len().saturating_sub(NOTES_MAX);
        self.notes.drain(..excess);
    }

    /// Switches a module on that is ready, or looks how far that is. Never waits: one that hangs must not keep the others
    /// from being watched.
    fn switch_on(&mut self, index: usize) {
        let child = &mut self.children[index];
        let call = self.switching[index].take();
        if *child.phase() != Phase::Ready {
            // It ended meanwhile.
            call.into_iter().for_each(|call| self.tool.link.forget(call));
            return;
        }
        let answer = match call {
            None if !child.wants_on() => Some(Ok(())),
            None => match self.tool.begin_switch(child.name(), true) {
                Ok(call) => return self.switching[index] = Some(call),
                Err(error) => Some(Err(error)),
            },
            Some(call) => {
                self.tool.link.collect();
                let answer = self.tool.link.poll(call);
                self.switching[index] = answer.is_none().then_some(call);
                answer
            }
        };
        let Some(answer) = answer else { return };
        child.runs();
        // The lower layers know numbers only.
        let told = |error: CallError| error.to_string().replace(&child.name().to_string(), child.text());
        let note = answer.err().map(|error| format!("{} could not be switched on: {}", child.text(), told(error)));
        self.note(note);
    }

    /// Waits for an event, at most for `period`. Whoever could send one being gone is a word to stop, too.
    fn told_to_stop(&self, period: Duration) -> bool {
        match self.events.recv_timeout(period) {
            Ok(Event::Stop) | Err(RecvTimeoutError::Disconnected) => true,
            Ok(Event::Child) | Err(RecvTimeoutError::Timeout) => false,
        }
    }

    /// Watches for at most `period`, or until something happens; false when it is time to stop.
    pub fn watch(&mut self, period: Duration) -> bool {
        let starting = self.children.iter().any(|child| matches!(child.phase(), Phase::Starting | Phase::Ready));
        let look = if starting { LOOK_STARTING } else { Duration::MAX };
        let look = if self.switching.iter().any(Option::is_some) { LOOK_SWITCHING } else { look };
        let stop = self.told_to_stop(period.min(look));
        for index in 0..self.children.len() {
            self.step(index);
            self.switch_on(index);
        }
        !stop
    }

    /// What happened since it was last asked.
    pub fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// Modules that failed for good, and why.
    pub fn failures(&self) -> Vec<(String, String)> {
        let failed = |child: &Child| match child.phase() {
            Phase::Failed(why) => Some((child.text().to_owned(), why.clone())),
            _ => None,
        };
        self.children.iter().filter_map(failed).collect()
    }

    /// Where launch stands with a module.
    pub fn phase(&self, name: Name) -> Option<&Phase> {
        self.children.iter().find(|child| child.name() == name).map(Child::phase)
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
        Survey::new(&self.node, &self.installation, &self.node_name)
    }

    /// Launch's own link, for calls.
    pub fn tool(&mut self) -> &mut ToolLink {
        &mut self.tool
    }

    /// The configuration it runs.
    pub fn installation(&self) -> &Arc<Installation> {
        &self.installation
    }

    /// Stops all modules, the last first, and removes the node. What does not stop in its time is killed. Returns what there
    /// is to say about it.
    pub fn stop(self) -> Vec<String> {
        let Self { node, mut children, tool, lock, _time, mut notes, .. } = self;
        for child in children.iter_mut().rev() {
            notes.extend(child.stop(&node));
        }
        tool.close();
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

/// Makes a node and becomes its launch.
fn take_node(path: &Path, mode: u32) -> Result<(Arc<Node>, LaunchLock), NodeError> {
    let mut tries = 0;
    loop {
        match Node::create(path, mode).and_then(|node| Ok((node.launch_lock()?, node))) {
            Ok((lock, node)) => return Ok((node, lock)),
            Err(error) if tries == TAKE_MAX || !passes(&error) => return Err(error),
            Err(_) => {}
        }
        tries += 1;
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Whether an earlier launch that ends just now, or `rohrpost clean`, may be the reason: they keep all others out while they
/// remove a node, which takes a moment.
fn passes(error: &NodeError) -> bool {
    match error {
        NodeError::Missing(_) | NodeError::Launched(..) => true,
        NodeError::Io(_, error) => error.kind() == ErrorKind::NotFound,
        _ => false,
    }
}

fn begin_time(node: &Arc<Node>, installation: &Installation) -> Result<TimeKeeper, NodeError> {
    let (source, pace) = match installation.time {
        ConfiguredTime::Local => (TimeSource::Local, 1.0),
        ConfiguredTime::Simulation { speed } => (TimeSource::Simulation, speed),
        ConfiguredTime::Log => (TimeSource::Log, 1.0),
    };
    TimeKeeper::begin(node, source, realtime_ns(), pace)
}

/// A channel of events: SIGINT, SIGTERM and SIGHUP (a terminal was closed) say stop, SIGCHLD that a child may have ended.
///
/// # Errors
/// [`LaunchError::Signals`].
pub fn events() -> Result<Receiver<Event>, LaunchError> {
    use signal_hook::consts::{SIGCHLD, SIGHUP, SIGINT, SIGTERM};
    let mut signals =
        signal_hook::iterator::Signals::new([SIGINT, SIGTERM, SIGHUP, SIGCHLD]).map_err(LaunchError::Signals)?;
    let (sender, receiver) = std::sync::mpsc::channel();
    let forward = move || {
        for signal in signals.forever() {
            let event = if signal == SIGCHLD { Event::Child } else { Event::Stop };
            if sender.send(event).is_err() {
                break;
            }
        }
    };
    std::thread::Builder::new().name("signals".into()).spawn(forward).map_err(LaunchError::Signals)?;
    Ok(receiver)
}
