//! Launch as others see it: what it can be asked while it runs, and what it knows of its modules.
//!
//! Launch takes the first instance of class `tool` on its node; this is the interface that it serves there.

mod asking;
mod known;

pub use asking::AskLaunch;
pub(crate) use known::{Known, read as known_children};

use rohrpost_config::Installation;
use rohrpost_mailbox::Name;
use rohrpost_modules::interface;
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

/// Questions about leases that a node asks another one, or the answers.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct LeaseMessage {
    /// The last incarnation that the sending node gave out. The other one passes it, so that a module has rising
    /// incarnations from node to node.
    pub incarnation: u32,
    /// Of modules, by their raw names: bytes of `rohrpost_supervision::lease`.
    pub leases: Vec<(u32, Vec<u8>)>,
}

/// Where launch stands with a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Phase {
    /// Not started yet, or waiting to be started again.
    Waiting,
    /// Started, not ready.
    Starting,
    /// Ready, and not switched on yet.
    Ready,
    /// At work, or switched off by somebody.
    Running,
    /// Told to end.
    Stopping,
    /// Ended because somebody asked for it; it stays so until it is started.
    Stopped,
    /// Ended, and that was all right.
    Ended,
    /// Ended, and not to be started again.
    Failed,
    /// Optional, and its program was not there when launch began; a start looks for the program again.
    LeftOut,
    /// Another of its nodes runs it, or may; this one begins when it holds the lease.
    StandsBy,
}

impl Phase {
    /// One word.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Starting => "starting",
            Self::Ready => "ready",
            Self::Running => "running",
            Self::Stopping => "stopping",
            Self::Stopped => "stopped",
            Self::Ended => "ended",
            Self::Failed => "failed",
            Self::LeftOut => "left out",
            Self::StandsBy => "stands by",
        }
    }

    /// Whether it does not run, and will not unless somebody asks for it.
    ///
    /// ```
    /// use rohrpost_launch::launcher::Phase;
    ///
    /// assert!(Phase::Failed.is_over() && !Phase::Starting.is_over());
    /// ```
    pub const fn is_over(self) -> bool {
        matches!(self, Self::Stopped | Self::Ended | Self::Failed | Self::LeftOut)
    }
}

/// What launch knows of a module.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ChildState {
    /// The module's name, such as `pilot.0`.
    pub module: String,
    /// Where launch stands with it.
    pub phase: Phase,
    /// The module's process, while there is one.
    pub pid: Option<u32>,
    /// Processes it has had, this one included.
    pub lives: u32,
    /// How often its restart policy has started it again.
    pub restarts: u32,
    /// How many of these count against its restart policy now,
    pub attempt: u32,
    /// and at how many it is given up.
    pub attempts_max: u32,
    /// When it will be started again, ms from now.
    pub starts_in_ms: Option<u32>,
    /// How it ended the last time, or why it failed; empty if it never ended. With what it printed, as far as it fits.
    pub last_end: String,
    /// The last that went wrong with it: why it is or was in error, or how it failed; empty if nothing did.
    pub error: String,
    /// The last line that it printed; empty if it printed none.
    pub printed: String,
}

/// Some of the modules that launch watches over.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Children {
    /// All there are.
    pub total: u16,
    /// From the one that was asked for on, as many as fit in a reply.
    pub states: Vec<ChildState>,
}

/// Why launch did not do what it was asked. A text without a name is the module's name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema, thiserror::Error)]
pub enum ControlError {
    /// Not one of its modules.
    #[error(
        "launch watches over no module `{0}` on this node: it is on another one, or not in the configuration; \
         `rohrpost list` shows which there are"
    )]
    NoModule(String),
    /// The module is to be started, and runs.
    #[error("{0} runs already; `rohrpost restart {0}` would end it first")]
    Running(String),
    /// The module is to be stopped, and was.
    #[error("{0} is stopped already; `rohrpost start {0}` starts it")]
    Stopped(String),
    /// The module is to be stopped, and has ended by itself.
    #[error("{0} has ended already, and is not started again by itself; `rohrpost start {0}` starts it")]
    Ended(String),
    /// The module is to be stopped, and was left out.
    #[error("{0} is left out and never ran, since its program is missing; `rohrpost start {0}` looks for it again")]
    LeftOut(String),
    /// The module is to be started, and its program is missing. One that runs goes on.
    #[error("{module} is not started: for launch `{program}` {place}; build or install it, then say it again")]
    NoProgram {
        /// The module.
        module: String,
        /// The module's program, as the configuration names it.
        program: String,
        /// Where launch looked for it.
        place: String,
    },
    /// Launch stops all modules.
    #[error("launch is ending; it stops {0} like all others")]
    Ending(String),
    /// A new epoch is to begin, and launch does not tell the time.
    #[error("launch does not tell the time of this node; the master of time, a simulation or a player does")]
    OtherTime,
}

/// Bytes of the longest look; one is some ten kilobytes.
pub const LOOK_BYTES_MAX: usize = 1 << 20;

/// How much of a node is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Scope {
    /// The node's modules, and the traffic by class.
    Modules,
    /// The node's modules, all mailboxes and all streams.
    Mailboxes,
    /// The node's streams alone.
    Streams,
    /// All of the node, and what everybody sends.
    All,
    /// What there is of one module (its raw name): its streams, its mailboxes and those that it sends to, what it sends
    /// and what is sent to it.
    Module(u32),
}

