//! How nodes keep their time slots, as a table: of `net`, and of the demo's summary.

use super::table::table;
use super::units::{bytes, fine};
use rohrpost::interfaces::SlotState;

/// A row for each node, and why those are silent that are; empty without any.
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
            off_ns.map_or("-".into(), |ns| fine(ns as f64 * 1e-9)),
            bytes(slots.wire_bytes as f64),
            slots.synchronisations_sent.to_string(),
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
        ">off of late",
        ">sent",
        ">syncs sent",
        ">heard",
        ">missed",
        ">replaced",
        "scheduled",
    ];
    let silent = slots.iter().filter(|slots| !slots.why_silent.is_empty());
    let silent = silent.map(|slots| format!("node {} is silent: {}\n", slots.node, slots.why_silent));
    table(heads, rows) + &silent.collect::<String>()
}
