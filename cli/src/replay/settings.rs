//! The settings of the player, as `rohrpost replay` writes them into the configuration of its node.

use super::configuration::PlayedModules;
use super::recorded::RecordedFiles;
use crate::record::PartArguments;
use crate::terminal::{Failure, say};
use rohrpost_recorder::player::{ROUND_MIN, RecordingPath};
use rohrpost_recording::Selection;
use std::path::Path;
use std::time::Duration;
use toml::{Table, Value};

/// What the command line says of the course.
pub(super) struct WantedCourse<'a> {
    pub(super) part: &'a PartArguments,
    pub(super) rate: f64,
    pub(super) repeats: bool,
}

/// The player's settings, and files with the descriptions.
pub(super) fn made(
    course: &WantedCourse<'_>,
    recorded: &RecordedFiles,
    played: &PlayedModules,
    folder: &Path,
) -> Result<Table, Failure> {
    let mut described = Vec::new();
    for (name, description) in &played.described {
        let file = format!("{name}.description");
        std::fs::write(folder.join(&file), description.to_bytes())?;
        described.push(Value::Array(vec![name.as_str().into(), file.into()]));
    }
    let files = recorded.infos.iter().map(|info| Ok(RecordingPath::from(info.path.canonicalize()?).into()));
    let files = files.collect::<std::io::Result<Vec<Value>>>()?;
    let topics = played.topics.iter().map(|topic| topic.as_str().into()).collect();
    let pair = |(topic, stream): (&String, &String)| Value::Array(vec![topic.as_str().into(), stream.as_str().into()]);
    let into = played.into.iter().map(pair).collect();
    let mut whole = recorded.infos[0].clone();
    (whole.first_ns, whole.last_ns) = (Some(recorded.begin_ns), Some(recorded.end_ns));
    let part = course.part.of(&whole, &[]);
    if let (Some(from_ns), Some(until_ns)) = (part.from_ns, part.until_ns)
        && from_ns >= until_ns
    {
        return Err("the time range is empty: --until is not behind --from".into());
    }
    if part.from_ns.is_some_and(|from_ns| from_ns > recorded.end_ns)
        || part.until_ns.is_some_and(|until_ns| until_ns <= recorded.begin_ns)
    {
        let seconds = recorded.end_ns.saturating_sub(recorded.begin_ns) as f64 / 1e9;
        return Err(format!("nothing lies between --from and --until; the recording lasts {seconds:.1} s").into());
    }
    if course.repeats {
        note_short_rounds(recorded, played, &part);
    }
    let ns = |ns: u64| i64::try_from(ns).map(Value::Integer).map_err(|_| format!("{ns} ns is beyond the year 2262"));
    let mut settings = Table::new();
    for (key, value) in [
        ("files", Value::Array(files)),
        ("begin-ns", ns(recorded.begin_ns)?),
        ("end-ns", ns(recorded.end_ns)?),
        ("described", Value::Array(described)),
        ("topics", Value::Array(topics)),
        ("into", Value::Array(into)),
        ("rate", course.rate.into()),
        ("repeats", course.repeats.into()),
    ] {
        settings.insert(key.into(), value);
    }
    for (key, time) in [("from-ns", part.from_ns), ("until-ns", part.until_ns)] {
        if let Some(time) = time {
            settings.insert(key.into(), ns(time)?);
        }
    }
    Ok(settings)
}

/// Says how long a round takes if that is longer than what is repeated.
fn note_short_rounds(recorded: &RecordedFiles, played: &PlayedModules, part: &Selection) {
    let channels = recorded.infos.iter().flat_map(|info| &info.channels);
    let is_played = |topic: &str| played.topics.contains(topic) || played.into.contains_key(topic);
    let times = channels.filter(|its| is_played(&its.topic)).filter_map(|its| its.first_ns.zip(its.last_ns));
    let (first_ns, last_ns) = times.fold((u64::MAX, 0), |(first, last), its| (first.min(its.0), last.max(its.1)));
    let begin_ns = first_ns.max(part.from_ns.unwrap_or_default());
    let end_ns = part.until_ns.filter(|until_ns| *until_ns <= last_ns).unwrap_or(last_ns);
    let lasts = Duration::from_nanos(end_ns.saturating_sub(begin_ns));
    if lasts < ROUND_MIN {
        say(format_args!("--loop: what is repeated lasts {lasts:?}; each round takes {ROUND_MIN:?} at least"));
    }
}
