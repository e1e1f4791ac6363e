//! The settings of the player, as `rohrpost replay` makes them.

use super::configuration::PlayedModules;
use super::recorded::RecordedFiles;
use crate::record::PartArguments;
use crate::terminal::{Failure, say};
use rohrpost_recorder::player::{PlayerSettings, ROUND_MIN, RecordingPath};
use rohrpost_recording::Selection;
use std::path::Path;
use std::time::Duration;

/// The player's settings, and files with the descriptions. Of the command line: which part, at which rate, and whether
/// over and over.
pub(super) fn made(
    (part, rate, repeats): (&PartArguments, f64, bool),
    recorded: &RecordedFiles,
    played: &PlayedModules,
    folder: &Path,
) -> Result<PlayerSettings, Failure> {
    let mut described = Vec::new();
    for (name, description) in &played.described {
        let file = format!("{name}.description");
        std::fs::write(folder.join(&file), description.to_bytes())?;
        described.push((name.clone(), file));
    }
    let files = recorded.infos.iter().map(|info| Ok(RecordingPath::from(info.path.canonicalize()?)));
    let files = files.collect::<std::io::Result<_>>()?;
    let mut whole = recorded.infos[0].clone();
    (whole.first_ns, whole.last_ns) = (Some(recorded.begin_ns), Some(recorded.end_ns));
    let part = part.of(&whole, &[]);
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
    if repeats {
        note_short_rounds(recorded, played, &part);
    }
    // Integers of a configuration are signed.
    let mut times = [recorded.begin_ns, recorded.end_ns].into_iter().chain(part.from_ns).chain(part.until_ns);
    if let Some(ns) = times.find(|ns| i64::try_from(*ns).is_err()) {
        return Err(format!("{ns} ns is beyond the year 2262").into());
    }
    Ok(PlayerSettings {
        files,
        begin_ns: recorded.begin_ns,
        end_ns: recorded.end_ns,
        described,
        topics: played.topics.clone(),
        into: played.into.clone().into_iter().collect(),
        answers: None,
        rate,
        from_ns: part.from_ns,
        until_ns: part.until_ns,
        repeats,
    })
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
