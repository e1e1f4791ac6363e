//! What an earlier launch left behind.

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rohrpost_config::Installation;
use rohrpost_mailbox::{Node, NodeError};
use std::fs;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// File in a node's directory that tells tools which configuration runs: its path, then the node's name.
pub const CONFIG_FILE: &str = "config";

/// Ends modules of this node that still live though no launch watches them, and removes mailboxes that nobody owns.
pub(super) fn end(node: &Arc<Node>, installation: &Installation, node_name: &str) -> Result<Vec<String>, NodeError> {
    let ours = || {
        let mine = |pid: u32| pid != std::process::id();
        let named = |name| installation.modules_on(node_name).any(|module| module.name == name);
        node.participants().into_iter().filter(move |p| named(p.module) && mine(p.pid)).collect::<Vec<_>>()
    };
    let mut notes = Vec::new();
    for participant in ours() {
        let name = installation.classes.format(participant.module);
        notes.push(format!("{name} (process {}) was left over from an earlier launch; ended", participant.pid));
        let _ = kill(Pid::from_raw(participant.pid as i32), Signal::SIGTERM);
    }
    let patience = installation.modules_on(node_name).map(|module| module.stop_within).max().unwrap_or_default();
    let deadline = Instant::now() + patience;
    let mut killed = false;
    loop {
        let left = ours();
        if left.is_empty() {
            break;
        }
        if Instant::now() >= deadline && !killed {
            killed = true;
            for participant in left {
                let _ = kill(Pid::from_raw(participant.pid as i32), Signal::SIGKILL);
            }
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    // A new start begins with empty mailboxes: what was meant for the last run must not drive this one.
    for name in node.mailboxes()? {
        node.remove_orphan(name)?;
    }
    Ok(notes)
}

/// Says in the node's directory which configuration runs.
pub(super) fn note_config(node: &Node, installation: &Installation, node_name: &str) -> Result<(), NodeError> {
    let path = installation.path.canonicalize().unwrap_or_else(|_| installation.path.clone());
    let file = node.path().join(CONFIG_FILE);
    fs::write(&file, format!("{}\n{node_name}\n", path.display())).map_err(|error| NodeError::Io(file, error))
}
