//! Two routers with real sockets, threads and mailboxes: what is undeliverable is answered, what waits outlives a
//! router, and what is not a node's own is refused.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "shell_common/mod.rs"]
mod common;

use common::{PATIENCE, Pair, Side, label, module};
use rohrpost_mailbox::monotonic_ns;
use rohrpost_mailbox::{Kind, Label, Name, Options, Receiver, SendError, Shape, Type, local};
use rohrpost_network::Security;
use rohrpost_routers::counts::Cause;
use rohrpost_routers::frame::{FrameHead, FrameKind};
use rohrpost_routers::inbound::SOCKET_MAX_NS;
use rohrpost_routers::link::PeerLinkState;
use rohrpost_routers::security::Port;
use rohrpost_routers::shell::{Shell, listen};
use rohrpost_routers::stats::Stats;
use rohrpost_testbed::lan::alive;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicU16, Ordering};
use std::time::{Duration, Instant};

fn until(what: &str, mut done: impl FnMut() -> bool) {
    let began = Instant::now();
    while !done() {
        assert!(began.elapsed() < PATIENCE, "waited too long until {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

impl Side {
    fn shell(&self) -> &Shell {
        self.shell.as_ref().unwrap()
    }

    fn sees(&self, peer: u8) -> PeerLinkState {
        self.shell().stats().state(peer, monotonic_ns())
    }
}

/// Of node 0: where answers come to.
fn replies(pair: &Pair) -> Receiver {
    pair.sides[0].receiver(module(0).with_local(local::REPLIES), Shape { slots: 64, ..Shape::default() })
}

/// Sends commands to a mailbox of node 1 until one is answered by a router; the answer.
fn answer(pair: &Pair, replies: &mut Receiver, to: Name, body: &[u8]) -> String {
    // Answers to former commands may come late.
    static COMMANDS: AtomicU16 = AtomicU16::new(0);
    let mut sender = pair.sides[0].sender(to);
    let (from, began) = (replies.name(), Instant::now());
    let first = COMMANDS.load(Ordering::Relaxed);
    while began.elapsed() < PATIENCE {
        sender.send(&label(from, 100, COMMANDS.fetch_add(1, Ordering::Relaxed)), &[body]).unwrap();
        let Some(package) = replies.receive_timeout(Duration::from_millis(50)) else { continue };
        let head = package.head();
        if head.id < first {
            continue;
        }
        assert_eq!((head.to, head.from, head.kind.kind()), (from, to, Kind::Reply(16)));
        assert!(head.options.has(Options::ERROR));
        return String::from_utf8(package.body().to_vec()).unwrap();
    }
    panic!("nobody answers a command to {to}");
}

#[test]
fn an_undeliverable_command_comes_back_and_says_why() {
    let mut pair = Pair::new();
    let mut replies = replies(&pair);
    assert_eq!(answer(&pair, &mut replies, module(1), b"call and arguments"), "callno-mailbox");
    let small = Shape { slots: 2, body_bytes_max: 8, ..Shape::default() };
    let mut receiver = pair.sides[1].receiver(module(1), small);
    assert_eq!(answer(&pair, &mut replies, module(1), b"call and arguments"), "calltoo-large");
    assert_eq!(answer(&pair, &mut replies, module(1), b"call"), "callmailbox-full");
    assert!(receiver.try_receive().is_some());
    let elsewhere = module(1).with_local(9);
    assert_eq!(answer(&pair, &mut replies, elsewhere, b"call"), "callno-mailbox", "a mailbox that the module has not");
    pair.sides[1].shell = None;
    until("node 1 is silent", || pair.sides[0].sees(1) == PeerLinkState::Silent);
    assert_eq!(answer(&pair, &mut replies, module(1), b"call"), "callsilent");
    // Data are counted, and nobody is told.
    let data = rohrpost_mailbox::Label { kind: Type::data(1), ..label(replies.name(), 90, u16::MAX) };
    pair.sides[0].sender(module(1)).send(&data, &[b"data"]).unwrap();
    until("it is counted", || {
        let mut classes = pair.sides[0].shell().stats().out.classes();
        classes.any(|(priority, class)| priority.0 == 90 && class.lost_in_all() == 1)
    });
    while let Some(package) = replies.try_receive() {
        assert_ne!(package.head().id, u16::MAX, "of commands, late ones");
    }
}

#[test]
fn packages_in_the_routers_mailbox_outlive_it() {
    let mut pair = Pair::new();
    let mut receiver = pair.sides[1].receiver(module(1), Shape { slots: 64, ..Shape::default() });
    let mut sender = pair.sides[0].sender(module(1));
    let mut id = 0;
    for _ in 0..5 {
        pair.sides[0].shell = None;
        for _ in 0..10 {
            sender.send(&label(module(0), 100, id), &[b"waits"]).unwrap();
            id += 1;
        }
        pair.sides[0].start();
        for wanted in id - 10..id {
            assert_eq!(receiver.receive_timeout(PATIENCE).unwrap().head().id, wanted);
        }
    }
    assert!(receiver.try_receive().is_none());
    let restarts = pair.sides[1].shell().stats().peer(0).received.restarts.get();
    assert!((1..=5).contains(&restarts), "seen as one that was started anew: {restarts}");
}

#[test]
fn a_router_with_another_digest_is_refused_by_both_and_taken_when_it_is_corrected() {
    let mut pair = Pair::new();
    let mut replies = replies(&pair);
    pair.sides[1].settings.digest = 8;
    pair.sides[1].start();
    for (side, theirs) in [(0, 8), (1, 7)] {
        until("each refuses the other", || match pair.sides[side].sees(1 - side as u8) {
            PeerLinkState::Refused(mismatch) => mismatch.digest == Some(theirs),
            _ => false,
        });
    }
    assert_eq!(answer(&pair, &mut replies, module(1), b"call"), "callrefused");
    pair.sides[1].settings.digest = 7;
    pair.sides[1].start();
    until("they hear each other", || (0..2).all(|side| pair.sides[side].sees(1 - side as u8) == PeerLinkState::Alive));
}

#[test]
fn what_comes_from_an_address_that_is_not_its_nodes_is_not_taken() {
    let pair = Pair::new();
    let here = &pair.sides[0];
    let to = (here.settings.nodes[0].address, here.settings.network.port);
    let refused = |peer: u8| here.shell().stats().peer(peer).received.refused.get();
    let [foreign, dropped] = [|stats: &Stats| stats.foreign.get(), |stats: &Stats| stats.dropped.get()];
    let [foreign, dropped] = [foreign, dropped].map(|count| move || count(here.shell().stats()));
    let head = FrameHead { kind: FrameKind::Alive, system: 1, from: 1, to: 0, digest: 7, incarnation: 99, sequence: 0 };
    let claims = alive(head);
    until("the peer is heard", || here.shell().stats().peer(1).link.incarnation.get() == 2);
    let before = (foreign(), dropped());
    let stranger = UdpSocket::bind((IpAddr::V4(Ipv4Addr::new(127, 127, 127, 127)), 0)).unwrap();
    for bytes in [&claims[..], b"anything", b""] {
        stranger.send_to(bytes, to).unwrap();
    }
    // By the kernel, which tells with the next datagram of the peer.
    until("all are counted", || dropped() == before.1 + 3);
    assert_eq!(foreign(), before.0, "none came to the router");
    assert_eq!(
        here.shell().stats().peer(1).link.incarnation.get(),
        2,
        "the peer's own incarnation still is the known one"
    );
    // From the node's address, but of another system.
    let own = UdpSocket::bind((here.settings.nodes[1].address, 0)).unwrap();
    let head = FrameHead { system: 2, ..head };
    own.send_to(&alive(head), to).unwrap();
    until("it is counted", || refused(1) == 1);
}

#[test]
fn each_sealed_router_has_an_incarnation_of_its_own_whatever_its_settings_say() {
    let mut pair = Pair::new();
    let lives: Vec<_> = (0..3).map(|_| sealed_incarnation(&mut pair)).collect();
    assert!(lives[0] != lives[1] && lives[1] != lives[2] && lives[0] != lives[2], "{lives:?}");
}

/// Starts the first router anew with the same settings; the incarnation that it has.
fn sealed_incarnation(pair: &mut Pair) -> u64 {
    let side = &mut pair.sides[0];
    side.settings.incarnation = 7;
    side.settings.network.security = Security::Keys;
    side.start();
    side.shell().settings().incarnation
}

#[test]
fn without_the_right_to_the_address_a_router_does_not_start_and_leaves_the_node_as_it_was() {
    let pair = Pair::new();
    let mut second = Pair::new();
    second.sides[0].settings.nodes = pair.sides[0].settings.nodes.clone();
    let side = &mut second.sides[0];
    side.shell = None;
    let parts = rohrpost_routers::shell::Parts {
        node: &side.node,
        name: Name::new(1, 250, 0, 0),
        settings: side.settings.clone(),
        faults: std::sync::Arc::new(common::Words),
        sockets: Vec::new(),
        impair: None,
        clock: None,
    };
    let error = Shell::start(parts).err().unwrap().to_string();
    assert!(error.contains("is in use"), "{error}");
    // What is sent meanwhile waits.
    let mut sender = side.sender(module(1));
    assert!(!matches!(sender.send(&label(module(0), 1, 1), &[]), Err(SendError::NoRouter { .. })));
}

#[test]
fn what_comes_at_either_port_while_there_is_no_router_waits_for_the_next() {
    let mut pair = Pair::new();
    let rest_port = pair.sides[1].settings.network.rest_port();
    pair.sides.iter_mut().for_each(|side| {
        side.shell = None;
        // Priorities below are not real time.
        side.settings.real_time_from = 100;
    });
    let [there, here] = [0, 1].map(|node: usize| pair.sides[1].settings.nodes[node].address);
    let port = pair.sides[1].settings.network.port;
    pair.sides[1].sockets = listen(here, (port, [Some(rest_port), None]), &[there]);
    pair.sides.iter_mut().for_each(Side::start);
    let mailbox = module(1).with_local(local::DATA);
    let mut receiver = pair.sides[1].receiver(mailbox, Shape { slots: 64, ..Shape::default() });
    let mut sender = pair.sides[0].sender(mailbox);
    let mut take = |what: &str, sent: &[(u8, u16)]| {
        let mut came = Vec::new();
        until(what, || {
            came.extend(receiver.try_receive().map(|package| (package.head().priority.0, package.head().id)));
            came.len() == sent.len()
        });
        came.sort_unstable();
        assert_eq!(came, sent);
    };
    let sent = [(50, 1), (100, 2)];
    let mut send = || {
        sent.iter().for_each(|(priority, id)| {
            let label = Label { kind: Type::data(1), ..label(module(0), *priority, *id) };
            sender.send(&label, &[b"data"]).unwrap();
        })
    };
    send();
    take("both came", &sent);
    pair.sides[1].shell = None;
    let left = || pair.sides[0].shell().stats().out.classes().map(|(_, class)| class.passed.get()).sum::<u64>();
    let before = left();
    send();
    until("both have left", || left() == before + 2);
    pair.sides[1].start();
    take("both waited", &sent);
}

#[test]
fn what_waited_for_a_router_for_long_says_nothing_of_the_present_incarnation() {
    let mut pair = Pair::new();
    pair.sides.iter_mut().for_each(|side| side.shell = None);
    let [there, here] = [0, 1].map(|node: usize| pair.sides[1].settings.nodes[node].address);
    let at = SocketAddr::new(here, pair.sides[1].settings.network.port);
    pair.sides[1].sockets = listen(here, (at.port(), [None, None]), &[there]);
    let peer = UdpSocket::bind((there, 0)).unwrap();
    let says = |sequence: u32| {
        let sequence = sequence.into();
        let head =
            FrameHead { kind: FrameKind::Alive, system: 1, from: 0, to: 1, digest: 7, incarnation: 99, sequence };
        peer.send_to(&alive(head), at).unwrap();
    };
    says(0);
    std::thread::sleep(Duration::from_nanos(SOCKET_MAX_NS) + Duration::from_millis(100));
    pair.sides[1].start();
    // Behind it in the socket, and young.
    until("what is behind it is counted", || {
        peer.send_to(b"anything", at).unwrap();
        pair.sides[1].shell().stats().foreign.get() > 0
    });
    let heard = || pair.sides[1].shell().stats().peer(0).link.incarnation.get();
    assert_eq!(heard(), 0, "it waited for longer than the peer that sent it may have lived");
    let mut sequence = 1;
    until("what comes now is heard", || {
        says(sequence);
        sequence += 1;
        heard() == 99
    });
}

/// What is real time and what is not, both ways, each by threads and a port of its own; unsealed and sealed.
#[test]
fn what_is_not_real_time_goes_by_a_port_of_its_own() {
    for is_sealed in [false, true] {
        let mut pair = Pair::new();
        for side in &mut pair.sides {
            // The class of the modules is 100.
            side.settings.real_time_from = 50;
            if is_sealed { side.seal() } else { side.start() }
        }
        let shape = Shape { body_bytes_max: 8000, ..Shape::default() };
        let mut receiver = pair.sides[1].receiver(module(1), shape);
        let mut sender = pair.sides[0].sender(module(1));
        let data = |priority, id| Label { kind: Type::data(1), ..label(module(0), priority, id) };
        let counts = || {
            let [sent, came] = [&pair.sides[0], &pair.sides[1]].map(Side::shell);
            let all = [(sent, 1), (came, 0)]
                .map(|(shell, peer)| [shell.stats(), shell.rest_stats().unwrap()].map(|stats| stats.peer(peer)));
            let [[a, b], [c, d]] = all;
            [a.sent.packages.get(), b.sent.packages.get(), c.received.packages.get(), d.received.packages.get()]
        };
        let (mut id, mut rest) = (0, 0);
        for (priority, body, why) in [
            (100, 10, "real time"),
            (50, 4000, "the least that is, in parts"),
            (49, 10, "the most that is not"),
            (20, 4000, "not, in parts"),
        ] {
            let before = counts();
            let began = Instant::now();
            loop {
                id += 1;
                sender.send(&data(priority, id), &[&vec![7; body]]).unwrap();
                let came = receiver.receive_timeout(Duration::from_millis(200));
                let came = came.map(|came| (came.head().priority.0, came.body().len()));
                if came == Some((priority, body)) {
                    break;
                }
                assert!(began.elapsed() < PATIENCE, "{why}: {came:?}");
            }
            let after = counts();
            let went = [0, 1, 2, 3].map(|at: usize| after[at] > before[at]);
            let is_rest = priority < 50;
            assert_eq!(went, [!is_rest, is_rest, !is_rest, is_rest], "{why}, sealed {is_sealed}");
            rest += u64::from(is_rest);
        }
        assert_eq!(rest, 2);
        let classes: Vec<_> = pair.sides[1].shell().stats().inn.classes().map(|(class, _)| class.0).collect();
        assert_eq!(classes, [100, 50, 49, 20], "one account of all");
        if is_sealed {
            assert!(pair.sides[1].shell().rejections(Port::Rest).is_some());
        }
    }
}

/// A command that hurries more than its sender may goes with what its sender may.
#[test]
fn packages_above_their_class_are_not_carried_as_such() {
    let mut pair = Pair::new();
    for side in &mut pair.sides {
        side.settings.real_time_from = 128;
        side.start();
    }
    let mut receiver = pair.sides[1].receiver(module(1), Shape::default());
    pair.sides[0].sender(module(1)).send(&label(module(0), 255, 1), &[b"drive"]).unwrap();
    assert_eq!(receiver.receive_timeout(PATIENCE).unwrap().head().priority.0, 100);
    let shell = pair.sides[0].shell();
    let packages = [shell.stats(), shell.rest_stats().unwrap()].map(|stats| stats.peer(1).sent.packages.get());
    assert_eq!(packages, [0, 1]);
}

/// Neither do those of which there is more than can leave: they are lost, and counted, before they delay what may.
#[test]
fn a_flood_that_may_not_hurry_is_lost_rather_than_carried_as_if_it_might() {
    let mut pair = Pair::new();
    for side in &mut pair.sides {
        side.settings.real_time_from = 128;
        // So that more than can leave soon is sent in a moment.
        side.settings.network.rate_bytes_s = 1 << 20;
        side.start();
    }
    let (join, body) = (pair.sides[0].join(), [7; 1000]);
    let mut sender = join.sender(module(1)).unwrap();
    let shell = pair.sides[0].shell();
    let lost = || shell.stats().out.classes().map(|(_, class)| class.lost(Cause::Quota)).sum::<u64>();
    until("more than is taken was lost", || {
        // What does not fit into the mailbox is refused there.
        (0..64).for_each(|id| drop(sender.send(&label(module(0), 255, id), &[&body])));
        lost() > 1000
    });
    let packages = [shell.stats(), shell.rest_stats().unwrap()].map(|stats| stats.peer(1).sent.packages.get());
    assert_eq!(packages[0], 0, "none went as if it were real time");
    let classes: Vec<_> = shell.stats().out.classes().map(|(class, _)| class.0).collect();
    assert_eq!(classes, [100], "each is counted as what it may be");
}

/// The two threads that carry what is not real time are never in real time, whatever their process is.
#[test]
fn threads_that_are_not_real_time_run_below_all_that_are() {
    let mut pair = Pair::new();
    let _ = rohrpost_mailbox::sys::schedule(rohrpost_mailbox::sys::Scheduling::Fifo(1));
    for side in &mut pair.sides {
        side.settings.real_time_from = 128;
        side.start();
    }
    let policies = || -> Vec<(String, String)> {
        let read = |task: &std::path::Path, file: &str| std::fs::read_to_string(task.join(file)).unwrap_or_default();
        let tasks = std::fs::read_dir("/proc/self/task").unwrap().flatten();
        let named = tasks.map(|task| (read(&task.path(), "comm"), read(&task.path(), "sched")));
        let policy = |text: &str| text.lines().find(|line| line.starts_with("policy")).map(str::to_string);
        named
            .filter(|(name, _)| name.starts_with("rest-"))
            .filter_map(|(name, sched)| Some((name, policy(&sched)?)))
            .collect()
    };
    if policies().is_empty() {
        // A kernel that does not tell.
        return;
    }
    until("both have begun and are scheduled as others are", || {
        policies().len() >= 2 && policies().iter().all(|(_, policy)| policy.ends_with(" 0"))
    });
}
