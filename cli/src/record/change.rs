//! `record recover`, `record cut` and `record merge`: new files from old ones.

use super::info::more_damages;
use super::part::PartArguments;
use super::progress::with_progress;
use crate::terminal::units::size;
use crate::terminal::{Failure, say};
use rohrpost_recording::Recovered;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
pub(super) struct RecoverArguments {
    /// File that was not closed, or is damaged.
    file: PathBuf,
    /// New file; default: beside it, as NAME.recovered.mcap.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(clap::Args)]
pub(super) struct CutArguments {
    /// Recording.
    file: PathBuf,
    /// New file.
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Names (laser.0) or topics (laser.0/scan) to keep; all, if none is named.
    #[arg(long, num_args = 1.., value_name = "NAME")]
    names: Vec<String>,
    #[command(flatten)]
    part: PartArguments,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(clap::Args)]
pub(super) struct MergeArguments {
    /// Recordings.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// New file.
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

pub(super) fn recover(arguments: &RecoverArguments) -> Result<ExitCode, Failure> {
    let file = &arguments.file;
    let to = arguments.output.clone().unwrap_or_else(|| rohrpost_recording::recovered_path(file));
    let told = with_progress(|progress| rohrpost_recording::recover(file, &to, progress))?;
    if arguments.json {
        let damages: Vec<_> =
            told.damages.iter().map(|(at, what)| json!({"at": at, "what": what.to_string()})).collect();
        say(json!({
            "path": told.path, "bytes": told.bytes, "messages": told.messages, "unchecked": told.unchecked,
            "bytes_before": told.bytes_before, "bytes_read": told.bytes_read, "was_closed": told.was_closed,
            "damages": damages, "damage_count": told.damage_count,
        }));
    } else {
        say(recovered_text(file, &told));
    }
    Ok(ExitCode::SUCCESS)
}

fn recovered_text(file: &Path, told: &Recovered) -> String {
    let mut text =
        format!("{}: {} messages of {}, {}", told.path.display(), told.messages, file.display(), size(told.bytes));
    if told.was_closed && told.damage_count == 0 {
        text.push_str("\nthe old file was whole already");
    }
    if told.unchecked > 0 {
        let cut = "are of the chunk that the end cuts off: no checksum says that they are right";
        text.push_str(&format!("\n{} of them {cut}", told.unchecked));
    }
    for (at, damage) in &told.damages {
        text.push_str(&format!("\nat byte {at} of {}: {damage}", told.bytes_before));
    }
    if let Some(more) = more_damages(told.damage_count, &told.damages) {
        text.push_str(&format!("\n{more}"));
    }
    text
}

pub(super) fn cut(arguments: &CutArguments) -> Result<ExitCode, Failure> {
    let CutArguments { file, output: to, names, part, json } = arguments;
    let selection = part.of(&rohrpost_recording::info(file)?, names);
    let told = with_progress(|progress| rohrpost_recording::cut(file, to, &selection, progress))?;
    report(to, told, *json);
    Ok(ExitCode::SUCCESS)
}

pub(super) fn merge(arguments: &MergeArguments) -> Result<ExitCode, Failure> {
    let MergeArguments { files, output: to, json } = arguments;
    let told = with_progress(|progress| rohrpost_recording::merge(files, to, progress))?;
    report(to, told, *json);
    Ok(ExitCode::SUCCESS)
}

fn report(to: &Path, (messages, bytes): (u64, u64), as_json: bool) {
    if as_json {
        say(json!({"path": to, "bytes": bytes, "messages": messages}));
    } else {
        say(format_args!("{}: {messages} messages, {}", to.display(), size(bytes)));
    }
}
