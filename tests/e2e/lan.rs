//! Two nodes of one system on this computer, each with its router, at addresses of the loopback device: packages
//! between them, and messages about failures.

use crate::harness::{PATIENCE, Place, assert_has, halt, probe, signal, until, wait};
use crate::network::{NETWORK, Network, addresses, nodes};
use nix::sys::signal::Signal;
use rohrpost::{CallError, Fault};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Head, monotonic_ns};
use rohrpost_routers::frame::{FrameHead, FrameKind};
use std::collections::BTreeSet;
use std::net::{IpAddr, Ipv4Addr, UdpSocket};
use std::path::PathBuf;
use std::time::Duration;

/// A router that joined longer ago than this is not young any more.
const YOUNG_NS: u64 = 1_500_000_000;

/// A configuration with these nodes' addresses: `base` with probe.0 and `arm` with probe.1.
fn configured(place: &Place, [base, arm]: &[String; 2]) -> PathBuf {
    let modules = [probe("probe.0", "", "node = \"base\""), probe("probe.1", "rate-hz = 20.0", "node = \"arm\"")];
    place.config_of("test", &(nodes([("base", base), ("arm", arm)]) + NETWORK), &[&modules[0], &modules[1]])
}

/// Both nodes, and all that is on them.
fn launched() -> Network {
    launched_with("")
}

/// Both nodes, with a network that is bad in this way.
fn launched_with(impair: &'static str) -> Network {
    let place = Place::new();
    let config = configured(&place, &addresses());
    let lan = Network::new(place, config, None).impaired(impair).launched(&["base", "arm"]);
    // A router is silent about packages in its first half second: they may be duplicates of what its predecessor has
    // delivered.
    until("routers that answer", || {
        let routers = lan.nodes.iter().zip(["router.0", "router.1"]);
        let mut began_ns = routers.filter_map(|((.., robot), router)| Some(robot.process(router)?.joined_ns));
        began_ns.all(|ns| monotonic_ns() > ns + YOUNG_NS)
    });
    lan
}

/// The result of counting at `arm`, called from `base`.
fn count(lan: &Network, number: u32) -> Result<u64, CallError> {
    lan.robot("base").count("probe.1", number, Duration::from_secs(1))
}

/// The fault of a call from `base` to `arm`; none when it was run, or nobody answered.
fn fault(lan: &Network) -> Option<Fault> {
    match count(lan, 0) {
        Err(CallError::Fault(_, fault)) => Some(fault),
        _ => None,
    }
}

#[test]
fn calls_and_data_cross_from_node_to_node_as_if_there_were_one() {
    let lan = launched();
    assert_eq!(lan.says("base", &["call", "probe.1", "count", "1"]).ok(), "1\n");
    assert_eq!(lan.says("base", &["call", "probe.1", "count", "2"]).ok(), "2\n", "by another tool");
    assert_eq!(lan.says("base", &["call", "probe.0", "count", "3"]).ok(), "1\n", "its own node's");
    let data = lan.says("base", &["echo", "probe.1", "beat", "--count", "3"]).ok();
    assert_eq!(data.lines().count(), 3, "{data}");
    // Larger than a datagram, there and back.
    let word = "x".repeat(900);
    lan.says("base", &["call", "probe.1", "tell", "1", "2.5", &word, "true", "[1, 2, 3]"]).ok_with([&word]);
    lan.stop();
}

#[test]
fn what_is_not_there_is_told_with_its_remedy() {
    let mut lan = launched();
    assert_eq!(lan.says("base", &["stop", "probe.1"]).code, Some(0));
    until("it is refused", || fault(&lan) == Some(Fault::NoMailbox));
    lan.says("base", &["call", "probe.1", "count", "1"])
        .fails_with(["probe.1 does not run on node arm; `rohrpost start probe.1` starts it"]);

    // The node goes, and is silent.
    lan.halt("arm");
    let silent = Some(Fault::NodeSilent { node: "arm".into() });
    until("arm is silent", || fault(&lan) == silent);
    lan.says("base", &["call", "probe.1", "count", "1"]).fails_with(["probe.1: node arm is silent; is it on"]);

    // Its own router goes.
    assert_eq!(lan.says("base", &["stop", "router.0"]).code, Some(0));
    lan.says("base", &["call", "probe.1", "count", "1"])
        .fails_with(["the router of this node, router.0, does not run", "`rohrpost start router.0`"]);
    assert!(lan.place.counted().is_empty(), "nothing was run");
    lan.stop();
}

