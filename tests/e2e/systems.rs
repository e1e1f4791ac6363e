//! Systems that meet at a TCP router, each node in a network namespace of its own: `north` (system 1) runs it, `south`
//! (system 2) reaches it. Where system 1 has a LAN, `arm` is on it; else `arm` may be a system of its own.

use crate::harness::{NETWORK, Place, Robot, lab, probe, wait};
use crate::probe::ProbingInterface;
use crate::process::{Running, Said};
use rohrpost::CallError;
use rohrpost::wire::{append, from_bytes};
use rohrpost_routers::lab::Lab;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Classes and scheduling, as in all configurations with a TCP router.
pub(crate) const CLASSES: &str = r#"
[classes]
router = { id = 250 }
probe = { id = 96 }
tcp = { id = 64, text = "Carries packages beyond the LAN" }
output = { id = 32, text = "Collects what modules say" }
tool = { id = 16 }
[scheduling]
real-time-from = 256
"#;

/// Nodes, the first two of which are systems, and their addresses.
pub(crate) const NODES: [(&str, &str); 3] = [("north", "10.79.0.1"), ("south", "10.79.0.2"), ("arm", "10.79.0.3")];
pub(crate) const SYSTEMS: [&str; 2] = [NODES[0].0, NODES[1].0];
pub(crate) const OPEN: &str = "security = \"none\"";
pub(crate) const SEALED: &str = "security = \"tls\"\ncertificates = \"certificates\"";

/// Two systems, as configured of one installation.
pub(crate) struct Systems {
    // Dropped in this order: processes, what they left, their network.
    pub(crate) nodes: Vec<(&'static str, Running, Robot)>,
    pub(crate) place: Place,
    lab: Lab,
}

impl Systems {
    /// Without any launch. None, with a report, where namespaces are not permitted.
    pub(crate) fn new(security: &str) -> Option<Self> {
        let lab = lab(NODES, "systems that meet")?;
        let place = Place::new();
        for (system, id) in SYSTEMS.into_iter().zip(1..) {
            std::fs::write(place.path(&format!("{system}.toml")), configured(system, id, security)).unwrap();
        }
        Some(Self { nodes: Vec::new(), place, lab })
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
        let nodes = format!(
            "[nodes.north]\naddress = \"{north}\"\ntools = [0, 15]\n[nodes.arm]\naddress = \"{arm}\"\n\
             tools = [16, 31]\n{NETWORK}[tcp]"
        );
        let text = text.replace("[nodes.north]\n[tcp]", &nodes)
            + "node = \"north\"\n"
            + &probe("probe.1", "", "node = \"arm\"");
        std::fs::write(&config, text).unwrap();
    }

    /// `arm`, of a system of its own, is refused, and both it and the TCP router report the reason.
    pub(crate) fn wait_refused(&self, here: &str, there: &str) {
        wait(format!("arm is refused: {here}"), || {
            let told = self.client("arm");
            (told["state"] != "up" && told["why"].as_str().is_some_and(|why| why.contains(here))).then_some(())
        });
        wait(format!("the TCP router refuses: {there}"), || {
            self.says("north", &["net"]).out.contains(there).then_some(())
        });
    }

    pub(crate) fn launch(&mut self, node: &'static str) {
        let command = self.place.command(&["launch", self.config(node).to_str().unwrap(), "--node", node]);
        let mut launch = {
            let _inside = self.lab.enter(node).unwrap();
            Running::start(command)
        };
        let robot = self.place.robot(&self.config(node), node, &mut launch);
        robot.wait_on(&mut launch);
        self.nodes.push((node, launch, robot));
    }

    /// The output of `net` about a node's client of the TCP router.
    pub(crate) fn client(&self, node: &str) -> serde_json::Value {
        let said = self.says(node, &["net", "--json"]);
        let told: serde_json::Value = serde_json::from_str(said.out.trim()).unwrap_or_default();
        told[0]["beyond"].clone()
    }

    pub(crate) fn wait_up(&self, node: &str) {
        wait(format!("{node} takes part"), || (self.client(node)["state"] == "up").then_some(()));
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
        let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/e2e/python/foreign.py");
        let arguments = [page, NODES[0].1, "21119", &digest.to_string(), name, order, "1.96.0.0"];
        self.python(&[&arguments, certificates].concat())
    }

    /// Python at `south`'s computer.
    pub(crate) fn python(&self, arguments: &[&str]) -> Running {
        let mut command = Command::new("python3");
        // Beside the sources nothing is to be written.
        command.arg("-B").args(arguments).current_dir(self.place.path(""));
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let _inside = self.lab.enter("south").unwrap();
        Running::start(command)
    }

    pub(crate) fn robot(&self, node: &str) -> &Robot {
        &self.nodes.iter().find(|(known, ..)| *known == node).unwrap().2
    }

    /// The result of counting at `south`, called from `north`.
    pub(crate) fn count(&self, number: u32) -> Result<u64, CallError> {
        let north = self.robot("north");
        let mut tool = north.tool(Duration::from_secs(1));
        let write = |body: &mut Vec<u8>| append(body, &(number,));
        let (probe, hash) = (north.name("2.probe.0.0"), ProbingInterface::hash());
        let counted = tool.call(probe, crate::probe::COUNT, hash, write, |bytes| from_bytes(bytes));
        tool.close();
        counted
    }

    pub(crate) fn stop(mut self) {
        for (_, mut launch, robot) in self.nodes.drain(..) {
            drop(robot);
            launch.stop();
        }
        self.place.assert_empty();
    }
}

/// The file of a system of one node.
pub(crate) fn configured(node: &str, id: u8, security: &str) -> String {
    let (server, address) = (if id == 1 { "server = \"north\"\n" } else { "" }, NODES[0].1);
    // South's module follows north's.
    let hears = if id == 2 { ", hears = \"1.probe.0.0\"" } else { "" };
    format!(
        "installation = \"test\"\n[system]\nname = \"{node}\"\nid = {id}\n{CLASSES}[nodes.{node}]\n[tcp]\n{security}\n\
         address = \"{address}\"\n\
         {server}{}",
        probe("probe.0", &format!("rate-hz = 20.0{hears}"), "")
    )
}

/// Traffic both ways.
pub(crate) fn check_crossing(systems: &Systems) {
    assert_eq!(systems.says("north", &["call", "2.probe.0.0", "count", "1"]).ok(), "1\n");
    assert_eq!(systems.says("north", &["call", "2.probe.0.0", "count", "2"]).ok(), "2\n", "by another tool");
    assert_eq!(systems.says("south", &["call", "1.probe.0.0", "count", "3"]).ok(), "1\n", "the other way");
    let hears = || systems.place.record().iter().any(|line| line.starts_with("probe.0 each "));
    wait("beats of the other system's module", || hears().then_some(()));
    let data = systems.says("north", &["echo", "2.probe.0.0", "beat", "--count", "3"]).ok();
    assert_eq!(data.lines().count(), 3, "{data}");
    let word = "x".repeat(900);
    let told = systems.says("north", &["call", "2.probe.0.0", "tell", "1", "2.5", &word, "true", "[1, 2, 3]"]).ok();
    assert!(told.contains(&word), "{told}");
}
