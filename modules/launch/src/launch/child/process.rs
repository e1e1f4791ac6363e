//! A module's process and what belongs to it.
//!
//! ```text
//!  launch ── started ─┬─ module      `started` itself, or below it: a script without `exec`, `uv run`
//!                     └─ helpers     what the module starts
//!            └────────────────┘      one process group, of the number of `started`
//! ```
//!
//! `started` ends last of what is to end in order, so all that is left of the group then is killed. It is still a
//! zombie at that moment: until launch has asked for its end, no other process and no other group has its number.

use nix::sys::signal::{Signal, kill, killpg};
use nix::unistd::Pid;
use rohrpost_mailbox::{Name, Node, ParticipantInfo, ParticipantProcess, ProcessError, sys};
use std::io;
use std::process::{Child, ExitStatus};

/// A process that launch has started, not reaped yet, and the module in it.
pub(super) struct ModuleProcess {
    name: Name,
    started: Child,
    /// What the node had given out before: an earlier process may have had the same number.
    before: u32,
    /// The process that has joined the node as the module.
    module: Option<u32>,
}

impl ModuleProcess {
    /// For a process that was just started; `before`: an incarnation that the node gave out before that.
    pub(super) fn new(name: Name, started: Child, before: u32) -> Self {
        Self { name, started, before, module: None }
    }

    /// The number of the process that launch has started.
    pub(super) fn started(&self) -> u32 {
        self.started.id()
    }

    /// The number of the module's process; until that is known, of the one that launch has started.
    pub(super) fn pid(&self) -> u32 {
        self.module.unwrap_or(self.started.id())
    }

    /// Looks which process has joined the node as the module, unless that is known.
    pub(super) fn find_module(&mut self, node: &Node) {
        if self.module.is_some() {
            return;
        }
        let started = self.started.id();
        if self.last_word(node).is_some() {
            self.module = Some(started);
            return;
        }
        let joined =
            node.participants().into_iter().filter(|it| it.module == self.name && it.joined_after(self.before));
        self.module = joined.map(|it| it.pid).find(|pid| sys::descends_from(*pid, started));
    }

    /// The last that the module said in the node's table, also if it has ended since.
    pub(super) fn last_word(&self, node: &Node) -> Option<ParticipantInfo> {
        node.last_word_of(self.name, self.pid()).filter(|word| word.joined_after(self.before))
    }

    /// Whether the node gave out this incarnation after it began. They wrap.
    pub(super) fn began_before(&self, incarnation: u32) -> bool {
        incarnation.wrapping_sub(self.before).cast_signed() > 0
    }

    /// The module's process, if it is another one than launch has started.
    fn within(&self, node: &Node) -> Result<Option<ParticipantProcess>, ProcessError> {
        let word = self.last_word(node).filter(|word| word.pid != self.started.id());
        word.map_or(Ok(None), |word| node.process_of(&word))
    }

    /// Asks the module to end, and nobody around it: a shell would end at once, and leave the module alone. Where the
    /// kernel does not tell which process it is, all of the group are asked.
    pub(super) fn terminate(&mut self, node: &Node) {
        self.find_module(node);
        // What has ended meanwhile needs no signal.
        let _ = match self.within(node) {
            Ok(Some(module)) => module.terminate(),
            Ok(None) => kill(self.number(), Signal::SIGTERM).map_err(io::Error::from),
            Err(_) => killpg(self.number(), Signal::SIGTERM).map_err(io::Error::from),
        };
    }

    /// Kills the whole group, and the module if it has left it: `timeout` makes a group of its own.
    pub(super) fn kill(&self, node: &Node) {
        if let Ok(Some(module)) = self.within(node) {
            let _ = module.kill();
        }
        let _ = killpg(self.number(), Signal::SIGKILL);
    }

    /// How the process that launch has started ended, if it has; what it left of its group ends with it.
    ///
    /// # Errors
    /// When somebody else has asked for its end.
    pub(super) fn end(&mut self, node: &Node) -> io::Result<Option<ExitStatus>> {
        if sys::ended_child(Some(self.started.id()))?.is_none() {
            return Ok(None);
        }
        self.kill(node);
        self.started.try_wait()
    }

    fn number(&self) -> Pid {
        Pid::from_raw(self.started.id().cast_signed())
    }
}
