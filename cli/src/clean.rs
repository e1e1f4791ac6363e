//! `rohrpost clean`.

use super::demo::remove_abandoned;
use crate::terminal::{Failure, say};
use rohrpost_mailbox::{Node, NodeError, base_directory, remove_base_if_empty};
use std::path::Path;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost clean\nDirectories that a launch or a live process uses stay.")]
pub(super) struct Arguments {
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let base = base_directory();
    let entries = std::fs::read_dir(&base).into_iter().flatten();
    let mut done = Vec::new();
    for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
        match clean(&path) {
            // Its launch has ended meanwhile and removed it.
            Err(_) if !path.exists() => {}
            outcome => done.push((path, outcome)),
        }
    }
    let demos = remove_abandoned(&std::env::temp_dir());
    if arguments.json {
        let nodes: Vec<serde_json::Value> = done.iter().map(|(path, outcome)| json(path, outcome)).collect();
        say(serde_json::json!({ "directory": base, "nodes": nodes, "demos": demos }));
        remove_base_if_empty();
        return Ok(ExitCode::SUCCESS);
    }
    if done.is_empty() {
        say(format_args!("nothing to clean in {}", base.display()));
    }
    for (path, outcome) in &done {
        say(text(path, outcome));
    }
    for folder in demos {
        say(format_args!("removed {}, the files of a demo", folder.display()));
    }
    remove_base_if_empty();
    Ok(ExitCode::SUCCESS)
}

/// The result for one node.
enum Cleaned {
    /// No process lived in it.
    Removed,
    /// It is in use; this many of its mailboxes had no owner.
    InUse(usize),
}

fn text(path: &Path, outcome: &Result<Cleaned, NodeError>) -> String {
    match outcome {
        Ok(Cleaned::Removed) => format!("removed {}", path.display()),
        Ok(Cleaned::InUse(1)) => format!("{} is in use; removed 1 mailbox without owner", path.display()),
        Ok(Cleaned::InUse(removed)) => {
            format!("{} is in use; removed {removed} mailboxes without owner", path.display())
        }
        Err(error) => format!("left alone: {error}"),
    }
}

fn json(path: &Path, outcome: &Result<Cleaned, NodeError>) -> serde_json::Value {
    match outcome {
        Ok(Cleaned::Removed) => serde_json::json!({ "path": path, "removed": true }),
        Ok(Cleaned::InUse(mailboxes)) => {
            serde_json::json!({ "path": path, "removed": false, "mailboxes_removed": mailboxes })
        }
        Err(error) => serde_json::json!({ "path": path, "removed": false, "error": error.to_string() }),
    }
}

/// Removes the dead remains of one node.
fn clean(path: &Path) -> Result<Cleaned, NodeError> {
    let node = Node::open(path)?;
    if node.remove_if_dead()? {
        return Ok(Cleaned::Removed);
    }
    let mut removed = 0;
    // A module that its launch is about to start again has no owner for a moment; its packages must stay.
    if node.launcher().is_none() {
        for name in node.mailboxes()? {
            removed += usize::from(node.remove_orphan(name)?);
        }
    }
    Ok(Cleaned::InUse(removed))
}
