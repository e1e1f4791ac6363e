//! Paths, and calls of other programs.

use crate::failure::Failure;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus};
use std::sync::OnceLock;

/// The package with a build that compiles all of Rerun.
pub(crate) const BRIDGE: &str = "rohrpost-gui-bridge";

/// Whether this is a whole check: see [`check_what_is_compiled`].
static CHECKED: OnceLock<()> = OnceLock::new();

/// From now on clippy is the compiler of the workspace's own crates for what [`checked`] builds, and its warnings are
/// errors. So what is linted is what the tests use; a `cargo clippy` beside it would compile all once more, since it
/// shares nothing with a build. And nothing is kept for a next compilation, which would make the first one slower.
pub(crate) fn check_what_is_compiled() {
    CHECKED.get_or_init(|| ());
}

pub(crate) fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here).to_path_buf()
}

/// Folder of Cargo's build products.
pub(crate) fn target() -> PathBuf {
    // A relative path counts from where Cargo was called, which is where this runs.
    let asked = std::env::var_os("CARGO_TARGET_DIR").map(PathBuf::from);
    asked.map_or_else(|| root().join("target"), |path| std::path::absolute(&path).unwrap_or(path))
}

/// A call of the Cargo that called this, from the root.
pub(crate) fn cargo(args: &[&str]) -> Command {
    cargo_behind(&[], args)
}

/// A call of Cargo behind the words of another program that runs it.
pub(crate) fn cargo_behind(before: &[&str], args: &[&str]) -> Command {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut words = before.iter().map(OsString::from).chain([cargo]);
    let mut command = Command::new(words.next().unwrap_or_default());
    command.args(words).args(args).current_dir(root()).env("CARGO_TARGET_DIR", target());
    // What `cargo xtask` has told of this package. Build scripts (ring's) run anew if they see it once and then not, so
    // all that needs them would be compiled twice: by `cargo demo`, and by `cargo build` after it.
    let ours = |name: &str| ["CARGO_PKG_", "CARGO_MANIFEST_", "CARGO_BIN_"].iter().any(|begin| name.starts_with(begin));
    for (name, _) in std::env::vars().filter(|(name, _)| ours(name)) {
        command.env_remove(name);
    }
    if CHECKED.get().is_some() {
        command.env("CARGO_INCREMENTAL", "0");
    }
    command
}

/// A call of Cargo for what tests run; in a whole check clippy compiles that. [`cargo`] is for what is measured: clippy
/// leaves out optimisations, so that it sees what was written.
pub(crate) fn checked(args: &[&str]) -> Command {
    let mut command = cargo(args);
    if CHECKED.get().is_some() {
        // The flags of `cargo clippy -- --deny warnings` for its driver.
        command.env("RUSTC_WORKSPACE_WRAPPER", "clippy-driver").env("CLIPPY_ARGS", "-Dwarnings__CLIPPY_HACKERY__");
    }
    command
}

/// The compiler's own target.
pub(crate) fn host() -> Result<String, Failure> {
    let output = Command::new("rustc").arg("-vV").output().map_err(|error| format!("rustc -vV: {error}"))?;
    let text = String::from_utf8_lossy(&output.stdout);
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned).ok_or_else(|| "rustc -vV names no host".into())
}

/// Prints the command and its reason, runs it, and fails if it does.
pub(crate) fn run(why: &str, command: &mut Command) -> Result<(), Failure> {
    eprintln!("==> {why}\n    {}", shown(command));
    let status = status(command)?;
    if status.success() { Ok(()) } else { Err(format!("{why}: `{}` ended with {status}", shown(command))) }
}

/// Runs any command to its end.
pub(crate) fn status(command: &mut Command) -> Result<ExitStatus, Failure> {
    command.status().map_err(|error| format!("cannot run `{}`: {error}", shown(command)))
}

/// A command as a user would type it.
pub(crate) fn shown(command: &Command) -> String {
    let program = Path::new(command.get_program());
    let name = program.file_name().unwrap_or(program.as_os_str());
    let words = std::iter::once(name).chain(command.get_args());
    words.map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ")
}

/// The output of a program that must succeed.
pub(crate) fn output(command: &mut Command) -> Result<String, Failure> {
    let said = command.output().map_err(|error| format!("cannot run `{}`: {error}", shown(command)))?;
    if !said.status.success() {
        let why = String::from_utf8_lossy(&said.stderr).trim_end().to_owned();
        return Err(format!("`{}` ended with {}: {why}", shown(command), said.status));
    }
    String::from_utf8(said.stdout).map_err(|_| format!("`{}` printed what is no text", shown(command)))
}
