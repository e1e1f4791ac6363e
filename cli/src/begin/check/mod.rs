//! `rohrpost check`, and reading a configuration with every check that is possible before anything runs.

mod notes;

use crate::computer::doctor;
use crate::daemons;
use crate::look::resolved;
use crate::terminal::{Failure, say};
use rohrpost::Name;
use rohrpost_config::{Errors, Flow, Installation, MissingProgram, TimeSource, explain};
use rohrpost_mailbox::base_directory;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost check config/demo.toml
  rohrpost check robot.toml --resolved     where each value comes from, of files that include others
  rohrpost check robot.toml --json         mistakes with file and line, or the resolved file, for programs")]
pub(crate) struct Arguments {
    /// The configuration.
    file: PathBuf,
    /// Explain only this node.
    #[arg(long, value_name = "NAME")]
    node: Option<String>,
    /// Print the whole text with what the file includes, and behind each value the file and line that it comes from.
    #[arg(long, conflicts_with = "json")]
    resolved: bool,
    /// Print mistakes, or what the file means, as JSON.
    #[arg(long)]
    json: bool,
}

/// Reads a configuration, and asks the built-in modules whether they can work with it.
///
/// # Errors
/// Everything that is wrong, by line.
pub(crate) fn load(file: &Path) -> Result<Installation, Errors> {
    validate(Installation::load(file)?)
}

/// Asks the built-in modules of an installation whether they can work with it.
///
/// # Errors
/// Everything that they would refuse, by line.
pub(crate) fn validate(installation: Installation) -> Result<Installation, Errors> {
    let problems = rohrpost_builtin::check(&installation);
    if !problems.is_empty() {
        return Err(installation.errors(problems));
    }
    let problems = rohrpost_builtin::check_saved(&installation);
    match &installation.saved {
        Some(saved) if !problems.is_empty() => Err(Errors::new(&saved.path, problems)),
        _ => Ok(installation),
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let installation = match load(&arguments.file) {
        Err(errors) if arguments.json => {
            say(errors_json(&errors));
            return Ok(ExitCode::FAILURE);
        }
        loaded => loaded?,
    };
    if arguments.resolved {
        say(installation.text.trim_end());
        return Ok(ExitCode::SUCCESS);
    }
    let only = arguments.node.as_deref();
    if only.is_some() {
        rohrpost_launch::choose_node(&installation, only)?;
    }
    let missing = missing_programs(&installation, only)?;
    let mut notes = separated_by_size(&installation);
    notes.extend(rohrpost_builtin::notes(&installation));
    notes.extend(notes::records_too_large(&installation));
    notes.extend(daemons_here(&installation, Path::new("/proc")));
    let base = base_directory();
    let room = doctor::room_of_nodes(&base);
    notes.extend(room.into_iter().flat_map(|room| notes::too_small(&installation, only, &base, room)));
    if arguments.json {
        say(installation_json(&installation, only, &missing, &notes));
        return Ok(ExitCode::SUCCESS);
    }
    say(explain(&installation, only).trim_end());
    for note in missing.iter().map(ToString::to_string).chain(notes) {
        say(format_args!("note: {note}"));
    }
    Ok(ExitCode::SUCCESS)
}

/// Time daemons that run on this computer, if the installation has a common time.
fn daemons_here(installation: &Installation, processes: &Path) -> Vec<String> {
    if !matches!(installation.time, TimeSource::Master { .. }) {
        return Vec::new();
    }
    let told = daemons::running(processes).into_iter().map(|daemon| {
        let (name, ends, why) = (daemon.name, daemon.ends, daemons::WHY);
        format!("{name} runs on this computer; if that is a node, end it: {ends}; {why}")
    });
    told.collect()
}

/// Flows between the same two modules of two nodes, if the file does not list their content: routers go by the size of
/// each package.
fn separated_by_size(installation: &Installation) -> Vec<String> {
    let name = |name| installation.classes.format(name);
    let crosses = |flow: &&Flow| installation.node_of(flow.from) != installation.node_of(flow.to);
    let unsaid: Vec<&Flow> = installation.flows.iter().filter(|flow| flow.carries.is_none()).filter(crosses).collect();
    let mut lines: BTreeMap<(Name, Name), Vec<String>> = BTreeMap::new();
    for flow in unsaid {
        lines.entry((flow.from, flow.to)).or_default().push(installation.place(flow.line).1.to_string());
    }
    let notes = lines.into_iter().filter(|(_, lines)| lines.len() > 1).map(|((from, to), lines)| {
        format!(
            "the [[flow]]s from {} to {} in lines {} are told apart by the size of packages alone; say what each \
             carries, such as `carries = \"data 1\"`",
            name(from),
            name(to),
            lines.join(", ")
        )
    });
    notes.collect()
}

/// The file does not say on which computer this runs; a missing program is an error only where its node is launched.
fn missing_programs(installation: &Installation, only: Option<&str>) -> Result<Vec<MissingProgram>, Failure> {
    let beside = std::env::current_exe()?.parent().map(PathBuf::from).unwrap_or_default();
    let nodes = installation.nodes.iter().filter(|node| only.is_none_or(|name| name == node.name));
    Ok(nodes.flat_map(|node| installation.missing_programs(&node.name, &beside)).collect())
}

/// A file with mistakes.
pub(super) fn errors_json(errors: &Errors) -> Value {
    let file = errors.path().display().to_string();
    let mut problems = Vec::new();
    for (path, line, message) in errors.placed() {
        problems.push(json!({ "file": path.display().to_string(), "line": line, "message": message }));
    }
    json!({ "file": file, "right": false, "errors": problems })
}

/// A correct file, as `explain` describes it. `notes`: additional hints for people.
pub(super) fn installation_json(
    installation: &Installation,
    only: Option<&str>,
    missing: &[MissingProgram],
    notes: &[String],
) -> Value {
    let missing = missing.iter().map(|program| {
        let module = installation.classes.format(program.module);
        json!({ "module": module, "optional": program.optional, "message": program.message })
    });
    json!({
        "file": installation.path.display().to_string(),
        "right": true,
        "installation": resolved::of(installation, only),
        "missing_programs": missing.collect::<Vec<_>>(),
        "notes": notes,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flows_separated_only_by_size_get_a_note() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo-tdma.toml");
        let text = std::fs::read_to_string(&file).unwrap();
        let notes = |text: &str| separated_by_size(&Installation::parse(text, &file).unwrap());
        assert_eq!(notes(&text), [""; 0], "each says what it carries");
        let line = |from: &str| 1 + text[..text.find(from).unwrap()].matches('\n').count();
        let lines = [line("[[flow]] # 181 beams"), line("[[flow]] # and answered")];
        let unsaid = text.replace("carries = \"data 1\"", "").replace("carries = \"reply 5\"", "");
        let notes = notes(&unsaid);
        let note = format!("the [[flow]]s from laser.0 to pilot.0 in lines {}, {} ", lines[0], lines[1]);
        assert!(notes.len() == 3 && notes.iter().any(|said| said.starts_with(&note)), "{notes:#?}");
    }
}
