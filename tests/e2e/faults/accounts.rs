//! A bad network: every lost, delayed, duplicated and reordered package is accounted for.

use super::calls::{Calls, assert_once};
use super::flow::{PLAIN, Sink, Source, balance};
use super::{Field, TRANSIT_MAX};
use crate::harness::wait;
use std::time::{Duration, Instant};

const IMPAIR: &str = "loss=5%,delay=2ms,reorder=5%,duplicate=1%,seed=7";
const PACKAGES: u64 = 3000;
/// One call after so many packages.
const CALL_EVERY: u64 = 30;
/// Calls that are made at least.
const CALLS_MIN: usize = 20;
/// As many as a tool may have in flight.
const CALLS: usize = rohrpost_modules::call::REPLIES_KEPT;
/// Repeated after a third of it.
const CALL: Duration = Duration::from_millis(900);

#[test]
fn on_a_bad_network_accounts_balance_order_holds_and_no_call_runs_twice() {
    let Some(mut field) = Field::new(2, "") else { return };
    field.network.impair = IMPAIR;
    field.launch(&["base", "arm"]);
    let mut sink = Sink::new(field.robot("arm"), "arm");
    let mut source = Source::new(field.robot("base"), "base", "arm", PLAIN);
    // A younger server cannot tell whether its predecessor has run a repeated call, and answers that the outcome is
    // unknown.
    let (probe, old) = (field.robot("base").name("probe.1"), (CALL + TRANSIT_MAX).as_millis() as u64);
    wait("probe.1 is old enough", || {
        let mut tool = field.robot("base").tool(CALL);
        let status = tool.status(probe);
        tool.close();
        status.ok().filter(|status| status.uptime_ms > old)
    });
    let mut calls = Calls::new(&field, "base", "probe.1", CALL);
    let mut begun = Vec::new();
    while source.sent < PACKAGES || begun.len() < CALLS_MIN {
        let is_room = calls.look() < CALLS;
        if source.send() && source.sent.is_multiple_of(CALL_EVERY) && is_room {
            calls.begin(begun.len() as u32);
            begun.push(Instant::now());
        }
        sink.take(Duration::from_micros(500));
    }
    calls.settle();
    let accounts = balance(&field, &source, &mut sink, PLAIN);

    let numbers = sink.numbers(PLAIN);
    assert!(numbers.is_sorted_by(|one, next| one < next), "in order, none twice");
    // Of the 5 % that the network lost, every one is known; the other missing datagrams carried no package.
    let lost = source.sent / 40..source.sent / 10 + field.dropped("arm");
    assert!(lost.contains(&accounts.wire), "{accounts:?}, not {lost:?}");
    let peer = field.peer("arm", "base");
    assert!(accounts.datagrams_lost - accounts.wire <= accounts.datagrams_other, "{accounts:?}");
    assert!(peer.counters.duplicates > 0 && peer.counters.reordered > 0, "{peer:?}");
    let late = accounts.arm.lost.iter().find(|loss| loss.cause == "late").map_or(0, |loss| loss.packages);
    assert!(late > 0, "reordered datagrams are not delivered: {accounts:?}");

    // Each has three tries: with 10 % lost on the way there or back, hardly any is lost three times. One that lost a
    // try to a stall had fewer.
    let is_short = |number: &u32| {
        let begun = begun[*number as usize];
        field.stalls.stalled(begun, begun + CALL) >= CALL / 3
    };
    let failed = calls.answers.iter().filter(|(number, answer)| answer.is_err() && !is_short(number)).count();
    assert!(failed <= begun.len() / 10, "{:?}", calls.answers);
    assert_once(&field, "probe.1", &calls.close());
    drop((source, sink));
    field.stop();
}
