//! What would keep a team's module from its work, told before anything runs.

use super::settings::Settings;
use crate::map::read_map;
use rohrpost_config::{Document, Installation, Module, Problem, Program};

/// All problems of the team's modules of an installation.
pub(crate) fn problems(installation: &Installation, document: &Document<'_>) -> Vec<Problem> {
    let is_team = |module: &&Module| module.program == Program::Builtin("team".into());
    installation.modules.iter().filter(is_team).flat_map(|module| of_one(installation, document, module)).collect()
}

fn of_one(installation: &Installation, document: &Document<'_>, module: &Module) -> Vec<Problem> {
    let Ok(settings) = document.settings_without_saved::<Settings>(module) else { return Vec::new() };
    let problem = |line, text: String| {
        let name = installation.classes.format(module.name);
        Problem { line: Some(line), message: format!("module `{name}`: {text}") }
    };
    let mut problems = Vec::new();
    if installation.team.is_none() && installation.tcp.is_none() {
        problems.push(problem(module.line, "no other robot hears it; add [team], or [tcp] with a TCP router".into()));
    }
    if let Some(Err(error)) = settings.map.as_ref().map(|map| read_map(&installation.resolve(map))) {
        let line = document.settings_line(module, "map");
        problems.push(problem(line, format!("settings: `map` cannot be used: {error}")));
    }
    problems
}
