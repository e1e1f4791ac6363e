//! What would keep an arena from its work, told before anything runs.

use super::settings::Settings;
use rohrpost_config::{Document, Installation, Module, Problem, Program};
use rohrpost_payload::Ground;
use std::collections::BTreeSet;

/// The name of the built-in module.
pub(crate) const NAME: &str = "arena";

/// All problems of the arenas of an installation.
pub(crate) fn problems(installation: &Installation, document: &Document<'_>) -> Vec<Problem> {
    let is_arena = |module: &&Module| module.program == Program::Builtin(NAME.into());
    installation.modules.iter().filter(is_arena).flat_map(|module| of_one(installation, document, module)).collect()
}

fn of_one(installation: &Installation, document: &Document<'_>, module: &Module) -> Vec<Problem> {
    let Ok(settings) = document.settings_without_saved::<Settings>(module) else { return Vec::new() };
    let problem = |key: &str, text: String| {
        let name = installation.classes.format(module.name);
        let line = Some(document.settings_line(module, key));
        Problem { line, message: format!("module `{name}`: settings: `{key}` {text}") }
    };
    if settings.map.is_empty() {
        return Vec::new();
    }
    let file = installation.resolve(&settings.map);
    let text = std::fs::read(&file).map_err(|error| format!("{}: {error}", file.display()));
    let ground = text.and_then(|text| {
        let ground = Ground::read(&text, settings.cell_m, 0.0);
        ground.map_err(|error| format!("{}: {error}", file.display()))
    });
    let ground = match ground {
        Ok(ground) => ground,
        Err(error) => return vec![problem("map", format!("cannot be used: {error}"))],
    };
    let mut ids = BTreeSet::new();
    let twice = settings.robots.iter().filter(|robot| !ids.insert(robot.id));
    let twice =
        twice.map(|robot| problem("robots", format!("has robot {} twice; give each an id of its own", robot.id)));
    let starts = settings.robots.iter().map(|robot| ("robots", robot.cell));
    let cells = starts.chain(settings.intruders.iter().map(|intruder| ("intruders", intruder.cell)));
    let off = cells.filter(|(_, cell)| !ground.grid().is_path(*cell));
    let off = off.map(|(key, cell)| problem(key, format!("begins where {cell} is no path; name a path of the map")));
    twice.chain(off).collect()
}
