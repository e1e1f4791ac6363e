//! `rohrpost replay --exact`: runs the programs of modules again with what their journals say, and tells whether they
//! do the same.
//!
//! ```text
//! recording ──▶ journals: pieces of each run put together, a file each ──▶ the module's program, alone ──▶ its report
//!          └──▶ records that these name, in another file ───────────────────┘
//! ```
//!
//! A recording names programs, and anybody may have written it. So nothing runs until the user has named the
//! program, or has said that the recorded ones are to run; until then `consent` says which those are.

mod answers;
mod command;
mod consent;
mod journals;
mod program;
mod records;

use crate::begin::demo::Folder;
use crate::command_line::command_line;
use crate::quota::UnpackedQuota;
use crate::terminal::{Failure, complain, say};
pub(super) use answers::read_answers;
use consent::LocalConfiguration;
use journals::RecordedRun;
use program::ExactPrograms;
pub(super) use program::{ExactProgram, SHARED_MEMORY};
use rohrpost::output::plain;
use rohrpost_modules::journal::{Difference, ExactRun, ReplayReport, ReplayVerdict};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// What is to be replayed.
pub(super) struct ExactArguments {
    /// The recording.
    pub(super) file: PathBuf,
    /// Modules; none: all with a journal.
    pub(super) modules: Vec<String>,
    /// What runs; none: nothing, and what the recording would run is shown.
    pub(super) program: Option<ExactProgram>,
    /// The user's own configuration, with which recorded commands, settings and saved parameters are compared.
    pub(super) config: Option<PathBuf>,
    /// Where relative paths of the configuration start; none: where they did.
    pub(super) folder: Option<PathBuf>,
    /// Print the journals instead, entry by entry.
    pub(super) list: bool,
    /// One JSON object a run.
    pub(super) json: bool,
}

pub(super) fn run(arguments: &ExactArguments) -> Result<ExitCode, Failure> {
    let own = Folder::new()?;
    let mut quota = UnpackedQuota::of_files(&[&arguments.file]);
    let runs = journals::read(&arguments.file, &arguments.modules, own.path(), &mut quota)?;
    if arguments.list {
        runs.iter().try_for_each(list)?;
        return Ok(ExitCode::SUCCESS);
    }
    let folder = arguments.folder.as_deref().map(canonical).transpose()?;
    let Some(program) = &arguments.program else {
        show(arguments, &runs, folder.as_deref())?;
        complain(advice(arguments));
        return Ok(ExitCode::FAILURE);
    };
    let local = LocalConfiguration::load(arguments.config.as_deref())?;
    let mut told: Vec<String> = Vec::new();
    for run in &runs {
        let exact = ExactRun { folder: folder.clone(), ..run.exact() };
        // What cannot be read is told when it is to run.
        let notes = local.given(run, &exact).unwrap_or_default();
        for note in notes.iter().map(|note| format!("{}: {}", plain::line(&run.module), plain::line(note))) {
            if !told.contains(&note) {
                complain(&note);
                told.push(note);
            }
        }
    }
    let records = records::collect(&arguments.file, &runs, own.path(), &mut quota)?;
    let records = records.map(|path| path.display().to_string());
    let programs = ExactPrograms { program, folder, records };
    let mut code = ExitCode::SUCCESS;
    for (number, run) in numbered(&runs) {
        let began = Instant::now();
        let report = match &run.begins_late {
            Some(why) => ReplayReport::refused(why.clone()),
            None => programs.repeat(run)?,
        };
        if !matches!(report.verdict, ReplayVerdict::Identical { .. }) {
            code = ExitCode::FAILURE;
        }
        tell(arguments.json, run, number, &report, began.elapsed());
    }
    Ok(code)
}

fn canonical(folder: &Path) -> Result<String, Failure> {
    let found = folder.canonicalize().map_err(|error| format!("--folder {}: {error}", folder.display()))?;
    found.into_os_string().into_string().map_err(|name| format!("--folder {}: is no UTF-8 text", name.display()).into())
}

/// Each run with its number among those of its module, from 1 on.
fn numbered(runs: &[RecordedRun]) -> impl Iterator<Item = (usize, &RecordedRun)> {
    let number = move |at: usize| runs[..=at].iter().filter(|run| run.module == runs[at].module).count();
    runs.iter().enumerate().map(move |(at, run)| (number(at), run))
}

/// Says what each run would have run. Runs of one module mostly say the same, which is said once.
fn show(arguments: &ExactArguments, runs: &[RecordedRun], folder: Option<&str>) -> Result<(), Failure> {
    let local = LocalConfiguration::load(arguments.config.as_deref())?;
    let mut shown: Vec<String> = Vec::new();
    for (number, run) in numbered(runs) {
        let exact = ExactRun { folder: folder.map(str::to_owned), ..run.exact() };
        let compared = local.compared(run, &exact);
        let text = if arguments.json {
            let (command, differences, why) = match &compared {
                Ok(its) => {
                    let words = its.command.words().map(|word| word.to_string_lossy().into_owned());
                    (json!(words.collect::<Vec<_>>()), json!(its.differences), Value::Null)
                }
                Err(why) => (Value::Null, Value::Null, json!(why)),
            };
            json!({
                "module": run.module, "run": number, "result": "not run", "command": command,
                "differences": differences, "why": why,
            })
            .to_string()
        } else {
            let name = plain::line(&run.module);
            match &compared {
                Ok(its) => {
                    let notes = its.differences.iter().map(|note| format!("\n    {}", plain::line(note)));
                    format!("{name}: the recording would run\n  {}{}", its.command, notes.collect::<String>())
                }
                Err(why) => format!("{name}: refused: {}", plain::line(why)),
            }
        };
        if !shown.contains(&text) {
            say(&text);
            shown.push(text);
        }
    }
    Ok(())
}

/// Why nothing was run, and how one has it run.
fn advice(arguments: &ExactArguments) -> String {
    let mut rest = vec![arguments.file.as_os_str()];
    rest.extend(arguments.modules.iter().map(std::ffi::OsStr::new));
    if let Some(folder) = &arguments.folder {
        rest.extend([std::ffi::OsStr::new("--folder"), folder.as_os_str()]);
    }
    if arguments.json {
        rest.push("--json".as_ref());
    }
    let rest = command_line(rest);
    format!(
        "nothing was run: a recording can name any command. To run these commands, as you:\n  rohrpost replay --exact \
         --run-recorded {rest}\nTo run a program of your own instead:\n  rohrpost replay --exact {rest} --program PATH \
         [-- ARGUMENT...]"
    )
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
