//! `cargo demo`: from a fresh clone to a robot on the screen.

use crate::beside::{self, Begun};
use crate::cargo::{self, BRIDGE};
use crate::crates;
use crate::failure::Failure;
use std::path::PathBuf;
use std::process::{Command, ExitCode};

/// When the GUI bridge is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum BridgeBuild {
    Never,
    /// Before the robot starts.
    First,
    /// Beside the robot, which it joins.
    Beside,
}

impl BridgeBuild {
    /// The rule. A robot that runs until Ctrl-C does not wait for its picture. With any other option the demo ends by
    /// itself, needs the drawing from its beginning, or has other modules: then the bridge is built first.
    fn of(args: &[String]) -> Self {
        let is_without = |arg: &String| ["--no-gui", "--chaos", "--help", "-h"].contains(&arg.as_str());
        match () {
            () if args.iter().any(is_without) => Self::Never,
            () if args.iter().all(|arg| arg == "--quiet") => Self::Beside,
            () => Self::First,
        }
    }
}

/// Builds what the demo needs and becomes it.
pub(crate) fn run(args: &[String]) -> Result<ExitCode, Failure> {
    crates::build("building rohrpost: the launcher and the modules", "rohrpost-cli", &["--bin", "rohrpost"])?;
    let programs = cargo::target().join("debug");
    let mut demo = Command::new(programs.join("rohrpost"));
    demo.arg("demo").args(args);
    let is_later = match BridgeBuild::of(args) {
        BridgeBuild::Never => false,
        BridgeBuild::First => {
            crates::build("building the GUI bridge with Rerun (`cargo demo --no-gui` goes without)", BRIDGE, &[])?;
            false
        }
        BridgeBuild::Beside => beside::begin()? == Begun::Later,
    };
    if is_later {
        demo.arg("--gui-build").arg(beside::shown_log());
    }
    demo.env("PATH", path(programs, is_later)?);
    become_it(&mut demo)
}

/// The search path with our programs before all else. While the bridge is built, no other one may take its place.
fn path(first: PathBuf, without_bridge: bool) -> Result<std::ffi::OsString, Failure> {
    let old = std::env::var_os("PATH").unwrap_or_default();
    let others = std::env::split_paths(&old).filter(|folder| !(without_bridge && folder.join(BRIDGE).exists()));
    std::env::join_paths(std::iter::once(first).chain(others))
        .map_err(|error| format!("cannot put the build's folders in the PATH: {error}; build in a folder without `:`"))
}

/// Replaces this process, so that Ctrl-C, the exit code and the terminal are the demo's own.
fn become_it(command: &mut Command) -> Result<ExitCode, Failure> {
    use std::os::unix::process::CommandExt;
    let error = command.exec();
    Err(format!("cannot run {}: {error}", command.get_program().to_string_lossy()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_robot_waits_for_the_bridge_only_where_it_must() {
        for (line, build, why) in [
            ("", BridgeBuild::Beside, "it runs until Ctrl-C"),
            ("--quiet", BridgeBuild::Beside, "likewise"),
            ("--no-gui", BridgeBuild::Never, "as asked"),
            ("--seconds 5 --no-gui", BridgeBuild::Never, "as asked"),
            ("--help", BridgeBuild::Never, "nothing runs"),
            ("--nodes 3 --chaos 7 --seconds 60", BridgeBuild::Never, "it draws nothing"),
            ("--seconds 60", BridgeBuild::First, "it may end before the bridge is there"),
            ("--log FILE", BridgeBuild::First, "a log ends"),
            ("--viewer", BridgeBuild::First, "the picture is what was asked for"),
            ("--record out.mcap", BridgeBuild::First, "a recording has all modules"),
            ("--nodes 3", BridgeBuild::First, "its GUI is on another node"),
            ("--config robot.toml", BridgeBuild::First, "it may have no gui.0"),
            ("--quiet --unknown", BridgeBuild::First, "nobody knows what it does"),
        ] {
            let args: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
            assert_eq!(BridgeBuild::of(&args), build, "`{line}`: {why}");
        }
    }
}
