//! `cargo xtask test` and `cargo xtask ci`.
//!
//! Rerun's tests are in two builds: the bridge's own ones run in its profile, so that Rerun is compiled once only, and
//! those that look at whole drawings with Rerun's command line belong to the feature `rerun-tests`. They
//! find that command line by the environment variable `ROHRPOST_RERUN`, and have to fail without it, saying
//! `run them by "cargo xtask test --all", which installs Rerun`.

use crate::cargo::{self, BRIDGE, cargo};
use crate::failure::Failure;
use crate::parts;
use crate::report;
use crate::stages::{self, Done, Stage};
use crate::venv;
use crate::{fuzz, instructions, tsan};
use std::process::{Command, ExitCode};

/// The bench, with its peers: some 70 crates.
const BENCH: &str = "rohrpost-bench";

/// `cargo xtask test [--all]`: what a change to the product may break, or all tests.
pub(crate) fn test(args: &[String]) -> Result<ExitCode, Failure> {
    match args {
        [] => Ok(stages::run_all([PRODUCT])),
        [all] if all == "--all" => Ok(stages::run_all(ALL)),
        others => Err(format!("`{}`: cargo xtask test takes --all or nothing", others.join(" "))),
    }
}

/// Checks that must pass before anything lands.
pub(crate) fn ci() -> ExitCode {
    stages::run_all(LINTS.into_iter().chain(ALL))
}

const LINTS: [Stage; 3] = [
    Stage {
        name: "format",
        budget_s: 180,
        run: || whole(cargo::run("looking at the format", &mut cargo(&["fmt", "--all", "--check"]))),
    },
    Stage {
        name: "clippy for all but the GUI bridge",
        budget_s: 1080,
        run: || {
            let all = ["clippy", "--workspace", "--exclude", BRIDGE, "--all-targets", "--", "--deny", "warnings"];
            whole(cargo::run("clippy for all but the GUI bridge", &mut cargo(&all)))
        },
    },
    Stage {
        name: "clippy for the GUI bridge",
        budget_s: 1080,
        run: || whole(cargo::run("clippy for the GUI bridge", &mut bridge_clippy())),
    },
];

/// What a change to the product may break.
const PRODUCT: Stage = Stage {
    name: "tests of the product",
    budget_s: 4500,
    run: || {
        let most = ["test", "--workspace", "--exclude", BRIDGE, "--exclude", BENCH, "--no-fail-fast"];
        parts::run("testing all but the GUI bridge and the bench", tests(&most))
    },
};

const ALL: [Stage; 8] = [
    Stage {
        name: "tests of all but the GUI bridge",
        budget_s: 4500,
        run: || {
            let all = ["test", "--workspace", "--exclude", BRIDGE, "--no-fail-fast"];
            parts::run("testing all but the GUI bridge", tests(&all))
        },
    },
    Stage { name: "ThreadSanitizer", budget_s: 180, run: || whole(tsan::run().map(drop)) },
    Stage { name: "instructions of the hot paths", budget_s: 720, run: || whole(instructions::check()) },
    Stage { name: "fuzzing, short", budget_s: 720, run: || whole(fuzz::short()) },
    Stage {
        name: "tests of the GUI bridge",
        budget_s: 900,
        run: || {
            let bridge = ["test", "--package", BRIDGE, "--no-fail-fast"];
            parts::run("testing the GUI bridge", tests(&bridge))
        },
    },
    Stage { name: "drawings, with Rerun's command line", budget_s: 900, run: || whole(drawings()) },
    Stage { name: "recordings, with Python's reader", budget_s: 360, run: || whole(recordings()) },
    Stage { name: "the client in Python, installed, with mypy", budget_s: 540, run: || whole(python_client()) },
];

/// A stage without parts.
fn whole(result: Result<(), Failure>) -> Done {
    (Vec::new(), result)
}

/// A call of Cargo that runs tests, which report to the file of this run.
fn tests(args: &[&str]) -> Command {
    let mut command = cargo(args);
    command.env(rohrpost_test_report::FILE, report::path());
    command
}

