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
        let own = wormhole.name.class();
        if !installation.access.of(motor).is_some_and(|rule| rule.callers == [own].into_iter().collect()) {
            let own = classes.name(own).unwrap_or_default();
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
    let laser = classes.parse_module(&settings.laser).ok().and_then(|laser| installation.module(laser));
    if let Some(laser) = laser.filter(|laser| laser.node != wormhole.node) {
        let line = document.settings_line(wormhole, "laser");
        tell(
            line,
            format!(
                "`{}` is on node {}, and its clock says nothing here of a scan's age; put both on one node",
                settings.laser, laser.node
            ),
        );
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

#[cfg(test)]
mod tests {
    use rohrpost_config::Installation;

    const FILE: &str = include_str!("../../../../config/demo-supervised.toml");

    /// What is told of the demo's file with some changes.
    fn told(changes: &[(&str, &str)]) -> Vec<String> {
        let text = changes.iter().fold(FILE.to_owned(), |text, (old, new)| {
            assert!(text.contains(old), "{old}");
            text.replacen(old, new, 1)
        });
        let installation =
            Installation::parse(&text, "robot.toml".as_ref()).unwrap_or_else(|errors| panic!("{errors}"));
        crate::check(&installation).into_iter().map(|problem| problem.message).collect()
    }

    #[test]
    fn what_would_keep_a_wormhole_from_its_work_is_told() {
        assert_eq!(told(&[("lag-ms = 50", "lag-ms = 60")]), [""; 0]);
        let motor = "\"motor.1\" = [\"wormhole\"]";
        let cases: [(&[(&str, &str)], &str); 8] = [
            (&[(motor, "\"motor.1\" = [\"wormhole\", \"tool\"]")], "others may command `motor.1`"),
            (&[(motor, ""), ("[\"pilot\", \"tool\"]", "[\"pilot\", \"wormhole\"]")], "into [access]"),
            (
                &[("wormhole = { id = 210", "wormhole = { id = 130"), ("\"motor.0\"]\nsettings", CALLS_BELOW)],
                "give class `wormhole` a higher one",
            ),
            (&[("[nodes.main]", "[nodes.main]\n[time]\nsource = \"simulation\"")], "go by the computer's clock"),
            (&[("program = \"pilot.0\"", "program = \"pilot.7\"")], "`pilot.7`, which no [[module]] defines"),
            (
                &[("aliases = [\"motor.0\"]", ""), ("[\"laser.0\", \"motor.0\"]", "[\"laser.0\"]")],
                "no name of class `motor`",
            ),
            (&[("radius-m = 0.25", "radius-m = 0")], "`radius-m` is 0"),
            (
                &[("id = 140", "id = 230"), (motor, "\"motor.1\" = [\"wormhole\", \"pilot\"]"), PAST],
                "`pilot.0` calls `motor.1` past it",
            ),
        ];
        for (changes, words) in cases {
            let problems = told(changes);
            assert!(problems.iter().any(|problem| problem.contains(words)), "{words}: {problems:#?}");
        }
    }

    const CALLS_BELOW: &str = "{ to = \"motor.0\", although = \"it waits\" }]\nsettings";
    const PAST: (&str, &str) = (
        "calls = [\"laser.0\", \"motor.0\"]",
        "calls = [{ to = \"laser.0\", subscribes = true }, { to = \"motor.1\", although = \"it waits\" }]",
    );
}
