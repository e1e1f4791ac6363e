//! Nodes that seal their datagrams: nothing can be read, strangers are refused, and keys can be changed.

use super::strangers::of_earlier_version;
use super::{Field, LOG, configure, lines};
use crate::harness::{OUTPUT, signal, until, wait};
use crate::network::at;
use nix::sys::signal::Signal;
use rohrpost::interfaces::LinkState;
use rohrpost::{CallError, Fault};
use rohrpost_routers::frame::{FrameHead, FrameKind, VERSION};
use std::net::UdpSocket;
use std::path::PathBuf;
use std::time::Duration;

const KEYS: &str = "security = \"keys\"";
/// Longer than a datagram, and used nowhere else.
const SECRET: &str = "the combination of the safe is 4711. ";

impl Field {
    /// So many nodes that seal, with keys in the folder `keys`.
    fn sealed(nodes: usize) -> Option<Self> {
        let field = Self::new(nodes, KEYS)?;
        field.keys("new", "keys");
        Some(field)
    }

    /// Makes or changes the keys in a folder.
    fn keys(&self, step: &str, folder: &str) -> String {
        self.place.say(&["keys", step, self.place.path(folder).to_str().unwrap()]).ok()
    }

    /// The field's configuration, but with keys in this folder; or with these security settings.
    fn with(&self, name: &str, security: &str) -> PathBuf {
        let text = std::fs::read_to_string(&self.config).unwrap();
        let other = self.place.path(&format!("{name}.toml"));
        std::fs::write(&other, text.replace(KEYS, security)).unwrap();
        other
    }

    /// A configuration of two nodes with these security settings, in which the collector of lines is on the other node.
    pub(super) fn collects_on_arm(&self, security: &str) -> PathBuf {
        let log = LOG.replace("robot.log", "arm.log");
        let other = configure(&self.place, "other", 2, security, &[&at("arm", OUTPUT), &log]);
        // One installation for shared memory.
        let text = std::fs::read_to_string(&other).unwrap();
        std::fs::write(&other, text.replace("installation = \"other\"", "installation = \"test\"")).unwrap();
        other
    }

    /// Each of the two has reported why it accepts nothing from the other.
    fn wait_apart(&self, base: &[&str], arm: &[&str]) {
        self.wait_told("router.0", base, 1);
        let log = self.place.path("arm.log");
        until(format!("arm says {arm:?}"), || !lines(&log, "router.1", arm).is_empty());
    }
}

#[test]
fn sealed_nodes_exchange_calls_and_data_and_nothing_of_it_can_be_read() {
    let Some(mut field) = Field::sealed(3) else { return };
    let mut capture = field.lab().capture().unwrap();
    field.launch(&["base", "arm", "desk"]);
    let (mut datagrams, mut unsealed, mut readable) = (0, 0, 0);
    let mut look = || {
        capture.drain(|crossing| {
            datagrams += 1;
            unsealed += usize::from(crossing.datagram[7] == 0);
            let has = |word: &str| crossing.datagram.windows(word.len()).any(|bytes| bytes == word.as_bytes());
            readable += usize::from(has(&SECRET[..16]) || has("probe"));
        });
    };
    for (number, (node, to)) in (1..).zip([("base", "probe.1"), ("arm", "probe.2"), ("desk", "probe.0")]) {
        field.wait_counted(node, to, number);
        let word = SECRET.repeat(20);
        field.says(node, &["call", to, "tell", "1", "2.5", &word, "true", "[1, 2, 3]"]).ok_with([&word]);
        look();
    }
    let data = field.says("base", &["echo", "probe.1", "beat", "--count", "3"]).ok();
    assert_eq!(data.lines().count(), 3, "{data}");
    // Time too: all have that of one master.
    for (node, master) in [("arm", "base"), ("desk", "base")] {
        until(format!("{node} has the time of {master}"), || {
            let clock = field.said(node, rohrpost::interfaces::RouterInterface::CLOCK);
            clock.master == master && clock.error_ns.is_some()
        });
    }
    look();
    assert!(datagrams > 100, "only {datagrams} datagrams were seen");
    assert_eq!((unsealed, readable), (0, 0), "of {datagrams} datagrams");
    field.stop();
}

