//! Processes of a node stop for seconds, as on a swapping computer, and go on.

use super::calls::Calls;
use super::{AT_ONCE, Field, TRANSIT_MAX};
use crate::harness::{PATIENCE, halt, signal, until};
use nix::sys::signal::Signal;
use rohrpost::Fault;
use rohrpost::interfaces::LinkState;
use std::time::{Duration, Instant};

/// Longer than any package may be in flight.
const FROZEN: Duration = Duration::from_millis(500).saturating_add(TRANSIT_MAX);

/// Begins calls of these numbers, which nobody can take, and waits until they are too old to run.
fn grow_old(field: &Field, node: &str, module: &str, numbers: std::ops::Range<u32>) {
    let begun = Instant::now();
    let mut calls = Calls::new(field, node, module, PATIENCE);
    numbers.for_each(|number| calls.begin(number));
    until("they are old", || begun.elapsed() > FROZEN);
    calls.forget();
    calls.close();
}

/// Checks the reports about a node with these frozen processes; then it goes on, and all is as before.
fn freeze_arm(field: &Field, pids: &[u32], old: std::ops::Range<u32>, after: u32) {
    let silent = field.lines("router.0", &["node arm", "is silent"]).len();
    pids.iter().for_each(|pid| halt(*pid));
    grow_old(field, "base", "probe.1", old);
    field.wait_for_state("base", "arm", LinkState::Silent);
    let fault = field.fault("base", "probe.1");
    assert_eq!(fault, Fault::NodeSilent { node: "arm".into() });
    assert!(fault.to_string().contains("node arm is silent"), "{fault}");
    field.wait_told("router.0", &["node arm", "is silent", "is it on"], silent + 1);
    pids.iter().for_each(|pid| signal(*pid, Signal::SIGCONT));
    let continued = Instant::now();
    field.wait_counted("base", "probe.1", after);
    assert!(field.stalls.ran(continued) < AT_ONCE, "after {:?}", continued.elapsed());
    field.wait_for_state("base", "arm", LinkState::Alive);
    field.wait_for_state("arm", "base", LinkState::Alive);
    field.wait_told("router.0", &["node arm", "is heard"], silent + 2);
}

#[test]
fn what_grew_old_while_a_router_or_a_node_was_frozen_is_never_run() {
    let Some(field) = Field::launched() else { return };
    field.wait_counted("base", "probe.1", 1);
    freeze_arm(&field, &[field.router("arm")], 10..20, 2);

    let arm = field.robot("arm");
    let all = [field.launcher("arm").pid(), field.router("arm"), arm.pid("probe.1")];
    freeze_arm(&field, &all, 20..30, 3);

    // The router of the callers' own node: their commands wait in its mailbox.
    let router = field.router("base");
    let blamed = || field.lines("router.0", &["node arm", "is silent"]).len();
    let blamed_before = blamed();
    halt(router);
    grow_old(&field, "base", "probe.1", 30..40);
    field.wait_for_state("arm", "base", LinkState::Silent);
    signal(router, Signal::SIGCONT);
    field.wait_counted("base", "probe.1", 4);
    field.wait_counted("arm", "probe.0", 5);
    assert_eq!(blamed(), blamed_before, "a router that stood still blames nobody");

    let counted = field.counted("probe.1");
    assert!((1..5).all(|number| counted.contains(&number)), "{counted:?}");
    assert!(counted.iter().all(|number| *number < 5), "what was old was run: {counted:?}");
    field.stop();
}
