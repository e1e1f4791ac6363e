//! `rohrpost completions`, and the completions themselves, for shells where the script is installed.
//!
//! A shell runs this command at each press of Tab, with the words typed so far. Names of modules and nodes come from
//! the configuration that launch recorded; functions and data come from the descriptions that modules store beside
//! their mailboxes. A module is asked only for its parameters, when one of them is to be completed.

use crate::look::target::{Running, Target};
use crate::measure::stream::item_of;
use crate::running::call::COMMON;
use crate::terminal::{Failure, say};
use clap::builder::StyledStr;
use clap::{Arg, Command, ValueEnum};
use clap_complete::engine::{ArgValueCandidates, ArgValueCompleter, CompletionCandidate, PathCompleter};
use clap_complete::env::{Bash, CompleteEnv, EnvCompleter, Fish, Zsh};
use rohrpost::Name;
use rohrpost::common::OutputLevel;
use rohrpost::output::plain;
use rohrpost::schema::Description;
use rohrpost_config::Installation;
use rohrpost_launch::survey::purpose;
use rohrpost_mailbox::StreamId;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// The environment variable by which a shell asks for completions; its value is the shell's name.
const VARIABLE: &str = "ROHRPOST_COMPLETE";
/// Timeout for a module's answer: nobody wants to wait long for a completion.
const PATIENCE: Duration = Duration::from_millis(300);

#[derive(clap::Args)]
#[command(after_help = "Examples:
  source <(rohrpost completions bash)        in ~/.bashrc
  source <(rohrpost completions zsh)         in ~/.zshrc, after compinit
  rohrpost completions fish | source         in ~/.config/fish/config.fish
Names of modules, functions and data come from the running node.")]
pub(crate) struct Arguments {
    /// The shell.
    shell: Shell,
}

#[derive(Clone, Copy, ValueEnum)]
enum Shell {
    Bash,
    Zsh,
    Fish,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let shell: &dyn EnvCompleter = match arguments.shell {
        Shell::Bash => &Bash,
        Shell::Zsh => &Zsh,
        Shell::Fish => &Fish,
    };
    // If PATH leads to this program, the name is used, so that it is found after an update, too; else its own path.
    let called = std::env::args_os().next().unwrap_or_default().to_string_lossy().into_owned();
    let completer = if called.contains('/') { std::env::current_exe()?.display().to_string() } else { called };
    let mut script = Vec::new();
    shell.write_registration(VARIABLE, "rohrpost", "rohrpost", &completer, &mut script)?;
    say(String::from_utf8_lossy(&script).trim_end());
    Ok(ExitCode::SUCCESS)
}

/// Answers and ends the process if a shell asks for completions. Must be called before anything else.
pub(crate) fn answer(command: fn() -> Command) {
    CompleteEnv::with_factory(|| with_candidates(command())).var(VARIABLE).complete();
}

/// The same command line, with candidates for each argument. Arguments of one name mean the same in every subcommand.
fn with_candidates(command: Command) -> Command {
    let names: Vec<String> = command.get_subcommands().map(|sub| sub.get_name().to_owned()).collect();
    let named = command.get_name().to_owned();
    let command = command.mut_args(|arg| completed(&named, arg));
    names.iter().fold(command, |command, name| command.mut_subcommand(name, with_candidates))
}

fn completed(command: &str, arg: Arg) -> Arg {
    match (command, arg.get_id().as_str()) {
        // A new name: there is nothing to complete.
        ("new", _) => arg,
        ("mailbox", "name") => from(arg, mailboxes),
        ("write", "stream") => from(arg, modules),
        (_, "stream") => from(arg, streams),
        (_, "item") => from(arg, stream_items),
        (_, "name" | "names" | "module" | "modules") => from(arg, modules),
        (_, "node") => from(arg, nodes),
        ("send", "function") => from(arg, own_functions),
        (_, "function") => from(arg, functions),
        (_, "data") => from(arg, data),
        (_, "level") => from(arg, levels),
        (_, "parameter") => from(arg, parameters),
        ("call", "arguments") => from(arg, call_arguments),
        ("check" | "launch" | "load" | "make", "file") | (_, "config") => {
            let toml =
                PathCompleter::any().filter(|path| path.is_dir() || path.extension().is_some_and(|end| end == "toml"));
            arg.add(ArgValueCompleter::new(toml))
        }
        _ => arg,
    }
}

fn from(arg: Arg, candidates: fn() -> Vec<CompletionCandidate>) -> Arg {
    arg.add(ArgValueCandidates::new(candidates))
}

/// The words so far, without the command's own name. A file name need not be UTF-8; names that we look up are.
fn words() -> Vec<String> {
    let words = std::env::args_os().skip_while(|word| word != "--").skip(2);
    words.map(|word| word.to_string_lossy().into_owned()).collect()
}

