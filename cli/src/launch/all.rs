//! `rohrpost launch --all`: every node of a configuration on this computer, each in its own network namespace.
//!
//! ```text
//!  this command ─┬─ rohrpost launch FILE --node base ─┬─ router.0      namespace of base ──┐
//!                │                                    └─ motor.0 …                         ├─ bridge
//!                └─ rohrpost launch FILE --node desk ─── router.1 …    namespace of desk ──┘
//! ```
//!
//! The nodes start together, like computers that are switched on together, and stop one after the other, the last
//! first. If this command dies, the kernel tells each launch to stop; when the last process of a node has ended, its
//! namespace is gone.

use crate::terminal::Failure;
use crate::terminal::speech::Speech;
use nix::sys::signal::{Signal, kill};
use nix::unistd::{Pid, getppid};
use rohrpost_config::{Installation, Reach};
use rohrpost_launch::{Event, events, reap_orphans};
use rohrpost_mailbox::node_directory;
use rohrpost_routers::impair;
use rohrpost_routers::lab::{Capture, Lab, NodeSpec};
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, ExitCode, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// The environment variable with the id of the process that a launch must not outlive.
const WITHIN: &str = "ROHRPOST_LAUNCH_ALL";
/// Link rate where the configuration gives none: Ethernet.
const MTU: u16 = 1500;
/// Capacity for lines from the nodes; a full channel makes their threads wait.
const LINES_MAX: usize = 256;
/// The signals for "stop" and "stop at once". They differ, since the kernel may merge two equal signals into one.
const WORDS: [Signal; 2] = [Signal::SIGINT, Signal::SIGTERM];
/// At the end, wait this long for the last lines.
const LAST_LINES: Duration = Duration::from_secs(1);

/// The line that a launch prints when all its modules are on.
pub(super) fn runs(node: &str, installation: &str) -> String {
    format!("node {node} of {installation} runs")
}

/// Ends this launch in order when its parent `launch --all` dies. A launch without such a parent is not affected.
///
/// # Errors
/// When that command has already ended.
pub(super) fn stop_with_it() -> Result<(), Failure> {
    let Some(parent) = std::env::var(WITHIN).ok().and_then(|pid| pid.parse().ok()) else { return Ok(()) };
    nix::sys::prctl::set_pdeathsig(Some(Signal::SIGTERM))?;
    // It may have died before the call above.
    if getppid() == Pid::from_raw(parent) {
        Ok(())
    } else {
        Err(format!("process {parent}, which launches all nodes, is gone").into())
    }
}

/// The nodes of an installation, or of several, all on this computer.
pub(crate) struct LaunchedNodes<'a> {
    nodes: Vec<Node>,
    happenings: Receiver<NodeEvent>,
    /// Open output streams of all nodes.
    open: usize,
    speech: &'a Speech,
    /// Stop requests so far.
    words: u32,
    /// The nodes are being stopped: their ends are expected.
    stopping: bool,
    /// Their network; none: they share that of this computer.
    lab: Option<Lab>,
    /// How each launch is started.
    start_with: StartWith,
}

struct StartWith {
    executable: PathBuf,
    /// How the network is made worse.
    bad: Option<impair::ImpairmentSettings>,
    /// Level from which on launch shows what modules say.
    log: Option<String>,
    sender: SyncSender<NodeEvent>,
}

struct Node {
    installation: Arc<Installation>,
    name: String,
    child: Child,
    /// All its modules are on.
    runs: bool,
    ended: Option<ExitStatus>,
    /// Stop signals that it was sent.
    told: usize,
    /// An end that was wanted.
    killed: bool,
}

enum NodeEvent {
    Line {
        node: usize,
        text: String,
        complaint: bool,
    },
    /// One of its two streams has ended.
    Closed,
    /// A stop was requested, or a child may have ended.
    Event(Event),
}

/// Creates the namespaces of all nodes. Must be called before this process has a second thread.
///
/// # Errors
/// When there is only one node, or the system does not allow namespaces.
pub(crate) fn lab(installation: &Installation) -> Result<Lab, Failure> {
    if installation.nodes.len() == 1 {
        let file = installation.shown.display();
        return Err(format!("{file} has one node; launch it without --all: rohrpost launch {file}").into());
    }
    // A node that is alone on its LAN may have no address there: then it gets one on the network of the TCP router.
    let server = installation.tcp.as_ref().and_then(|tcp| Some((tcp.server.as_deref()?, tcp.address.ip())));
    let address = |node: &rohrpost_config::Node| node.address.or_else(|| server.map(|(_, address)| address));
    let spec = |node: &rohrpost_config::Node| Some(NodeSpec { name: node.name.clone(), address: address(node)? });
    let specs: Vec<NodeSpec> = installation.lan_nodes().iter().filter_map(spec).collect();
    rohrpost_routers::lab::become_able()?;
    let mut lab = Lab::new(&specs, installation.network.map_or(MTU, |network| network.mtu))?;
    if let Some((home, address)) = server {
        let beyond = installation.nodes.iter().filter(|node| node.reach == Reach::Tcp);
        let beyond: Vec<&str> = beyond.map(|node| node.name.as_str()).collect();
        let is_on_lan = specs.iter().any(|spec| spec.address == address);
        if !beyond.is_empty() || !is_on_lan {
            lab.join_beyond(home, address, &beyond)?;
        }
    }
    Ok(lab)
}

