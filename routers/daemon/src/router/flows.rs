//! The latency of declared flows, as a router publishes it.

use rohrpost_config::ClassTable;
use rohrpost_mailbox::Name;
use rohrpost_modules::interfaces::{CarriedLoss, FlowState, FlowStates};
use rohrpost_routers::counts::Cause;
use rohrpost_routers::flows::{Flow, FlowCounts};
use rohrpost_routers::shell::Shell;
use std::time::Duration;

/// The present state.
pub(super) fn of(shell: &Shell, classes: &ClassTable) -> FlowStates {
    let (settings, counts) = (shell.settings(), shell.stats().flows.counts());
    FlowStates {
        node: settings.nodes[usize::from(settings.own)].name.clone(),
        flows: settings.flows.iter().zip(counts).map(|(flow, counts)| state(flow, counts, classes)).collect(),
    }
}

fn state(flow: &Flow, counts: &FlowCounts, classes: &ClassTable) -> FlowState {
    let name = |names: &[Name]| names.first().map(|name| classes.format(*name)).unwrap_or_default();
    let (latency, ns) = (counts.latency(), |time: Duration| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
    let measured = |time: Duration| Some(ns(time)).filter(|ns| *ns > 0);
    let lost = Cause::ALL.into_iter().map(|cause| (cause.word(), counts.lost(cause))).filter(|(_, n)| *n > 0);
    FlowState {
        from: name(&flow.from),
        to: name(&flow.to),
        carries: flow.carries.map(|carries| carries.to_string()).unwrap_or_default(),
        size: flow.size,
        packages: latency.count(),
        bound_ns: flow.bound.map(ns),
        kept_worst_ns: flow.bound.and(measured(counts.kept_worst())),
        worst_ns: measured(latency.max),
        mean_ns: latency.mean().map(ns),
        p99_ns: latency.quantile(0.99).map(ns),
        deadline_ns: ns(flow.deadline),
        over_bound: flow.bound.map(|_| counts.over_bound.get()),
        kept_over_bound: flow.bound.map(|_| counts.kept_over_bound.get()),
        over_deadline: counts.over_deadline.get(),
        lost: lost.map(|(cause, packages)| CarriedLoss { cause: cause.into(), packages }).collect(),
    }
}
