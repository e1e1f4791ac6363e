//! A device that stands still keeps up what is for its own peers: all others are sent to meanwhile, and are told that
//! the node is there.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "shell_common/mod.rs"]
#[allow(dead_code, reason = "made for two nodes in one namespace; a part of it serves here")]
mod common;

use common::{PATIENCE, Side, Words, label, router};
use rohrpost_mailbox::{Name, Node, Shape, monotonic_ns};
use rohrpost_network::Route;
use rohrpost_routers::lab::{Lab, LabError, NodeSpec};
use rohrpost_routers::link::PeerLinkState;
use rohrpost_routers::settings::{NodeSettings, Settings};
use rohrpost_routers::shell::{Parts, Shell};
use rohrpost_testbed::report;
use std::net::IpAddr;
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};

const NODES: [&str; 3] = ["n0", "n1", "n2"];
const ADDRESSES: [&str; 3] = ["10.91.0.1", "10.91.0.2", "10.91.0.3"];
/// What goes to the second node goes by a device that sends a datagram in some ten seconds.
const STALL: [&str; 6] = [
    "ip link add slow0 type veth peer name slow1",
    "ip link set slow0 up",
    "ip link set slow1 up",
    "tc qdisc add dev slow0 root tbf rate 1kbit burst 1600 limit 10000000",
    "ip neigh add 10.91.0.2 lladdr 02:00:00:00:00:77 dev slow0 nud permanent",
    "ip route add 10.91.0.2/32 dev slow0",
];

fn lab() -> Option<Lab> {
    let specs = NODES.iter().zip(ADDRESSES);
    let specs: Vec<_> =
        specs.map(|(name, address)| NodeSpec { name: (*name).into(), address: address.parse().unwrap() }).collect();
    match Lab::new(&specs, 1500) {
        Ok(lab) => Some(lab),
        Err(LabError::NotAllowed(error)) => skip(&format!("network namespaces ({error})")),
        Err(error) => panic!("{error}"),
    }
}

fn skip<T>(why: &str) -> Option<T> {
    report::skipped(why);
    None
}

/// Runs in the first node; whether it could.
fn run(lab: &Lab, line: &str) -> bool {
    let mut words = line.split(' ');
    let mut command = Command::new(words.next().unwrap());
    lab.command(NODES[0], command.args(words)).is_ok_and(|mut child| child.wait().is_ok_and(|ended| ended.success()))
}

fn module(node: u8) -> Name {
    common::module(node)
}

fn settings(own: u8, real_time_from: u16) -> Settings {
    let folder = tempfile::tempdir().unwrap();
    let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
    let addresses = [0, 1].map(|node: usize| ADDRESSES[node].parse::<IpAddr>().unwrap());
    let others = (0..3).filter(|node| *node != own);
    let address = |node: usize| ADDRESSES[node].parse().unwrap();
    Settings {
        own,
        nodes: (0..3).map(|node| NodeSettings { name: NODES[node].into(), address: address(node) }).collect(),
        routes: others.map(|node| Route { first: module(node), last: module(node).with_local(255), node }).collect(),
        hosts: [module(own), router(own)].map(|name| (name, name.with_local(u8::MAX))).into(),
        flows: Vec::new(),
        real_time_from,
        ..Side::new(own.min(1), node, addresses, None).settings
    }
}

#[test]
fn a_way_that_stands_still_keeps_nobody_else_waiting() {
    // The module's class is 100.
    for real_time_from in [0, 128] {
        let Some(lab) = lab() else { return };
        let folder = tempfile::Builder::new().prefix("rohrpost-stalled-").tempdir_in("/dev/shm").unwrap();
        let nodes = NODES.map(|name| Node::create(&folder.path().join(name), 0o700).unwrap());
        let start = |own: usize| {
            let _inside = lab.enter(NODES[own]).unwrap();
            let (settings, faults) = (settings(own as u8, real_time_from), Arc::new(Words));
            let (name, node) = (router(own as u8), &nodes[own]);
            Shell::start(Parts { node, name, settings, faults, sockets: Vec::new(), impair: None, clock: None })
                .unwrap()
        };
        let shells = [0, 1, 2].map(start);
        let join = |node: usize| rohrpost_mailbox::Participant::join(&nodes[node], Name::NONE).unwrap();
        let shape = Shape { slots: 64, ..Shape::default() };
        let mut receivers = [1, 2].map(|node: usize| join(node).receiver(module(node as u8), shape).unwrap());
        let mut senders = [1, 2].map(|node: u8| join(0).sender(module(node)).unwrap());
        let mut id = 0_u16;
        let mut goes = |to: usize| {
            let (began, first) = (Instant::now(), id.wrapping_add(1));
            loop {
                id = id.wrapping_add(1);
                let _ = senders[to].send(&label(module(0), 100, id), &[&[7; 1000]]);
                let until = Instant::now() + Duration::from_millis(20);
                let left = || until.saturating_duration_since(Instant::now());
                // Before it what waited so far may come, which is much.
                while let Some(came) = receivers[to].receive_timeout(left()) {
                    if came.head().id.wrapping_sub(first) < u16::MAX / 2 {
                        return;
                    }
                }
                assert!(began.elapsed() < PATIENCE, "nothing comes to node {}", to + 1);
            }
        };
        [0, 1].into_iter().for_each(&mut goes);
        if !STALL.iter().all(|line| run(&lab, line)) {
            return skip("no `ip` and `tc` with tbf").unwrap_or_default();
        }
        let began = Instant::now();
        let mut flood = join(0).sender(module(1)).unwrap();
        while began.elapsed() < Duration::from_secs(2) {
            // More than the kernel keeps of it.
            for _ in 0..8 {
                let _ = flood.send(&label(module(0), 100, 0), &[&[7; 1400]]);
            }
            goes(1);
            assert_ne!(shells[2].stats().state(0, monotonic_ns()), PeerLinkState::Silent, "a living node says so");
        }
        assert_eq!(shells[2].stats().state(0, monotonic_ns()), PeerLinkState::Alive, "and was heard all the while");
        assert!(run(&lab, "ip link del slow0"), "the stall ends");
        goes(0);
    }
}
