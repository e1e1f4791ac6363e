//! Rerun's own command line and viewer, from PyPI into `target/venv`.
//!
//! Its version is that of the `rerun` crate: a viewer reads drawings of its own version best.

use crate::cargo;
use crate::failure::Failure;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The package and its version, as `gui-bridge/Cargo.toml` has it.
const PACKAGE: &str = "rerun-sdk==0.36.3";

/// A Python with Rerun in it.
pub(crate) struct Venv {
    /// The interpreter.
    pub(crate) python: PathBuf,
    /// The viewer and command line. Not the script of the same name, which would leave the viewer running when it is
    /// killed.
    pub(crate) rerun: PathBuf,
}

/// Finds it, or makes it.
pub(crate) fn venv() -> Result<Venv, Failure> {
    let folder = cargo::target().join("venv");
    let python = folder.join("bin").join("python");
    // Written last: a folder without it was interrupted.
    let stamp = folder.join("rohrpost-stamp");
    if std::fs::read_to_string(&stamp).is_ok_and(|made| made == PACKAGE) {
        return Ok(Venv { rerun: program(&python)?, python });
    }
    cargo::run("making a Python environment in target/venv", Command::new("python3").args(["-m", "venv"]).arg(&folder))
        .map_err(|failure| format!("{failure}; on Debian: apt-get install -y python3-venv"))?;
    cargo::run(
        "installing Rerun's viewer and command line in it (160 MB to fetch, 740 MB on disk)",
        Command::new(&python).args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", PACKAGE]),
    )?;
    let rerun = program(&python)?;
    cargo::run("turning off its analytics", Command::new(&rerun).args(["analytics", "disable"]))?;
    std::fs::write(&stamp, PACKAGE).map_err(|error| format!("cannot write {}: {error}", stamp.display()))?;
    Ok(Venv { python, rerun })
}

fn program(python: &Path) -> Result<PathBuf, Failure> {
    let ask = "import os, rerun_sdk; print(os.path.join(rerun_sdk.__path__[0], 'rerun_cli', 'rerun'), end='')";
    let told = Command::new(python).args(["-c", ask]).output();
    let told = told.map_err(|error| format!("cannot run {}: {error}", python.display()))?;
    let path = PathBuf::from(String::from_utf8_lossy(&told.stdout).into_owned());
    if path.is_file() { Ok(path) } else { Err(format!("no viewer in {PACKAGE}; delete target/venv and try again")) }
}