/// The value of an option, if the words contain it.
fn option(words: &[String], name: &str) -> Option<String> {
    let at = words.iter().position(|word| word == name)?;
    words.get(at + 1).cloned()
}

fn target() -> Target {
    let words = words();
    let installation = option(&words, "--installation").or_else(|| option(&words, "-i"));
    Target::new(option(&words, "--config").map(PathBuf::from), installation, option(&words, "--node"))
}

/// The configuration: the one named on the command line, or that of the running installation.
fn installation() -> Option<Installation> {
    if let Ok(running) = target().find() {
        return Some(running.installation);
    }
    let words = words();
    let named = ["--config", "check", "launch"].iter().find_map(|before| option(&words, before))?;
    Installation::load(named.as_ref()).ok()
}

/// The shell shows candidates on the terminal: control characters are escaped.
fn candidate(name: impl AsRef<str>, help: &str) -> CompletionCandidate {
    let help = Some(StyledStr::from(plain::line(help).into_owned())).filter(|_| !help.is_empty());
    CompletionCandidate::new(plain::line(name.as_ref()).into_owned()).help(help)
}

fn modules() -> Vec<CompletionCandidate> {
    let Some(installation) = installation() else { return Vec::new() };
    let name = |name| {
        let text = installation.classes.text(Name::class(name)).unwrap_or_default();
        candidate(installation.classes.format(name), text)
    };
    installation.modules.iter().flat_map(|module| module.names()).map(name).collect()
}

fn mailboxes() -> Vec<CompletionCandidate> {
    let Ok(running) = target().find() else { return Vec::new() };
    let all = running.node.mailboxes().unwrap_or_default();
    all.into_iter().map(|name| candidate(running.text(name), purpose(name.local()))).collect()
}

/// Modules with streams here.
fn streams() -> Vec<CompletionCandidate> {
    let Ok(running) = target().find() else { return Vec::new() };
    let mut names: Vec<Name> = running.node.streams().unwrap_or_default().iter().map(|id| id.name).collect();
    names.dedup();
    names.into_iter().map(|name| candidate(running.text(name), "")).collect()
}

/// Streams of the module that one of the words names: by name, with a text, where that is known.
fn stream_items() -> Vec<CompletionCandidate> {
    let Ok(running) = target().find() else { return Vec::new() };
    let named = words().iter().find_map(|word| running.name(word).ok());
    let all = running.node.streams().unwrap_or_default().into_iter().filter(|id| Some(id.name) == named);
    let item = |id: StreamId| match item_of(&running, id) {
        Some(item) => candidate(item.field.name, &item.field.text),
        None => candidate(id.number.to_string(), ""),
    };
    all.map(item).collect()
}

fn nodes() -> Vec<CompletionCandidate> {
    let Some(installation) = installation() else { return Vec::new() };
    installation.nodes.iter().map(|node| candidate(&node.name, "")).collect()
}

fn levels() -> Vec<CompletionCandidate> {
    use OutputLevel::{Debug, Error, Info, Trace, Warn};
    [Error, Warn, Info, Debug, Trace].iter().map(|level| candidate(level.name(), "")).collect()
}

fn own_functions() -> Vec<CompletionCandidate> {
    let own = described().map(|description| description.functions).unwrap_or_default();
    own.iter().map(|function| candidate(&function.name, &function.text)).collect()
}

fn functions() -> Vec<CompletionCandidate> {
    own_functions().into_iter().chain(COMMON.iter().map(|(name, text, _)| candidate(*name, text))).collect()
}

fn data() -> Vec<CompletionCandidate> {
    let data = described().map(|description| description.data).unwrap_or_default();
    data.iter().map(|item| candidate(&item.field.name, &item.field.text)).collect()
}

fn parameters() -> Vec<CompletionCandidate> {
    let found = target().find().ok().and_then(|running| {
        let name = named(&running)?;
        let mut tool = running.join(PATIENCE).ok()?;
        tool.parameters(name).ok()
    });
    found.unwrap_or_default().iter().map(|parameter| candidate(&parameter.field.name, &parameter.field.text)).collect()
}

/// Arguments of functions that every module has; a module's own functions take numbers and words.
fn call_arguments() -> Vec<CompletionCandidate> {
    let words = words();
    let is = |function| words.iter().any(|word| word == function);
    match () {
        () if is("get") => data(),
        () if is("output-level") => levels(),
        () => Vec::new(),
    }
}

fn described() -> Option<Description> {
    let running = target().find().ok()?;
    running.describe(named(&running)?).ok()
}

fn named(running: &Running) -> Option<Name> {
    let classes = &running.installation.classes;
    words().iter().find_map(|word| classes.parse_module(word).ok())
}
