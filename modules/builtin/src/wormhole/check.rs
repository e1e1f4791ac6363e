//! What would keep a wormhole from its work, told before anything runs.

use super::settings::Settings;
use crate::map::read_walls;
use crate::settings::has_class;
use crate::sim;
use rohrpost_config::{Document, Installation, Module, Problem, Program, TimeSource};
use rohrpost_mailbox::Name;
use rohrpost_modules::interface::Interface;
use rohrpost_modules::interfaces::MotorInterface;
use std::time::Duration;

/// The name of the built-in module.
const WORMHOLE: &str = "wormhole";

/// All problems of the wormholes of an installation.
pub(crate) fn problems(installation: &Installation, document: &Document<'_>) -> Vec<Problem> {
    wormholes(installation).flat_map(|module| of_one(installation, document, module)).collect()
}

/// What each wormhole counts on, defaults included: safety is as true as these.
pub(crate) fn notes(installation: &Installation) -> Vec<String> {
    let document = installation.document();
    let note = |module: &Module| {
        let settings: Settings = document.settings_without_saved(module).ok()?;
        let (own, Settings { motor, laser, program, .. }) = (installation.classes.format(module.name), &settings);
        let counts_on = settings.counts_on();
        Some(format!("{own} supervises {program}, commands {motor} by what {laser} sees, and {counts_on}"))
    };
    wormholes(installation).filter_map(note).collect()
}

