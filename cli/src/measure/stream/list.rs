//! `stream list` and `stream info`.

use super::choice::{StreamChoice, stream_failure, stream_text};
use super::view::{StreamView, name_items, print_stream, print_streams, stream_views};
use crate::look::observer::Silence;
use crate::look::target::{Running, Target};
use crate::running::list::{NodeLine, node_lines};
use crate::terminal::{Failure, say, say_folded};
use rohrpost_launch::survey::{Scope, StreamSurvey};
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
    /// The node that the tool runs on.
    node: &'a str,
    nodes: Vec<NodeLine>,
    streams: Vec<StreamView>,
    /// Files of that node that are no stream, or not ours.
    unreadable: Vec<String>,
}

pub(super) fn list(arguments: &ListArguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let (survey, silent) = running.survey(Scope::Streams)?;
    let nodes = running.shown();
    let mut streams = stream_views(&running.installation, &survey.streams);
    name_items(&running, &mut streams);
    let listing = StreamListing {
        installation: &running.installation.name,
        node: &running.node_name,
        nodes: node_lines(&nodes, &silent),
        streams,
        unreadable: if nodes.contains(&&*running.node_name) { unreadable(&running)? } else { Vec::new() },
    };
    if arguments.json {
        say(serde_json::to_string(&listing)?);
        return Ok(ExitCode::SUCCESS);
    }
    let StreamListing { installation, streams, unreadable, .. } = &listing;
    let several = nodes.len() > 1;
    let (noun, have) = if several { ("nodes", "have") } else { ("node", "has") };
    let whole = format!("{noun} {} of {installation}", nodes.join(", "));
    if streams.is_empty() {
        say(format_args!("{whole} {have} no streams"));
    } else {
        say(format_args!("{whole}\n\n{}", print_streams(streams, several).trim_end()));
    }
    let notes: Vec<String> = silent.iter().map(Silence::text).chain(unreadable.iter().cloned()).collect();
    if !notes.is_empty() {
        say(format_args!("\n{}", notes.join("\n")));
    }
    Ok(ExitCode::SUCCESS)
}

/// Why streams of the node that the tool runs on are not listed.
fn unreadable(running: &Running) -> Result<Vec<String>, Failure> {
    let all = running.node.streams()?.into_iter();
    let failed = all.filter_map(|id| Some((id, running.node.inspect_stream(id).err()?)));
    let told = |(id, error)| stream_failure(running, id, &stream_text(running, id), &error).to_string();
    Ok(failed.map(told).collect())
}

pub(super) fn info(arguments: &InfoArguments) -> Result<ExitCode, Failure> {
    let chosen = arguments.stream.find()?;
    let info = chosen.inspect()?;
    let seen = StreamSurvey { node: chosen.running.node_name.clone(), at_ns: monotonic_ns(), info };
    let item = chosen.item.as_ref().map(|item| item.field.name.clone());
    let view = StreamView::new(&seen, item, |name| chosen.running.text(name)).of(&chosen.running.installation);
    if arguments.json {
        say(serde_json::to_string(&view)?);
    } else {
        say_folded(print_stream(&view));
    }
    Ok(ExitCode::SUCCESS)
}
