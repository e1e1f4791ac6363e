//! The `rohrpost` command.

#![forbid(unsafe_code)]
// What is printed goes through `cli::say` and `cli::complain`, and so nothing in it that a terminal would obey.
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
