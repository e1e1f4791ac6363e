//! `cargo xtask test` and `cargo xtask ci`.
//!
//! What a stage needs is built once. Cargo takes what it has built if the profile, the selection of packages and
//! thereby the features are the same; so each call selects all of the workspace, and those that want less name targets.
//! The tests that look at whole drawings with Rerun's command line, and at recordings with Python's reader, are targets
//! that run only if they are named. They find these programs by environment variables, and have to fail without them,
//! saying `run them by "cargo xtask test --all"`.

use crate::cargo::{self, BRIDGE, cargo, checked};
use crate::failure::Failure;
use crate::parts;
use crate::release::{self, Profile};
use crate::report;
use crate::stages::{self, Done, Stage};
use crate::venv;
use crate::{fuzz, instructions, tsan};
use std::process::{Command, ExitCode};

/// The bench, with its peers: some 70 crates.
const BENCH: &str = "rohrpost-bench";
/// The models of the slot core, of supervision and of teams. Their model checkers ask for features of others' crates,
/// with which Cargo would compile ours once more.
const MODELS: [&str; 3] = ["rohrpost-proof-loom", "rohrpost-proof-supervision", "rohrpost-proof-team"];

/// `cargo xtask test [--all]`: what a change to the product may break, or all tests.
pub(crate) fn test(args: &[String]) -> Result<ExitCode, Failure> {
    match args {
        [] => Ok(stages::run_all(PRODUCT)),
        [all] if all == "--all" => Ok(stages::run_all(ALL)),
        others => Err(format!("`{}`: cargo xtask test takes --all or nothing", others.join(" "))),
    }
}

/// Checks that must pass before anything lands.
pub(crate) fn ci() -> ExitCode {
    cargo::check_what_is_compiled();
    stages::run_all(LINTS.into_iter().chain(ALL))
}

const LINTS: [Stage; 2] = [
    Stage {
        name: "format",
        budget_s: 10,
        run: || whole(cargo::run("looking at the format", &mut cargo(&["fmt", "--all", "--check"]))),
    },
    Stage {
        name: "build of all, by clippy",
        budget_s: 1650,
        run: || {
            let all = ["test", "--workspace", "--no-run", "--no-fail-fast"];
            let counted = ["test", "--workspace", "--bench", "instructions", "--bench", "instructions-c", "--no-run"];
            let built = cargo::run("building all, by clippy", &mut checked(&all));
            let linted = cargo::run("and the programs of the counted paths", &mut checked(&counted));
            whole(built.and(linted))
        },
    },
];

/// What a change to the product may break.
const PRODUCT: [Stage; 2] = [
    Stage {
        name: "tests of the product",
        budget_s: 2700,
        run: || {
            let left_out = [BRIDGE, BENCH].into_iter().chain(MODELS).flat_map(|package| ["--exclude", package]);
            let most: Vec<&str> = ["test", "--workspace", "--no-fail-fast"].into_iter().chain(left_out).collect();
            parts::run("testing all but the GUI bridge and the bench with its peers", tests(&most))
        },
    },
    Stage {
        name: "models of slots, supervision and teams",
        budget_s: 500,
        run: || {
            let packages = MODELS.into_iter().flat_map(|package| ["--package", package]);
            let all: Vec<&str> = ["test", "--no-fail-fast"].into_iter().chain(packages).collect();
            parts::run("testing models of the slot core, of supervision and of teams", tests(&all))
        },
    },
];

const ALL: [Stage; 9] = [
    Stage {
        name: "tests",
        budget_s: 2500,
        run: || parts::run("testing all", tests(&["test", "--workspace", "--no-fail-fast"])),
    },
    Stage { name: "drawings, with Rerun's command line", budget_s: 220, run: || whole(drawings()) },
    Stage { name: "recordings, with Python's reader", budget_s: 30, run: || whole(recordings()) },
    Stage { name: "the client in Python, installed, with mypy", budget_s: 170, run: || whole(python_client()) },
    Stage {
        name: "packages, installed where nothing is",
        budget_s: 100,
        run: || whole(release::run(Profile::Dev, false)),
    },
    Stage { name: "crates, packed for crates.io", budget_s: 30, run: || whole(release::crates_io::pack()) },
    Stage { name: "ThreadSanitizer", budget_s: 40, run: || whole(tsan::run().map(drop)) },
    Stage { name: "instructions of the hot paths", budget_s: 380, run: || whole(instructions::check()) },
    Stage { name: "fuzzing, short", budget_s: 470, run: || whole(fuzz::short()) },
];

/// A stage without parts.
fn whole(result: Result<(), Failure>) -> Done {
    (Vec::new(), result)
}

/// A call of Cargo that runs tests, which report to the file of this run.
fn tests(args: &[&str]) -> Command {
    let mut command = checked(args);
    command.env(rohrpost_test_report::FILE, report::path());
    command
}

fn drawings() -> Result<(), Failure> {
    // The example is a bridge with a user's own view, which a test starts.
    let build = ["build", "--workspace", "--bin", BRIDGE, "--example", "own_view"];
    cargo::run("building the GUI bridge", &mut checked(&build))?;
    let rerun = venv::venv()?.rerun;
    cargo::run(
        "testing drawings, and a viewer that misbehaves, with Rerun's command line",
        tests(&["test", "--workspace", "--test", "rerun"])
            .args(["--", "--test-threads", "1"])
            .env("ROHRPOST_RERUN", rerun)
            .env("ROHRPOST_BRIDGE", cargo::target().join("debug").join(BRIDGE)),
    )
}

/// By the makers of the format, in Python: it says whether others can read what is written here. And by Rerun, whether
/// it shows what is drawn.
fn recordings() -> Result<(), Failure> {
    let (python, rerun) = (venv::mcap()?, venv::venv()?.rerun);
    cargo::run(
        "testing recordings with Python's reader and Rerun's converter",
        tests(&["test", "--workspace", "--test", "python"])
            .env("ROHRPOST_MCAP_PYTHON", python)
            .env("ROHRPOST_RERUN", rerun),
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
