//! `cargo run --release -p rohrpost-bench -- local`

use clap::{Parser, Subcommand};
use rohrpost_bench::{Failure, Settings, cases, report};
use std::io::{self, Write};
use std::process::ExitCode;

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
}

fn main() -> ExitCode {
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
    let settings = Settings { rounds, only: arguments.only.clone(), quick: arguments.quick };
    let say = |text: String| writeln!(io::stdout(), "{text}").is_ok();
    Ok(report::run(&settings, &cases::all(), arguments.json, say)?.is_sound())
}
