//! How a router keeps its time slots, as it publishes it.

use rohrpost_modules::interfaces::{SlotState, SlotUse, TunnelState};
use rohrpost_routers::driver::Used;
use rohrpost_routers::shell::Shell;
use rohrpost_routers::shell::slots::SlotStatus;
use rohrpost_routers::shell::tunnel::Passed;
use rohrpost_routers::tdma::WindowKind;

/// The present state.
pub(super) fn of(shell: &Shell, slots: &SlotStatus) -> SlotState {
    let (settings, seen) = (shell.settings(), slots.snapshot());
    let (counts, syncs) = (seen.counts, seen.counts.syncs);
    SlotState {
        node: settings.nodes.get(usize::from(settings.own)).map(|node| node.name.clone()).unwrap_or_default(),
        used: counts.used,
        empty: counts.empty,
        late: counts.late,
        skipped: counts.skipped,
        silent: counts.silent,
        why_silent: seen.silent.map(|silent| silent.to_string()).unwrap_or_default(),
        datagrams: counts.datagrams,
        wire_bytes: counts.wire_bytes,
        synchronisations_sent: syncs.sent,
        replacements_sent: syncs.replacements_sent,
        synchronisations_heard: syncs.heard,
        replacements_heard: syncs.replacements_heard,
        synchronisations_missed: syncs.missed,
        synchronisations_late: counts.synchronisations_late,
        held: seen.log.held,
        overran: seen.log.overran,
        behind: seen.log.behind,
        unproven: counts.unproven,
        roles: counts.roles,
        lead_ns: seen.lead_ns.0,
        tunnel: shell.tunnel().map(|passed| tunnel(passed)),
        scheduled: seen.granted.word().into(),
        last: seen.log.windows.iter().flatten().map(used).collect(),
    }
}

fn tunnel(passed: &Passed) -> TunnelState {
    TunnelState {
        sent: passed.sent.get(),
        dropped: passed.dropped.get(),
        stray: passed.stray.get(),
        received: passed.received.get(),
        refused: passed.refused.get(),
    }
}

fn used(used: &Used) -> SlotUse {
    SlotUse {
        slot: match used.window.kind {
            WindowKind::Slot { index } => Some(index),
            WindowKind::Synchronisation { .. } => None,
        },
        begin_ns: used.window.begin_ns,
        end_ns: used.window.end_ns,
        off_ns: used.off_ns,
        by_kernel: used.by_kernel,
        datagrams: used.datagrams,
    }
}
