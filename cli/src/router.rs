//! `rohrpost router`: carries packages between this node and the others of its system. Launch starts one on each node.

use crate::terminal::Failure;
use rohrpost::Start;
use rohrpost_modules::runtime::exit;
use std::ffi::OsString;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example, on the first node of robot.toml: rohrpost router --config robot.toml --name router.0
Launch starts it on each node of a system with several nodes; start it by hand only if you start modules by hand.")]
pub(super) struct Arguments {
    /// The arguments of every module: --config FILE --name router.I [--off]; I is the place of its node in the
    /// configuration, from 0.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

pub(super) fn run(arguments: Arguments) -> Result<ExitCode, Failure> {
    let start = Start::from_arguments(arguments.arguments.into_iter());
    Ok(exit(start.and_then(rohrpost_router_daemon::run_router)))
}
