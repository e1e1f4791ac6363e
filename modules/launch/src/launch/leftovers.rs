//! What an earlier launch left behind.

use super::LaunchError;
use super::error::NotStarted;
use rohrpost_config::{Installation, Module};
use rohrpost_mailbox::{Node, NodeError, ParticipantInfo, ParticipantProcess, ProcessError};
use rohrpost_modules::launch_support::environment;
use rohrpost_modules::runtime::CONFIG_FILE;
use std::os::unix::ffi::OsStrExt;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A process that was killed ends within this time, or never (it waits for a broken disk, say).
pub(super) const KILL_TIME: Duration = Duration::from_secs(5);
/// Between two looks at what is still there.
const LOOK: Duration = Duration::from_millis(5);

/// What it resolved to, for programs: a file of the node's directory.
const RESOLVED_FILE: &str = "node.json";

/// Ends modules of this node that an earlier launch started and that still live, and removes mailboxes that nobody owns
/// and streams that nobody writes. Nobody is sent a signal as long as one process is not known to be such a module.
pub(super) fn end(node: &Arc<Node>, installation: &Installation, node_name: &str) -> Result<Vec<String>, LaunchError> {
    let leftovers = Leftovers { node, installation, node_name };
    let patience = installation.modules_on(node_name).map(|module| module.stop_within).max().unwrap_or_default();
    let processes = leftovers.identify(Instant::now() + patience)?;
    let mut notes = Vec::new();
    for (module, process) in &processes {
        let pid = process.pid();
        notes.push(format!("{module} (process {pid}) ran already, left over from an earlier launch; ended"));
        // It has ended already, or is another user's: the loop below sees whether it still lives.
        let _ = process.terminate();
    }
    let deadline = Instant::now() + patience;
    while let Some(left) = leftovers.living().first() {
        if Instant::now() >= deadline + KILL_TIME {
            return Err(LaunchError::Leftover(installation.classes.format(left.module), left.pid));
        }
        if Instant::now() >= deadline {
            processes.iter().for_each(|(_, process)| drop(process.kill()));
        }
        std::thread::sleep(LOOK);
    }
    // A new start begins with empty mailboxes: what was meant for the last run must not drive this one.
    for name in node.mailboxes()? {
        node.remove_orphan(name)?;
    }
    // Nor does it begin with the memory of streams that it may not have.
    for stream in node.streams()? {
        node.remove_orphan_stream(stream)?;
    }
    // What was on other nodes then need not be now; the router says so anew.
    node.forget_routes()?;
    Ok(notes)
}

/// Modules of a node that live though no launch watches them.
struct Leftovers<'a> {
    node: &'a Node,
    installation: &'a Installation,
    node_name: &'a str,
}

impl Leftovers<'_> {
    fn living(&self) -> Vec<ParticipantInfo> {
        let named = |name| self.installation.modules_on(self.node_name).any(|module| module.name == name);
        // Our own number may be that of a process in another container.
        let is_own = |it: &ParticipantInfo| it.pid == std::process::id() && self.node.process_of(it).is_ok();
        self.node.participants().into_iter().filter(|it| named(it.module) && !is_own(it)).collect()
    }

    /// Processes that are left, by their modules' names. Until `deadline` it waits for those that it may not end: the
    /// last launch has died a moment ago, perhaps, and they are about to.
    fn identify(&self, deadline: Instant) -> Result<Vec<(String, ParticipantProcess)>, LaunchError> {
        loop {
            let processes: Result<Vec<_>, _> = self.living().iter().filter_map(|it| self.process_of(it)).collect();
            if processes.is_ok() || Instant::now() >= deadline {
                return processes;
            }
            std::thread::sleep(LOOK);
        }
    }

    /// A process that a launch started as this module; none when it has ended.
    fn process_of(&self, found: &ParticipantInfo) -> Option<Result<(String, ParticipantProcess), LaunchError>> {
        let module = self.installation.classes.format(found.module);
        let refused = |why| Some(Err(LaunchError::NotStarted { module: module.clone(), pid: found.pid, why }));
        let process = match self.node.process_of(found) {
            Ok(process) => process?,
            Err(why) => return refused(NotStarted::Unknown(why)),
        };
        // The launcher's variable alone is inherited by what a module starts, such as a shell.
        let given = [environment::LAUNCHER, environment::MODULE].map(|name| process.was_given(name));
        let [launcher, named] = match given {
            [Ok(launcher), Ok(named)] => [launcher, named],
            [Err(error), _] | [_, Err(error)] if !process.has_ended() => {
                return refused(NotStarted::Unknown(ProcessError::Untold(error)));
            }
            _ => return None,
        };
        match launcher {
            Some(_) if named.as_ref() == Some(&module) => Some(Ok((module, process))),
            _ => refused(NotStarted::ByHand(found.pid)),
        }
    }
}

/// Removes the mailboxes of a module that is not started again: senders are told so, instead of filling them. One that
/// cannot be removed does not keep the others.
///
/// Never waits: [`NodeError::Busy`] while somebody else holds the registry.
pub(super) fn remove_mailboxes(node: &Node, module: &Module) -> Result<(), NodeError> {
    let mut result = Ok(());
    for name in node.mailboxes()?.into_iter().filter(|name| module.names().any(|own| own == name.module())) {
        match node.try_remove_orphan(name) {
            Err(busy @ NodeError::Busy(_)) => return Err(busy),
            Err(error) => result = Err(error),
            Ok(_) => {}
        }
    }
    result
}

/// Says in the node's directory which configuration runs, and what it resolved to. Each file appears whole.
pub(super) fn note_config(
    node: &Node,
    installation: &Installation,
    node_name: &str,
    resolved: &[u8],
) -> Result<(), NodeError> {
    let path = installation.path.canonicalize().unwrap_or_else(|_| installation.path.clone());
    let config = [path.as_os_str().as_bytes(), b"\n", node_name.as_bytes(), b"\n"].concat();
    node.put_file(CONFIG_FILE, &config)?;
    node.put_file(RESOLVED_FILE, resolved)
}
