//! Traffic through the TCP router in the demo, as its clients count it; and the losses when it died.

use crate::look::newest;
use crate::look::summary::class_name;
use crate::nodes::net;
use crate::nodes::tables::lost;
use crate::terminal::Failure;
use crate::terminal::table::table;
use rohrpost::interfaces::{BeyondLink, BeyondState, CarriedLoss, ClassPassed, TcpInterface};
use rohrpost::{Class, ToolLink};
use rohrpost_config::Installation;
use std::collections::BTreeMap;

/// The reports of all nodes' clients; empty without a TCP router.
pub(super) fn ask(installation: &Installation, tool: &mut ToolLink) -> Result<Vec<BeyondLink>, Failure> {
    let mut links = Vec::new();
    for node in &installation.nodes {
        let Some(client) = installation.tcp_client_of(&node.name) else { continue };
        let named = |error| format!("client of the TCP router on {}: {error}", node.name);
        let (_, link) = newest(tool, client, TcpInterface::LINK).map_err(named)?;
        links.push(link);
    }
    Ok(links)
}

/// A class's counters, summed over all clients.
#[derive(Default)]
struct ClassSum {
    /// Addressed to the TCP router.
    meant: u64,
    left: u64,
    /// Replaced by newer ones, at the clients.
    replaced: u64,
    came: u64,
    delivered: u64,
    /// Losses by cause.
    lost: BTreeMap<String, u64>,
}

impl ClassSum {
    /// Written to a connection, and never received from another.
    fn on_way(&self) -> u64 {
        self.left.saturating_sub(self.came)
    }

    fn lose(&mut self, class: &ClassPassed) {
        for lost in &class.lost {
            *self.lost.entry(lost.cause.clone()).or_default() += lost.packages;
        }
    }
}

fn sums(links: &[BeyondLink]) -> BTreeMap<u8, ClassSum> {
    let mut sums: BTreeMap<u8, ClassSum> = BTreeMap::new();
    for link in links {
        for class in &link.sent {
            let sum = sums.entry(class.class).or_default();
            (sum.meant, sum.left) = (sum.meant + class.packages, sum.left + class.passed);
            sum.replaced += class.replaced;
            sum.lose(class);
        }
        for class in &link.received {
            let sum = sums.entry(class.class).or_default();
            (sum.came, sum.delivered) = (sum.came + class.packages, sum.delivered + class.passed);
            sum.lose(class);
        }
    }
    sums
}

/// Tables of classes and of clients; empty where there are none.
pub(super) fn text(installation: &Installation, links: &[BeyondLink], has_died: bool) -> String {
    if links.is_empty() {
        return String::new();
    }
    let all = sums(links);
    let is_any_on_way = all.values().any(|sum| sum.on_way() > 0);
    let rows = all.into_iter().rev().map(|(class, sum)| {
        let losses = sum.lost.iter().map(|(cause, packages)| CarriedLoss { cause: cause.clone(), packages: *packages });
        let losses: Vec<CarriedLoss> = losses.collect();
        [
            class_name(installation, Some(Class(class))),
            sum.meant.to_string(),
            sum.left.to_string(),
            sum.replaced.to_string(),
            sum.came.to_string(),
            sum.delivered.to_string(),
            sum.on_way().to_string(),
            lost(&losses),
        ]
    });
    let heads =
        ["class", ">meant to", ">left", ">replaced", ">came", ">delivered", ">lost on the way", "lost at the ends"];
    let mut text = String::from("\nThrough the TCP router, by class, as the clients of all nodes have counted:\n\n");
    text += &table(heads, rows);
    if has_died {
        text += "(lost on the way: with broken connections, or waiting in a TCP router that died, minus its own error \
            answers)\n";
    }
    if is_any_on_way {
        text += "(packages that newer ones replaced at the TCP router itself count as lost on the way here; `rohrpost \
            net` lists them separately)\n";
    }
    text + "\n" + &net::beyond::links(&links.iter().collect::<Vec<_>>())
}

/// Whether all clients are connected at the end.
pub(super) fn is_well(links: &[BeyondLink]) -> bool {
    links.iter().all(|link| link.state == BeyondState::Up)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_client_that_never_took_part_is_not_well() {
        let link = |state| BeyondLink { state, ..BeyondLink::default() };
        assert!(is_well(&[link(BeyondState::Up), link(BeyondState::Up)]));
        for state in [BeyondState::Away, BeyondState::Joining] {
            assert!(!is_well(&[link(BeyondState::Up), link(state)]), "{state:?}");
        }
    }
}