#[test]
fn a_node_with_another_key_or_none_takes_no_part_and_both_say_why() {
    let Some(mut field) = Field::sealed(2) else { return };
    field.keys("new", "others");
    field.keys("new", "second");
    field.keys("rotate", "second");
    field.keys("finish", "second");
    field.launch_deaf(&["base"]);
    let (from_arm, from_base) = ("takes nothing from node arm (10.78.0.2)", "takes nothing from node base (10.78.0.1)");
    for (name, security, cause, base, arm) in [
        (
            "others",
            "security = \"keys\"\nkeys = \"others\"",
            "forged",
            "its seal is not right",
            "its seal is not right",
        ),
        (
            "second",
            "security = \"keys\"\nkeys = \"second\"",
            "other-key",
            "an id that we have not",
            "an id that we have not",
        ),
        ("none", "security = \"none\"", "unsealed", "it is not sealed", "one of both seals"),
    ] {
        let other = field.collects_on_arm(security);
        field.network.launch_from(&other, &["arm"]);
        field.wait_apart(&[from_arm, base], &[from_base, arm]);
        let peer = field.peer("base", "arm");
        assert_eq!((peer.received.datagrams, peer.received.packages), (0, 0), "{name}: nothing of it was taken");
        // Routers publish their counts twice a second.
        let rejects = || {
            field
                .links("base")
                .rejections
                .into_iter()
                .find(|rejected| rejected.node == "arm" && rejected.cause == cause)
        };
        let rejected = wait(format!("{name}: base counts"), rejects);
        assert!(rejected.datagrams > 0, "{rejected:?}");
        // A caller learns the reason without the other's log; so do tools.
        let hint = if name == "none" { "one of both seals" } else { "copy the folder of keys from the first computer" };
        let told =
            |fault: &Fault| matches!(fault, Fault::NodeRefuses { node, why } if node == "arm" && why.contains(hint));
        wait(format!("{name}: callers are told"), || Some(field.fault("base", "probe.1")).filter(told));
        field.wait_for_state("base", "arm", LinkState::Refused);
        for words in [&["ping", "probe.1", "-c", "1"][..], &["net"], &["list"]] {
            until(format!("{name}: {words:?} tells"), || {
                // As seen from the base, which is the first.
                let said = field.place.say(&[words, &["--config", field.config.to_str().unwrap()]].concat());
                (said.out + &said.err).contains(hint)
            });
        }
        field.network.halt("arm");
        std::fs::remove_file(field.place.path("arm.log")).unwrap();
    }
    // Without the file a node is not even launched.
    let other = field.with("arm", "security = \"keys\"\nkeys = \"nowhere\"");
    let said = field.place.say(&["launch", other.to_str().unwrap(), "--node", "arm"]);
    said.fails_with(["nowhere/udp.keys", "copy this folder from the first computer"]);
    // With the right key it takes part.
    field.launch(&["arm"]);
    field.wait_counted("base", "probe.1", 1);
    field.stop();
}

#[test]
fn sealed_nodes_with_different_configurations_both_say_why() {
    let Some(mut field) = Field::sealed(2) else { return };
    let other = field.collects_on_arm(KEYS);
    field.launch_deaf(&["base"]);
    field.network.launch_from(&other, &["arm"]);
    let words = "its configuration has the digest";
    field.wait_apart(&["takes nothing from node arm", words], &["takes nothing from node base", words]);
    for (node, peer) in [("base", "arm"), ("arm", "base")] {
        field.wait_for_state(node, peer, LinkState::Refused);
    }
    field.stop();
}

