//! Routers are killed, again and again, while packages are under way.

use super::calls::{Calls, assert_once};
use super::{Field, router_of};
use crate::harness::{runs, signal, wait};
use nix::sys::signal::Signal;
use std::time::{Duration, Instant};

/// Calls are answered again within this time after a router was killed: launch waits 100 ms, the router starts; the rest is for a busy
/// computer.
const ANSWERED_WITHIN: Duration = Duration::from_secs(15);
/// A call is repeated after a third of this: so what is answered within [`ANSWERED_WITHIN`] was sent once.
const ONE_TRY: Duration = Duration::from_secs(60);
/// As many as a tool may have under way.
const WAITING: usize = 8;
/// These are repeated several times meanwhile.
const MANY_TRIES: Duration = Duration::from_millis(900);

/// How often: for a long run, `ROHRPOST_FAULT_ROUNDS=1000 cargo test --test e2e faults::killed`.
fn rounds() -> u32 {
    std::env::var("ROHRPOST_FAULT_ROUNDS").ok().map_or(10, |rounds| rounds.parse().unwrap())
}

#[test]
fn a_router_that_is_killed_again_and_again_loses_nothing_that_waits_for_it_and_nothing_runs_twice() {
    let Some(field) = Field::launched() else { return };
    let mut numbers = 0..;
    let mut answers = [Vec::new(), Vec::new()];
    for round in 0..rounds() {
        // The other node's probe is called, so that commands wait in the mailbox of the router that is killed.
        let (node, other, probe, restarts) = match round % 2 {
            0 => ("base", "arm", 1, round / 2 + 1),
            _ => ("arm", "base", 0, round / 2 + 1),
        };
        let module = format!("probe.{probe}");
        let mut under_way = Calls::new(&field, node, &module, MANY_TRIES);
        let mut waiting = Calls::new(&field, node, &module, ONE_TRY);
        let pid = field.router(node);
        numbers.by_ref().take(6).for_each(|number| under_way.begin(number));
        signal(pid, Signal::SIGKILL);
        let killed = Instant::now();
        wait(format!("{pid} is gone"), || (!runs(pid)).then_some(()));
        numbers.by_ref().take(WAITING).for_each(|number| waiting.begin(number));
        waiting.settle();
        assert!(killed.elapsed() < ANSWERED_WITHIN, "after {:?}", killed.elapsed());
        assert_eq!(
            waiting.answered().len(),
            WAITING,
            "what waited was carried by the next router: {:?}",
            waiting.answers
        );
        under_way.settle();
        answers[probe].extend(waiting.close());
        answers[probe].extend(under_way.close());
        field.robot(node).wait_restarted(&router_of(node), pid);
        wait(format!("{other} has heard of {restarts} restarts"), || {
            (field.peer(other, node).restarts >= u64::from(restarts)).then_some(())
        });
    }
    field.wait_told("router.0", &["the router of node arm", "was started anew"], 1);
    field.wait_told("router.1", &["the router of node base", "was started anew"], 1);
    for (probe, answers) in answers.iter().enumerate() {
        assert_once(&field, &format!("probe.{probe}"), answers);
    }
    field.stop();
}
