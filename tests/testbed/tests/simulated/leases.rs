//! Networks with a module that several nodes may run: launches ask for its lease by packages, and routers take what it
//! sends from the holder alone.

use super::{asked, validate};
use rohrpost_testbed::sim::plan::Plan;

/// Networks without being asked for more.
const SEEDS: u64 = 200;
/// Networks with time slots, which take longer.
const SLOTTED_SEEDS: u64 = 60;
/// What must have been seen so often in each hundred networks.
const SEEN_IN_A_HUNDRED: [(&str, u64); 7] = [
    ("leases given", 150),
    ("heard a holder", 40_000),
    ("a stopped holder goes on", 10),
    ("a holder is refused", 50),
    ("node killed", 150),
    ("frozen", 100),
    ("lost on the wire", 5_000),
];
const SEEN_IN_A_HUNDRED_SLOTTED: [(&str, u64); 4] =
    [("leases given", 150), ("heard a holder", 40_000), ("a stopped holder goes on", 10), ("node killed", 150)];
/// What must have been seen where nothing goes wrong but deaths.
const SEEN_IN_A_HUNDRED_CALM: [(&str, u64); 2] = [("leases given", 200), ("node killed", 290)];

#[test]
fn leases_keep_their_promises() {
    validate("leases_keep_their_promises", asked(SEEDS), Plan::leased, &SEEN_IN_A_HUNDRED);
}

#[test]
fn leases_in_time_slots_keep_their_promises() {
    validate("leases_in_time_slots", asked(SLOTTED_SEEDS), Plan::leased_slotted, &SEEN_IN_A_HUNDRED_SLOTTED);
}

/// Each death is followed by a new holder, in time.
#[test]
fn a_dead_holder_is_followed_by_another_in_time() {
    validate("a_dead_holder_is_followed", asked(SEEDS) / 2, Plan::leased_calm, &SEEN_IN_A_HUNDRED_CALM);
}

/// In time slots that takes some cycles.
#[test]
fn a_dead_holder_in_time_slots_is_followed_by_another_in_some_cycles() {
    let seeds = asked(SLOTTED_SEEDS) / 4;
    validate("a_dead_holder_in_time_slots", seeds, Plan::leased_slotted_calm, &SEEN_IN_A_HUNDRED_CALM);
}
