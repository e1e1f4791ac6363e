//! The configuration of a demo: the folder's own, or a copy with the command line's options added. A copy keeps each
//! line at its place, and messages name the original file.

use super::arguments::{Arguments, GuiConnection};
use super::recording::{recorder, start_early};
use crate::begin::check;
use crate::nodes::keys::certificates::{self, Renewal};
use crate::terminal::Failure;
use rohrpost_config::examples::{BUILDING, CHAOS, LOG, NODES, SIMULATION, TCP, TDMA};
use rohrpost_config::{GUI, Installation, Keys, Program, resolved_text};
use rohrpost_routers::security::random;
use std::path::{Path, PathBuf};
use toml_edit::{ArrayOfTables, DocumentMut, Item, TableLike, value};

/// The end of a demo's own configuration, by which it is known in recordings: what it names is [`BUILDING`].
const BUILT_IN: &str = "\n# Built into `rohrpost demo`.\n";

/// Folders of keys and certificates, beside the copy.
const KEYS: &str = "keys";
const CERTIFICATES: &str = "certificates";
/// Validity of a run's certificates, days.
const DAYS: u32 = 1;

/// The configuration that runs. A copy is written into `temporary`.
pub(super) fn installation(arguments: &Arguments, temporary: &Path) -> Result<Installation, Failure> {
    if arguments.tdma && arguments.nodes == Some(1) {
        return Err("one node alone has no time slots; use --nodes 3".into());
    }
    let (name, text) = match (&arguments.log, arguments.nodes) {
        (Some(_), _) => ("demo-log.toml", LOG),
        (None, Some(2..)) if arguments.chaos.is_some() => ("demo-chaos.toml", CHAOS),
        (None, Some(2..)) if arguments.tdma => ("demo-tdma.toml", TDMA),
        (None, Some(2..)) if arguments.gui == GuiConnection::Tcp => ("demo-tcp.toml", TCP),
        (None, Some(2..)) => ("demo-nodes.toml", NODES),
        (None, _) => ("demo.toml", SIMULATION),
    };
    let own = arguments.config.clone().unwrap_or_else(|| Path::new("config").join(name));
    let there = own.exists();
    if arguments.config.is_some() && !there {
        return Err(format!("{}: no such file", own.display()).into());
    }
    let is_changed = arguments.no_gui
        || arguments.viewer
        || arguments.secure
        || arguments.record.is_some()
        // The arena's socket is to be in a folder of this run.
        || arguments.chaos.is_some();
    if there && arguments.log.is_none() && !is_changed {
        return Ok(check::load(&own)?);
    }
    let text = if there { resolved_text(&own)? } else { text.to_owned() };
    let shown = if there { own } else { format!("built-in {name}").into() };
    // The base of its relative paths; the built-in configuration's base is the folder of the copy.
    let folder = if there { Some(folder(&shown)?) } else { None };
    let copy = temporary.join(name);
    write_map(temporary)?;
    if arguments.secure {
        Keys::first(random()?).create(&Keys::file(&temporary.join(KEYS)))?;
    }
    std::fs::write(&copy, rewritten(&text, &shown, folder.as_deref(), arguments)?)?;
    let named = |error: rohrpost_config::Errors| {
        error.to_string().replace(&copy.display().to_string(), &shown.display().to_string())
    };
    let mut installation = check::load(&copy).map_err(named)?;
    if arguments.secure && installation.tcp.is_some() {
        certificates::make(&installation, Renewal::Missing, DAYS)?;
    }
    installation.shown = shown;
    if arguments.record.is_some() {
        start_early(&mut installation);
    }
    Ok(installation)
}

/// Whether this is the text of a configuration that a demo brought along, with [`write_map`] beside it.
pub(crate) fn is_built_in(text: &str) -> bool {
    text.ends_with(BUILT_IN)
}

/// The file that settings of the built-in configurations name.
pub(crate) fn write_map(folder: &Path) -> std::io::Result<()> {
    std::fs::write(folder.join("building.map"), BUILDING)
}

/// The folder of an existing file; a file named without one is in the present folder.
fn folder(file: &Path) -> Result<PathBuf, Failure> {
    Ok(file.canonicalize()?.parent().map(Path::to_owned).unwrap_or_default())
}

