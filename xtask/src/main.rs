//! `cargo xtask`: builds, runs, tests and shows Rohrpost; `cargo demo` is the first of its commands.
//!
//! Nothing but the standard library and a small file of our own: `cargo demo` compiles this before
//! anything else, and that should take a second.
#![forbid(unsafe_code)]

mod bench_page;
mod beside;
mod c_client;
mod campaign;
mod cargo;
mod checks;
mod crates;
mod demo;
mod failure;
mod files;
mod fuzz;
mod instructions;
mod parts;
mod picture;
mod release;
mod report;
mod stages;
mod tsan;
mod venv;

use std::process::ExitCode;

const HELP: &str = "\
cargo demo [--no-gui] [ARGS...]   the same as `cargo xtask demo`
cargo xtask demo [--no-gui] [ARGS...]
    Builds `rohrpost` and runs `rohrpost demo ARGS...`. The GUI bridge is built before, or, if the demo runs until
    Ctrl-C, beside it, and joins it; with --no-gui not at all.
cargo xtask test [--all]
    All tests that a change to the product may break. With --all also those of the bench with its peers and of the GUI
    bridge, the slot core under ThreadSanitizer, instructions of the hot paths, a short run of the fuzz targets, and
    drawings with Rerun's command line. Every stage runs, even if one failed; a table of stages, their times and
    processor times, and what was skipped or repeated, comes last.
cargo xtask ci
    Format, a build of all by clippy, then all tests with what was built.
cargo xtask fuzz [TARGET...] [--seconds N] | --short
    Fuzzes each target, or those named, for so long (60 s), from where the last run ended; or as the tests do, a little.
cargo xtask instructions [--record]
    Counts instructions of the hot paths with callgrind and compares them with recorded ceilings, or records these.
cargo xtask campaign [--runs N] [--seed S]
    Lets programs, processes, scanner, clock and network of the supervised robot fail, one run for each seed from S on
    (10 from 0 on), and the same without the wormhole. A run that fails prints its seed and its faults.
cargo xtask tsan
    Runs the mailbox's slot core, and broken variants of it, under ThreadSanitizer.
cargo xtask c-client DIR
    Builds the library for C and C++, and installs it with its headers and pkg-config file below DIR.
cargo xtask release [--profile dev] [--bridge]
    Builds, and packs into target/dist, a .deb, a tarball, and a wheel of the Python package with the command in it;
    installs them in an empty root and in a fresh venv, and runs a demo there. --bridge adds the GUI bridge to them.
cargo xtask bench-page
    Writes the tables of docs/src/bench.md from benches/results.
cargo xtask picture FILE.rrd OUT.png [--size WIDTHxHEIGHT] [--wait SECONDS]
    A picture of a drawing as its viewer shows it, without a screen.
";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (command, rest) = args.split_first().map_or(("help", &[][..]), |(first, rest)| (first.as_str(), rest));
    let done = match command {
        "demo" => demo::run(rest),
        beside::COMMAND => beside::run(rest),
        "test" => checks::test(rest),
        "ci" => Ok(checks::ci()),
        "fuzz" => fuzz::run(rest),
        "instructions" => instructions::command(rest),
        "campaign" => campaign::run(rest),
        "tsan" => tsan::run(),
        "c-client" => c_client::install(rest),
        "release" => release::command(rest),
        "bench-page" => bench_page::command(rest),
        "picture" => picture::run(rest),
        "help" | "--help" | "-h" => {
            print!("{HELP}");
            Ok(ExitCode::SUCCESS)
        }
        other => Err(format!("no command `{other}`; there are:\n{HELP}")),
    };
    done.unwrap_or_else(|failure| {
        eprintln!("xtask: {failure}");
        ExitCode::FAILURE
    })
}
