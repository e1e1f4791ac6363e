//! `record export`: a recording for programs of others.

use super::jsonl::JsonLines;
use super::part::PartArguments;
use super::progress::ProgressLine;
use crate::terminal::{Failure, say};
use crate::units::size;
use rohrpost::output::plain;
use rohrpost_recording::{Drawn, Reader, Selection};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
pub(super) struct ExportArguments {
    /// Recording.
    file: PathBuf,
    /// New file; with JSON `-` is the standard output.
    to: PathBuf,
    /// What is made of it.
    #[arg(long, value_enum)]
    format: ExportFormat,
    /// Names (laser.0) or topics (laser.0/scan) to take; all, if none is named.
    #[arg(long, num_args = 1.., value_name = "NAME")]
    names: Vec<String>,
    #[command(flatten)]
    part: PartArguments,
    /// At most so many messages a second of each channel, by their stamps; output lines are all taken.
    #[arg(long, value_name = "HZ", value_parser = parse_rate)]
    rate: Option<u64>,
    /// Also copy what is drawn as it was recorded; then messages above 64 KiB are not drawn.
    #[arg(long)]
    with_original: bool,
}

/// What a recording can be made into.
#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum)]
enum ExportFormat {
    /// MCAP with what Rerun and Foxglove draw: poses, scans, points, images, output lines.
    Drawn,
    /// One JSON object a line: topic, times, epoch, and the value by its description.
    Json,
}

/// Messages a second, as the time between two.
fn parse_rate(text: &str) -> Result<u64, String> {
    let hz: f64 = text.parse().map_err(|_| "write a number, such as 10 or 0.5".to_owned())?;
    match hz {
        0.001..=1_000_000.0 => Ok((1e9 / hz) as u64),
        _ => Err("from 0.001 to 1000000 a second".to_owned()),
    }
}

pub(super) fn run(arguments: &ExportArguments) -> Result<ExitCode, Failure> {
    let ExportArguments { file, to, format, names, part, rate, with_original } = arguments;
    if *with_original && *format == ExportFormat::Json {
        return Err("--with-original is for --format drawn: JSON has what was recorded, and nothing else".into());
    }
    let selection = Selection { period_ns: *rate, ..part.of(file, names)? };
    match format {
        ExportFormat::Drawn => draw(file, to, &selection, *with_original),
        ExportFormat::Json => write_json(file, to, &selection),
    }
}

fn draw(file: &Path, to: &Path, selection: &Selection, with_original: bool) -> Result<ExitCode, Failure> {
    let mut line = ProgressLine::new();
    let told = rohrpost_recording::draw(file, to, selection, with_original, &mut |read, all| line.tell(read, all));
    drop(line);
    say(drawn_text(to, &told?));
    Ok(ExitCode::SUCCESS)
}

fn drawn_text(to: &Path, told: &Drawn) -> String {
    let mut lines = vec![format!("{}: {} messages, {}", to.display(), told.messages, size(told.bytes))];
    lines.extend(told.drawn.iter().map(|(topic, count)| format!("{topic}: {count}")));
    if let Some(carrier) = &told.carrier {
        lines.push(format!("scans and points without a place of their own are on {carrier}"));
    }
    let mut left_out = |counts: &BTreeMap<String, u64>, why: &str| {
        lines.extend(counts.iter().map(|(topic, count)| format!("{topic}: {count} not drawn: {why}")));
    };
    left_out(&told.not_drawn, "the value contradicts itself, or is nowhere");
    left_out(&told.too_long, "above 64 KiB it would be in the file twice; leave out --with-original");
    if !told.without.is_empty() {
        lines.push(format!("not drawn, as there is no picture of them: {}", told.without.join(", ")));
    }
    // Texts of others would make lines of their own.
    lines.iter().map(|line| plain::line(line)).collect::<Vec<_>>().join("\n")
}

fn write_json(file: &Path, to: &Path, selection: &Selection) -> Result<ExitCode, Failure> {
    let mut reader = Reader::select(file, selection)?;
    let mut lines = JsonLines::create(to)?;
    let mut line = ProgressLine::new();
    loop {
        let (read, all) = reader.progress();
        line.tell(read, all);
        let Some((channel, message)) = reader.next()? else { break };
        // What others draw is not what was recorded.
        if !channel.is_drawn() && !lines.add(&channel, &message)? {
            return Ok(ExitCode::SUCCESS);
        }
    }
    drop(line);
    if let Some((messages, bytes)) = lines.finish()? {
        say(format_args!("{}: {messages} messages, {}", to.display(), size(bytes)));
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_the_time_between_two_messages() {
        assert_eq!((parse_rate("10"), parse_rate("0.5")), (Ok(100_000_000), Ok(2_000_000_000)));
        for wrong in ["", "fast", "0", "-1", "nan", "inf", "1e9"] {
            assert!(parse_rate(wrong).is_err(), "{wrong}");
        }
    }
}
