//! `rohrpost replay --exact`: runs the programs of modules again with what their journals say, and tells whether they
//! do the same.
//!
//! ```text
//! recording ──▶ journals: pieces of each run put together, a file each ──▶ the module's program, alone ──▶ its report
//!          └──▶ records that these name, in another file ───────────────────┘
//! ```

mod answers;
mod journals;
mod program;
mod records;

use crate::demo::Folder;
use crate::quota::UnpackedQuota;
use crate::terminal::{Failure, complain, say};
pub(super) use answers::JournalAnswers;
use journals::RecordedRun;
use program::ExactPrograms;
pub(super) use program::SHARED_MEMORY;
use rohrpost::output::plain;
use rohrpost_modules::journal::{Difference, ReplayReport, ReplayVerdict};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// What is to be replayed.
pub(super) struct ExactArguments {
    /// The recording.
    pub(super) file: PathBuf,
    /// Modules; none: all with a journal.
    pub(super) modules: Vec<String>,
    /// In place of the program that the configuration names.
    pub(super) program: Option<PathBuf>,
    /// Where relative paths of the configuration start; none: where they did.
    pub(super) folder: Option<PathBuf>,
    /// Print the journals instead, entry by entry.
    pub(super) list: bool,
    /// One JSON object a run.
    pub(super) json: bool,
}

pub(super) fn run(arguments: &ExactArguments) -> Result<ExitCode, Failure> {
    let folder = Folder::new()?;
    let file = arguments.file.as_path();
    let mut quota = UnpackedQuota::of_files(&[file]);
    let runs = journals::read(file, &arguments.modules, folder.path(), &mut quota)?;
    if arguments.list {
        runs.iter().try_for_each(list)?;
        return Ok(ExitCode::SUCCESS);
    }
    let records = records::collect(file, &runs, folder.path(), &mut quota)?;
    let programs = ExactPrograms::new(arguments.program.clone(), arguments.folder.clone(), records);
    let mut code = ExitCode::SUCCESS;
    for run in &runs {
        let began = Instant::now();
        let report = match &run.begins_late {
            Some(why) => ReplayReport::refused(why.clone()),
            None => programs.repeat(run)?,
        };
        if !matches!(report.verdict, ReplayVerdict::Identical { .. }) {
            code = ExitCode::FAILURE;
        }
        let number = runs.iter().take_while(|other| !std::ptr::eq(*other, run)).filter(|o| o.module == run.module);
        tell(arguments.json, run, number.count() + 1, &report, began.elapsed());
    }
    Ok(code)
}

fn list(run: &RecordedRun) -> Result<(), Failure> {
    say(format_args!("{}:", plain::line(&run.module)));
    let exact = run.exact();
    if let Err(why) = run.readable(&exact) {
        say(format_args!("  ({})", plain::line(&why)));
        return Ok(());
    }
    // The reader may have seen enough.
    Ok(exact.each_entry(|entry| say(plain::line(entry)))?)
}

fn tell(is_json: bool, run: &RecordedRun, number: usize, report: &ReplayReport, took: Duration) {
    let (module, last_ns) = (&run.module, report.last_ns);
    let recorded_s = last_ns.saturating_sub(report.first_ns) as f64 / 1e9;
    if is_json {
        let (result, why): (&str, Value) = match &report.verdict {
            ReplayVerdict::Identical { .. } => ("identical", json!(report.not_made)),
            ReplayVerdict::Differs(Difference { event, recorded, replayed }) => {
                ("differs", json!({"event": event, "recorded": recorded, "replayed": replayed}))
            }
            ReplayVerdict::Refused(why) => ("refused", json!(why)),
        };
        let is_whole = matches!(report.verdict, ReplayVerdict::Identical { is_whole: true });
        say(json!({
            "module": module, "run": number, "result": result, "why": why, "is_whole": is_whole,
            "events": report.events, "outputs": report.outputs, "first_ns": report.first_ns, "last_ns": last_ns,
            "took_s": took.as_secs_f64(),
        }));
        return;
    }
    let name = plain::line(module);
    let which = if number > 1 { format!("{name}, run {number}") } else { name.to_string() };
    let text = format!("{which}: {report}");
    let times = format!("{recorded_s:.1} s in {:.1} s", took.as_secs_f64());
    match report.verdict {
        ReplayVerdict::Identical { .. } => drop(say(format_args!("{text}; {times}"))),
        ReplayVerdict::Differs(_) | ReplayVerdict::Refused(_) => complain(text),
    }
}

#[cfg(test)]
mod tests {
    /// Records that a journal may name are those that a recording takes.
    #[test]
    fn what_a_journal_names_is_recorded() {
        assert_eq!(rohrpost_config::RECORDED_BYTES_MAX, rohrpost_recording::format::MESSAGE_BYTES_MAX);
    }
}
