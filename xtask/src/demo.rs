//! `cargo demo`: from a fresh clone to a robot on the screen.

use crate::cargo::{self, BRIDGE};
use crate::failure::Failure;
use std::path::PathBuf;
use std::process::{Command, ExitCode};

/// Builds what the demo needs and becomes it.
pub(crate) fn run(args: &[String]) -> Result<ExitCode, Failure> {
    let gui = !args.iter().any(|arg| arg == "--no-gui");
    cargo::run(
        "building rohrpost: the launcher and the modules (a minute the first time)",
        &mut cargo::cargo(&["build", "--package", "rohrpost-cli", "--bin", "rohrpost"]),
    )?;
    if gui {
        cargo::run(
            "building the GUI bridge with Rerun: some 400 crates, unoptimised, about 3 minutes on two cores the first \
             time (`cargo demo --no-gui` goes without)",
            &mut cargo::cargo(&["build", "--package", BRIDGE]),
        )?;
    }
    let programs = cargo::target().join("debug");
    let mut demo = Command::new(programs.join("rohrpost"));
    demo.arg("demo").args(args).env("PATH", path(&[programs])?);
    become_it(&mut demo)
}

/// The search path with `first` before all else.
fn path(first: &[PathBuf]) -> Result<std::ffi::OsString, Failure> {
    let old = std::env::var_os("PATH").unwrap_or_default();
    std::env::join_paths(first.iter().cloned().chain(std::env::split_paths(&old)))
        .map_err(|error| format!("cannot put the build's folders in the PATH: {error}; build in a folder without `:`"))
}

/// Replaces this process, so that Ctrl-C, the exit code and the terminal are the demo's own.
fn become_it(command: &mut Command) -> Result<ExitCode, Failure> {
    use std::os::unix::process::CommandExt;
    let error = command.exec();
    Err(format!("cannot run {}: {error}", command.get_program().to_string_lossy()))
}