impl<'a> LaunchedNodes<'a> {
    /// Starts the launch of each node of these installations, no two of one name; each shows what its modules say from
    /// the level `log` on. The calling thread must live as long as the nodes: the kernel takes its end for this
    /// command's end.
    ///
    /// # Errors
    /// When one cannot be started; then all are stopped.
    pub(crate) fn begin(
        installations: impl IntoIterator<Item = Arc<Installation>>,
        lab: impl Into<Option<Lab>>,
        bad: Option<impair::ImpairmentSettings>,
        log: Option<&str>,
        speech: &'a Speech,
    ) -> Result<Self, Failure> {
        let (sender, happenings) = sync_channel(LINES_MAX);
        listen(sender.clone())?;
        let start_with = StartWith { executable: std::env::current_exe()?, bad, log: log.map(str::to_owned), sender };
        let (nodes, open, words, stopping, lab) = (Vec::new(), 0, 0, false, lab.into());
        let mut all = Self { nodes, happenings, open, speech, words, stopping, lab, start_with };
        for installation in installations {
            for node in &installation.nodes {
                let started = all.start(all.nodes.len(), installation.clone(), node.name.clone());
                if let Err(error) = started {
                    all.stop();
                    return Err(error);
                }
            }
        }
        Ok(all)
    }