fn rewritten(text: &str, shown: &Path, folder: Option<&Path>, arguments: &Arguments) -> Result<String, Failure> {
    // Checked before the changes, so that a mistake names the original file and line.
    let installation = check::validate(Installation::parse(text, shown)?)?;
    let mut document: DocumentMut = text.parse()?;
    if let (Some(folder), Some(item)) = (folder, document.get_mut("parameters")) {
        start_from(folder, item);
    }
    if arguments.secure {
        let network = document.get_mut("network").and_then(Item::as_table_like_mut).ok_or("no [network]")?;
        // Also if the file has its own keys: the demo's keys are for this run.
        network.insert("security", value("keys"));
        network.insert("keys", value(KEYS));
        if let Some(tcp) = document.get_mut("tcp").and_then(Item::as_table_like_mut) {
            tcp.insert("security", value("tls"));
            tcp.insert("certificates", value(CERTIFICATES));
        }
    }
    let modules = document.get_mut("module").and_then(Item::as_array_of_tables_mut).ok_or("no [[module]]")?;
    for (entry, module) in modules.iter_mut().zip(installation.modules.iter().filter(|module| module.is_in_file())) {
        rewrite(entry, &module.program, folder, arguments)?;
    }
    let gui = |entry: &toml_edit::Table| entry.get("name").and_then(Item::as_str).is_some_and(is_gui);
    for at in (0..modules.len()).rev().filter(|_| arguments.no_gui) {
        if modules.get(at).is_some_and(gui) {
            remove(modules, at);
        }
    }
    let recorder = arguments.record.as_deref().map(|to| recorder(&installation, to)).transpose()?;
    let end = if folder.is_none() { BUILT_IN } else { "" };
    Ok(document.to_string() + &recorder.unwrap_or_default() + end)
}

/// Replaces a module by empty lines, so that the modules behind it keep their line numbers.
fn remove(modules: &mut ArrayOfTables, at: usize) {
    let lines = |modules: &ArrayOfTables| {
        let mut document = DocumentMut::new();
        document.insert("module", Item::ArrayOfTables(modules.clone()));
        document.to_string().matches('\n').count()
    };
    let before = lines(modules);
    modules.remove(at);
    let gone = "\n".repeat(before - lines(modules));
    if let Some(next) = modules.get_mut(at) {
        let prefix = next.decor().prefix().and_then(|prefix| prefix.as_str()).unwrap_or_default();
        let prefix = format!("{gone}{prefix}");
        next.decor_mut().set_prefix(prefix);
    }
}

pub(super) fn is_gui(name: &str) -> bool {
    name.split('.').next() == Some(GUI)
}

/// A path relative to this folder, rewritten for another folder.
fn start_from(folder: &Path, item: &mut Item) {
    if let Some(path) = item.as_str() {
        *item = value(folder.join(path).display().to_string());
    }
}

