//! What an earlier launch left behind.

use super::LaunchError;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rohrpost_config::{Installation, Module};
use rohrpost_mailbox::{Node, NodeError};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A process that was killed ends within this time, or never (it waits for a broken disk, say).
pub(super) const KILL_TIME: Duration = Duration::from_secs(5);

/// File in a node's directory that tells tools which configuration runs: its path, then the node's name.
pub const CONFIG_FILE: &str = "config";
/// What it resolved to, for programs: a file of the node's directory.
const RESOLVED_FILE: &str = "node.json";

/// Ends modules of this node that still live though no launch watches them, and removes mailboxes that nobody owns
/// and streams that nobody writes.
pub(super) fn end(node: &Arc<Node>, installation: &Installation, node_name: &str) -> Result<Vec<String>, LaunchError> {
    let ours = || {
        // A participant that joins or leaves just now has no name in the table, or no number; 0 would be our own
        // process group.
        let other = |pid: u32| pid != std::process::id() && pid != 0;
        let named = |name| installation.modules_on(node_name).any(|module| module.name == name);
        node.participants().into_iter().filter(move |p| named(p.module) && other(p.pid)).collect::<Vec<_>>()
    };
    let mut notes = Vec::new();
    for participant in ours() {
        let name = installation.classes.format(participant.module);
        notes.push(format!(
            "{name} (process {}) ran already, left over from an earlier launch or started by hand; ended",
            participant.pid
        ));
        send(participant.pid, Signal::SIGTERM);
    }
    let patience = installation.modules_on(node_name).map(|module| module.stop_within).max().unwrap_or_default();
    let deadline = Instant::now() + patience;
    loop {
        let left = ours();
        let Some(first) = left.first() else { break };
        if Instant::now() >= deadline + KILL_TIME {
            return Err(LaunchError::Leftover(installation.classes.format(first.module), first.pid));
        }
        if Instant::now() >= deadline {
            left.iter().for_each(|participant| send(participant.pid, Signal::SIGKILL));
        }
        std::thread::sleep(Duration::from_millis(5));
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

fn send(pid: u32, signal: Signal) {
    // What stands in shared memory is a claim: numbers that mean a group, or all, are nobody's.
    if let Some(pid) = i32::try_from(pid).ok().filter(|pid| *pid > 1) {
        // Gone already, or another user's: the loop sees whether it still lives.
        let _ = kill(Pid::from_raw(pid), signal);
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
    let config = format!("{}\n{node_name}\n", path.display());
    node.put_file(CONFIG_FILE, config.as_bytes())?;
    node.put_file(RESOLVED_FILE, resolved)
}
