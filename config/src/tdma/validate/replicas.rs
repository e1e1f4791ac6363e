//! Validates that replicas have room in what slots leave behind packages.

use super::Validator;
use crate::replica::Replica;
use crate::units::{count_text, duration_decimal, size_about, size_text};
use rohrpost_network::PlannedReplica;

/// Parts in a second are counted in thousandths.
const THOUSANDTHS: u64 = 1000;

/// A replica with a known load.
struct Load<'a> {
    replica: &'a Replica,
    planned: PlannedReplica,
    /// Parts that it asks for in a second, in thousandths.
    asks: u64,
}

impl Validator<'_> {
    /// What is known of their load fits into what the slots of each node leave for sure.
    pub(super) fn replicas(&self) {
        (0..).zip(self.installation.lan_nodes()).for_each(|(node, _)| self.replicas_of(node));
    }

    fn replicas_of(&self, node: u8) {
        let all = self.plan.replicas.iter().zip(&self.installation.replicas);
        let own = all.filter_map(|(planned, replica)| {
            let planned = planned.filter(|planned| planned.node == node)?;
            Some(Load { replica, planned, asks: planned.asks(&self.plan.link)? })
        });
        let mut own: Vec<_> = own.collect();
        // As they leave.
        own.sort_by_key(|load| load.replica.level(self.installation));
        let mut left = self.plan.parts_left(self.tdma, node);
        let mut asked = 0_u64;
        for load in own {
            asked = asked.saturating_add(load.asks);
            let Some(rest) = left.checked_sub(load.asks) else {
                // Consequences for the less important ones are not reported.
                return self.report_load(&load, left, asked);
            };
            left = rest;
        }
    }

    /// `left` for it by more important replicas; `asked` by it and these.
    fn report_load(&self, Load { replica, planned, asks }: &Load<'_>, left: u64, asked: u64) {
        let PlannedReplica { node, receivers, record_bytes, .. } = *planned;
        let (link, parts) = (&self.plan.link, planned.parts(&self.plan.link));
        let nodes = count_text(receivers as usize, "node");
        let load = format!(
            "{} of its records, each of {} and so of {} to {nodes}, are {} parts a second",
            replica.sampling,
            size_text(record_bytes.into()),
            count_text(parts as usize, "part"),
            asks.div_ceil(THOUSANDTHS)
        );
        let (whole, name) = (left / THOUSANDTHS, self.node_name(node));
        let bytes = size_about(whole * link.part_bytes() as u64);
        let before = if asked > *asks { " and more important replicas" } else { "" };
        let slower = format!("{:?}", (left / parts) as f64 / THOUSANDTHS as f64);
        let slower = (left >= parts).then(|| format!("write `rate = {slower}` or less"));
        let longer = self.plan.longer_for_parts(self.tdma, node, asked).map(|(slot, longer)| {
            let by = duration_decimal(longer.length - self.tdma.slots[slot].length);
            let length = duration_decimal(longer.length);
            format!("lengthen {} by {by}: `length = \"{length}\"`", self.described(slot))
        });
        let right: Vec<String> = slower.into_iter().chain(longer).collect();
        let right = if right.is_empty() { "drop it, or give the node more slots".into() } else { right.join(", or ") };
        let text = replica.text(self.installation);
        self.reader.report(
            replica.line,
            format!(
                "[[replica]] of `{text}`: {load}, and slots of `{name}` leave {whole} of them ({bytes}) for sure \
                 behind flows{before}; {right}"
            ),
        );
    }
}
