//! What would keep a payload from its work, told before anything runs.

use super::settings::Settings;
use rohrpost_config::{Document, Installation, Module, Problem, Program};

/// The name of the built-in module.
pub(crate) const NAME: &str = "payload";

/// All problems of the payloads of an installation.
pub(crate) fn problems(installation: &Installation, document: &Document<'_>) -> Vec<Problem> {
    let is_payload = |module: &&Module| module.program == Program::Builtin(NAME.into());
    installation.modules.iter().filter(is_payload).flat_map(|module| of_one(installation, document, module)).collect()
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
    if !settings.map.is_empty()
        && let Err(error) = settings.ground(&installation.resolve(&settings.map))
    {
        let line = document.settings_line(module, "map");
        problems.push(problem(line, format!("settings: `map` cannot be used: {error}")));
    }
    problems
}