#[test]
fn a_full_mailbox_on_another_node_is_told() {
    let lan = launched();
    halt(lan.robot("arm").pid("probe.1"));
    let mut tool = lan.robot("base").tool(PATIENCE);
    // One after the other, each given up when it is in the mailbox, until one is refused.
    let full = wait("full", || {
        let before = lan.robot("arm").waiting("probe.1");
        let call = lan.robot("base").begin(&mut tool, "probe.1", crate::probe::COUNT, &(1u32,));
        let answer = wait("answered, or in the mailbox", || {
            tool.link.collect();
            let answer = tool.link.poll(call);
            (answer.is_some() || lan.robot("arm").waiting("probe.1") > before).then_some(answer)
        });
        tool.link.forget(call);
        // A module without processor time for a second counts as silent.
        answer.filter(|answer| !matches!(answer, Err(CallError::Fault(_, Fault::NodeSilent { .. }))))
    });
    assert!(matches!(full, Err(CallError::Fault(_, Fault::MailboxFull))), "{full:?}");
    tool.close();
    signal(lan.robot("arm").pid("probe.1"), Signal::SIGCONT);
    lan.stop();
}

#[test]
fn routers_may_be_killed_at_any_time_and_nothing_runs_twice() {
    let lan = launched();
    let (mut numbers, mut answered) = (0.., Vec::new());
    for (robot, router) in
        [(lan.robot("base"), "router.0"), (lan.robot("arm"), "router.1"), (lan.robot("base"), "router.0")]
    {
        let pid = robot.pid(router);
        signal(pid, Signal::SIGKILL);
        // Through the transit mailbox, in which it waits for the next router; or refused, if launch was quicker.
        // A call that timed out may have run all the same: the next one is a new call.
        for _ in 0..3 {
            let number = wait("a call comes through", || {
                let number = numbers.next()?;
                count(&lan, number).ok().map(|_| number)
            });
            answered.push(number);
        }
        robot.wait_restarted(router, pid);
    }
    let counted = lan.place.counted();
    let once: BTreeSet<_> = counted.iter().collect();
    assert_eq!(counted.len(), once.len(), "none ran twice: {counted:?}");
    assert!(
        answered.len() == 9 && answered.iter().all(|number| counted.contains(number)),
        "{answered:?} of {counted:?}"
    );
    lan.stop();
}

#[test]
fn a_node_with_another_configuration_is_refused_by_both_digests() {
    let mut lan = launched();
    lan.halt("arm");
    // The same nodes, one module more.
    let text = std::fs::read_to_string(&lan.config).unwrap();
    let other = lan.place.write("other.toml", format!("{text}{}", probe("probe.2", "", "node = \"arm\"")));
    lan.launch_from(&other, &["arm"]);
    let digests = [&lan.config, &other]
        .map(|file| format!("{:016x}", rohrpost_config::Installation::load(file).unwrap().digest().lan()));
    let fault = wait("refused", || fault(&lan).filter(|fault| matches!(fault, Fault::NodeRefuses { .. })));
    let told = fault.to_string();
    assert!(
        told.starts_with("node arm takes nothing from this one") && digests.iter().all(|digest| told.contains(digest)),
        "{told}"
    );
    assert!(told.contains("launch all nodes from the same file"), "{told}");
    lan.stop();
}

#[test]
fn an_address_in_use_is_told_plainly() {
    let place = Place::new();
    let config = configured(&place, &addresses());
    let installation = rohrpost_config::Installation::load(&config).unwrap();
    let (address, port) = (installation.nodes[0].address.unwrap(), installation.network.unwrap().port);
    let _taken = std::net::UdpSocket::bind((address, port)).unwrap();
    let said = place.say(&["router", "--config", config.to_str().unwrap(), "--name", "router.0"]);
    said.fails_with([&format!("{address}:{port} is in use"), "choose another `port`"]);
}

#[test]
fn a_bad_network_loses_no_call_and_runs_none_twice() {
    let lan = launched_with("loss=10%,duplicate=20%,reorder=20%,delay=1ms,jitter=1ms,corrupt=1%,seed=7");
    for number in 0..20 {
        wait("a call comes through", || count(&lan, number).ok());
    }
    let counted = lan.place.counted();
    // After a timeout the tool makes a new call: one call runs at most once.
    assert!((0..20).all(|number| counted.contains(&number)), "{counted:?}");
    // Known once it is clear that they are not just late.
    until("losses and duplicates are counted", || {
        let told = lan.says("base", &["echo", "router.0", "links", "--count", "1", "--json"]).json();
        let peer = &told["value"]["peers"][0];
        ["lost", "duplicates", "damaged"].iter().all(|count| peer["counters"][count].as_u64().unwrap() > 0)
    });
    lan.stop();
}

