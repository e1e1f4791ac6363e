//! `cargo run --release -p rohrpost-bench -- local`, `streams`, `recording`, `lan`, `tdma`, `tcp` or `languages`.

use clap::{Parser, Subcommand};
use rohrpost_bench::cases;
use rohrpost_bench::counting::CountingHeap;
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
    if let Some(done) = cases::run_hidden_program() {
        return done.map_or_else(
            |error| {
                let _ = writeln!(io::stderr(), "{error}");
                ExitCode::FAILURE
            },
            |()| ExitCode::SUCCESS,
        );
    }
    let done = match Arguments::parse().command {
        Command::Local(run) => measure(&run, &cases::all()),
        Command::Streams(run) => measure(&run, &cases::streams::all()),
        Command::Recording(run) => measure(&run, &cases::recording::all()),
        Command::Lan(run) => {
            rohrpost_bench::lan::prepare();
            measure(&run, &cases::lan::all())
        }
        Command::Tdma(run) => {
            rohrpost_bench::lan::prepare();
            measure(&run, &cases::tdma::all())
        }
        Command::Tcp(run) => measure(&run, &cases::tcp::all()),
        Command::Languages { run, python } => measure_languages(&run, python),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            let _ = writeln!(io::stderr(), "{error}");
            ExitCode::FAILURE
        }
    }
}

/// False when a contender failed.
fn measure(arguments: &Run, cases: &[Case]) -> Result<bool, Failure> {
    run(arguments, &settings(arguments), cases)
}

fn measure_languages(arguments: &Run, python: Option<PathBuf>) -> Result<bool, Failure> {
    use rohrpost_bench::languages::{Interpreter, c_version};
    let mut settings = Settings { python, ..settings(arguments) };
    settings.versions = c_version().into_iter().chain(Interpreter::of(&settings).versions()).collect();
    run(arguments, &settings, &cases::languages::all())
}

fn settings(arguments: &Run) -> Settings {
    let rounds = if arguments.quick { arguments.rounds.min(1) } else { arguments.rounds };
    let (only, rohrpost) = (arguments.only.clone(), arguments.rohrpost.clone());
    Settings { rounds, only, quick: arguments.quick, rohrpost, ..Settings::default() }
}

fn run(arguments: &Run, settings: &Settings, cases: &[Case]) -> Result<bool, Failure> {
    let say = |text: String| writeln!(io::stdout(), "{text}").is_ok();
    Ok(report::run(settings, cases, arguments.json, say)?.is_sound())
}
