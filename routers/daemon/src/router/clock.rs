//! The state of system time, as a router publishes it.

use rohrpost_mailbox::{monotonic_ns, realtime_ns};
use rohrpost_modules::interfaces::{ClockRole, ClockState};
use rohrpost_routers::shell::Shell;
use rohrpost_routers::shell::clock::ClockState as Shown;
use rohrpost_routers::time::Role;

/// The present state.
pub(super) fn of(shell: &Shell, clock: &Shown) -> ClockState {
    let (settings, seen, now_ns) = (shell.settings(), clock.snapshot(), monotonic_ns());
    let name = |node: u8| settings.nodes.get(usize::from(node)).map(|node| node.name.clone()).unwrap_or_default();
    let time = seen.record.at(now_ns);
    ClockState {
        node: name(settings.own),
        role: match seen.role {
            Role::Listening => ClockRole::Listening,
            Role::Slave => ClockRole::Slave,
            Role::Master => ClockRole::Master,
        },
        master: seen.master.map(name).unwrap_or_default(),
        term: seen.term.round(),
        epoch: time.epoch,
        now_ns: time.ns,
        error_ns: seen.synchronised.then(|| u64::try_from(time.error.as_nanos()).unwrap_or(u64::MAX)),
        offset_ns: -seen.offset_ns,
        rate_ppb: -seen.rate_ppb,
        round_trip_ns: seen.delay_ns,
        exchanges: seen.exchanges,
        by_kernel: seen.by_kernel,
        clock_set_by_ns: seen.record.clock_set_by(now_ns, realtime_ns()),
    }
}
