//! Foreign texts in each tool: names, texts, units, values, faults and lines of a module that tries to control the
//! terminal.

use crate::harness::{OUTPUT, PATIENCE, Place, program, run_if_launched, until};
use crate::record::recording_that_says;
use crate::replayed_others::bag_that_says;
use rohrpost::interface::{Interface, Serve};
use rohrpost::output::plain::is_obeyed;
use rohrpost::parameter::{Parameter, ParameterSet, Refusal};
use rohrpost::schema::{DataItem, DataKind, Description, Field, Function, Members, Named, Schema, Type};
use rohrpost::wire::append;
use rohrpost::{Context, Fault, Module, ModuleError};
use std::time::Duration;

/// One character of each kind that a terminal interprets, and the beginning of a line that imitates a tool's own.
pub(crate) const HOSTILE: &str =
    "x\u{1b}[2J\u{1b}]0;title\u{7}\r\u{9b}31m\u{90}\u{202e}\u{2066}\u{200f}\u{2028}\u{8}\u{7f}\nFORGED: all is well\n";
/// Functions with failures and results.
const FAILS: u16 = 16;
const TELLS: u16 = 17;
const REFUSES: u16 = 18;

/// Not a test: what launch starts. Run as a test it ends at once.
#[test]
fn module() {
    run_if_launched::<Hostile>();
}

/// A type with only hostile names.
pub(crate) fn structure(inner: Type) -> Type {
    let field = Field::new(HOSTILE, inner).said(HOSTILE, HOSTILE);
    Type::Struct(Named::new(HOSTILE, Members::Fields(vec![field])).said(HOSTILE))
}

struct HostileInterface;

impl HostileInterface {
    fn hash() -> u32 {
        Self::description().hash()
    }
}

impl Interface for HostileInterface {
    const CLASS: &'static str = "probe";

    fn description() -> Description {
        let function = |number: u16, name: &str| Function {
            number,
            name: name.into(),
            text: HOSTILE.into(),
            idempotent: true,
            arguments: Vec::new(),
            result: structure(String::schema()),
        };
        let mut odd = function(19, HOSTILE);
        odd.arguments = vec![Field::new(HOSTILE, structure(String::schema())).said(HOSTILE, HOSTILE)];
        Description {
            name: HOSTILE.into(),
            class: HOSTILE.into(),
            text: HOSTILE.into(),
            functions: vec![function(FAILS, "fails"), function(TELLS, "tells"), function(REFUSES, "refuses"), odd],
            data: vec![DataItem {
                number: 1,
                kind: DataKind::Data,
                field: Field::new(HOSTILE, structure(String::schema())).said(HOSTILE, HOSTILE),
            }],
        }
    }
}

impl Serve<Hostile> for HostileInterface {
    fn serve(_: &mut Hostile, function: u16, _: &[u8], reply: &mut Vec<u8>) -> Result<(), Fault> {
        match function {
            TELLS => append(reply, &(HOSTILE,)).map_err(|error| Fault::Arguments(error.to_string())),
            REFUSES => Err(Fault::NodeRefuses { node: HOSTILE.into(), why: HOSTILE.into() }),
            _ => Err(Fault::Arguments(HOSTILE.into())),
        }
    }
}

struct Parameters(Vec<u8>);

impl ParameterSet for Parameters {
    fn names(&self) -> Vec<&str> {
        vec![HOSTILE]
    }

    fn get(&self, index: usize) -> Option<Parameter> {
        (index == 0).then(|| Parameter {
            field: Field::new(HOSTILE, String::schema()).said(HOSTILE, HOSTILE),
            value: self.0.clone(),
        })
    }

    fn accept(&self, _: usize, value: &[u8]) -> Result<Vec<u8>, Refusal> {
        let text = String::from_utf8_lossy(value);
        if text.contains("no") { Err(Refusal::Module(HOSTILE.into())) } else { Ok(value.into()) }
    }

    fn put(&mut self, _: usize, value: &[u8]) {
        self.0 = value.into();
    }
}

#[derive(rohrpost::serde::Deserialize)]
#[serde(crate = "rohrpost::serde", deny_unknown_fields)]
struct Settings {
    /// Refuses to be switched on.
    fails: bool,
}

struct Hostile {
    settings: Settings,
    parameters: Parameters,
}

