//! A router that sends in time slots is killed between two of them: what waits for the next is still there.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "shell_common/mod.rs"]
mod common;

use common::{PATIENCE, Pair, Side, label, module, router, turns};
use rohrpost_config::TRANSIT;
use rohrpost_mailbox::{Name, Node, Receiver, Shape, local};
use rohrpost_network::Tdma;
use rohrpost_testbed::stall_detector::{Watched, repeated_on_stall};
use std::net::IpAddr;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const ROLE: &str = "ROHRPOST_TEST_ROUTER";
const ROUNDS: u16 = 10;
/// Fewer than what is taken from the mailbox so that it does not become full.
const PACKAGES: u16 = 20;
/// Long enough for a router that would take them from the mailbox as they come, short beside a cycle.
const AWHILE: Duration = Duration::from_millis(8);

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

struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn start(side: &Side, incarnation: u16) -> Killed {
    let [first, second] = [0, 1].map(|node: usize| side.settings.nodes[node].address);
    let said = format!("{} {first} {second} {}", side.node.path().display(), 1000 + u64::from(incarnation));
    let mut child = Command::new(std::env::current_exe().unwrap());
    child.args(["--exact", "role", "--nocapture", "--test-threads=1"]).env(ROLE, said);
    Killed(child.stdin(Stdio::null()).stdout(Stdio::null()).spawn().unwrap())
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

#[test]
fn what_waits_for_a_slot_outlives_a_router_that_is_killed() {
    repeated_on_stall(Watched::RealTime, || {
        let mut pair = Pair::with(Some(seldom()));
        pair.sides[0].shell = None;
        let there = Shape { slots: 256, ..Shape::default() };
        let mut receiver = pair.sides[1].receiver(module(1), there);
        let mut sender = pair.sides[0].sender(module(1));
        let waiting = || pair.sides[0].node.look_at(transit()).map_or(0, |mailbox| mailbox.depth);
        let mut kept = 0;
        for round in 0..ROUNDS {
            let killed = start(&pair.sides[0], round);
            // Its slots have begun, and one has just taken what there was.
            let began = Instant::now();
            let mut hello = || {
                let _ = sender.send(&label(module(0), 100, u16::MAX), &[b"hello"]);
                receiver.receive_timeout(Duration::from_millis(100)).is_some()
            };
            while !hello() || waiting() > 0 {
                assert!(began.elapsed() < PATIENCE, "round {round}: nothing comes");
            }
            for id in 0..PACKAGES {
                sender.send(&label(module(0), 100, id), &[b"waits for a slot"]).unwrap();
            }
            std::thread::sleep(AWHILE);
            drop(killed);
            let mut left = adopt(&pair.sides[0]);
            let ids: Vec<_> = std::iter::from_fn(|| left.try_receive().map(|package| package.head().id)).collect();
            // On a busy computer a slot may have come in between.
            kept += u16::from(ids == (0..PACKAGES).collect::<Vec<_>>());
            println!("round {round}: {} of {PACKAGES} left", ids.len());
            while receiver.try_receive().is_some() {}
        }
        assert!(kept * 2 >= ROUNDS, "all were kept in {kept} of {ROUNDS} rounds");
    });
}
