//! `rohrpost tcp-router` and `rohrpost tcp-client`: what carries packages beyond the LAN. Launch starts them where `[tcp]` says so.

mod client;
mod server;

use super::router::NoSettings;
use crate::terminal::Failure;
use rohrpost::interfaces::{CarriedLoss, ClassPassed};
use rohrpost::{ModuleError, Start};
use rohrpost_config::{Installation, Tcp};
use rohrpost_mailbox::Priority;
use rohrpost_modules::runtime::{exit, run_started};
use rohrpost_routers::tcp::Class;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// How often they tell how they are.
const PERIOD: Duration = Duration::from_millis(500);
/// Bytes of a name that sessions take.
const NAME_BYTES_MAX: usize = rohrpost_routers::session::frame::NAME_BYTES_MAX;

#[derive(clap::Args)]
#[command(
    after_help = "Example, on the node that `server` of [tcp] names: rohrpost tcp-router --config robot.toml --name tcp.255
Launch starts both by itself, the client on every node; by hand they are of use where modules are started by hand."
)]
pub(super) struct Arguments {
    /// What every module takes: --config FILE --name tcp.I [--off]; 255 is the TCP router, the others are the clients of the nodes.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<String>,
}

/// Runs the server.
pub(super) fn serve(arguments: Arguments) -> Result<ExitCode, Failure> {
    let start = Start::from_arguments(arguments.arguments.into_iter());
    Ok(exit(start.and_then(run_started::<server::ServerModule>)))
}

/// Runs a client.
pub(super) fn join(arguments: Arguments) -> Result<ExitCode, Failure> {
    let start = Start::from_arguments(arguments.arguments.into_iter());
    Ok(exit(start.and_then(run_started::<client::ClientModule>)))
}

/// The section `[tcp]`.
fn configured(installation: &Installation) -> Result<&Tcp, ModuleError> {
    installation.tcp.as_ref().ok_or_else(|| ModuleError::new("the configuration has no [tcp]"))
}

/// The folder of the certificates; without one nothing is sealed, and that is said.
fn certificates(installation: &Installation, tcp: &Tcp) -> Option<PathBuf> {
    if tcp.certificates.is_none() {
        tracing::warn!("{}", Tcp::UNPROTECTED);
    }
    tcp.certificates.as_ref().map(|folder| installation.resolve(folder))
}

/// The level of each priority.
fn levels(tcp: &Tcp) -> [u8; 256] {
    std::array::from_fn(|priority| tcp.level(Priority(priority as u8)))
}

/// What a node's client calls itself at the TCP router.
fn called(node: &str, installation: &Installation) -> String {
    short(&format!("node {node} of {}", installation.system.name))
}

/// A name for people, no longer than sessions take it.
fn short(name: &str) -> String {
    let printable = || name.chars().filter(|c| !c.is_control());
    let ends = printable().scan(0, |end, c| {
        *end += c.len_utf8();
        Some(*end)
    });
    printable().take(ends.take_while(|end| *end <= NAME_BYTES_MAX).count()).collect()
}

fn classes(all: &[Class]) -> Vec<ClassPassed> {
    let class = |class: &Class| ClassPassed {
        class: class.priority.0,
        packages: class.packages,
        passed: class.passed,
        replaced: class.replaced,
        lost: class
            .lost
            .iter()
            .map(|(cause, packages)| CarriedLoss { cause: cause.word().into(), packages: *packages })
            .collect(),
    };
    all.iter().map(class).collect()
}