fn drawings() -> Result<(), Failure> {
    // The example is a bridge with a user's own view, which a test starts.
    let build = ["build", "--package", BRIDGE, "--bin", BRIDGE, "--example", "own_view"];
    cargo::run("building the GUI bridge", &mut cargo(&build))?;
    let rerun = venv::venv()?.rerun;
    let test = ["test", "--package", "rohrpost-cli", "--features", "rerun-tests", "--test", "rerun"];
    cargo::run(
        "testing drawings, and a viewer that misbehaves, with Rerun's command line",
        tests(&test)
            .args(["--", "--test-threads", "1"])
            .env("ROHRPOST_RERUN", rerun)
            .env("ROHRPOST_BRIDGE", cargo::target().join("debug").join(BRIDGE)),
    )
}

/// By the makers of the format, in Python: it says whether others can read what is written here. And by Rerun, whether
/// it shows what is drawn.
fn recordings() -> Result<(), Failure> {
    let (python, rerun) = (venv::mcap()?, venv::venv()?.rerun);
    let test = ["test", "--package", "rohrpost-recording", "--features", "python-tests", "--test", "python"];
    cargo::run(
        "testing recordings with Python's reader and Rerun's converter",
        tests(&test).env("ROHRPOST_MCAP_PYTHON", python).env("ROHRPOST_RERUN", rerun),
    )
}

/// Types, strictly; then as its users have it: installed by pip, without its part in Rust and with it. (Tests of
/// `rohrpost-modules` and of the command run it uninstalled.)
fn python_client() -> Result<(), Failure> {
    let (python, folder) = (venv::clients()?, cargo::root().join("clients/python"));
    let run = |why: &str, arguments: &[&str]| {
        cargo::run(why, Command::new(&python).arg("-B").args(arguments).current_dir(&folder))
    };
    let cache = cargo::target().join("mypy");
    run("checking types of the client in Python", &["-m", "mypy", "--cache-dir", &cache.to_string_lossy()])?;
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-build-isolation"];
    let install = [&install[..], &["--force-reinstall", "."]].concat();
    let mut pure = Command::new(&python);
    pure.args(&install).current_dir(&folder).env("ROHRPOST_PURE", "1");
    cargo::run("installing the client in Python, without Rust", &mut pure)?;
    let is_available = "import rohrpost as rp, sys; sys.exit(rp.is_available() != (sys.argv[1] == 'yes'))";
    run("asking it for modules on the node, which it has not", &["-c", is_available, "no"])?;
    let mut whole = Command::new(&python);
    // By the profile of all tests, so that less is compiled.
    whole.args(&install).current_dir(&folder).env("MATURIN_PEP517_ARGS", "--profile dev");
    cargo::run("installing the client in Python, with its part in Rust", &mut whole)?;
    run("asking it for modules on the node, which it has", &["-c", is_available, "yes"])?;
    run("testing the client in Python, installed", &["-m", "unittest", "discover", "-t", ".", "-s", "tests"])?;
    // As the tests of all have built it, with the command beside it.
    let mut bench = Command::new(cargo::target().join("debug").join(BENCH));
    bench.args(["languages", "--quick", "--only", "Python", "--python"]).arg(&python);
    cargo::run("measuring it, quickly: each program of the bench in Python delivers", &mut bench)
}

/// `cargo clippy` would check all of Rerun once more, 2.5 minutes, since it shares nothing with a build. As the
/// compiler of the workspace's own crates, clippy takes Rerun as it was built: 10 seconds.
fn bridge_clippy() -> Command {
    let mut command = cargo(&["build", "--package", BRIDGE, "--all-targets"]);
    // The flags of `cargo clippy -- --deny warnings` for its driver.
    command.env("RUSTC_WORKSPACE_WRAPPER", "clippy-driver").env("CLIPPY_ARGS", "-Dwarnings__CLIPPY_HACKERY__");
    command
}
