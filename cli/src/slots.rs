//! How nodes keep their time slots, as a table: used by `net` and by the demo's summary.

use super::table::table;
use super::units::{bytes, fine};
use rohrpost::interfaces::{SlotState, TunnelState};

/// A row for each node, and the reason for each silent node; empty if there are no slots.
pub(super) fn kept<'a>(slots: impl IntoIterator<Item = &'a SlotState>) -> String {
    let slots: Vec<&SlotState> = slots.into_iter().collect();
    if slots.is_empty() {
        return String::new();
    }
    let rows = slots.iter().map(|slots| {
        let off_ns = slots.last.iter().map(|used| used.off_ns.unsigned_abs()).max();
        [
            slots.node.clone(),
            slots.used.to_string(),
            slots.empty.to_string(),
            slots.late.to_string(),
            slots.skipped.to_string(),
            slots.silent.to_string(),
            slots.held.to_string(),
            off_ns.map_or("-".into(), |ns| fine(ns as f64 * 1e-9)),
            bytes(slots.wire_bytes as f64),
            slots.synchronisations_sent.to_string(),
            slots.synchronisations_late.to_string(),
            slots.synchronisations_heard.to_string(),
            slots.synchronisations_missed.to_string(),
            slots.replacements_sent.to_string(),
            slots.scheduled.clone(),
        ]
    });
    let heads = [
        "node",
        ">slots used",
        ">empty",
        ">late",
        ">skipped",
        ">silent",
        ">held",
        ">off by",
        ">sent",
        ">syncs sent",
        ">late",
        ">heard",
        ">missed",
        ">replaced",
        "scheduled",
    ];
    let silent = slots.iter().filter(|slots| !slots.why_silent.is_empty());
    let silent = silent.map(|slots| format!("node {} is silent: {}\n", slots.node, slots.why_silent));
    let hellos = slots.iter().filter(|slots| slots.unproven > 0).map(|slots| unproven(slots));
    let tunnels = slots.iter().filter_map(|slots| slots.tunnel.map(|tunnel| tunnelled(&slots.node, &tunnel)));
    table(heads, rows) + &silent.collect::<String>() + &hellos.collect::<String>() + &tunnels.collect::<String>()
}

/// Hellos that were sent at an unverified time.
fn unproven(slots: &SlotState) -> String {
    let hellos = if slots.unproven == 1 { "1 hello".into() } else { format!("{} hellos", slots.unproven) };
    format!("node {}: {hellos} sent by the time of an unverified node\n", slots.node)
}

/// Ordinary traffic in the slots; errors appear if there were any.
fn tunnelled(node: &str, tunnel: &TunnelState) -> String {
    let TunnelState { sent, dropped, stray, received, refused } = *tunnel;
    let wrong =
        [(dropped, "dropped, since too many waited"), (stray, "for nobody"), (refused, "not taken by the kernel")];
    let wrong = wrong.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!(", {count} {what}"));
    format!("tunnel of {node}: {sent} packets sent, {received} received{}\n", wrong.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unverified_hellos_are_reported_if_there_were_any() {
        let slots = |unproven| SlotState { node: "arm".into(), unproven, ..SlotState::default() };
        assert!(!kept([&slots(0)]).contains("hello"));
        let line = "node arm: 3 hellos sent by the time of an unverified node";
        assert!(kept([&slots(3)]).lines().any(|told| told == line));
        assert!(kept([&slots(1)]).contains("arm: 1 hello sent"));
    }

    #[test]
    fn a_tunnel_reports_errors_only_if_there_were_any() {
        let well = TunnelState { sent: 7, received: 5, ..TunnelState::default() };
        assert_eq!(tunnelled("arm", &well), "tunnel of arm: 7 packets sent, 5 received\n");
        let badly = TunnelState { dropped: 3, stray: 2, refused: 1, ..well };
        assert_eq!(
            tunnelled("arm", &badly),
            "tunnel of arm: 7 packets sent, 5 received, 3 dropped, since too many waited, 2 for nobody, 1 not taken \
            by the kernel\n"
        );
    }
}
