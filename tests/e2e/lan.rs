//! Two nodes of one system on this computer, each with its router, at addresses of the loopback device: packages
//! between them, and messages about failures.

use crate::harness::{NETWORK, PATIENCE, Place, Robot, halt, probe, signal, wait};
use crate::probe::ProbingInterface;
use crate::process::Running;
use nix::sys::signal::Signal;
use rohrpost::wire::{append, from_bytes};
use rohrpost::{CallError, Fault};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Head, monotonic_ns};
use rohrpost_routers::frame::{FrameHead, FrameKind};
use std::collections::BTreeSet;
use std::net::{IpAddr, Ipv4Addr, UdpSocket};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU16, Ordering};
use std::time::Duration;

/// A router that joined longer ago than this is not young any more.
const YOUNG_NS: u64 = 1_500_000_000;

/// Two nodes, `base` with probe.0 and `arm` with probe.1.
struct Lan {
    place: Place,
    config: PathBuf,
    nodes: Vec<(Running, Robot)>,
}

/// Addresses that no other test has: of the loopback's 16 million, by process and count.
pub(crate) fn addresses() -> [String; 2] {
    static COUNT: AtomicU16 = AtomicU16::new(0);
    let (pid, count) = (std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
    assert!(count <= 50, "a process has so many");
    [1, 2].map(|node| format!("127.{}.{}.{}", 1 + pid / 250 % 250, pid % 250, 5 * count + node))
}

/// A configuration with these nodes' addresses, and further sections.
fn configured(place: &Place, name: &str, addresses: &[String; 2], further: &str) -> PathBuf {
    let [base, arm] = addresses;
    let nodes = format!(
        "[nodes.base]\naddress = \"{base}\"\ntools = [0, 15]\n[nodes.arm]\naddress = \"{arm}\"\ntools = [16, 31]\n\
         {NETWORK}{further}"
    );
    let modules = [probe("probe.0", "", "node = \"base\""), probe("probe.1", "rate-hz = 20.0", "node = \"arm\"")];
    place.config_of(name, &nodes, &[&modules[0], &modules[1]])
}

impl Lan {
    /// Both nodes, and all that is on them.
    fn launched() -> Self {
        Self::launched_with("", &[])
    }

    /// The same, with further sections of the configuration, and environment variables.
    fn launched_with(further: &str, environment: &[(&str, &str)]) -> Self {
        let place = Place::new();
        let config = configured(&place, "test", &addresses(), further);
        let mut lan = Self { place, config, nodes: Vec::new() };
        for node in ["base", "arm"] {
            let started = lan.start(node, environment);
            lan.nodes.push(started);
        }
        // A router is silent about packages in its first half second: they may be duplicates of what its predecessor
        // has delivered.
        wait("routers that answer", || {
            let routers = lan.nodes.iter().zip(["router.0", "router.1"]);
            let mut began_ns = routers.filter_map(|((_, robot), router)| Some(robot.process(router)?.joined_ns));
            began_ns.all(|ns| monotonic_ns() > ns + YOUNG_NS).then_some(())
        });
        lan
    }

    fn start(&self, node: &str, environment: &[(&str, &str)]) -> (Running, Robot) {
        let mut command = self.place.command(&["launch", self.config.to_str().unwrap(), "--node", node]);
        command.envs(environment.iter().copied());
        let mut launch = Running::start(command);
        let robot = self.place.robot(&self.config, node, &mut launch);
        robot.wait_on(&mut launch);
        (launch, robot)
    }

    fn base(&self) -> &Robot {
        &self.nodes[0].1
    }

    fn arm(&self) -> &Robot {
        &self.nodes[1].1
    }

    /// A person's command at `base`.
    fn say(&self, arguments: &[&str]) -> crate::process::Said {
        self.place.say_at(&self.config, "base", arguments)
    }

    /// The result of counting at `arm`, called from `base`.
    fn count(&self, number: u32) -> Result<u64, CallError> {
        let mut tool = self.base().tool(Duration::from_secs(1));
        let write = |body: &mut Vec<u8>| append(body, &(number,));
        let (probe, hash) = (self.base().name("probe.1"), ProbingInterface::hash());
        let counted = tool.call(probe, crate::probe::COUNT, hash, write, |bytes| from_bytes(bytes));
        tool.close();
        counted
    }

    /// The fault of a call from `base` to `arm`; none when it was run, or nobody answered.
    fn fault(&self) -> Option<Fault> {
        match self.count(0) {
            Err(CallError::Fault(_, fault)) => Some(fault),
            _ => None,
        }
    }

    fn stop(mut self) {
        for (mut launch, robot) in self.nodes.drain(..) {
            drop(robot);
            launch.stop();
        }
        self.place.assert_empty();
    }
}

#[test]
fn calls_and_data_cross_from_node_to_node_as_if_there_were_one() {
    let lan = Lan::launched();
    assert_eq!(lan.say(&["call", "probe.1", "count", "1"]).ok(), "1\n");
    assert_eq!(lan.say(&["call", "probe.1", "count", "2"]).ok(), "2\n", "by another tool");
    assert_eq!(lan.say(&["call", "probe.0", "count", "3"]).ok(), "1\n", "its own node's");
    let data = lan.say(&["echo", "probe.1", "beat", "--count", "3"]).ok();
    assert_eq!(data.lines().count(), 3, "{data}");
    // Larger than a datagram, there and back.
    let word = "x".repeat(900);
    let told = lan.say(&["call", "probe.1", "tell", "1", "2.5", &word, "true", "[1, 2, 3]"]).ok();
    assert!(told.contains(&word), "{told}");
    lan.stop();
}

#[test]
fn what_is_not_there_is_told_with_its_remedy() {
    let mut lan = Lan::launched();
    assert_eq!(lan.say(&["stop", "probe.1"]).code, Some(0));
    wait("it is refused", || (lan.fault() == Some(Fault::NoMailbox)).then_some(()));
    let told = lan.say(&["call", "probe.1", "count", "1"]).fails();
    assert!(told.contains("probe.1 does not run on node arm; `rohrpost start probe.1` starts it"), "{told}");

    // The node goes, and is silent.
    let (mut launch, robot) = lan.nodes.pop().unwrap();
    drop(robot);
    launch.stop();
    let silent = Some(Fault::NodeSilent { node: "arm".into() });
    wait("arm is silent", || (lan.fault() == silent).then_some(()));
    let told = lan.say(&["call", "probe.1", "count", "1"]).fails();
    assert!(told.contains("probe.1: node arm is silent; is it on"), "{told}");

    // Its own router goes.
    assert_eq!(lan.say(&["stop", "router.0"]).code, Some(0));
    let told = lan.say(&["call", "probe.1", "count", "1"]).fails();
    assert!(
        told.contains("the router of this node, router.0, does not run") && told.contains("`rohrpost start router.0`"),
        "{told}"
    );
    assert!(lan.place.counted().is_empty(), "nothing was run");
    lan.stop();
}

#[test]
fn a_full_mailbox_on_another_node_is_told() {
    let lan = Lan::launched();
    halt(lan.arm().pid("probe.1"));
    let mut tool = lan.base().tool(PATIENCE);
    // One after the other, each given up when it is in the mailbox, until one is refused.
    let full = wait("full", || {
        let before = lan.arm().waiting("probe.1");
        let call = lan.base().begin(&mut tool, "probe.1", crate::probe::COUNT, &(1u32,));
        let answer = wait("answered, or in the mailbox", || {
            tool.link.collect();
            let answer = tool.link.poll(call);
            (answer.is_some() || lan.arm().waiting("probe.1") > before).then_some(answer)
        });
        tool.link.forget(call);
        // A module without processor time for a second counts as silent.
        answer.filter(|answer| !matches!(answer, Err(CallError::Fault(_, Fault::NodeSilent { .. }))))
    });
    assert!(matches!(full, Err(CallError::Fault(_, Fault::MailboxFull))), "{full:?}");
    tool.close();
    signal(lan.arm().pid("probe.1"), Signal::SIGCONT);
    lan.stop();
}

#[test]
fn routers_may_be_killed_at_any_time_and_nothing_runs_twice() {
    let lan = Lan::launched();
    let (mut numbers, mut answered) = (0.., Vec::new());
    for (robot, router) in [(lan.base(), "router.0"), (lan.arm(), "router.1"), (lan.base(), "router.0")] {
        let pid = robot.pid(router);
        signal(pid, Signal::SIGKILL);
        // Through the transit mailbox, in which it waits for the next router; or refused, if launch was quicker.
        // A call that timed out may have run all the same: the next one is a new call.
        for _ in 0..3 {
            let number = wait("a call comes through", || {
                let number = numbers.next()?;
                lan.count(number).ok().map(|_| number)
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
    let mut lan = Lan::launched();
    let (mut launch, robot) = lan.nodes.pop().unwrap();
    drop(robot);
    launch.stop();
    // The same nodes, one module more.
    let text = std::fs::read_to_string(&lan.config).unwrap();
    let other = lan.place.path("other.toml");
    std::fs::write(&other, format!("{text}{}", probe("probe.2", "", "node = \"arm\""))).unwrap();
    let ours = std::mem::replace(&mut lan.config, other);
    let started = lan.start("arm", &[]);
    lan.nodes.push(started);
    let theirs = std::mem::replace(&mut lan.config, ours);
    let digests = [&lan.config, &theirs]
        .map(|file| format!("{:016x}", rohrpost_config::Installation::load(file).unwrap().digest().lan()));
    let fault = wait("refused", || lan.fault().filter(|fault| matches!(fault, Fault::NodeRefuses { .. })));
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
    let config = configured(&place, "test", &addresses(), "");
    let installation = rohrpost_config::Installation::load(&config).unwrap();
    let (address, port) = (installation.nodes[0].address.unwrap(), installation.network.unwrap().port);
    let _taken = std::net::UdpSocket::bind((address, port)).unwrap();
    let told = place.say(&["router", "--config", config.to_str().unwrap(), "--name", "router.0"]).fails();
    assert!(told.contains(&format!("{address}:{port} is in use")) && told.contains("choose another `port`"), "{told}");
}

#[test]
fn a_bad_network_loses_no_call_and_runs_none_twice() {
    let lan = Lan::launched_with(
        "",
        &[("ROHRPOST_IMPAIR", "loss=10%,duplicate=20%,reorder=20%,delay=1ms,jitter=1ms,corrupt=1%,seed=7")],
    );
    for number in 0..20 {
        wait("a call comes through", || lan.count(number).ok());
    }
    let counted = lan.place.counted();
    // After a timeout the tool makes a new call: one call runs at most once.
    assert!((0..20).all(|number| counted.contains(&number)), "{counted:?}");
    // Known once it is clear that they are not just late.
    wait("losses and duplicates are counted", || {
        let told = lan.say(&["echo", "router.0", "links", "--count", "1", "--json"]).json();
        let peer = &told["value"]["peers"][0];
        ["lost", "duplicates", "damaged"]
            .iter()
            .all(|count| peer["counters"][count].as_u64().unwrap() > 0)
            .then_some(())
    });
    lan.stop();
}

#[test]
fn net_shows_links_losses_and_the_master_of_time() {
    let mut lan = Lan::launched();
    let state = |told: &serde_json::Value, node: usize| told[node]["links"]["peers"][0]["state"].clone();
    let told: serde_json::Value = serde_json::from_str(&lan.say(&["net", "--json"]).out).unwrap();
    assert_eq!(told.as_array().unwrap().len(), 1, "of the node that was asked for");
    let config = lan.config.to_str().unwrap().to_owned();
    let all = |lan: &Lan, more: &[&str]| lan.place.say(&[&["net", "--config", &config], more].concat());
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
    for words in ["base", "arm", "alive", "slave of", "there and back"] {
        assert!(text.contains(words), "no `{words}` in:\n{text}");
    }
    // A command to a missing mailbox is lost at its node, and that is reported.
    assert_eq!(lan.say(&["stop", "probe.1"]).code, Some(0));
    wait("it is refused", || (lan.fault() == Some(Fault::NoMailbox)).then_some(()));
    wait("the loss is told", || all(&lan, &[]).out.contains("no-mailbox").then_some(()));
    let (mut launch, robot) = lan.nodes.pop().unwrap();
    drop(robot);
    launch.stop();
    let silent = wait("arm is silent", || Some(all(&lan, &[])).filter(|said| said.out.contains("silent")));
    assert_eq!(silent.code, Some(1), "{silent:?}");
    assert!(silent.out.contains("node arm: "), "{silent:?}");
    lan.stop();
}

#[test]
fn net_shows_what_was_refused_and_what_to_do() {
    let lan = Lan::launched();
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
        Head { to: lan.base().name("probe.0"), from: lan.base().name("probe.1"), ..Head::default() }.to_bytes();
    for _ in 0..3 {
        router_of_arm.send_to(&[&head.to_bytes(&[&package])[..], &package].concat(), (base, port)).unwrap();
    }
    let IpAddr::V4(base_v4) = base else { panic!("{base}") };
    let [a, b, c, d] = base_v4.octets();
    let stranger = UdpSocket::bind((Ipv4Addr::new(a, b, c, d + 7), 0)).unwrap();
    stranger.send_to(b"is anybody there?", (base, port)).unwrap();
    let text = wait("all are counted", || {
        let text = lan.say(&["net"]).out;
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
    let told: serde_json::Value = serde_json::from_str(&lan.say(&["net", "--json"]).out).unwrap();
    assert_eq!(
        (&told[0]["links"]["peers"][0]["counters"]["refused"], &told[0]["links"]["foreign"]),
        (&3.into(), &1.into())
    );
    lan.stop();
}

#[test]
fn a_node_alone_has_no_net() {
    let place = Place::new();
    let (mut launch, robot) = place.launched(&[&probe("probe.0", "", "")]);
    let told = place.say(&["net"]).fails();
    assert!(told.contains("has one node, and so no routers"), "{told}");
    drop(robot);
    launch.stop();
    place.assert_empty();
}
