//! `stream list` and `stream info`.

use super::choice::{StreamChoice, node_here, stream_failure};
use super::view::{StreamView, print_stream, print_streams};
use crate::target::Target;
use crate::terminal::{Failure, say};
use rohrpost_mailbox::monotonic_ns;
use serde::Serialize;
use std::process::ExitCode;

#[derive(clap::Args)]
pub(super) struct ListArguments {
    #[command(flatten)]
    target: Target,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(clap::Args)]
pub(super) struct InfoArguments {
    #[command(flatten)]
    stream: StreamChoice,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct StreamListing<'a> {
    installation: &'a str,
    node: &'a str,
    streams: Vec<StreamView>,
    /// Files that are no stream, or not ours.
    unreadable: Vec<String>,
}

pub(super) fn list(arguments: &ListArguments) -> Result<ExitCode, Failure> {
    let running = node_here(&arguments.target)?;
    let mut listing = StreamListing {
        installation: &running.installation.name,
        node: &running.node_name,
        streams: Vec::new(),
        unreadable: Vec::new(),
    };
    for id in running.node.streams()? {
        match running.node.inspect_stream(id) {
            Ok(Some(info)) => {
                listing.streams.push(StreamView::new(&info, monotonic_ns(), |name| running.text(name)));
            }
            // Removed meanwhile.
            Ok(None) => {}
            Err(error) => listing.unreadable.push(stream_failure(&running, id, &error).to_string()),
        }
    }
    if arguments.json {
        say(serde_json::to_string(&listing)?);
        return Ok(ExitCode::SUCCESS);
    }
    let StreamListing { installation, node, streams, unreadable } = &listing;
    if streams.is_empty() {
        say(format_args!("node {node} of {installation} has no streams"));
    } else {
        say(format_args!("node {node} of {installation}\n\n{}", print_streams(streams).trim_end()));
    }
    if !unreadable.is_empty() {
        say(format_args!("\n{}", unreadable.join("\n")));
    }
    Ok(ExitCode::SUCCESS)
}

pub(super) fn info(arguments: &InfoArguments) -> Result<ExitCode, Failure> {
    let chosen = arguments.stream.find()?;
    let info = chosen.inspect()?;
    let view = StreamView::new(&info, monotonic_ns(), |name| chosen.running.text(name));
    let node = &chosen.running.node_name;
    say(if arguments.json { serde_json::to_string(&view)? } else { print_stream(&view, node) });
    Ok(ExitCode::SUCCESS)
}