#[test]
fn a_sealed_node_says_that_another_speaks_another_wire_format() {
    let Some(mut field) = Field::sealed(2) else { return };
    field.launch(&["base"]);
    // The test is the router of the arm.
    let arm = field.inside("arm", || UdpSocket::bind(("10.78.0.2", 21117)).unwrap());
    let (kind, digest) = (FrameKind::Packages, field.digest());
    let head = FrameHead { kind, system: 1, from: 1, to: 0, digest, incarnation: 9, sequence: 0 };
    let counted = || field.links("base").rejections.into_iter().find(|rejected| rejected.cause == "version");
    let rejected = wait("base counts", || {
        arm.send_to(&of_earlier_version(&head), ("10.78.0.1", 21117)).unwrap();
        counted()
    });
    assert!(rejected.node == "arm" && rejected.datagrams > 0, "{rejected:?}");
    wait("callers are told", || {
        arm.send_to(&of_earlier_version(&head), ("10.78.0.1", 21117)).unwrap();
        let told = |fault: &Fault| matches!(fault, Fault::NodeRefuses { why, .. } if why.contains("wire format 1"));
        Some(field.fault("base", "probe.1")).filter(told)
    });
    let ours = format!("wire format 1, ours is {VERSION}");
    let words = ["takes nothing from node arm (10.78.0.2)", ours.as_str(), "same version of Rohrpost"];
    field.wait_told("router.0", &words, 1);
    field.stop();
}

#[test]
fn keys_are_changed_node_by_node_while_calls_go_on() {
    let Some(mut field) = Field::new(3, KEYS) else { return };
    let nodes = ["base", "arm", "desk"];
    field.keys("new", "keys");
    // Each node has a folder of its own, as a computer has.
    let copy = |field: &Field, node: &str| {
        let folder = field.place.path(node);
        let _ = std::fs::create_dir(&folder);
        std::fs::copy(field.place.path("keys/udp.keys"), folder.join("udp.keys")).unwrap();
    };
    for node in nodes {
        copy(&field, node);
        let config = field.with(node, &format!("{KEYS}\nkeys = \"{node}\""));
        field.network.launch_from(&config, &[node]);
    }
    let mut number = 0;
    let mut all_reach_all = |field: &Field| {
        for (node, module) in [("base", "probe.1"), ("arm", "probe.2"), ("desk", "probe.0"), ("base", "probe.2")] {
            number += 1;
            field.wait_counted(node, module, number);
        }
    };
    all_reach_all(&field);
    for step in ["rotate", "finish"] {
        let said = field.keys(step, "keys");
        assert_eq!(said.lines().count(), if step == "rotate" { 2 } else { 1 }, "{said}");
        for node in nodes {
            let old = field.router(node);
            copy(&field, node);
            signal(old, Signal::SIGKILL);
            field.robot(node).wait_restarted(&super::router_of(node), old);
            all_reach_all(&field);
        }
    }
    field.stop();
}

#[test]
fn a_command_of_a_class_that_is_not_listed_is_answered_with_the_rule() {
    let Some(mut field) = Field::sealed(2) else { return };
    let text = std::fs::read_to_string(&field.config).unwrap();
    std::fs::write(&field.config, format!("{text}\n[access]\nprobe = [\"probe\"]\n")).unwrap();
    field.launch(&["base", "arm"]);
    let line = text.lines().count() + 3;
    // A command from another node is refused by the router, one from the same node by the module itself.
    for from in ["base", "arm"] {
        let fault = wait("a fault", || match field.count(from, "probe.1", super::NEVER, Duration::from_secs(2)) {
            Err(CallError::Fault(_, fault)) => Some(fault.to_string()),
            // A router that has just started answers nothing.
            _ => None,
        });
        let rule = format!("test.toml:{line}, [access]");
        assert!(fault.contains(&rule) && fault.contains("node arm refuses it"), "{from}: {fault}");
    }
    assert_eq!(field.counted("probe.1"), [0; 0]);
    field.stop();
}
