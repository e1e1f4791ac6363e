//! `rohrpost clean`.

use crate::begin::demo::remove_abandoned;
use crate::exact::SHARED_MEMORY;
use crate::terminal::units::counted;
use crate::terminal::{Failure, say};
use rohrpost_mailbox::{Node, NodeError, base_directory, remove_base_if_empty};
use std::path::Path;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost clean\nDirectories that a launch or a live process uses stay.")]
pub(crate) struct Arguments {
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
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
    let mut demos = remove_abandoned(&std::env::temp_dir());
    demos.extend(remove_abandoned(Path::new(SHARED_MEMORY)));
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
        say(format_args!("removed {}, the files of a demo or a replay", folder.display()));
    }
    remove_base_if_empty();
    Ok(ExitCode::SUCCESS)
}

/// The result for one node.
enum Cleaned {
    /// No process lived in it.
    Removed,
    /// It is in use; this many of its mailboxes had no owner, and this many of its streams no writer.
    InUse { mailboxes: usize, streams: usize },
}

fn text(path: &Path, outcome: &Result<Cleaned, NodeError>) -> String {
    match outcome {
        Ok(Cleaned::Removed) => format!("removed {}", path.display()),
        Ok(Cleaned::InUse { mailboxes, streams }) => {
            let streams = Some(*streams).filter(|count| *count > 0);
            let streams = streams.map(|count| format!(", {} without writer", counted(count as u64, "stream")));
            let (path, mailboxes) = (path.display(), counted(*mailboxes as u64, "mailbox"));
            format!("{path} is in use; removed {mailboxes} without owner{}", streams.unwrap_or_default())
        }
        Err(error) => format!("left alone: {error}"),
    }
}

fn json(path: &Path, outcome: &Result<Cleaned, NodeError>) -> serde_json::Value {
    match outcome {
        Ok(Cleaned::Removed) => serde_json::json!({ "path": path, "removed": true }),
        Ok(Cleaned::InUse { mailboxes, streams }) => serde_json::json!({
            "path": path, "removed": false, "mailboxes_removed": mailboxes, "streams_removed": streams,
        }),
        Err(error) => serde_json::json!({ "path": path, "removed": false, "error": error.to_string() }),
    }
}

/// Removes the dead remains of one node.
fn clean(path: &Path) -> Result<Cleaned, NodeError> {
    let node = Node::open(path)?;
    if node.remove_if_dead()? {
        return Ok(Cleaned::Removed);
    }
    let (mut mailboxes, mut streams) = (0, 0);
    // A module that its launch is about to start again has no owner for a moment; its packages and records must stay.
    if node.launcher().is_none() {
        for name in node.mailboxes()? {
            mailboxes += usize::from(node.remove_orphan(name)?);
        }
        for id in node.streams()? {
            streams += usize::from(node.remove_orphan_stream(id)?);
        }
    }
    Ok(Cleaned::InUse { mailboxes, streams })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_removed_of_a_node_in_use_is_counted() {
        for (mailboxes, streams, words) in [
            (0, 0, "removed 0 mailboxes without owner"),
            (1, 1, "removed 1 mailbox without owner, 1 stream without writer"),
            (2, 3, "removed 2 mailboxes without owner, 3 streams without writer"),
        ] {
            let told = text(Path::new("/node"), &Ok(Cleaned::InUse { mailboxes, streams }));
            assert_eq!(told, format!("/node is in use; {words}"));
        }
    }
}
