//! What would keep a wormhole from its work, told before anything runs.

use super::settings::Settings;
use crate::settings::has_class;
use rohrpost_config::{Document, Installation, Module, Problem, Program, TimeSource};
use rohrpost_mailbox::Name;
use rohrpost_modules::interface::Interface;
use rohrpost_modules::interfaces::MotorInterface;

/// The name of the built-in module.
const WORMHOLE: &str = "wormhole";

/// All problems of the wormholes of an installation.
pub(crate) fn problems(installation: &Installation, document: &Document<'_>) -> Vec<Problem> {
    let is_wormhole = |module: &&Module| module.program == Program::Builtin(WORMHOLE.into());
    let wormholes = installation.modules.iter().filter(is_wormhole);
    wormholes.flat_map(|module| of_one(installation, document, module)).collect()
}

fn of_one(installation: &Installation, document: &Document<'_>, wormhole: &Module) -> Vec<Problem> {
    let Ok(settings) = document.settings_without_saved::<Settings>(wormhole) else { return Vec::new() };
    let classes = &installation.classes;
    let mut problems = Vec::new();
    let mut tell = |line: usize, text: String| {
        let message = format!("module `{}`: {text}", classes.format(wormhole.name));
        problems.push(Problem { line: Some(line), message });
    };
    if matches!(installation.time, TimeSource::Simulation { .. } | TimeSource::Log) {
        let line = wormhole.line;
        tell(line, "its deadlines go by the computer's clock; use `source = \"local\"` or \"master\" in [time]".into());
    }
    if let Ok(motor) = classes.parse_module(&settings.motor) {
        for (other, line) in callers_past(installation, wormhole, motor) {
            let by = classes.format(other.name);
            tell(
                line,
                format!(
                    "`{by}` calls `{}` past it; let it call the motor's name that is an alias here",
                    settings.motor
                ),
            );
        }
        if installation.access_against(programs_name(installation, &settings.program), motor).is_none() {
            let own = classes.name(wormhole.name.class()).unwrap_or_default();
            let line = document.settings_line(wormhole, "motor");
            tell(
                line,
                format!(
                    "others may command `{}`; write `\"{}\" = [\"{own}\"]` into [access]",
                    settings.motor, settings.motor
                ),
            );
        }
    }
    if !has_class(installation, wormhole, MotorInterface::CLASS) {
        let line = wormhole.line;
        tell(line, "it has no name of class `motor` that programs command; add one to `aliases`".into());
    }
    let line = document.settings_line(wormhole, "program");
    match classes.parse_module(&settings.program).ok().and_then(|program| installation.module(program)) {
        None => tell(line, format!("`program` is `{}`, which no [[module]] defines", settings.program)),
        Some(program) if program.name.class() >= wormhole.name.class() => {
            let text = "its class has no higher id than that of its program, which could keep it from its work";
            tell(
                line,
                format!(
                    "{text}; give class `{}` a higher one",
                    classes.name(wormhole.name.class()).unwrap_or_default()
                ),
            );
        }
        Some(_) => {}
    }
    problems
}

/// A name that a command of the program would come from.
fn programs_name(installation: &Installation, program: &str) -> Name {
    installation.classes.parse_module(program).unwrap_or(Name::from_raw(0)).with_local(rohrpost_mailbox::local::REPLIES)
}

/// Modules that command the motor themselves, with their line.
fn callers_past<'a>(
    installation: &'a Installation,
    wormhole: &'a Module,
    motor: Name,
) -> impl Iterator<Item = (&'a Module, usize)> {
    let others = installation.modules.iter().filter(|module| module.name != wormhole.name);
    let commands = others.filter(move |module| module.calls.contains(&motor) && !module.downwards.subscribes(motor));
    commands.map(|module| (module, module.line))
}
