//! `cargo run --release -p rohrpost-bench -- local`, `streams`, `recording`, `lan`, `tdma`, `tcp`, `supervision`,
//! `grid`, `plan`, `team` or `languages`.

use clap::{Parser, Subcommand};
use rohrpost_bench::cases;
use rohrpost_bench::counting::CountingHeap;
use rohrpost_bench::languages::{Interpreter, c_version};
use rohrpost_bench_local::{Case, Failure, Settings, report};
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

/// Rohrpost's mailboxes and streams beside the floors of this computer, and beside what else could be used.
#[derive(Parser)]
#[command(name = "rohrpost-bench")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Mailboxes between processes of one computer.
    Local(Run),
    /// Streams between processes of one computer.
    Streams(Run),
    /// Recordings: the recorder beside the crate that it writes with.
    Recording(Run),
    /// Packages between nodes, over routers: two network namespaces of this computer.
    Lan(Run),
    /// Time slots: three network namespaces of this computer.
    Tdma(Run),
    /// Packages between systems, over the TCP router: the loopback device.
    Tcp(Run),
    /// Supervised control: the wormhole between a program and its motor, and watchdogs.
    Supervision(Run),
    /// Paths on the grids of teams, beside a search in C++.
    Grid(Run),
    /// Ways for 64 robots at once: time and steps.
    Plan(Run),
    /// Teams of robots: hellos, views, merges in virtual time, and routers of two network namespaces.
    Team(Run),
    /// Programs in C and in Python, beside the same in Rust.
    Languages {
        #[command(flatten)]
        run: Run,
        /// The interpreter, with the packages to measure; without it, `python3` with the sources of this repository.
        #[arg(long, value_name = "PATH")]
        python: Option<PathBuf>,
    },
}

#[derive(clap::Args)]
struct Run {
    /// One JSON object a line.
    #[arg(long)]
    json: bool,
    /// Rounds; in each, every contender has its turn.
    #[arg(long, default_value_t = Settings::default().rounds)]
    rounds: usize,
    /// Only cases with a name that contains one of these.
    #[arg(long, num_args = 1.., value_name = "CASE")]
    only: Vec<String>,
    /// A few hundred messages a turn, one round: checks that everything runs.
    #[arg(long)]
    quick: bool,
    /// The `rohrpost` command to measure; without it, the one beside this program.
    #[arg(long, value_name = "PATH")]
    rohrpost: Option<PathBuf>,
}

fn main() -> ExitCode {
    let done = cases::run_hidden_program().map(|done| done.map(|()| true));
    match done.unwrap_or_else(|| measure(Arguments::parse().command)) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            let _ = writeln!(io::stderr(), "{error}");
            ExitCode::FAILURE
        }
    }
}

/// False when a contender failed.
fn measure(command: Command) -> Result<bool, Failure> {
    if matches!(command, Command::Lan(_) | Command::Tdma(_) | Command::Team(_)) {
        rohrpost_bench::lan::prepare();
    }
    match command {
        Command::Local(run) => run.measure(&run.settings(), &cases::all()),
        Command::Streams(run) => run.measure(&run.settings(), &cases::streams::all()),
        Command::Recording(run) => run.measure(&run.settings(), &cases::recording::all()),
        Command::Lan(run) => run.measure(&run.settings(), &cases::lan::all()),
        Command::Tdma(run) => run.measure(&run.settings(), &cases::tdma::all()),
        Command::Tcp(run) => run.measure(&run.settings(), &cases::tcp::all()),
        Command::Supervision(run) => run.measure(&run.settings(), &cases::supervision::all()),
        Command::Grid(run) => run.measure(&run.settings(), &cases::grid::all()),
        Command::Plan(run) => run.measure(&run.settings(), &cases::plan::all()),
        Command::Team(run) => run.measure(&run.settings(), &cases::team::all()),
        Command::Languages { run, python } => {
            let mut settings = Settings { python, ..run.settings() };
            settings.versions = c_version().into_iter().chain(Interpreter::of(&settings).versions()).collect();
            run.measure(&settings, &cases::languages::all())
        }
    }
}

impl Run {
    fn settings(&self) -> Settings {
        let rounds = if self.quick { self.rounds.min(1) } else { self.rounds };
        let (only, rohrpost) = (self.only.clone(), self.rohrpost.clone());
        Settings { rounds, only, quick: self.quick, rohrpost, ..Settings::default() }
    }

    fn measure(&self, settings: &Settings, cases: &[Case]) -> Result<bool, Failure> {
        let say = |text: String| writeln!(io::stdout(), "{text}").is_ok();
        Ok(report::run(settings, cases, self.json, say)?.is_sound())
    }
}