#[test]
fn net_shows_links_losses_and_the_master_of_time() {
    let mut lan = launched();
    let state = |told: &serde_json::Value, node: usize| told[node]["links"]["peers"][0]["state"].clone();
    let told: serde_json::Value = serde_json::from_str(&lan.says("base", &["net", "--json"]).out).unwrap();
    assert_eq!(told.as_array().unwrap().len(), 1, "of the node that was asked for");
    let config = lan.config.to_str().unwrap().to_owned();
    let all = |lan: &Network, more: &[&str]| lan.place.say(&[&["net", "--config", &config], more].concat());
    let told = wait("all hear each other, and have one time", || {
        let told: serde_json::Value = serde_json::from_str(&all(&lan, &["--json"]).out).unwrap();
        let alive = (0..2).all(|node| state(&told, node) == "alive");
        let slave = (0..2).any(|node| told[node]["clock"]["role"] == "slave");
        // They report that they are there.
        let sends = told[0]["rates"][0]["sent_bytes_s"].as_f64() > Some(0.0);
        (alive && slave && sends).then_some(told)
    });
    assert_eq!((&told[0]["node"], &told[1]["links"]["peers"][0]["node"]), (&"base".into(), &"base".into()));
    let text = all(&lan, &[]).ok();
    assert_has(&text, ["base", "arm", "alive", "slave of", "there and back"]);
    // A command to a missing mailbox is lost at its node, and that is reported.
    assert_eq!(lan.says("base", &["stop", "probe.1"]).code, Some(0));
    until("it is refused", || fault(&lan) == Some(Fault::NoMailbox));
    until("the loss is told", || all(&lan, &[]).out.contains("no-mailbox"));
    lan.halt("arm");
    let silent = wait("arm is silent", || Some(all(&lan, &[])).filter(|said| said.out.contains("silent")));
    assert_eq!(silent.code, Some(1), "{silent:?}");
    assert!(silent.out.contains("node arm: "), "{silent:?}");
    lan.stop();
}

#[test]
fn net_shows_what_was_refused_and_what_to_do() {
    let lan = launched();
    let installation = Installation::load(&lan.config).unwrap();
    let [base, arm] = [0, 1].map(|node| installation.nodes[node].address.unwrap());
    let port = installation.network.unwrap().port;
    let router_of_arm = UdpSocket::bind((arm, 0)).unwrap();
    let head = FrameHead {
        kind: FrameKind::Packages,
        system: installation.system.id,
        from: 1,
        to: 0,
        digest: !installation.digest().lan(),
        incarnation: 1,
        sequence: 0,
    };
    let package =
        Head { to: lan.robot("base").name("probe.0"), from: lan.robot("base").name("probe.1"), ..Head::default() }
            .to_bytes();
    for _ in 0..3 {
        router_of_arm.send_to(&[&head.to_bytes(&[&package])[..], &package].concat(), (base, port)).unwrap();
    }
    let IpAddr::V4(base_v4) = base else { panic!("{base}") };
    let [a, b, c, d] = base_v4.octets();
    let stranger = UdpSocket::bind((Ipv4Addr::new(a, b, c, d + 7), 0)).unwrap();
    stranger.send_to(b"is anybody there?", (base, port)).unwrap();
    let text = wait("all are counted", || {
        let text = lan.says("base", &["net"]).out;
        (text.contains("3 datagrams refused") && text.contains("1 datagram dropped")).then_some(text)
    });
    for words in [
        format!("node base: 3 datagrams refused that came from {arm}, the address of node arm: they were of another"),
        "launch all nodes from the same file; `rohrpost version`".into(),
        "came from addresses of no node, or are nothing of Rohrpost's".into(),
        "another `port` in [network]".into(),
    ] {
        assert!(text.contains(&words), "no `{words}` in:\n{text}");
    }
    let told: serde_json::Value = serde_json::from_str(&lan.says("base", &["net", "--json"]).out).unwrap();
    assert_eq!(
        (&told[0]["links"]["peers"][0]["counters"]["refused"], &told[0]["links"]["foreign"]),
        (&3.into(), &1.into())
    );
    lan.stop();
}

#[test]
fn a_node_alone_has_no_net() {
    let (place, mut launch, _robot) = Place::running(&[&probe("probe.0", "", "")]);
    place.say(&["net"]).fails_with(["has one node, and so no routers"]);
    place.end(&mut launch);
}
