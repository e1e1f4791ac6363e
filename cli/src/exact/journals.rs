//! Journals in a recording, put together of their pieces.

use crate::record::ProgressLine;
use crate::terminal::Failure;
use rohrpost::output::plain;
use rohrpost_modules::journal::{JOURNAL_NAME, JOURNAL_NUMBER, Piece};
use rohrpost_recording::{Reader, RecordedChannel};
use std::path::Path;

/// The journal of one run of a module: from its start to its end, or as far as it was recorded.
#[derive(Debug)]
pub(super) struct RecordedRun {
    pub(super) module: String,
    /// Tells it from other runs of the module.
    incarnation: u32,
    pub(super) bytes: Vec<u8>,
    /// Why it goes on no further, if it should.
    pub(super) ends: Option<String>,
    /// Why it cannot be replayed at all: its beginning is missing.
    pub(super) begins_late: Option<String>,
}

/// Journals of these modules, or of all, in the order in which they begin.
pub(super) fn read(file: &Path, modules: &[String]) -> Result<Vec<RecordedRun>, Failure> {
    let mut runs: Vec<RecordedRun> = Vec::new();
    let mut reader = Reader::open(file)?;
    let mut damage = None;
    loop {
        match reader.next() {
            Ok(Some((channel, message))) if is_wanted(&channel, modules) => {
                take(&mut runs, &channel.name, message.data)
            }
            Ok(Some(_)) => {}
            Ok(None) => break,
            Err(error) => {
                // What comes behind it may be whole; but no journal is.
                let why = format!("the recording is damaged or cut off here: {error}");
                for run in &mut runs {
                    run.ends.get_or_insert_with(|| why.clone());
                }
                damage = Some(error);
                break;
            }
        }
    }
    let missing = modules.iter().find(|module| !runs.iter().any(|run| run.module == **module));
    match (missing, damage) {
        (Some(_), Some(error)) => Err(error.into()),
        (None, Some(error)) if runs.is_empty() => Err(error.into()),
        (Some(module), None) => Err(no_journal(file, Some(module))),
        (None, None) if runs.is_empty() => Err(no_journal(file, None)),
        (None, _) => Ok(runs),
    }
}

/// Those of these modules in files that follow one another, as far as they are whole.
pub(super) fn of_files(files: &[&Path], modules: &[String]) -> Result<Vec<RecordedRun>, Failure> {
    let (mut runs, mut progress) = (Vec::new(), ProgressLine::new());
    for file in files {
        let mut reader = Reader::open(file)?;
        loop {
            match reader.next() {
                Ok(Some((channel, message))) if is_wanted(&channel, modules) => {
                    take(&mut runs, &channel.name, message.data)
                }
                Ok(Some(_)) => {}
                // Behind a damage a piece is missing.
                Ok(None) | Err(_) => break,
            }
            let (read, all) = reader.progress();
            progress.tell(read, all);
        }
    }
    Ok(runs)
}

fn is_wanted(channel: &RecordedChannel, modules: &[String]) -> bool {
    let is_journal = channel.item == JOURNAL_NAME
        && channel.texts.get("number").is_some_and(|number| *number == JOURNAL_NUMBER.to_string());
    is_journal && (modules.is_empty() || modules.contains(&channel.name))
}

fn take(runs: &mut Vec<RecordedRun>, module: &str, value: &[u8]) {
    let Some(Piece { incarnation, offset, bytes }) = Piece::read(value) else { return };
    let is_it = |run: &RecordedRun| (run.module.as_str(), run.incarnation) == (module, incarnation);
    // After the node's memory was made anew, incarnations are counted from the beginning.
    let known = runs.iter().rposition(is_it).filter(|at| offset > 0 || runs[*at].bytes.is_empty());
    let at = known.unwrap_or_else(|| {
        let begins_late = (offset > 0).then(|| {
            format!(
                "its journal began {offset} bytes before the recording did; record from the module's start on, or \
                 `rohrpost record merge` this file with the one before it"
            )
        });
        let module = module.to_owned();
        runs.push(RecordedRun { module, incarnation, bytes: Vec::new(), ends: None, begins_late });
        runs.len() - 1
    });
    let run = &mut runs[at];
    let have = run.bytes.len() as u64;
    if run.ends.is_some() || run.begins_late.is_some() || offset < have {
        return;
    }
    match offset - have {
        0 => run.bytes.extend_from_slice(bytes),
        lost => run.ends = Some(format!("{lost} bytes of the journal were not recorded: the recorder was too slow")),
    }
}

fn no_journal(file: &Path, module: Option<&String>) -> Failure {
    let name = plain::line(module.map_or("pilot.0", String::as_str));
    let of = module.map_or_else(String::new, |_| format!(" of {name}"));
    format!(
        "{}: no journal{of}; name the module in [record] of the configuration before it is recorded, \
         `exact = [\"{name}\"]`",
        file.display()
    )
    .into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(incarnation: u32, offset: u64, bytes: &[u8]) -> Vec<u8> {
        let mut record = vec![0; 64];
        let len = Piece { incarnation, offset, bytes }.write(&mut record);
        record.truncate(len);
        record
    }

    #[test]
    fn pieces_are_put_together_until_one_is_missing() {
        let mut runs = Vec::new();
        for (module, incarnation, offset, bytes) in [
            ("pilot.0", 5, 0, &b"ab"[..]),
            ("mapper.0", 6, 9, b"x"),
            ("pilot.0", 7, 0, b"z"),
            ("pilot.0", 5, 2, b"cd"),
            ("pilot.0", 5, 2, b"cd"),
            ("pilot.0", 5, 7, b"h"),
            ("pilot.0", 5, 4, b"efg"),
            ("mapper.0", 6, 10, b"y"),
            ("pilot.0", 7, 0, b"new"),
            ("pilot.0", 7, 3, b"er"),
        ] {
            take(&mut runs, module, &record(incarnation, offset, bytes));
        }
        take(&mut runs, "pilot.0", b"no piece");
        let told: Vec<(&str, &[u8], bool, bool)> = runs
            .iter()
            .map(|run| (run.module.as_str(), &run.bytes[..], run.ends.is_some(), run.begins_late.is_some()))
            .collect();
        let expected = [
            ("pilot.0", &b"abcd"[..], true, false),
            ("mapper.0", b"", false, true),
            ("pilot.0", b"z", false, false),
            ("pilot.0", b"newer", false, false),
        ];
        assert_eq!(told, expected);
        assert!(runs[0].ends.as_ref().is_some_and(|why| why.starts_with("3 bytes ")), "{:?}", runs[0].ends);
    }
}
