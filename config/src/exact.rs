//! Modules with a journal, so that they can be replayed exactly: `exact` of `[record]`.

use crate::classes::{ClassTable, ROUTER, TEAM_ROUTER};
use crate::directory::Directory;
use crate::module::{Module, Program, RECORDER, REPLAY, TCP_CLIENT, TCP_ROUTER};
use crate::reader::Section;
use crate::stream::StreamSpec;
use rohrpost_mailbox::Name;
use std::time::Duration;

/// Built-in modules that take in what no journal sees: descriptors, files, threads, packages past their proxies.
const WITHOUT: [&str; 8] = [RECORDER, REPLAY, ROUTER, TEAM_ROUTER, TCP_CLIENT, TCP_ROUTER, "output", "carmen"];

/// The stream that a journal is written into: with little to do it holds the last 20 s. Journals are in order by
/// themselves, so no record is late.
pub const JOURNAL: StreamSpec = StreamSpec { record_bytes: 4096, keep: 1024, readers: 4, late: Duration::MAX };

/// Bytes of a longest record that a recording takes.
pub const RECORDED_BYTES_MAX: usize = 16 << 20;

/// A module of `exact`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExactModule {
    /// Its name.
    pub name: Name,
    /// Line in the file.
    pub line: usize,
}

/// Whether the journal of a module with this program would say all that it takes in. Own programs are believed.
pub fn may_have_journal(program: &Program) -> bool {
    !matches!(program, Program::Builtin(builtin) if WITHOUT.contains(&builtin.as_str()))
}

pub(crate) fn read(section: &Section<'_>, directory: &Directory<'_>) -> Vec<ExactModule> {
    let mut all: Vec<ExactModule> = Vec::new();
    for item in &section.or("exact", Vec::new(), |item| item.list("[\"pilot.0\"]")) {
        let Some(text) = item.text_of_list("pilot.0") else { continue };
        let Some(name) = directory.module(item, text) else { continue };
        match all.iter().find(|first| first.name == name) {
            Some(first) => item.report(format!("`{text}` is in line {} of `exact` already; drop one", first.line)),
            None => all.push(ExactModule { name, line: item.line }),
        }
    }
    all
}

/// What is wrong with them, each with its line. `own` records.
pub(crate) fn mistakes(
    exact: &[ExactModule],
    classes: &ClassTable,
    modules: &[Module],
    own: &Module,
) -> Vec<(usize, String)> {
    let mistake = |ExactModule { name, line }: &ExactModule| {
        let module = modules.iter().find(|module| module.names().any(|known| known == *name))?;
        let text = classes.format(*name);
        let why = match &module.program {
            _ if module.name != *name => {
                format!(
                    "is an alias of `{0}`, and a journal is of a whole module; write `{0}`",
                    classes.format(module.name)
                )
            }
            program @ Program::Builtin(builtin) if !may_have_journal(program) => {
                format!("runs the built-in `{builtin}`, which takes in what no journal sees; drop the entry")
            }
            _ if module.node != own.node => format!(
                "is on node {}, and `{}` records on node {}: journals are read on their own node; drop the entry, or \
                 record on node {}",
                module.node,
                classes.format(own.name),
                own.node,
                module.node
            ),
            _ => return None,
        };
        Some((*line, format!("`exact`: `{text}` {why}")))
    };
    exact.iter().filter_map(mistake).collect()
}
