//! Programs of others that tests need, from PyPI: Rerun's command line and viewer in `target/venv`, a reader of MCAP
//! files in `target/venv-mcap`, mypy in `target/venv-clients`.
//!
//! Rerun's version is that of the `rerun` crate: a viewer reads drawings of its own version best.

use crate::cargo;
use crate::failure::Failure;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The package and its version, as `gui-bridge/Cargo.toml` has it.
const PACKAGE: &str = "rerun-sdk==0.36.3";
/// The library of the makers of the format, in Python, with what it needs to decompress, and to decode protobuf; and
/// one that writes bags as rosbag2 does.
const MCAP_PACKAGES: &str = "mcap==1.6.0 mcap-protobuf-support==0.6.0 protobuf==7.36.2 rosbags==0.11.9";

/// What checks the types of the client in Python, and what builds and packs its package, with and without Rust; and
/// numpy, since arrays are views of its records.
const CLIENT_PACKAGES: &str = "mypy==1.13.0 hatchling==1.27.0 maturin==1.16.0 numpy==2.4.6 wheel==0.45.1";

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
    let what = "Rerun's viewer and command line (160 MB to fetch, 740 MB on disk)";
    let python = python_with("venv", PACKAGE, what, |python| {
        cargo::run("turning off its analytics", Command::new(program(python)?).args(["analytics", "disable"]))
    })?;
    Ok(Venv { rerun: program(&python)?, python })
}

/// A Python that reads MCAP files; finds it, or makes it.
pub(crate) fn mcap() -> Result<PathBuf, Failure> {
    python_with("venv-mcap", MCAP_PACKAGES, "a reader of MCAP files", |_| Ok(()))
}

/// A Python for the client in `clients/python`; finds it, or makes it.
pub(crate) fn clients() -> Result<PathBuf, Failure> {
    python_with("venv-clients", CLIENT_PACKAGES, "a checker of types, mypy", |_| Ok(()))
}

/// The interpreter of an environment with packages, which stand in one line.
fn python_with(
    name: &str,
    packages: &str,
    what: &str,
    then: impl Fn(&Path) -> Result<(), Failure>,
) -> Result<PathBuf, Failure> {
    let folder = cargo::target().join(name);
    let python = folder.join("bin").join("python");
    // Written last: a folder without it was interrupted.
    let stamp = folder.join("rohrpost-stamp");
    if std::fs::read_to_string(&stamp).is_ok_and(|made| made == packages) {
        return Ok(python);
    }
    let why = format!("making a Python environment in target/{name}");
    cargo::run(&why, Command::new("python3").args(["-m", "venv"]).arg(&folder))
        .map_err(|failure| format!("{failure}; on Debian: apt-get install -y python3-venv"))?;
    cargo::run(
        &format!("installing {what} in it"),
        Command::new(&python)
            .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"])
            .args(packages.split(' ')),
    )?;
    then(&python)?;
    std::fs::write(&stamp, packages).map_err(|error| format!("cannot write {}: {error}", stamp.display()))?;
    Ok(python)
}

fn program(python: &Path) -> Result<PathBuf, Failure> {
    let ask = "import os, rerun_sdk; print(os.path.join(rerun_sdk.__path__[0], 'rerun_cli', 'rerun'), end='')";
    let told = Command::new(python).args(["-c", ask]).output();
    let told = told.map_err(|error| format!("cannot run {}: {error}", python.display()))?;
    let path = PathBuf::from(String::from_utf8_lossy(&told.stdout).into_owned());
    if path.is_file() { Ok(path) } else { Err(format!("no viewer in {PACKAGE}; delete target/venv and try again")) }
}
