//! A device that stands still keeps up what is for its own peers: all others are sent to meanwhile, and are told that
//! the node is there.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "shell_common/mod.rs"]
#[allow(dead_code, reason = "made for two nodes in one namespace; a part of it serves here")]
mod common;

use common::{PATIENCE, Words, label, module, router};
use rohrpost_mailbox::{Name, Node, Shape, monotonic_ns};
use rohrpost_routers::lab::Lab;
use rohrpost_routers::link::PeerLinkState;
use rohrpost_routers::settings::Settings;
use rohrpost_routers::shell::{Parts, Shell};
use rohrpost_testbed::{lan, report};
use std::net::IpAddr;
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};

const NODES: [&str; 3] = ["n0", "n1", "n2"];
/// What goes to the second node goes by a device that sends a datagram in some ten seconds.
const STALL: [&str; 6] = [
    "ip link add slow0 type veth peer name slow1",
    "ip link set slow0 up",
    "ip link set slow1 up",
    "tc qdisc add dev slow0 root tbf rate 1kbit burst 1600 limit 10000000",
    "ip neigh add 10.91.0.2 lladdr 02:00:00:00:00:77 dev slow0 nud permanent",
    "ip route add 10.91.0.2/32 dev slow0",
];

fn addresses() -> [IpAddr; 3] {
    [1, 2, 3].map(|host| IpAddr::from([10, 91, 0, host]))
}

/// Runs in the first node; whether it could.
fn run(lab: &Lab, line: &str) -> bool {
    let mut words = line.split(' ');
    let mut command = Command::new(words.next().unwrap());
    lab.command(NODES[0], command.args(words)).is_ok_and(|mut child| child.wait().is_ok_and(|ended| ended.success()))
}

#[test]
fn a_way_that_stands_still_keeps_nobody_else_waiting() {
    // The module's class is 100.
    for real_time_from in [0, 128] {
        let Some(lab) = lan::lab(&lan::specs(&addresses()), 1500) else { return };
        let folder = tempfile::Builder::new().prefix("rohrpost-stalled-").tempdir_in("/dev/shm").unwrap();
        let nodes = NODES.map(|name| Node::create(&folder.path().join(name), 0o700).unwrap());
        let start = |own: usize| {
            let _inside = lab.enter(NODES[own]).unwrap();
            let faults = Arc::new(Words);
            let settings = Settings { real_time_from, ..lan::settings(own as u8, &addresses(), None) };
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
            return report::skipped("no `ip` and `tc` with tbf");
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
