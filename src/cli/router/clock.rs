//! The common time: what the configuration says of it, and how it stands.

use rohrpost::config::{Installation, TimeSource};
use rohrpost::interfaces::{ClockRole, ClockState};
use rohrpost::mailbox::{Node, SystemTime};
use rohrpost_routers::impair;
use rohrpost_routers::settings::Settings;
use rohrpost_routers::shell::clock::{ClockError, ClockParts, ClockService};
use rohrpost_routers::time::{Role, TimeSettings};
use std::sync::Arc;

/// The clock of a node's router; none if nodes have no common time.
///
/// # Errors
/// [`ClockError`]
pub(super) fn start(
    installation: &Installation,
    settings: &Settings,
    node: &Arc<Node>,
    impair: Option<impair::Settings>,
) -> Result<Option<ClockService>, ClockError> {
    let TimeSource::Master { masters, interval } = &installation.time else { return Ok(None) };
    let port = settings.network.time_port();
    let parts = ClockParts {
        settings: TimeSettings {
            system: settings.system,
            own: settings.own,
            nodes: settings.nodes.len() as u8,
            masters: masters.clone(),
            interval: *interval,
            digest: settings.digest,
            incarnation: settings.incarnation,
        },
        nodes: settings.nodes.iter().map(|node| (node.address, port).into()).collect(),
        node: Some(node.clone()),
        impair,
        skew: None,
        observer: None,
    };
    ClockService::start(parts).map(Some)
}

/// How it stands, with what a module of this node reads just now.
pub(super) fn state(service: &ClockService, settings: &Settings, now: SystemTime) -> ClockState {
    let seen = service.state().snapshot();
    let name = |node: u8| settings.nodes.get(usize::from(node)).map(|node| node.name.clone());
    ClockState {
        node: name(settings.own).unwrap_or_default(),
        role: match seen.role {
            Role::Listening => ClockRole::Listening,
            Role::Slave => ClockRole::Slave,
            Role::Master => ClockRole::Master,
        },
        master: seen.master.and_then(name).unwrap_or_default(),
        term: seen.term.0,
        epoch: now.epoch,
        now_ns: now.ns,
        error_ns: seen.synchronised.then(|| u64::try_from(now.error.as_nanos()).unwrap_or(u64::MAX)),
        offset_ns: seen.offset_ns,
        rate_ppb: seen.rate_ppb,
        round_trip_ns: seen.delay_ns,
        exchanges: seen.exchanges,
        by_kernel: seen.by_kernel,
    }
}
