//! `rohrpost clean`.

use super::{Failure, say};
use rohrpost::mailbox::{Node, NodeError, base_directory, remove_base_if_empty};
use std::path::Path;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost clean\nWhat a launch or a living process uses is left alone.")]
pub(super) struct Arguments {}

pub(super) fn run(_: &Arguments) -> Result<ExitCode, Failure> {
    let base = base_directory();
    let Ok(entries) = std::fs::read_dir(&base) else {
        say(format_args!("nothing to clean: {} does not exist", base.display()));
        return Ok(ExitCode::SUCCESS);
    };
    let mut seen = 0;
    for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
        seen += 1;
        match clean(&path) {
            Ok(done) => say(done),
            // Its launch has ended meanwhile, and removed it itself.
            Err(_) if !path.exists() => continue,
            Err(error) => say(error),
        };
    }
    if seen == 0 {
        say(format_args!("nothing to clean in {}", base.display()));
    }
    remove_base_if_empty();
    Ok(ExitCode::SUCCESS)
}

/// Removes what is dead of one node; what was done.
fn clean(path: &Path) -> Result<String, NodeError> {
    let node = Node::open(path)?;
    if node.remove_if_dead()? {
        return Ok(format!("removed {}", path.display()));
    }
    let mut removed = 0;
    // A module that its launch is about to start again has no owner for a moment; its packages are waited for.
    if node.launcher().is_none() {
        for name in node.mailboxes()? {
            removed += usize::from(node.remove_orphan(name)?);
        }
    }
    Ok(format!("{} is in use; removed {removed} mailboxes without owner", path.display()))
}
