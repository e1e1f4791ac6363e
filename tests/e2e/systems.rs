//! Systems that meet at a TCP router, each node in a network namespace of its own: `north` (system 1) runs it, `south`
//! (system 2) reaches it. Where system 1 has a LAN, `arm` is on it; else `arm` may be a system of its own.

use crate::harness::{Place, head, lab, probe, repository, until};
use crate::network::{NETWORK, Network, nodes};
use crate::process::{Running, Said};
use rohrpost::CallError;
use std::ops::Deref;
use std::path::PathBuf;
use std::time::Duration;

/// As in all configurations with a TCP router.
pub(crate) const CLASSES: &str = "router 250, probe 96, tcp 64, output 32, tool 16";

/// Nodes, the first two of which are systems, and their addresses.
pub(crate) const NODES: [(&str, &str); 3] = [("north", "10.79.0.1"), ("south", "10.79.0.2"), ("arm", "10.79.0.3")];
pub(crate) const SYSTEMS: [&str; 2] = [NODES[0].0, NODES[1].0];
pub(crate) const OPEN: &str = "security = \"none\"";
pub(crate) const SEALED: &str = "security = \"tls\"\ncertificates = \"certificates\"";

/// Two systems, as configured of one installation.
pub(crate) struct Systems {
    pub(crate) network: Network,
}

impl Deref for Systems {
    type Target = Network;

    fn deref(&self) -> &Network {
        &self.network
    }
}

impl Systems {
    /// Without any launch. None, with a report, where namespaces are not permitted.
    pub(crate) fn new(security: &str) -> Option<Self> {
        let lab = lab(NODES, "systems that meet")?;
        let place = Place::new();
        for (system, id) in SYSTEMS.into_iter().zip(1..) {
            place.write(&format!("{system}.toml"), configured(system, id, security));
        }
        let config = place.path("north.toml");
        Some(Self { network: Network::new(place, config, Some(lab)) })
    }

    pub(crate) fn launched(security: &str) -> Option<Self> {
        let mut systems = Self::new(security)?;
        if security == SEALED {
            for node in SYSTEMS {
                systems.place.say(&["keys", "new", systems.config(node).to_str().unwrap()]).ok();
            }
        }
        SYSTEMS.into_iter().for_each(|node| systems.launch(node));
        SYSTEMS.into_iter().for_each(|node| systems.wait_up(node));
        Some(systems)
    }

    pub(crate) fn config(&self, node: &str) -> PathBuf {
        // It may be of a system of its own.
        let third = self.place.path("arm.toml");
        let system = if node == "arm" && !third.exists() { "north" } else { node };
        self.place.path(&format!("{system}.toml"))
    }

    /// Gives north a LAN, with `probe.1` on `arm`.
    pub(crate) fn with_lan(&self) {
        let config = self.config("north");
        let text = std::fs::read_to_string(&config).unwrap();
        let [(_, north), _, (_, arm)] = NODES;
        let nodes = nodes([("north", north), ("arm", arm)]) + NETWORK + "[tcp]";
        let text = text.replace("[nodes.north]\n[tcp]", &nodes)
            + "node = \"north\"\n"
            + &probe("probe.1", "", "node = \"arm\"");
        std::fs::write(&config, text).unwrap();
    }

    /// `arm`, of a system of its own, is refused, and both it and the TCP router report the reason.
    pub(crate) fn wait_refused(&self, here: &str, there: &str) {
        until(format!("arm is refused: {here}"), || {
            let told = self.client("arm");
            told["state"] != "up" && told["why"].as_str().is_some_and(|why| why.contains(here))
        });
        until(format!("the TCP router refuses: {there}"), || self.says("north", &["net"]).out.contains(there));
    }

    pub(crate) fn launch(&mut self, node: &'static str) {
        self.network.launch_from(&self.config(node), &[node]);
    }

    /// The output of `net` about a node's client of the TCP router.
    pub(crate) fn client(&self, node: &str) -> serde_json::Value {
        let said = self.says(node, &["net", "--json"]);
        let told: serde_json::Value = serde_json::from_str(said.out.trim()).unwrap_or_default();
        told[0]["beyond"].clone()
    }

    pub(crate) fn wait_up(&self, node: &str) {
        until(format!("{node} takes part"), || self.client(node)["state"] == "up");
    }

    /// A person's command at a node.
    pub(crate) fn says(&self, node: &str, arguments: &[&str]) -> Said {
        self.place.say_at(&self.config(node), node, arguments)
    }

    /// A program that is no node, at `south`'s computer, under this name.
    pub(crate) fn foreign(&self, name: &str, order: &str, certificates: &[&str]) -> Running {
        let mut digest = self.robot("north").installation.digest();
        if !name.starts_with("1.") {
            // Of a system that no file describes.
            digest.system = 1;
        }
        let page = repository("tests/e2e/python/foreign.py");
        let arguments = [&page, NODES[0].1, "21119", &digest.to_string(), name, order, "1.96.0.0"];
        self.python("south", &[&arguments, certificates].concat())
    }

    /// The result of counting at `south`, called from `north`.
    pub(crate) fn count(&self, number: u32) -> Result<u64, CallError> {
        self.robot("north").count("2.probe.0.0", number, Duration::from_secs(1))
    }

    pub(crate) fn stop(self) {
        self.network.stop();
    }
}

/// The file of a system of one node.
pub(crate) fn configured(node: &str, id: u8, security: &str) -> String {
    let (server, address) = (if id == 1 { "server = \"north\"\n" } else { "" }, NODES[0].1);
    // South's module follows north's.
    let hears = if id == 2 { ", hears = \"1.probe.0.0\"" } else { "" };
    format!(
        "{}[nodes.{node}]\n[tcp]\n{security}\naddress = \"{address}\"\n{server}{}",
        head(CLASSES).replace("\"robot\"\nid = 1", &format!("\"{node}\"\nid = {id}")),
        probe("probe.0", &format!("rate-hz = 20.0{hears}"), "")
    )
}

/// Traffic both ways.
pub(crate) fn check_crossing(systems: &Systems) {
    assert_eq!(systems.says("north", &["call", "2.probe.0.0", "count", "1"]).ok(), "1\n");
    assert_eq!(systems.says("north", &["call", "2.probe.0.0", "count", "2"]).ok(), "2\n", "by another tool");
    assert_eq!(systems.says("south", &["call", "1.probe.0.0", "count", "3"]).ok(), "1\n", "the other way");
    let hears = || systems.place.record().iter().any(|line| line.starts_with("probe.0 each "));
    until("beats of the other system's module", hears);
    let data = systems.says("north", &["echo", "2.probe.0.0", "beat", "--count", "3"]).ok();
    assert_eq!(data.lines().count(), 3, "{data}");
    let word = "x".repeat(900);
    systems.says("north", &["call", "2.probe.0.0", "tell", "1", "2.5", &word, "true", "[1, 2, 3]"]).ok_with([&word]);
}
