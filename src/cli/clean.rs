//! `rohrpost clean`.

use super::{Failure, say};
use rohrpost::mailbox::{Node, base_directory, remove_base_if_empty};
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
        let node = match Node::open(&path) {
            Ok(node) => node,
            Err(error) => {
                say(error);
                continue;
            }
        };
        if node.remove_if_dead()? {
            say(format_args!("removed {}", path.display()));
            continue;
        }
        let mut removed = 0;
        // A module that its launch is about to start again has no owner for a moment; its packages are waited for.
        if node.launcher().is_none() {
            for name in node.mailboxes()? {
                removed += usize::from(node.remove_orphan(name)?);
            }
        }
        say(format_args!("{} is in use; removed {removed} mailboxes without owner", path.display()));
    }
    if seen == 0 {
        say(format_args!("nothing to clean in {}", base.display()));
    }
    remove_base_if_empty();
    Ok(ExitCode::SUCCESS)
}