/// What is to be looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum SnapshotRequest {
    /// The node.
    Survey(Scope),
    /// A mailbox (its raw name), down to its slots.
    Mailbox(u32),
}

/// A part of a look.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct LookPage {
    /// Number of the look: pages of different ones do not belong together.
    pub look: u32,
    /// Bytes of the whole.
    pub total: u32,
    /// First byte of this page.
    pub from: u32,
    /// From there on, as many as were asked for or are left.
    pub bytes: Vec<u8>,
}

/// Why launch shows nothing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema, thiserror::Error)]
pub enum LookError {
    /// Reader and launch are of different versions.
    #[error(
        "its launch shows nodes in another form ({0:#010x}) than this program reads: use the same version of Rohrpost \
         on all nodes (`rohrpost version`)"
    )]
    Form(u32),
    /// Newer looks took its place; begin anew.
    #[error("its launch does not keep this look any more: too many look at once; try again")]
    Gone,
    /// The look itself failed.
    #[error("{0}")]
    Failed(String),
    /// The look has so many bytes.
    #[error("the look has {0} bytes, which is more than {LOOK_BYTES_MAX}; look at one module (`rohrpost bw NAME`)")]
    TooLarge(u32),
}

/// Launch: starts the modules of its node, and watches over them.
#[interface(class = "tool", crate = rohrpost_modules::macro_support)]
pub trait Launcher {
    /// How it stands with the modules, from this one on (0: the first of the configuration), as many as fit.
    #[command(16, idempotent)]
    fn children(&mut self, first: u16) -> Children;

    /// Ends a module if it runs, and starts it; it is switched on again unless it was off. Not counted against its
    /// restart policy. Answers at once: with the number of the process that is to come, counted from 1 (`lives`).
    #[command(17)]
    fn restart(&mut self, module: String) -> Result<u32, ControlError>;

    /// Ends a module; it stays ended until it is started. Answers at once.
    #[command(18)]
    fn stop(&mut self, module: String) -> Result<(), ControlError>;

    /// Starts a module that has ended, was stopped, was left out, or waits to be started again. Answers as `restart`
    /// does.
    #[command(19)]
    fn start(&mut self, module: String) -> Result<u32, ControlError>;

    /// Looks at its node, keeps what it saw for a while, and answers with the first page of it. `form` is that of the
    /// looks that the reader knows; no page is longer than `bytes_max`.
    #[command(20, idempotent)]
    fn look(&mut self, what: SnapshotRequest, form: u32, bytes_max: u16) -> Result<LookPage, LookError>;

    /// A further page of this look, from this byte on.
    #[command(21, idempotent)]
    fn look_on(&mut self, look: u32, from: u32, bytes_max: u16) -> Result<LookPage, LookError>;

    /// Begins a new epoch of the node's time at the computer's clock; its number.
    #[command(22)]
    fn new_epoch(&mut self) -> Result<u64, ControlError>;

    /// Ends a module that does not do its work, as its watchdog would: a failure that its restart policy counts. Only
    /// if it is on, in the process that called with this incarnation; whether it was. One that was stopped, switched
    /// off, or started again meanwhile is left alone.
    #[command(23)]
    fn end_failing(&mut self, module: String, cause: String, incarnation: u32) -> Result<bool, ControlError>;

    /// Asks for leases of modules with several nodes, which this node grants. No answer: not a question, one that a
    /// newer one has passed, or this node's router could not be told.
    #[command(24, idempotent)]
    fn lease(&mut self, asks: LeaseMessage) -> LeaseMessage;
}

/// The functions' numbers.
const CHILDREN: u16 = 16;
const RESTART: u16 = 17;
const STOP: u16 = 18;
const START: u16 = 19;
pub(crate) const LOOK: u16 = 20;
pub(crate) const LOOK_ON: u16 = 21;
const NEW_EPOCH: u16 = 22;
#[cfg(test)]
const END_FAILING: u16 = 23;
pub(crate) const LEASE: u16 = 24;

/// The name under which the launch of a node takes commands, if the configuration has this node.
///
/// ```
/// # use rohrpost_launch::launcher::{AskLaunch, launcher_of};
/// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
/// # use rohrpost_config::Installation;
/// fn modules_of(tool: &mut ToolLink, installation: &Installation, node: &str) -> Result<usize, CallError> {
///     let Some(launcher) = launcher_of(installation, node) else { return Ok(0) };
///     Ok(tool.children(launcher)?.len())
/// }
/// ```
pub fn launcher_of(installation: &Installation, node: &str) -> Option<Name> {
    Some(installation.launch_of(installation.node(node)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_modules::interface::Interface;

    #[test]
    fn what_launch_says_comes_back() {
        let description = LauncherInterface::description();
        assert_eq!(rohrpost_schema::Description::from_bytes(&description.to_bytes()), Ok(description));
    }

    #[test]
    fn a_tool_calls_the_functions_by_their_numbers() {
        let functions = LauncherInterface::description().functions;
        let numbers: Vec<(&str, u16)> = functions.iter().map(|f| (f.name.as_str(), f.number)).collect();
        let controls = [("children", CHILDREN), ("restart", RESTART), ("stop", STOP), ("start", START)];
        assert_eq!(numbers[..4], controls);
        assert_eq!(
            numbers[4..],
            [
                ("look", LOOK),
                ("look_on", LOOK_ON),
                ("new_epoch", NEW_EPOCH),
                ("end_failing", END_FAILING),
                ("lease", LEASE)
            ]
        );
    }
}