impl Module for Hostile {
    type Settings = Settings;
    type Interfaces = HostileInterface;

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(Duration::from_millis(20));
        println!("{HOSTILE}");
        eprintln!("{HOSTILE}");
        let mut value = Vec::new();
        append(&mut value, HOSTILE)?;
        Ok(Self { settings, parameters: Parameters(value) })
    }

    fn on(&mut self, _: &mut Context) -> Result<(), ModuleError> {
        rohrpost::tracing::warn!("{HOSTILE}");
        if self.settings.fails { Err(ModuleError::new(HOSTILE)) } else { Ok(()) }
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let port = rohrpost::interface::DataPort::new("probe", 1, "hostile", HostileInterface::hash);
        Ok(context.publish_now(port, &(HOSTILE.to_owned(),))?)
    }

    fn parameters(&mut self) -> Option<&mut dyn ParameterSet> {
        Some(&mut self.parameters)
    }
}

/// No terminal control characters except the tool's own line ends and tabs; and no line that starts with foreign text.
#[track_caller]
pub(crate) fn assert_plain(what: &[&str], text: &str) {
    let obeyed: Vec<char> = text.chars().filter(|c| is_obeyed(*c) && !matches!(c, '\n' | '\t')).collect();
    assert!(obeyed.is_empty(), "{what:?} prints {obeyed:?}: {text:?}");
    assert!(!text.lines().any(|line| line.starts_with("FORGED")), "{what:?} lets others begin a line: {text}");
}

/// Subcommands that print nothing that a module, a node or an outside program wrote.
const OWN_WORDS: [&str; 27] = [
    "check",
    "launch",
    "demo",
    "clean",
    "doctor",
    "bench",
    "keys",
    "new",
    "completions",
    "man",
    "version",
    "run",
    "router",
    "tcp-router",
    "tcp-client",
    "team-router",
    "help",
    "time",
    // Numbers alone.
    "team",
    // Of supervisors, with words as plain lines; of files.
    "halt",
    "resume",
    "station",
    "arena",
    "wormhole",
    "bundle",
    "path",
    "entrances",
];