fn wormholes(installation: &Installation) -> impl Iterator<Item = &Module> {
    installation.modules.iter().filter(|module| module.program == Program::Builtin(WORMHOLE.into()))
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
        if let Some(dead_man) = dead_man_of(installation, document, motor).filter(|time| *time > settings.look_max()) {
            let line = document.settings_line(wormhole, "motor");
            let most = settings.look_max();
            tell(
                line,
                format!(
                    "`{}` goes on for {dead_man:?} if this wormhole dies; write at most {} as its `dead-man-ms` \
                     (`look-ms` and `late-ms` together)",
                    settings.motor,
                    most.as_millis()
                ),
            );
        }
        let own = wormhole.name.class();
        if !installation.access.of(motor).is_some_and(|rule| rule.callers == [own].into_iter().collect()) {
            let motor = &settings.motor;
            let line = document.settings_line(wormhole, "motor");
            let right = format!("write `{{ to = \"{motor}\", alone = true }}` into its `calls`");
            tell(line, format!("others may command `{motor}`; {right}"));
        }
    }
    if !has_class(installation, wormhole, MotorInterface::CLASS) {
        let line = wormhole.line;
        tell(line, "it has no name of class `motor` that programs command; add one to `aliases`".into());
    }
    for (key, name) in
        [("laser", Some(&settings.laser)), ("odometry", settings.odometry.as_ref()), ("motor", Some(&settings.motor))]
    {
        let sensor = name.and_then(|name| classes.parse_module(name).ok()).and_then(|name| installation.module(name));
        if let Some(sensor) = sensor.filter(|sensor| sensor.node != wormhole.node) {
            let name = classes.format(sensor.name);
            let text = "and its clock says nothing here of the age of what it tells, nor how long a command was on its \
                        way; put both on one node";
            tell(document.settings_line(wormhole, key), format!("`{name}` is on node {}, {text}", sensor.node));
        }
    }
    if let Some(Err(error)) =
        settings.walls.as_ref().map(|known| read_walls(&installation.resolve(&known.map), known.absolute))
    {
        tell(document.settings_line(wormhole, "walls"), format!("its map cannot be used: {error}"));
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

/// How long a simulated motor goes on without commands; nobody says it of a real one.
fn dead_man_of(installation: &Installation, document: &Document<'_>, motor: Name) -> Option<Duration> {
    let module = installation.module(motor).filter(|module| module.program == Program::Builtin(sim::NAME.into()))?;
    Some(document.settings_without_saved::<sim::Settings>(module).ok()?.dead_man())
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
        crate::check(&installation(changes)).into_iter().map(|problem| problem.message).collect()
    }

    fn installation(changes: &[(&str, &str)]) -> Installation {
        let text = changes.iter().fold(FILE.to_owned(), |text, (old, new)| {
            assert!(text.contains(old), "{old}");
            text.replacen(old, new, 1)
        });
        Installation::parse(&text, "../../config/robot.toml".as_ref()).unwrap_or_else(|errors| panic!("{errors}"))
    }

    #[test]
    fn what_would_keep_a_wormhole_from_its_work_is_told() {
        assert_eq!(told(&[("lag-ms = 50", "lag-ms = 60")]), [""; 0]);
        let said = super::notes(&installation(&[])).join("\n");
        for words in [
            "wormhole.0 supervises pilot.0, commands motor.1 by what laser.0 sees, and counts on radius-m = 0.25",
            "turn-braking-rad-s2 = 4,",
            "others-m-s = 0: only what stands is promised",
        ] {
            assert!(said.contains(words), "{words}: {said}");
        }
        let calls = ("calls = [{", "calls = [\"odometry.0\", {");
        let known = format!("safety = \"greedy\"\nodometry = \"odometry.0\"\n{WALLS}\nlag-ms = 50");
        assert_eq!(told(&[("lag-ms = 50", &known), calls]), [""; 0]);
        let [without_odometry, too_far_off, without_map] =
            [("odometry = \"odometry.0\"\n", ""), ("0.02", "0.05"), ("building", "no")]
                .map(|(old, new)| known.replace(old, new).replace("safety = \"greedy\"\n", ""));
        let alone = "{ to = \"motor.1\", alone = true }";
        let by_hand =
            "[access]\n\"motor.1\" = [\"wormhole\", \"pilot\"]\nodometry = []\nlaser = [\"wormhole\", \"pilot\"]\n";
        let cases: [(&[(&str, &str)], &str); 14] = [
            (&[(alone, "\"motor.1\""), ("[access]\n", by_hand)], "others may command `motor.1`"),
            (
                &[(alone, "\"motor.1\""), ("[access]\nmotor = [\"pilot\", \"tool\"]", "")],
                "alone = true }` into its `calls`",
            ),
            (
                &[("wormhole = { id = 210", "wormhole = { id = 130"), ("\"motor.0\"]\nsettings", CALLS_BELOW)],
                "give class `wormhole` a higher one",
            ),
            (&[("[nodes.main]", "[nodes.main]\n[time]\nsource = \"simulation\"")], "go by the computer's clock"),
            (&[("lag-ms = 50", "lag-ms = 50\nprogram = \"pilot.7\"")], "`pilot.7`, which no [[module]] defines"),
            (
                &[("aliases = [\"motor.0\"]", ""), ("[\"laser.0\", \"motor.0\"]", "[\"laser.0\"]")],
                "no name of class `motor`",
            ),
            (&[("radius-m = 0.25", "radius-m = 0")], "`radius-m` is 0"),
            (&[("lag-ms = 50", "lag-ms = 50\nsafety = \"greedy\"")], "name its module in `odometry`"),
            (
                &[("lag-ms = 50", "lag-ms = 50\nsafety = \"greedy\"\nodometry = \"odometry.0\"")],
                "`calls` does not name; add \"odometry.0\"",
            ),
            (&[("lag-ms = 50", "lag-ms = 50\ngreedy-s = 0")], "`greedy-s` is 0"),
            (&[("lag-ms = 50", &without_odometry)], "`walls` goes by odometry"),
            (&[("lag-ms = 50", &too_far_off)], "`others-radius-m` and `radius-m` have to be 0.125 or more"),
            (&[("lag-ms = 50", &without_map)], "its map cannot be used: ../../config/no.map"),
            (
                &[("id = 140", "id = 230"), (alone, "\"motor.1\""), ("[access]\n", by_hand), PAST],
                "`pilot.0` calls `motor.1` past it",
            ),
        ];
        for (changes, words) in cases {
            let problems = told(changes);
            assert!(problems.iter().any(|problem| problem.contains(words)), "{words}: {problems:#?}");
        }
    }

    const WALLS: &str = "walls = { map = \"building.map\", pose-error-m = 0.02, pose-error-rad = 0.01, \
                         others-radius-m = 0.1 }";
    const CALLS_BELOW: &str = "{ to = \"motor.0\", although = \"it waits\" }]\nsettings";
    const PAST: (&str, &str) = (
        "calls = [\"laser.0\", \"motor.0\"]",
        "calls = [{ to = \"laser.0\", subscribes = true }, { to = \"motor.1\", although = \"it waits\" }]",
    );
}
