//! `cargo xtask test` and `cargo xtask ci`.
//!
//! Rerun's tests are in two builds: the bridge's own ones run in its profile, so that Rerun is compiled once only, and
//! those that look at whole drawings with Rerun's command line belong to the feature `rerun-tests`. They
//! find that command line by the environment variable `ROHRPOST_RERUN`, and have to fail without it, saying
//! `run them by "cargo xtask test", which installs Rerun's command line`.

use crate::cargo::{self, BRIDGE, BRIDGE_PROFILE, cargo};
use crate::failure::Failure;
use crate::venv;
use crate::{fuzz, tsan};
use std::process::{Command, ExitCode};

/// All tests.
pub(crate) fn test() -> Result<ExitCode, Failure> {
    // All of them, so that one run shows all failures.
    let all = ["test", "--workspace", "--exclude", BRIDGE, "--no-fail-fast"];
    cargo::run("testing all but the GUI bridge", &mut cargo(&all))?;
    tsan::run()?;
    fuzz::short()?;
    let bridge = ["--profile", BRIDGE_PROFILE, "--package", BRIDGE];
    cargo::run("testing the GUI bridge", cargo(&["test"]).args(bridge))?;
    // The example is a bridge with a user's own view, which a test starts.
    let bins = ["--bin", BRIDGE, "--example", "own_view"];
    cargo::run("building the GUI bridge", cargo(&["build"]).args(bridge).args(bins))?;
    let rerun = venv::venv()?.rerun;
    cargo::run(
        "testing drawings, and a viewer that misbehaves, with Rerun's command line",
        cargo(&[
            "test",
            "--package",
            "rohrpost-cli",
            "--features",
            "rerun-tests",
            "--test",
            "rerun",
            "--",
            "--test-threads",
            "1",
        ])
        .env("ROHRPOST_RERUN", rerun)
        .env("ROHRPOST_BRIDGE", cargo::target().join(BRIDGE_PROFILE).join(BRIDGE)),
    )?;
    Ok(ExitCode::SUCCESS)
}

/// Checks that must pass before anything lands.
pub(crate) fn ci() -> Result<ExitCode, Failure> {
    cargo::run("looking at the format", &mut cargo(&["fmt", "--all", "--check"]))?;
    let deny = ["--all-targets", "--", "--deny", "warnings"];
    cargo::run("clippy for all but the GUI bridge", cargo(&["clippy", "--workspace", "--exclude", BRIDGE]).args(deny))?;
    cargo::run("clippy for the GUI bridge", &mut bridge_clippy())?;
    let bare = ["clippy", "--package", "rohrpost", "--package", "rohrpost-modules", "--lib"];
    cargo::run("clippy for what the author of a module compiles", cargo(&bare).args(["--", "--deny", "warnings"]))?;
    test()
}

/// `cargo clippy` would check all of Rerun once more, 2.5 minutes, since it shares nothing with a build. As the
/// compiler of the workspace's own crates, clippy takes Rerun as it was built: 10 seconds.
fn bridge_clippy() -> Command {
    let mut command = cargo(&["build", "--profile", BRIDGE_PROFILE, "--package", BRIDGE, "--all-targets"]);
    // The flags of `cargo clippy -- --deny warnings` for its driver.
    command.env("RUSTC_WORKSPACE_WRAPPER", "clippy-driver").env("CLIPPY_ARGS", "-Dwarnings__CLIPPY_HACKERY__");
    command
}