#[test]
fn no_tool_lets_a_module_drive_the_terminal() {
    let place = Place::new();
    let module = |name: &str, fails: bool| {
        format!(
            "[[module]]\nname = \"{name}\"\nprogram = {}\nsettings = {{ fails = {fails} }}\n",
            program("hostile_texts::module")
        )
    };
    let config = place.config(&[OUTPUT, &module("probe.0", false), &module("probe.1", true)]);
    let mut launch = place.launch(&config);
    let robot = place.robot(&config, "main", &mut launch);
    for (name, state) in [("output.0", "on"), ("probe.0", "on"), ("probe.1", "error")] {
        until(format!("{name} is {state}"), || robot.state(name) == state);
    }
    robot.tool(PATIENCE).close();
    let saved = place.path("saved.toml");
    let saved = saved.to_str().unwrap();
    let recording = recording_that_says(&place, HOSTILE, &structure(String::schema()));
    let recording = recording.to_str().unwrap();
    let bag = bag_that_says(&place, HOSTILE);
    let bag = bag.to_str().unwrap();
    let into = format!("{HOSTILE}=laser.0/scan");
    let tried: &[&[&str]] = &[
        &["record", "info", bag],
        &["replay", bag],
        &["replay", bag, recording],
        &["replay", bag, "--into", "x=laser.0/scan"],
        &["replay", bag, "--into", &into, &into],
        &["replay", recording, "--into", &into],
        &["record", "info", recording],
        &["record", "cut", recording, "-o", &place.path("cut.mcap").display().to_string(), "--names", HOSTILE],
        &["record", "export", recording, "-o", &place.path("drawn.mcap").display().to_string(), "--format", "drawn"],
        &["record", "export", recording, "-o", "-", "--format", "json"],
        &["log", "--file", recording],
        &["replay", recording],
        &["replay", recording, "--config", config.to_str().unwrap()],
        &["replay", recording, "--config", config.to_str().unwrap(), "--names", "x"],
        &["replay", "--exact", recording, HOSTILE],
        &["interface", "export", "probe.0"],
        &["interface", "export", "probe.0", "--json"],
        &["interface", "export", HOSTILE],
        &["interface", "generate", "--lang", "c", HOSTILE],
        &["call", "probe.0"],
        &["call", "probe.0", "tells"],
        &["call", "probe.0", "fails"],
        &["call", "probe.0", "refuses"],
        &["call", "probe.0", "missing"],
        &["call", "probe.0", "get", HOSTILE],
        &["call", "probe.0", "get", "missing"],
        &["call", "probe.0", "status"],
        &["call", "probe.1", "status"],
        &["call", "probe.1", "tells"],
        &["call", "probe.0", HOSTILE],
        &["status"],
        &["status", "probe.1"],
        &["param", "list"],
        &["param", "get", "probe.0"],
        &["param", "get", "probe.0", "missing"],
        &["param", "set", "probe.0", HOSTILE, "yes"],
        &["param", "set", "probe.0", HOSTILE, "no"],
        &["param", "set", "probe.0", HOSTILE, HOSTILE],
        &["param", "save", "-o", saved],
        &["param", "load", saved],
        &["echo", "probe.0", HOSTILE, "-c", "2"],
        &["echo", "probe.0", "missing"],
        &["log"],
        &["log", "--levels"],
        &["hz", "probe.0", "--seconds", "0.3"],
        &["hz", "probe.0", "missing"],
        &["bw", "probe.0", "--seconds", "0.3"],
        &["delay", "probe.0", "--seconds", "0.3"],
        &["data", "--seconds", "0.3", "--types"],
        &["graph", "--seconds", "0.3"],
        &["graph", "--seconds", "0.3", "--silent", "--all"],
        &["graph", "--seconds", "0.3", "--silent", "--all", "--dot"],
        &["graph", "--seconds", "0.3", "--silent", "--all", "--svg"],
        &["list", "--mailboxes"],
        &["top", "--once"],
        &["mailbox", "probe.0"],
        &["stream", "list"],
        &["stream", "info", "probe.0", "1"],
        &["ping", "probe.0", "-c", "1"],
        &["ping", "probe.1", "-c", "1"],
        &["send", "probe.0", "fails", "-c", "2", "--rate", "100"],
        &["send", "probe.0", "missing"],
        &["net"],
        &["restart", "probe.1"],
        &["stop", "probe.1"],
        &["start", "probe.1"],
    ];
    for words in tried {
        let said = place.say(words);
        assert_plain(words, &said.out);
        assert_plain(words, &said.err);
        assert!(!said.out.is_empty() || !said.err.is_empty() || words[0] == "param", "{words:?} says nothing");
    }
    for words in [
        &["call", "probe.0", "--json"][..],
        &["call", "probe.0", "tells", "--json"],
        &["status", "--json"],
        &["param", "list", "--json"],
        &["echo", "probe.0", HOSTILE, "-c", "1", "--json"],
        &["log", "--json"],
        &["hz", "probe.0", "--seconds", "0.3", "--json"],
        &["data", "--seconds", "0.3", "--json"],
        &["graph", "--seconds", "0.3", "--silent", "--json"],
        &["list", "--json"],
        &["top", "--once", "--json"],
        &["record", "info", recording, "--json"],
        &["record", "export", recording, "-o", "-", "--format", "json"],
    ] {
        let said = place.say(words);
        assert_plain(words, &said.out);
        for line in said.out.lines() {
            let json: Result<serde_json::Value, _> = serde_json::from_str(line);
            assert!(json.is_ok(), "{words:?}: {line}: {json:?}");
        }
        let is_exact = |word: &str| word == "call" || word == "echo" || word == "param";
        let whole = || {
            said.out.lines().any(|line| serde_json::from_str::<serde_json::Value>(line).is_ok_and(|json| holds(&json)))
        };
        assert!(!is_exact(words[0]) || whole(), "{words:?} changes what was written: {}", said.out);
    }
    let help = place.say(&["--help"]).out;
    let (commands, _) = help.split_once("\nOptions:").unwrap();
    let commands: Vec<&str> = commands
        .lines()
        .filter(|line| line.starts_with("  "))
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert!(commands.len() > 30, "{help}");
    for command in commands {
        let is_tried = tried.iter().any(|words| words[0] == command);
        assert_ne!(is_tried, OWN_WORDS.contains(&command), "{command}: try it here, or say that its words are its own");
    }
    for shell in ["call probe.0 ", "echo probe.0 ", "param get probe.0 ", "send probe.0 "] {
        let mut command = place.command(&[]);
        let words: Vec<&str> = ["--", "rohrpost"].into_iter().chain(shell.split(' ')).collect();
        let index = (words.len() - 2).to_string();
        command.env("ROHRPOST_COMPLETE", "bash").env("_CLAP_COMPLETE_INDEX", index).env("_CLAP_IFS", "\n").args(&words);
        let said = crate::process::Running::start(command).said();
        assert_plain(&words, &said.out);
        assert!(said.out.contains("\\u001b") || shell.starts_with("send"), "{shell}: {said:?}");
    }
    launch.signal(nix::sys::signal::Signal::SIGINT);
    assert_eq!(launch.end().code(), Some(1), "a module is in error");
    assert_plain(&["launch"], &launch.out());
    assert_plain(&["launch"], &launch.err());
}

/// Whether a text in it is the original one.
fn holds(json: &serde_json::Value) -> bool {
    match json {
        serde_json::Value::String(text) => text == HOSTILE,
        serde_json::Value::Array(values) => values.iter().any(holds),
        serde_json::Value::Object(values) => values.iter().any(|(key, value)| key == HOSTILE || holds(value)),
        _ => false,
    }
}
