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
mod export;
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
            let description = export::find(&export.name, &export.target)?;
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

fn generated(description: &rohrpost::schema::Description, lang: Language) -> Result<String, refusal::Refusal> {
    let blueprint = blueprint::Blueprint::of(description)?;
    match lang {
        Language::Rust => rust::write(&blueprint),
        Language::Python => python::write(&blueprint),
        Language::C => c::write(&blueprint),
    }
}
