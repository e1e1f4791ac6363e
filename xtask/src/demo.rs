//! `cargo demo`: from a fresh clone to a robot on the screen.

use crate::beside::{self, Begun};
use crate::cargo::{self, BRIDGE};
use crate::crates;
use crate::failure::Failure;
use std::fs::File;
use std::io::IsTerminal;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode};
use std::time::{Duration, Instant};

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

/// Builds what the demo needs and becomes it; while the bridge is built, a terminal has the robot's map.
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
    demo.env("PATH", path(programs.clone(), is_later)?);
    if is_later && args.is_empty() && std::io::stdout().is_terminal() && std::io::stdin().is_terminal() {
        return beside_its_map(&mut demo, &programs.join("rohrpost"));
    }
    become_it(&mut demo)
}

/// Longest wait for the robot of the demo.
const START: Duration = Duration::from_secs(20);

/// Runs the demo with its lines in a file, and the map of its robot on the terminal until the user has seen enough.
fn beside_its_map(demo: &mut Command, rohrpost: &Path) -> Result<ExitCode, Failure> {
    let log = cargo::target().join("demo.log");
    let told = |error: std::io::Error| format!("{}: {error}", log.display());
    let (out, err) = File::create(&log).and_then(|out| Ok((out.try_clone()?, out))).map_err(told)?;
    // It ends if this process does, as by a terminal that is closed. A group of its own: Ctrl-C is for the map.
    let mut held = Command::new("setpriv");
    held.args(["--pdeathsig", "INT"]).arg(demo.get_program()).args(demo.get_args()).arg("--quiet");
    held.envs(demo.get_envs().filter_map(|(name, value)| Some((name, value?))));
    let Ok(mut running) = held.stdout(out).stderr(err).process_group(0).spawn() else {
        return become_it(demo);
    };
    let began = Instant::now();
    let runs = |it: &mut Child| it.try_wait().is_ok_and(|ended| ended.is_none());
    let is_seen = || Command::new(rohrpost).args(["list", "-i", "demo"]).output().is_ok_and(|it| it.status.success());
    while runs(&mut running) && began.elapsed() < START && !is_seen() {
        std::thread::sleep(Duration::from_millis(100));
    }
    if runs(&mut running) {
        // How it ended counts less than how the demo does.
        let _ = Command::new(rohrpost).args(["top", "--map", "-i", "demo"]).status();
        let _ = Command::new("kill").args(["-INT", &running.id().to_string()]).status();
    }
    let ended = running.wait().map_err(told)?;
    print!("{}", std::fs::read_to_string(&log).map_err(told)?);
    Ok(if ended.success() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
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
