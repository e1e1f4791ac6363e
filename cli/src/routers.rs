//! `rohrpost router`, `rohrpost tcp-router`, `rohrpost tcp-client` and `rohrpost team-router`: carry packages between
//! nodes, beyond the LAN, and between systems. Launch starts them as the configuration requires.

use crate::terminal::Failure;
use rohrpost::Start;
use rohrpost_modules::runtime::exit;
use std::ffi::OsString;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(
    after_help = "Example, on the node that `server` of [tcp] names: rohrpost tcp-router --config robot.toml --name \
        tcp.255
Launch starts both, the client on every node; start them by hand only if you start modules by hand."
)]
pub(super) struct Arguments {
    /// The arguments of every module: --config FILE --name tcp.I [--off]; 255 is the TCP router, the others are the
    /// clients of the nodes.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Runs the server.
pub(super) fn serve(arguments: Arguments) -> Result<ExitCode, Failure> {
    let start = Start::from_arguments(arguments.arguments.into_iter());
    Ok(exit(start.and_then(rohrpost_router_daemon::run_tcp_router)))
}

/// Runs a router of the team.
pub(super) fn team(arguments: TeamArguments) -> Result<ExitCode, Failure> {
    let start = Start::from_arguments(arguments.arguments.into_iter());
    Ok(exit(start.and_then(rohrpost_router_daemon::run_team_router)))
}

#[derive(clap::Args)]
#[command(after_help = "Example, on the first node of robot.toml: rohrpost team-router --config robot.toml --name \
        team-router.0
Launch starts it on each node that `address` of [team] names; start it by hand only if you start modules by hand.")]
pub(super) struct TeamArguments {
    /// The arguments of every module: --config FILE --name team-router.I [--off]; I is the place of its node in the
    /// configuration, from 0.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

/// Runs a client.
pub(super) fn join(arguments: Arguments) -> Result<ExitCode, Failure> {
    let start = Start::from_arguments(arguments.arguments.into_iter());
    Ok(exit(start.and_then(rohrpost_router_daemon::run_tcp_client)))
}

#[derive(clap::Args)]
#[command(after_help = "Example, on the first node of robot.toml: rohrpost router --config robot.toml --name router.0
Launch starts it on each node of a system with several nodes; start it by hand only if you start modules by hand.")]
pub(super) struct LanArguments {
    /// The arguments of every module: --config FILE --name router.I [--off]; I is the place of its node in the
    /// configuration, from 0.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

pub(super) fn connect(arguments: LanArguments) -> Result<ExitCode, Failure> {
    let start = Start::from_arguments(arguments.arguments.into_iter());
    Ok(exit(start.and_then(rohrpost_router_daemon::run_router)))
}
