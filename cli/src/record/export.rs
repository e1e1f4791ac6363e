//! `record export`: a recording for programs of others.

use super::jsonl::{JsonLines, JsonMessage};
use super::part::PartArguments;
use super::progress::{ProgressLine, with_progress};
use crate::terminal::units::size;
use crate::terminal::{Failure, complain, say};
use rohrpost::output::plain::{self, ForeignText};
use rohrpost_recording::{DrawOptions, Drawn, Info, Reader, Selection};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
pub(super) struct ExportArguments {
    /// Recording.
    file: PathBuf,
    /// New file; with JSON `-` is the standard output.
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
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
    /// Also copy what is drawn as it was recorded; then fewer pixels and points are drawn of messages above 64 KiB.
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
    let ExportArguments { file, output: to, format, names, part, rate, with_original } = arguments;
    if *with_original && *format == ExportFormat::Json {
        return Err("--with-original is for --format drawn: JSON has what was recorded, and nothing else".into());
    }
    if to.as_os_str() == "-" && *format == ExportFormat::Drawn {
        return Err("an MCAP file cannot go to the standard output; name a file, such as drawn.mcap".into());
    }
    let info = rohrpost_recording::info(file)?;
    let selection = Selection { period_ns: *rate, ..part.of(&info, names) };
    match format {
        ExportFormat::Drawn => {
            let options = DrawOptions { with_original: *with_original, classes: classes(&info) };
            draw(file, to, &selection, &options)
        }
        ExportFormat::Json => write_json(file, to, &selection),
    }
}

/// Names of classes, by the configuration that was recorded.
fn classes(info: &Info) -> BTreeMap<u8, String> {
    let files = info.configuration.values().filter_map(|text| text.parse::<toml::Table>().ok());
    let all = files.filter_map(|mut file| match file.remove("classes")? {
        toml::Value::Table(classes) => Some(classes),
        _ => None,
    });
    let number = |class: &toml::Value| u8::try_from(class.get("id")?.as_integer()?).ok();
    all.flatten().filter_map(|(name, class)| Some((number(&class)?, name))).collect()
}

fn draw(file: &Path, to: &Path, selection: &Selection, options: &DrawOptions) -> Result<ExitCode, Failure> {
    let told = with_progress(|progress| rohrpost_recording::draw(file, to, selection, options, progress))?;
    say(drawn_text(to, &told));
    Ok(ExitCode::SUCCESS)
}

fn drawn_text(to: &Path, told: &Drawn) -> String {
    let mut lines = vec![format!("{}: {} messages, {}", to.display(), told.messages, size(told.bytes))];
    lines.extend(told.drawn.iter().map(|(topic, count)| format!("{topic}: {count}")));
    if let Some(carrier) = &told.carrier {
        lines.push(format!("scans and points without a place of their own are on {carrier}"));
    }
    let mut left_out = |counts: &BTreeMap<ForeignText, u64>, why: &str| {
        lines.extend(counts.iter().map(|(topic, count)| format!("{topic}: {count} not drawn: {why}")));
    };
    left_out(&told.not_drawn, "the value contradicts itself, or is nowhere");
    left_out(&told.too_long, "above 64 KiB a file or a path would be there twice; leave out --with-original");
    if !told.without.is_empty() {
        let without: Vec<String> = told.without.iter().map(ForeignText::to_string).collect();
        lines.push(format!("not drawn, as there is no picture of them: {}", without.join(", ")));
    }
    lines.join("\n")
}

fn write_json(file: &Path, to: &Path, selection: &Selection) -> Result<ExitCode, Failure> {
    let mut reader = Reader::select(file, selection)?;
    let mut lines = JsonLines::create(to)?;
    let mut line = ProgressLine::new();
    let mut unreadable: Option<(u64, String)> = None;
    loop {
        let (read, all) = reader.progress();
        line.tell(read, all);
        let Some((channel, message)) = reader.next()? else { break };
        // What others draw is not what was recorded.
        if channel.is_drawn() {
            continue;
        }
        let message = JsonMessage::of(&channel, &message);
        if let Some(why) = message.unreadable() {
            let (count, _) = unreadable.get_or_insert_with(|| (0, format!("{}: {why}", channel.topic)));
            *count += 1;
        }
        if !lines.add(&message)? {
            return Ok(ExitCode::SUCCESS);
        }
    }
    drop(line);
    if let Some((count, first)) = unreadable {
        complain(format_args!(
            "{count} messages are written as bytes (`hex`), since they could not be decoded (`unreadable` says why); \
             the first is of {}",
            plain::line(&first)
        ));
    }
    if let Some((messages, bytes)) = lines.finish()? {
        say(format_args!("{}: {messages} messages, {}", to.display(), size(bytes)));
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost::schema::Type;
    use rohrpost_recording::{ChannelSpec, Message, Options, Session, Writer};

    #[test]
    fn classes_are_named_by_the_recorded_configuration() {
        let place = tempfile::tempdir().unwrap();
        let text = "system = 1\n[classes]\npilot = { id = 140, text = \"Drives\" }\nodd = 7\nhuge = { id = 300 }\n";
        let configuration = [("robot.toml", text), ("other.toml", "no [ toml")];
        let configuration = configuration.map(|(name, text)| (name.to_owned(), text.to_owned()));
        let session = Session { configuration: configuration.into(), ..Session::default() };
        let mut writer = Writer::start(Options::new(place.path(), "base"), session).unwrap();
        let spec = ChannelSpec { name: "a.0", item: "b", ty: &Type::U8, texts: BTreeMap::new() };
        let channel = writer.channel(&spec).unwrap();
        let message = Message { arrival_ns: 1, stamp_ns: 1, epoch: 1, sequence: 0, data: &[7] };
        writer.write(channel, &message).unwrap();
        writer.finish().1.unwrap();
        let info = rohrpost_recording::info(&place.path().join("base-0001.mcap")).unwrap();
        assert_eq!(classes(&info), BTreeMap::from([(140, "pilot".to_owned())]));
    }

    #[test]
    fn a_rate_is_the_time_between_two_messages() {
        assert_eq!((parse_rate("10"), parse_rate("0.5")), (Ok(100_000_000), Ok(2_000_000_000)));
        for wrong in ["", "fast", "0", "-1", "nan", "inf", "1e9"] {
            assert!(parse_rate(wrong).is_err(), "{wrong}");
        }
    }
}
