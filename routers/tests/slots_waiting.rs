//! A router that sends in time slots is killed between two of them: what waits for the next is still there.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "shell_common/mod.rs"]
mod common;

use common::{PATIENCE, Pair, Side, label, module, router, turns};
use rohrpost_config::TRANSIT;
use rohrpost_mailbox::sys::{Scheduling, schedule};
use rohrpost_mailbox::{Name, Node, Receiver, Sender, Shape, local, monotonic_ns};
use rohrpost_network::Tdma;
use rohrpost_routers::tdma::SlotTable;
use rohrpost_testbed::lan::{self, Killed};
use rohrpost_testbed::stalls::{Late, unless_stalled};
use std::net::IpAddr;
use std::panic::resume_unwind;
use std::time::{Duration, Instant};

const ROLE: &str = "ROHRPOST_TEST_ROUTER";
const ROUNDS: u16 = 10;
/// Fewer than what is taken from the mailbox so that it does not become full.
const PACKAGES: u16 = 20;
/// Long enough for a router that would take them from the mailbox as they come, short beside a cycle.
const AWHILE: Duration = Duration::from_millis(8);

/// With this number it says that slots have begun; it counts for nothing else.
const HELLO: u16 = u16::MAX;
/// A router wakes up so long before its slot at most.
const SPINS: Duration = Duration::from_millis(1);
/// A slot is over so long after a package of it came.
const SLOT_ENDS: Duration = Duration::from_millis(5);
/// From the first package to the end of the router; a slot is further away than that before it begins.
const LEFT: Duration = Duration::from_millis(30);
const _: () = assert!(AWHILE.as_nanos() < LEFT.as_nanos(), "a router that ends in time ends before its slot");

/// A slot each, far apart.
fn seldom() -> Tdma {
    Tdma { cycle: Duration::from_millis(60), ..turns() }
}

/// The router of node 0, in a process of its own: until it is killed.
#[test]
fn role() {
    let Ok(said) = std::env::var(ROLE) else { return };
    let [folder, first, second, incarnation] = said.split(' ').collect::<Vec<_>>().try_into().unwrap();
    let addresses = [first, second].map(|address| address.parse::<IpAddr>().unwrap());
    let mut side = Side::new(0, Node::open(folder.as_ref()).unwrap(), addresses, Some(seldom()));
    side.settings.incarnation = incarnation.parse().unwrap();
    side.start();
    loop {
        std::thread::park();
    }
}

fn start(side: &Side, incarnation: u16) -> Killed {
    let [first, second] = [0, 1].map(|node: usize| side.settings.nodes[node].address);
    let said = format!("{} {first} {second} {}", side.node.path().display(), 1000 + u64::from(incarnation));
    Killed(lan::role("role", ROLE, &said).spawn().unwrap())
}

/// The mailbox of node 0's router.
fn transit() -> Name {
    router(0).with_local(local::TRANSIT)
}

fn adopt(side: &Side) -> Receiver {
    let shape = Shape {
        slots: TRANSIT.slots,
        body_bytes_max: TRANSIT.size as u16,
        full: TRANSIT.full,
        max_age: TRANSIT.max_age,
        claims: TRANSIT.claims,
    };
    side.receiver(transit(), shape)
}

/// How long it is until the router of node 0 may wake up for its next slot, by the time that node 1 follows.
fn until_next_slot(pair: &Pair) -> Duration {
    let now_ns = pair.sides[1].shell.as_ref().unwrap().clock().unwrap().snapshot().record.at(monotonic_ns()).ns;
    let table = SlotTable::new(&seldom(), &[0], 0, 2, 28);
    // What lasts still counts, too: one window and the guard before it.
    let next_ns = table.next_slot(now_ns - seldom().guard.as_nanos() as u64).unwrap().begin_ns;
    Duration::from_nanos(next_ns.saturating_sub(now_ns)).saturating_sub(SPINS)
}

/// Waits until the router's slots have begun, and one has just taken what there was: the moment then, and how long it
/// is from there until the next, [`LEFT`] at least.
fn wait_for_a_slot(pair: &Pair, sender: &mut Sender, receiver: &mut Receiver) -> (Instant, Duration) {
    let began = Instant::now();
    let waiting = || pair.sides[0].node.look_at(transit()).map_or(0, |mailbox| mailbox.depth);
    let mut hello = || {
        // One at a time: of more than a slot takes, which come together while a router starts slowly, some always wait.
        if waiting() == 0 {
            let _ = sender.send(&label(module(0), 100, HELLO), &[b"hello"]);
        }
        receiver.receive_timeout(Duration::from_millis(100)).is_some()
    };
    loop {
        if hello() && waiting() == 0 {
            // It comes when its slot has just begun, which counts until it is over.
            std::thread::sleep(SLOT_ENDS);
            let (now, left) = (Instant::now(), until_next_slot(pair));
            if left >= LEFT {
                return (now, left);
            }
        }
        assert!(began.elapsed() < PATIENCE, "nothing comes");
    }
}

/// Packages are sent between two slots, and the router is killed before the next: all of them wait.
fn round(pair: &Pair, sender: &mut Sender, receiver: &mut Receiver, mut killed: Killed) -> Result<(), Late> {
    // Load that is not in real time must not keep this from what is to happen before the slot.
    let _ = schedule(Scheduling::Fifo(1));
    let (began, left) = wait_for_a_slot(pair, sender, receiver);
    for id in 0..PACKAGES {
        sender.send(&label(module(0), 100, id), &[b"waits for a slot"]).unwrap();
    }
    std::thread::sleep(AWHILE);
    killed.0.kill().unwrap();
    // Its threads in real time are gone at once; the rest of the process may take longer.
    let took = began.elapsed();
    drop(killed);
    let ids = |mailbox: &mut Receiver| {
        let numbers = std::iter::from_fn(|| mailbox.try_receive().map(|package| package.head().id));
        numbers.filter(|id| *id != HELLO).collect::<Vec<_>>()
    };
    // What the killed router has sent is not on its way any more, but the other may not have taken it yet.
    let (waits, came) = (ids(&mut adopt(&pair.sides[0])), ids(receiver));
    assert!((0..PACKAGES).collect::<Vec<_>>().starts_with(&came), "in order, none twice: {came:?}");
    assert!((0..PACKAGES).collect::<Vec<_>>().ends_with(&waits), "in order, none twice: {waits:?}");
    assert!(came.len() + waits.len() <= PACKAGES.into(), "{came:?} came, and {waits:?} wait");
    if took >= left {
        let what = format!("the router was killed {:?} after its slot had begun", took - left);
        return Err(Late::now(what, began, left - AWHILE));
    }
    assert_eq!((came.len(), waits.len()), (0, PACKAGES.into()), "no slot came: all wait");
    Ok(())
}

#[test]
fn what_waits_for_a_slot_outlives_a_router_that_is_killed() {
    unless_stalled(|_| {
        let mut pair = Pair::with(Some(seldom()));
        pair.sides[0].shell = None;
        let there = Shape { slots: 256, ..Shape::default() };
        let mut receiver = pair.sides[1].receiver(module(1), there);
        let mut sender = pair.sides[0].sender(module(1));
        (0..ROUNDS).try_for_each(|number| {
            let killed = start(&pair.sides[0], number);
            let round = || round(&pair, &mut sender, &mut receiver, killed);
            // In a thread of its own: routers would inherit how it is scheduled.
            std::thread::scope(|scope| scope.spawn(round).join()).unwrap_or_else(|panic| resume_unwind(panic))
        })
    });
}
