//! `cargo run --release -p rohrpost-bench -- local`

use clap::{Parser, Subcommand};
use rohrpost_bench::counting::CountingHeap;
use rohrpost_bench::{Failure, Settings, cases, report};
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

/// Rohrpost's mailboxes beside the floors of this computer, and beside what else could be used.
#[derive(Parser)]
#[command(name = "rohrpost-bench")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Mailboxes between processes of one computer.
    Local(Local),
}

#[derive(clap::Args)]
struct Local {
    /// One JSON object a line.
    #[arg(long)]
    json: bool,
    /// Rounds; in each, every contender has its turn.
    #[arg(long, default_value_t = Settings::default().rounds)]
    rounds: usize,
    /// Only cases whose names contain one of these.
    #[arg(long, num_args = 1.., value_name = "CASE")]
    only: Vec<String>,
    /// A few hundred messages a turn, one round: whether everything runs.
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
    let Command::Local(arguments) = Arguments::parse().command;
    match local(&arguments) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            let _ = writeln!(io::stderr(), "{error}");
            ExitCode::FAILURE
        }
    }
}

/// False when a contender failed.
fn local(arguments: &Local) -> Result<bool, Failure> {
    let rounds = if arguments.quick { arguments.rounds.min(1) } else { arguments.rounds };
    let settings =
        Settings { rounds, only: arguments.only.clone(), quick: arguments.quick, rohrpost: arguments.rohrpost.clone() };
    let say = |text: String| writeln!(io::stdout(), "{text}").is_ok();
    Ok(report::run(&settings, &cases::all(), arguments.json, say)?.is_sound())
}
