//! `rohrpost version`: versions of this program, of its shared formats, and of the nodes here.

use crate::terminal::{Failure, say};
use rohrpost::common;
use rohrpost_mailbox::{LAYOUT_VERSION, NodeError};
use std::process::ExitCode;
use std::sync::OnceLock;

#[derive(clap::Args)]
#[command(
    after_help = "Example: rohrpost version\nPrograms of one node must have the same layout and the same common \
        functions."
)]
pub(crate) struct Arguments {
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The text of `--version` after the program's name.
pub(crate) fn text() -> &'static str {
    static TEXT: OnceLock<String> = OnceLock::new();
    TEXT.get_or_init(common::versions)
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let others = rohrpost::find_unusable().into_iter().filter(|error| matches!(error, NodeError::Version(..)));
    let others: Vec<String> = others.map(|error| error.to_string()).collect();
    if arguments.json {
        say(serde_json::json!({
            "version": env!("CARGO_PKG_VERSION"), "layout": LAYOUT_VERSION, "common_functions": common::HASH,
            "other_versions": others,
        }));
        return Ok(ExitCode::SUCCESS);
    }
    say(format_args!("rohrpost {}", text()));
    for other in others {
        say(other);
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_book_shows_the_present_versions() {
        let (page, said) = (include_str!("../../../docs/src/tools.md"), format!("\nrohrpost {}\n", super::text()));
        assert!(page.contains(&said), "docs/src/tools.md does not show{said}");
    }
}
