//! `rohrpost interface`: interfaces as files, and typed code of them, so that an interface written in any language is
//! used in any other.
//!
//! ```text
//! module, or class ──export──▶ file ──read──▶ Description ──Blueprint──▶ rust · python · c ──▶ code
//! ```
//!
//! A file may come from anywhere. What it says is checked when it is read (`file`) and when its types are laid out
//! (`blueprint`); each language then writes names that its compiler takes (`names`) and texts that end no comment
//! (`texts`), or says what it cannot have.

mod blueprint;
mod c;
mod file;
mod names;
mod python;
mod refusal;
mod rust;
#[cfg(test)]
mod tests;
mod texts;

use crate::look::target::Target;
use crate::terminal::whole_file::write_whole;
use crate::terminal::{Failure, say, say_folded};
use rohrpost::output::plain;
use rohrpost::schema::Description;
use rohrpost_config::{Installation, Program};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost interface export motor.0                     shows what motor.0 offers
  rohrpost interface export motor.0 --json -o motor.json
  rohrpost interface export motor --json                the same of a built-in class, where nothing runs
  rohrpost interface generate --lang rust motor.json -o motor.rs
  rohrpost interface generate --lang python motor.json -o motor.py
  rohrpost interface generate --lang c motor.json -o motor.h")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    action: InterfaceCommand,
}

#[derive(clap::Subcommand)]
enum InterfaceCommand {
    /// Write the interface of a module, or of a built-in class.
    Export(Export),
    /// Write typed code of an interface's file.
    Generate(Generate),
}

#[derive(clap::Args)]
struct Export {
    /// Module, such as motor.0; or a class, such as motor.
    name: String,
    /// Write a file for `generate`; without it, a list for people.
    #[arg(long)]
    json: bool,
    /// Write into this file, whole or not at all.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    target: Target,
}

#[derive(clap::Args)]
struct Generate {
    /// Language of the code.
    #[arg(long, value_name = "LANGUAGE")]
    lang: Language,
    /// What `export --json` wrote.
    file: PathBuf,
    /// Write into this file, whole or not at all.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Language {
    /// A trait with its types.
    Rust,
    /// A module's class with its types.
    Python,
    /// A header with its types, for C11 and C++17.
    C,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    match &arguments.action {
        InterfaceCommand::Export(export) => {
            let description = find(&export.name, &export.target)?;
            match (export.json, &export.output) {
                (true, output) => put(output.as_deref(), &file::write(&description)?)?,
                (false, Some(output)) => put(Some(output), &crate::running::call::listing(&description))?,
                (false, None) => _ = say_folded(crate::running::call::listing(&description)),
            }
        }
        InterfaceCommand::Generate(Generate { lang, file, output }) => {
            let code = file::load(file)
                .map_err(Failure::from)
                .and_then(|description| Ok(generated(&description, *lang)?))
                .map_err(|error| format!("{}: {error}", plain::line(&file.display().to_string())))?;
            put(output.as_deref(), code.trim_end())?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Into a file, or printed.
fn put(output: Option<&Path>, text: &str) -> Result<(), Failure> {
    match output {
        Some(file) => write_whole(file, &format!("{text}\n"))?,
        None => _ = say(text),
    }
    Ok(())
}

fn generated(description: &Description, lang: Language) -> Result<String, refusal::Refusal> {
    let blueprint = blueprint::Blueprint::of(description)?;
    match lang {
        Language::Rust => rust::write(&blueprint),
        Language::Python => python::write(&blueprint),
        Language::C => c::write(&blueprint),
    }
}

/// The interface of a module (`motor.0`) or class (`motor`). What runs is asked first; the programs of the built-in
/// modules are known without that, those of others are not.
pub(super) fn find(name: &str, target: &Target) -> Result<Description, Failure> {
    let asked = if name.contains('.') { of_module(name, target) } else { of_class(name, target) };
    asked.or_else(|error| built_in(name, target).ok_or_else(|| not_found(name, &*error)))
}

fn of_module(name: &str, target: &Target) -> Result<Description, Failure> {
    let running = target.find()?;
    running.describe(running.module(name)?)
}

/// Of the first module of this class that answers.
fn of_class(class: &str, target: &Target) -> Result<Description, Failure> {
    let running = target.find()?;
    let Some(id) = running.installation.classes.id(class) else {
        return Err(format!("the configuration has no class `{}`", plain::line(class)).into());
    };
    let names = running.installation.modules.iter().flat_map(|module| module.names()).filter(|it| it.class() == id);
    let mut last = format!("no module of class `{class}` is in the configuration").into();
    for name in names.collect::<Vec<_>>() {
        match running.describe(name) {
            Ok(description) => return Ok(description),
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// What a program that comes with Rohrpost offers: the one that the configuration names for it, else that of its class.
fn built_in(name: &str, target: &Target) -> Option<Description> {
    let Some((class, _)) = name.rsplit_once('.') else {
        return rohrpost_builtin::description(rohrpost_builtin::of_class(name)?, name);
    };
    let installation = Installation::load(target.config()?).ok()?;
    let module = installation.module(installation.classes.parse_name(name).ok()?.module())?;
    match &module.program {
        Program::Builtin(program) => rohrpost_builtin::description(program, class.rsplit('.').next()?),
        Program::Command(_) => None,
    }
}

fn not_found(name: &str, error: &dyn std::error::Error) -> Failure {
    let advice = "a module says its interface while it runs; what is built in is also known by its class alone";
    format!("no interface of `{}`: {error}\n{advice}, as `rohrpost interface export motor`", plain::line(name)).into()
}
