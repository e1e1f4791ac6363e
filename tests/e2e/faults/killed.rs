//! Routers are killed, again and again, while packages are in flight.

use super::calls::{Calls, assert_once};
use super::flow::{BULK, Sink, Source};
use super::{Field, router_of};
use crate::harness::{runs, signal, times, until};
use nix::sys::signal::Signal;
use rohrpost::{CallError, Class, Fault};
use rohrpost_mailbox::{Loss, local};
use rohrpost_routers::outbound::WAIT_MAX_NS;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Calls are answered again within this time after a router was killed: launch waits 100 ms, the router starts, and
/// they take some milliseconds; the rest is for a computer so busy that a call must be repeated.
const ANSWERED_WITHIN: Duration = Duration::from_secs(20);
/// A call answered within this time was sent once: a call is repeated after a third of its timeout.
const ONE_TRY: Duration = Duration::from_secs(10);
/// A package that has waited longer is not sent any more.
const TOO_LATE: Duration = Duration::from_nanos(WAIT_MAX_NS);
/// As many as a tool may have in flight.
const WAITING: usize = rohrpost_modules::call::REPLIES_KEPT;
/// These are repeated several times meanwhile.
const MANY_TRIES: Duration = Duration::from_millis(900);

/// Numbered data from node to node, a thousand a second, all the time. They fill the mailbox of a dead router, and give
/// way there to more important packages.
struct Traffic {
    ends: Arc<AtomicBool>,
    thread: JoinHandle<Vec<u64>>,
}

impl Traffic {
    fn new(field: &Field, from: &str, to: &str) -> Self {
        let mut source = Source::new(field.robot(from), from, to, BULK);
        let mut sink = Sink::new(field.robot(to), to);
        let ends = Arc::new(AtomicBool::new(false));
        let until = ends.clone();
        let flow = move || {
            while !until.load(Ordering::Relaxed) {
                source.send();
                std::thread::sleep(Duration::from_millis(1));
                sink.take(Duration::ZERO);
            }
            sink.numbers(BULK)
        };
        Self { ends, thread: std::thread::spawn(flow) }
    }

    /// The received numbers.
    fn end(self) -> Vec<u64> {
        self.ends.store(true, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}

/// Packages that grew too old in the mailbox of a router.
fn stale(field: &Field, node: &str) -> u64 {
    let mailbox = field.robot(node).name(&router_of(node)).with_local(local::TRANSIT);
    let rows = field.robot(node).node.look_at(mailbox).map(|mailbox| mailbox.classes).unwrap_or_default();
    rows.iter().filter(|row| row.class == Some(Class(16))).map(|row| row.lost(Loss::Stale)).sum()
}

/// Outcomes of the packages of tools, for diagnosis.
fn account(field: &Field, node: &str, other: &str) -> String {
    let mailbox = field.robot(node).name(&router_of(node)).with_local(local::TRANSIT);
    let rows = field.robot(node).node.look_at(mailbox).map(|mailbox| mailbox.classes).unwrap_or_default();
    let transit: Vec<_> = rows.iter().map(|row| (row.class, row.received, row.losses)).collect();
    format!("transit {transit:?}\n{:?}\n{:?}", field.links(node), field.links(other))
}

#[test]
fn a_router_that_is_killed_again_and_again_loses_nothing_that_waits_for_it_and_nothing_runs_twice() {
    let Some(field) = Field::launched() else { return };
    let traffic = [Traffic::new(&field, "base", "arm"), Traffic::new(&field, "arm", "base")];
    let mut numbers = 0..;
    let mut answers = [Vec::new(), Vec::new()];
    // For a long run: `ROHRPOST_FAULT_ROUNDS=1000 cargo test --test e2e faults::killed`.
    for round in 0..times("ROHRPOST_FAULT_ROUNDS", 10) {
        // The other node's probe is called, so that commands wait in the mailbox of the killed router.
        let (node, other, probe) = if round % 2 == 0 { ("base", "arm", 1) } else { ("arm", "base", 0) };
        let (before, stale_before) = (field.peer(other, node).counters.restarts, stale(&field, node));
        // The pause before a restart grows if there were others within a second.
        until(format!("{node} ran for a while"), || field.links(node).uptime_ms > 1000);
        let module = format!("probe.{probe}");
        let mut under_way = Calls::new(&field, node, &module, MANY_TRIES);
        let mut waiting = Calls::new(&field, node, &module, 3 * ONE_TRY);
        let pid = field.router(node);
        numbers.by_ref().take(6).for_each(|number| under_way.begin(number));
        signal(pid, Signal::SIGKILL);
        let killed = Instant::now();
        until(format!("{pid} is gone"), || !runs(pid));
        numbers.by_ref().take(WAITING).for_each(|number| waiting.begin(number));
        waiting.settle();
        let took = killed.elapsed();
        assert!(
            field.stalls.ran(killed) < ANSWERED_WITHIN,
            "round {round}, {took:?}: {}",
            account(&field, node, other)
        );
        if took < ONE_TRY {
            // The next router carried the waiting packages; late ones it reports.
            let is_late = |answer: &Result<u64, CallError>| {
                matches!(answer, Err(CallError::Fault(_, Fault::Delayed))) && took > TOO_LATE
            };
            let good = |(_, answer): &(u32, Result<u64, CallError>)| answer.is_ok() || is_late(answer);
            assert!(waiting.answers.iter().all(good), "{took:?}: {:?}", waiting.answers);
        } else {
            // The next router came when they were so old that its mailbox dropped them; they are counted.
            assert!(stale(&field, node) > stale_before, "round {round}, {took:?}: {}", account(&field, node, other));
        }
        under_way.settle();
        answers[probe].extend(waiting.close());
        answers[probe].extend(under_way.close());
        field.robot(node).wait_restarted(&router_of(node), pid);
        until(format!("{other} has heard of it"), || field.peer(other, node).counters.restarts > before);
    }
    field.wait_told("router.0", &["the router of node arm", "was started anew"], 1);
    field.wait_told("router.1", &["the router of node base", "was started anew"], 1);
    for (probe, answers) in answers.iter().enumerate() {
        assert_once(&field, &format!("probe.{probe}"), answers);
    }
    for came in traffic.map(Traffic::end) {
        // Packages that a router had in hand when it died are sent again by the next one.
        assert!(came.len() > 1000 && came.is_sorted(), "{} came", came.len());
    }
    field.stop();
}
