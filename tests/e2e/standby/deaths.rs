//! Real deaths: from the moment at which all processes of a node are killed to the first answer of the node that
//! stands by.

use super::{CALL, again, config, die, is_on};
use crate::harness::{Place, wait};
use crate::network::{NETWORK, Network, addresses};
use crate::probe::{COUNT, ProbingInterface};
use rohrpost::wire::{append, from_bytes};
use rohrpost_config::{Installation, LeaseTimes};
use rohrpost_testbed::stalls::{Late, Stalls, unless_stalled};
use std::time::{Duration, Instant};

/// How often a node dies; `ROHRPOST_STANDBY_DEATHS` says another number.
const DEATHS: usize = 3;
/// A caller tries again after this time.
const PATIENCE: Duration = Duration::from_millis(20);

/// In place of the free network.
const SLOTS: &str = r#"
[network]
security = "none"
mode = "tdma"
[tdma]
cycle = "5 ms"
synchronisation = "500 us"
guard = "150 us"
link = "100 Mbit/s"
[[slot]]
node = "base"
offset = "500 us"
length = "1.5 ms"
[[slot]]
node = "brain"
offset = "2 ms"
length = "1.5 ms"
[[slot]]
node = "desk"
offset = "3.5 ms"
length = "1.5 ms"
[time]
source = "master"
masters = ["base"]
"#;

#[test]
fn the_next_node_answers_soon_after_a_death() {
    unless_stalled(|stalls| all_deaths(NETWORK, Duration::from_millis(1200), stalls));
}

#[test]
fn in_time_slots_the_next_node_answers_within_cycles() {
    unless_stalled(|stalls| all_deaths(SLOTS, Duration::from_millis(150), stalls));
}

/// Nine of ten are answered within the limit, two of three; and no lease is lost but by a death.
fn all_deaths(network: &str, limit: Duration, stalls: &Stalls) -> Result<(), Late> {
    let count = std::env::var("ROHRPOST_STANDBY_DEATHS").ok().and_then(|count| count.parse().ok()).unwrap_or(DEATHS);
    let ([base, brain], [desk, _]) = (addresses(), addresses());
    let place = Place::new();
    let config = config(&place, [&base, &brain, &desk], network, &["probe.0"], super::SLOW);
    // Time slots are kept by threads that go before all others.
    let text = std::fs::read_to_string(&config).unwrap();
    let text = if network == SLOTS { text.replace("real-time-from = 256", "real-time-from = 90") } else { text };
    std::fs::write(&config, text).unwrap();
    let times = Installation::load(&config).unwrap().lease_times();
    let mut lan = Network::new(place, config, None).launched(&super::NODES);
    let mut taken = Vec::new();
    let (mut holder, mut next) = ("brain", "desk");
    let mut begun = Instant::now();
    for _ in 0..count {
        keeps(&lan, (holder, next), begun, times)?;
        let pid = lan.robot(next).pid("probe.0");
        let (since, took) = death(&lan, holder);
        begun = since + took;
        let stalled = stalls.stalled(since, begun);
        println!("{holder} is dead; {next} answers after {took:?} (a processor stood still for {stalled:?})");
        taken.push((took, since));
        again(&mut lan, holder);
        (holder, next) = (next, holder);
        if lan.robot(holder).process("probe.0").is_none_or(|process| process.pid != pid) {
            return Err(lost(holder, begun, times));
        }
    }
    keeps(&lan, (holder, next), begun, times)?;
    taken.sort_unstable();
    let (p90, since) = taken[(9 * count / 10).max(1) - 1];
    let [(p50, _), (most, _)] = [taken[count / 2], taken[count - 1]];
    println!("{count} deaths, a lease of {:?}: p50 {p50:?}, p90 {p90:?}, max {most:?}", times.lease);
    let late = Late { what: format!("p90 {p90:?}"), since, until: since + p90, by: p90.saturating_sub(limit) };
    if p90 <= limit { Ok(()) } else { Err(late) }
}

/// Until the holder answers and the next one stands by, unless they have changed places: nobody has died since then.
fn keeps(lan: &Network, (holder, next): (&str, &str), since: Instant, times: LeaseTimes) -> Result<(), Late> {
    wait(format!("{holder} answers and {next} stands by"), || {
        if is_on(lan, next) {
            return Some(Err(lost(holder, since, times)));
        }
        let is_kept = is_on(lan, holder) && lan.robot(next).state("probe.0") == "stands by";
        (is_kept && lan.robot("base").count("probe.0", 0, CALL).is_ok()).then_some(Ok(()))
    })
}

/// A holder that lives has lost its lease. An answer may take as long as the time between two questions: when a stall
/// begins the newest grant is at most two of these old, and when it is over the next one comes within two.
fn lost(holder: &str, since: Instant, times: LeaseTimes) -> Late {
    Late::now(format!("{holder} has lost its lease"), since, times.lease - times.off - 4 * times.ask_every)
}

/// When all processes of a node died, and how long it took until another one answered.
fn death(lan: &Network, node: &str) -> (Instant, Duration) {
    let base = lan.robot("base");
    let (mut tool, name) = (base.tool(PATIENCE), base.name("probe.0"));
    let mut calls = |number: u32| {
        let write = |body: &mut Vec<u8>| append(body, &(number,));
        tool.call(name, COUNT, ProbingInterface::hash(), write, |bytes| from_bytes::<u64>(bytes))
    };
    let since = Instant::now();
    die(lan, node);
    // What it had answered before it died.
    let mut number = 0;
    while calls(number).is_err() {
        number += 1;
        assert!(since.elapsed() < Duration::from_secs(20), "nobody answers");
    }
    let took = since.elapsed();
    tool.close();
    (since, took)
}