/// Rewrites relative paths for another folder; then adds the command line's options.
fn rewrite(
    entry: &mut dyn TableLike,
    program: &Program,
    folder: Option<&Path>,
    arguments: &Arguments,
) -> Result<(), Failure> {
    if let (Program::Command(words), Some(folder)) = (program, folder)
        && let [first, rest @ ..] = &words[..]
        && first.contains('/')
    {
        let absolute = folder.join(first).display().to_string();
        let words: toml_edit::Array = std::iter::once(&absolute).chain(rest).map(String::as_str).collect();
        entry.insert("program", value(words));
    }
    let gui = entry.get("name").and_then(Item::as_str).is_some_and(is_gui);
    let Some(settings) = entry.get_mut("settings").and_then(Item::as_table_like_mut) else { return Ok(()) };
    if let (Some(log), true) = (&arguments.log, settings.contains_key("speed")) {
        let log = log.canonicalize().map_err(|error| format!("{}: {error}", log.display()))?;
        settings.insert("file", value(log.display().to_string()));
        settings.insert("speed", value(arguments.speed));
    } else if gui {
        let file = std::env::current_dir()?.join("rohrpost-demo.rrd");
        settings.insert("file", value(file.display().to_string()));
        if arguments.viewer {
            settings.insert("viewer", value("window"));
        }
    } else if let (Some(folder), Some(map)) = (folder, settings.get_mut("map")) {
        start_from(folder, map);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct TestArguments {
        #[command(flatten)]
        arguments: Arguments,
    }

    fn copied(text: &str, words: &[&str]) -> Installation {
        let line = TestArguments::parse_from([&["demo"], words].concat());
        let text = rewritten(text, Path::new("robot.toml"), Some(Path::new("/etc/robot")), &line.arguments).unwrap();
        Installation::parse(&text, Path::new("/tmp/copy.toml")).unwrap()
    }

    #[test]
    fn lines_keep_their_numbers() {
        // The GUI stands in the middle, with its own table.
        let (head, gui) = SIMULATION.split_once("[[module]]\nname = \"gui.0\"").unwrap();
        let (gui, _show) = gui.split_once("[gui]").unwrap();
        let (first, rest) = head.split_once("[[module]]\nname = \"mapper.0\"").unwrap();
        let text = format!("{first}[[module]]\nname = \"gui.0\"{gui}[[module]]\nname = \"mapper.0\"{rest}");
        let before = Installation::parse(&text, Path::new("robot.toml")).unwrap();
        let line = |installation: &Installation, name: &str| {
            let name = installation.classes.parse_module(name).unwrap();
            installation.module(name).map(|module| module.line)
        };
        let names = ["output.0", "motor.0", "mapper.0", "pilot.0"];
        let (with, without) = (copied(&text, &["--viewer"]), copied(&text, &["--no-gui"]));
        for name in names {
            assert!(line(&before, name).is_some());
            assert_eq!(line(&with, name), line(&before, name), "{name}");
            assert_eq!(line(&without, name), line(&before, name), "{name}");
        }
        assert_eq!(line(&with, "gui.0"), line(&before, "gui.0"));
        assert_eq!(line(&without, "gui.0"), None);
        let mut recorded = copied(&text, &["--record", "out.mcap"]);
        for name in names {
            assert_eq!(line(&recorded, name), line(&before, name), "{name}");
        }
        start_early(&mut recorded);
        let names: Vec<_> = recorded.modules.iter().map(|its| recorded.classes.format(its.name)).collect();
        assert_eq!(names[..3], ["output.0", "logd.0", "motor.0"], "it hears all others");
        let gui = with.module(with.classes.parse_module("gui.0").unwrap()).unwrap();
        assert_eq!(gui.settings.get("viewer").and_then(|viewer| viewer.as_str()), Some("window"));
    }

    #[test]
    fn a_recorder_is_below_all_that_it_records() {
        let recorded = copied(SIMULATION, &["--record", "out.mcap"]);
        let [id] = recorded.classes.id("logd").into_iter().collect::<Vec<_>>()[..] else { panic!("no class") };
        assert_eq!(id.0, 24);
        let record = recorded.record.as_ref().unwrap();
        assert!(record.directory.is_absolute() && record.directory.ends_with("out.mcap.part"), "{record:?}");
        assert!(record.output.is_some());
        let exact: Vec<_> = record.exact.iter().map(|its| recorded.classes.format(its.name)).collect();
        assert_eq!(exact, ["motor.0", "mapper.0", "pilot.0"], "all that journals know, not the collector");
        let lower = SIMULATION.replace("output = { id = 32", "output = { id = 20");
        assert_eq!(copied(&lower, &["--record", "out.mcap"]).classes.id("logd").unwrap().0, 19);
        let line = TestArguments::parse_from(["demo", "--record", "out.mcap"]).arguments;
        let own = format!("{SIMULATION}{}", recorder(&copied(SIMULATION, &[]), Path::new("own.mcap")).unwrap());
        let error = rewritten(&own, Path::new("robot.toml"), None, &line).unwrap_err().to_string();
        assert!(error.starts_with("robot.toml has a recorder of its own"), "{error}");
    }

    #[test]
    fn paths_are_relative_to_the_folder_of_the_file() {
        let program = "builtin = \"pilot\"";
        let text = SIMULATION.replace(program, "program = [\"../bin/pilot\", \"--fast\"]");
        let installation = copied(&text, &["--no-gui"]);
        let of = |name: &str| installation.module(installation.classes.parse_module(name).unwrap()).unwrap();
        assert_eq!(of("pilot.0").program, Program::Command(vec!["/etc/robot/../bin/pilot".into(), "--fast".into()]));
        assert_eq!(of("motor.0").settings.get("map").and_then(|map| map.as_str()), Some("/etc/robot/building.map"));
    }
}
