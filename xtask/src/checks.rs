//! `cargo xtask test` and `cargo xtask ci`.
//!
//! Rerun's tests are in two builds: the bridge's own ones run in its profile, so that Rerun is compiled once only, and
//! those that look at whole drawings with Rerun's command line belong to the feature `rerun-tests`. They
//! find that command line by the environment variable `ROHRPOST_RERUN`, and have to fail without it, saying
//! `run them by "cargo xtask test", which installs Rerun's command line`.

use crate::cargo::{self, BRIDGE, BRIDGE_PROFILE, cargo};
use crate::failure::Failure;
use crate::stages::{self, Stage};
use crate::venv;
use crate::{fuzz, instructions, tsan};
use std::process::{Command, ExitCode};

/// All tests.
pub(crate) fn test() -> ExitCode {
    stages::run_all(TESTS)
}

/// Checks that must pass before anything lands.
pub(crate) fn ci() -> ExitCode {
    stages::run_all(LINTS.into_iter().chain(TESTS))
}

const LINTS: [Stage; 4] = [
    Stage { name: "format", run: || cargo::run("looking at the format", &mut cargo(&["fmt", "--all", "--check"])) },
    Stage {
        name: "clippy for all but the GUI bridge",
        run: || {
            let all = ["clippy", "--workspace", "--exclude", BRIDGE, "--all-targets", "--", "--deny", "warnings"];
            cargo::run("clippy for all but the GUI bridge", &mut cargo(&all))
        },
    },
    Stage { name: "clippy for the GUI bridge", run: || cargo::run("clippy for the GUI bridge", &mut bridge_clippy()) },
    Stage {
        name: "clippy for what the author of a module compiles",
        run: || {
            let bare = ["clippy", "--package", "rohrpost", "--package", "rohrpost-modules", "--lib"];
            let why = "clippy for what the author of a module compiles";
            cargo::run(why, cargo(&bare).args(["--", "--deny", "warnings"]))
        },
    },
];

const TESTS: [Stage; 6] = [
    Stage {
        name: "tests of all but the GUI bridge",
        run: || {
            let all = ["test", "--workspace", "--exclude", BRIDGE, "--no-fail-fast"];
            cargo::run("testing all but the GUI bridge", &mut cargo(&all))
        },
    },
    Stage { name: "ThreadSanitizer", run: || tsan::run().map(drop) },
    Stage { name: "instructions of the hot paths", run: instructions::check },
    Stage { name: "fuzzing, short", run: fuzz::short },
    Stage {
        name: "tests of the GUI bridge",
        run: || {
            let bridge = ["test", "--profile", BRIDGE_PROFILE, "--package", BRIDGE];
            cargo::run("testing the GUI bridge", &mut cargo(&bridge))
        },
    },
    Stage { name: "drawings, with Rerun's command line", run: drawings },
];

fn drawings() -> Result<(), Failure> {
    // The example is a bridge with a user's own view, which a test starts.
    let build = ["build", "--profile", BRIDGE_PROFILE, "--package", BRIDGE, "--bin", BRIDGE, "--example", "own_view"];
    cargo::run("building the GUI bridge", &mut cargo(&build))?;
    let rerun = venv::venv()?.rerun;
    let test = ["test", "--package", "rohrpost-cli", "--features", "rerun-tests", "--test", "rerun"];
    cargo::run(
        "testing drawings, and a viewer that misbehaves, with Rerun's command line",
        cargo(&test)
            .args(["--", "--test-threads", "1"])
            .env("ROHRPOST_RERUN", rerun)
            .env("ROHRPOST_BRIDGE", cargo::target().join(BRIDGE_PROFILE).join(BRIDGE)),
    )
}

/// `cargo clippy` would check all of Rerun once more, 2.5 minutes, since it shares nothing with a build. As the
/// compiler of the workspace's own crates, clippy takes Rerun as it was built: 10 seconds.
fn bridge_clippy() -> Command {
    let mut command = cargo(&["build", "--profile", BRIDGE_PROFILE, "--package", BRIDGE, "--all-targets"]);
    // The flags of `cargo clippy -- --deny warnings` for its driver.
    command.env("RUSTC_WORKSPACE_WRAPPER", "clippy-driver").env("CLIPPY_ARGS", "-Dwarnings__CLIPPY_HACKERY__");
    command
}
