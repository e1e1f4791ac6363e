//! Validates that every flow keeps its deadline with a table, and that waiting packages have room.

use super::{Validator, period_text};
use crate::flow::Flow;
use crate::mailbox::TRANSIT;
use crate::units::{duration_decimal, size_text};
use rohrpost_network::{FlowBound, KEPT_IN_BYTES, Remedy, TAKEN_BEFORE, TRANSIT_LOOK, Unbounded, round_up};
use std::time::Duration;

impl Validator<'_> {
    /// No flow publishes so fast that a package could miss each slot before the next package comes.
    pub(super) fn periods_of_flows(&self) {
        let node = |name| self.installation.node_of(name);
        let is_too_quick = |flow: &Flow| flow.period < TAKEN_BEFORE && node(flow.from) != node(flow.to);
        let flows = self.installation.flows.iter().enumerate();
        for (index, flow) in flows.filter(|(_, flow)| is_too_quick(flow)) {
            let right = self.plan.slower(self.tdma, index, |other| other.period < TAKEN_BEFORE).map_or_else(
                || "a longer `period`".into(),
                |period| format!("`period = \"{}\"`", duration_decimal(period)),
            );
            let text = |name| self.installation.classes.format(name);
            let message = format!(
                "[[flow]] from `{}` to `{}`: `period` {} is less than the {} that a package must be there before its \
                 slot, and a cycle is {}; put what comes meanwhile into one package, and write {right}",
                text(flow.from),
                text(flow.to),
                duration_decimal(flow.period),
                duration_decimal(TAKEN_BEFORE),
                duration_decimal(self.tdma.cycle)
            );
            self.reader.report(flow.line, message);
        }
    }

    /// Each flow keeps its deadline.
    pub(super) fn flows(&self) {
        for bound in self.plan.bounds(self.tdma) {
            let flow = &self.installation.flows[bound.flow];
            let deadline = duration_decimal(flow.deadline);
            let why = match bound.latency {
                Ok(bound) if bound.latency <= flow.deadline => continue,
                Ok(bound) => format!(
                    "a package may take {}, and must be there within {deadline}",
                    duration_decimal(round_up(bound.latency))
                ),
                Err(why) => format!("nothing says that a package is there within {deadline}: {why}"),
            };
            let right = match bound.latency {
                Err(Unbounded::NotRealTime) => {
                    "give the module that sends or subscribes a class from `bulk-below` of [network] up".into()
                }
                _ => self.remedy(bound.flow),
            };
            let text = |name| self.installation.classes.format(name);
            let what = format!("[[flow]] from `{}` to `{}`", text(flow.from), text(flow.to));
            self.reader.report(flow.line, format!("{what}: {why}; {right}"));
        }
    }

    /// The remedy with which a flow keeps its deadline.
    fn remedy(&self, flow: usize) -> String {
        match self.plan.remedy(self.tdma, flow) {
            Remedy::Longer(slot, longer) => {
                let by = duration_decimal(longer.length - self.tdma.slots[slot].length);
                let (described, length) = (self.described(slot), duration_decimal(longer.length));
                format!("lengthen {described} by {by}: `length = \"{length}\"`")
            }
            Remedy::Oftener(slot, oftener) => {
                let period = period_text(&oftener, &self.tdma.slots[slot]);
                format!("let {} come oftener: {period}", self.described(slot))
            }
            Remedy::Another(slot) => {
                let (offset, length) = (duration_decimal(slot.offset), duration_decimal(slot.length));
                let node = self.node_name(slot.node);
                format!("add a [[slot]]: `node = \"{node}\"`, `offset = \"{offset}\"`, `length = \"{length}\"`")
            }
            Remedy::Later(deadline) => {
                format!("no change of one slot suffices; allow `deadline = \"{}\"`", duration_decimal(deadline))
            }
            Remedy::Slower(period) => {
                let period = period.map(duration_decimal).map_or_else(
                    || "a longer `period`".into(),
                    |period| format!("`period = \"{period}\"` and a `deadline` no shorter"),
                );
                format!("no change of one slot suffices; write a smaller `size`, or {period}, or let others send less")
            }
        }
    }

    /// Of each flow one package may wait: it is there before the next. All packages of a module have room, since
    /// displaced ones have no bound.
    pub(super) fn quotas(&self) {
        let quota = self.installation.network.map_or(usize::MAX, |network| network.quota_bytes) as u64;
        let flows = self.plan.bounds(self.tdma).into_iter().map(|bound| &self.installation.flows[bound.flow]);
        let flows: Vec<_> = flows.collect();
        for module in &self.installation.modules {
            let own = || flows.iter().filter(|flow| module.names().any(|name| name == flow.from));
            let bytes: u64 = own().map(|flow| kept_bytes(flow.size)).sum();
            if let Some(flow) = own().next().filter(|_| bytes > quota) {
                let message = format!(
                    "[[flow]]s of `{}`: {} of them may wait at once, and its router keeps {} of a sender; write `quota \
                     = \"{}\"` in [network]",
                    self.installation.classes.format(module.name),
                    size_text(bytes.next_multiple_of(1 << 10)),
                    size_text(quota),
                    size_text(bytes.next_power_of_two())
                );
                self.reader.report(flow.line, message);
            }
        }
    }

    /// The mailbox of a node's router holds all packages of the node's flows that may wait for slots at once. That is
    /// either all in transit or, since the router takes all when more than half of the mailbox is full, all that come
    /// between two checks.
    pub(super) fn mailboxes(&self) {
        let bounds = self.plan.bounds(self.tdma);
        for (index, node) in (0..).zip(self.installation.lan_nodes()) {
            let is_own = |bound: &&FlowBound| {
                let from = self.installation.flows[bound.flow].from;
                self.installation.module(from).is_some_and(|module| module.node == node.name)
            };
            let own =
                || bounds.iter().filter(is_own).filter_map(|bound| Some((bound.flow, bound.latency.ok()?.latency)));
            let in_ns = |flow: usize, time: Duration| {
                1 + time.as_nanos() / self.installation.flows[flow].period.as_nanos().max(1)
            };
            let slots = self.tdma.slots.iter().filter(|slot| slot.node == index);
            let look = TRANSIT_LOOK + slots.map(|slot| slot.length).max().unwrap_or_default();
            let under_way: u128 = own().map(|(flow, latency)| in_ns(flow, latency)).sum();
            let behind_half: u128 = own().map(|(flow, _)| in_ns(flow, look)).sum();
            let most = under_way.min(behind_half + u128::from(TRANSIT.slots / 2));
            if let Some((flow, _)) = own().next().filter(|_| most > TRANSIT.slots.into()) {
                let message = format!(
                    "[[flow]]s from `{}`: {most} of their packages may wait for its slots at once, and the mailbox of \
                     its router holds {}; declare fewer, with one package for what goes to one module, or let slots of \
                     `{}` come oftener",
                    node.name, TRANSIT.slots, node.name
                );
                self.reader.report(self.installation.flows[flow].line, message);
            }
        }
    }
}

/// Bytes of a router's quota for a body.
fn kept_bytes(body_bytes: u32) -> u64 {
    u64::from(body_bytes).next_multiple_of(KEPT_IN_BYTES).max(KEPT_IN_BYTES)
}