    /// Starts the launch of a node, the next one or one that has ended.
    fn start(&mut self, index: usize, installation: Arc<Installation>, name: String) -> Result<(), Failure> {
        let StartWith { executable, bad, log, sender } = &self.start_with;
        let sender = sender.clone();
        let mut command = Command::new(executable);
        command.arg("launch").arg(&installation.path).args(["--node", &name, "--quiet"]);
        command.args(log.as_ref().map(|level| format!("--log={level}")));
        command.env(WITHIN, std::process::id().to_string());
        if let Some(bad) = bad {
            command.env(impair::ENVIRONMENT, bad.to_string());
        }
        // A separate process group: Ctrl-C reaches only this command.
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).process_group(0);
        let mut child = match &self.lab {
            Some(lab) => lab.command(&name, &mut command)?,
            None => command.spawn()?,
        };
        let (out, err) = (child.stdout.take(), child.stderr.take());
        let node = Node { installation, name, child, runs: false, ended: None, told: 0, killed: false };
        match self.nodes.get_mut(index) {
            Some(before) => *before = node,
            None => self.nodes.push(node),
        }
        read(index, false, out, sender.clone())?;
        self.open += 1;
        read(index, true, err, sender)?;
        self.open += 1;
        Ok(())
    }

    /// Kills all processes of a node, as a cut of its power does.
    ///
    /// # Errors
    /// When its launch cannot be waited for.
    pub(crate) fn kill(&mut self, name: &str) -> Result<(), Failure> {
        let Some(node) = self.nodes.iter_mut().find(|node| node.name == name) else { return Ok(()) };
        node.child.kill()?;
        node.killed = true;
        // Those that end by themselves meanwhile are gone, too.
        if let Ok(memory) = rohrpost_mailbox::Node::open(&node_directory(&node.installation.name, name)) {
            let of = |participant| memory.process_of(&participant).ok().flatten();
            for process in memory.participants().into_iter().filter_map(of) {
                let _ = process.kill();
            }
        }
        node.ended = Some(node.child.wait()?);
        Ok(())
    }

    /// Starts a node again that was killed.
    ///
    /// # Errors
    /// When its launch cannot be started.
    pub(crate) fn start_again(&mut self, name: &str) -> Result<(), Failure> {
        let Some(index) = self.nodes.iter().position(|node| node.name == name) else { return Ok(()) };
        self.start(index, self.nodes[index].installation.clone(), name.into())
    }

    /// The network between the nodes.
    ///
    /// # Errors
    /// Nodes share that of this computer.
    pub(crate) fn lab(&self) -> Result<&Lab, Failure> {
        self.lab.as_ref().ok_or_else(|| "the nodes have no network of their own".into())
    }

    /// Begins to capture the network's traffic.
    pub(crate) fn capture(&self) -> Result<Capture, Failure> {
        Ok(self.lab()?.capture()?)
    }

    /// Handles events for at most `period`, or until something happens; false when it is time to stop: a stop was
    /// requested, a node did not start, or no node runs any more.
    pub(crate) fn watch(&mut self, period: Duration) -> bool {
        match self.happenings.recv_timeout(period) {
            Ok(happening) => self.note(happening),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => self.words += 1,
        }
        self.words == 0
            && self.nodes.iter().all(|node| node.runs || node.ended.is_none())
            && self.nodes.iter().any(|node| node.ended.is_none())
    }

    /// Whether all modules of all nodes are on.
    pub(crate) fn all_run(&self) -> bool {
        self.nodes.iter().all(|node| node.runs)
    }

    fn note(&mut self, happening: NodeEvent) {
        match happening {
            NodeEvent::Line { node, text, complaint } => self.line(node, &text, complaint),
            NodeEvent::Closed => self.open -= 1,
            NodeEvent::Event(Event::Stop) => self.words += 1,
            NodeEvent::Event(Event::Child) => self.look_for_ended(),
        }
    }

    fn line(&mut self, index: usize, text: &str, complaint: bool) {
        let width = self.nodes.iter().map(|node| node.name.len()).max().unwrap_or(0);
        let node = &mut self.nodes[index];
        node.runs |= text.starts_with(&runs(&node.name, &node.installation.name));
        let line = format!("{:>width$} │ {text}", node.name);
        if complaint { self.speech.complain(&line) } else { self.speech.say(&line) }
    }

    fn look_for_ended(&mut self) {
        for node in self.nodes.iter_mut().filter(|node| node.ended.is_none()) {
            node.ended = node.child.try_wait().ok().flatten();
            if let Some(status) = node.ended.filter(|_| !self.stopping) {
                let how = if node.runs { "ended" } else { "did not start" };
                self.speech.complain(&format!("node {} {how}: {status}", node.name));
            }
        }
        let is_own = |ended| self.nodes.iter().any(|node| node.ended.is_none() && node.child.id() == ended);
        reap_orphans(is_own);
    }

    /// Stops all nodes, the last first; all at once on a second stop request. A node that failed sets the exit code.
    pub(crate) fn stop(mut self) -> ExitCode {
        // Earlier ends are reported already.
        self.look_for_ended();
        self.stopping = true;
        let words = self.words;
        while let Some(last) = self.nodes.iter().rposition(|node| node.ended.is_none()) {
            let hurry = self.words > words;
            for (index, node) in self.nodes.iter_mut().enumerate() {
                node.tell(if hurry { WORDS.len() } else { usize::from(index == last) });
            }
            match self.happenings.recv() {
                Ok(happening) => self.note(happening),
                Err(_) => break,
            }
        }
        let deadline = Instant::now() + LAST_LINES;
        while self.open > 0 && Instant::now() < deadline {
            let left = deadline.saturating_duration_since(Instant::now());
            self.happenings.recv_timeout(left).into_iter().for_each(|happening| self.note(happening));
        }
        let well = self.nodes.iter().all(|node| node.killed || node.ended.is_some_and(|status| status.success()));
        if well { ExitCode::SUCCESS } else { ExitCode::FAILURE }
    }
}

impl Node {
    /// Sends it stop signals, until it has got this many.
    fn tell(&mut self, often: usize) {
        for word in WORDS.iter().take(often).skip(self.told) {
            if self.ended.is_none() {
                // It is our child and not reaped, so its process id is not reused.
                let _ = kill(Pid::from_raw(self.child.id() as i32), *word);
            }
        }
        self.told = self.told.max(often);
    }
}

/// Forwards signals as events.
fn listen(sender: SyncSender<NodeEvent>) -> Result<(), Failure> {
    let events = events()?;
    let pass = move || {
        for event in events {
            if sender.send(NodeEvent::Event(event)).is_err() {
                break;
            }
        }
    };
    std::thread::Builder::new().name("events".into()).spawn(pass)?;
    Ok(())
}

/// Forwards a node's output as events.
fn read(
    node: usize,
    complaint: bool,
    pipe: Option<impl Read + Send + 'static>,
    sender: SyncSender<NodeEvent>,
) -> Result<(), Failure> {
    let Some(pipe) = pipe else { return Ok(()) };
    let pass = move || {
        for line in BufReader::new(pipe).split(b'\n').map_while(Result::ok) {
            let text = String::from_utf8_lossy(&line).into_owned();
            if sender.send(NodeEvent::Line { node, text, complaint }).is_err() {
                return;
            }
        }
        let _ = sender.send(NodeEvent::Closed);
    };
    std::thread::Builder::new().name("lines".into()).spawn(pass)?;
    Ok(())
}
