//! Routers as modules: `router.I` between the nodes of a LAN, `tcp.I`, the TCP router and its clients, beyond it, and
//! `team-router.I` between systems without a server.
//!
//! The cores, threads and sockets are in `rohrpost-routers`, which knows no module. Here they are started from a
//! configuration, and tell how they do as data that describes itself. Nothing here knows a command line or a terminal.
//!
//! ```text
//!  Start ─▶ Module::new ─▶ Shell, ServerShell, ClientShell, TeamShell ── threads ── UDP, TCP
//!           Module::tick ◀── counters ──┘
//!                │
//!                └─▶ links, clock, slots, flows, replicas, clients: published each 0.5 s
//! ```

#![forbid(unsafe_code)]

mod moving;
mod router;
mod tcp;
mod team;

pub use router::keys;

use rohrpost_modules::runtime::{Start, StartError, run_started};

/// Runs the router of a node, until it is told to end.
///
/// # Errors
/// See [`StartError`].
pub fn run_router(start: Start) -> Result<(), StartError> {
    run_started::<router::RouterModule>(start)
}

/// Runs the TCP router, until it is told to end.
///
/// # Errors
/// See [`StartError`].
pub fn run_tcp_router(start: Start) -> Result<(), StartError> {
    run_started::<tcp::server::ServerModule>(start)
}

/// Runs a node's client of the TCP router, until it is told to end.
///
/// # Errors
/// See [`StartError`].
pub fn run_tcp_client(start: Start) -> Result<(), StartError> {
    run_started::<tcp::client::ClientModule>(start)
}

/// Runs a node's router of the team, until it is told to end.
///
/// # Errors
/// See [`StartError`].
pub fn run_team_router(start: Start) -> Result<(), StartError> {
    run_started::<team::TeamRouterModule>(start)
}
