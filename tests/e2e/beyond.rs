//! Systems that meet at a TCP router: `north` (system 1) runs it, `south` (system 2) reaches it.

use crate::harness::{PATIENCE, Place, Robot, probe, wait};
use crate::lan::addresses;
use crate::probe::ProbingInterface;
use crate::process::{Running, Said};
use rohrpost::macro_support::{append, from_bytes};
use rohrpost::{CallError, Fault};
use std::path::PathBuf;
use std::time::Duration;

/// Head of all configurations but for the system.
const CLASSES: &str = r#"
[classes]
router = { id = 250 }
probe = { id = 96 }
tcp = { id = 64, text = "Carries packages beyond the LAN" }
output = { id = 32, text = "Collects what modules say" }
tool = { id = 16 }
[scheduling]
real-time-from = 256
"#;

/// Two systems of one installation, each of one node.
struct Systems {
    place: Place,
    configs: [PathBuf; 2],
    nodes: Vec<(Running, Robot)>,
}

const NODES: [&str; 2] = ["north", "south"];

impl Systems {
    fn launched() -> Self {
        let place = Place::new();
        let [server, _] = addresses();
        let modules = |node: &str| {
            let settings = if node == "south" { "rate-hz = 20.0" } else { "" };
            probe("probe.0", settings, "")
        };
        let configs = NODES.map(|node| {
            let (id, runs) = if node == "north" { (1, "server = \"north\"\n") } else { (2, "") };
            let text = format!(
                "installation = \"test\"\n[system]\nname = \"{node}\"\nid = {id}\n{CLASSES}[nodes.{node}]\n[tcp]\nsecurity = \"none\"\n\
                 address = \"{server}\"\n{runs}{}",
                modules(node)
            );
            let file = place.path(&format!("{node}.toml"));
            std::fs::write(&file, text).unwrap();
            file
        });
        let mut systems = Self { place, configs, nodes: Vec::new() };
        for index in 0..2 {
            let mut launch = systems.place.launch(&systems.configs[index]);
            let robot = systems.place.robot(&systems.configs[index], NODES[index], &mut launch);
            robot.wait_on(&mut launch);
            systems.nodes.push((launch, robot));
        }
        systems.wait_up();
        systems
    }

    fn wait_up(&self) {
        for node in NODES {
            wait(format!("{node} takes part"), || {
                self.says(node, &["echo", "tcp.0", "link", "--count", "1"]).out.contains("Up").then_some(())
            });
        }
    }

    /// A command of a person at a node.
    fn says(&self, node: &str, arguments: &[&str]) -> Said {
        let config = &self.configs[NODES.iter().position(|known| *known == node).unwrap()];
        self.place.say_at(config, node, arguments)
    }

    fn north(&self) -> &Robot {
        &self.nodes[0].1
    }

    fn south(&self) -> &Robot {
        &self.nodes[1].1
    }

    /// What counting at `south` brings, called from `north`.
    fn count(&self, number: u32) -> Result<u64, CallError> {
        let mut tool = self.north().tool(Duration::from_secs(1));
        let write = |body: &mut Vec<u8>| append(body, &(number,));
        let (probe, hash) = (self.north().name("2.probe.0.0"), ProbingInterface::hash());
        let counted = tool.call(probe, crate::probe::COUNT, hash, write, |bytes| from_bytes(bytes));
        tool.close();
        counted
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
fn calls_and_data_cross_from_system_to_system() {
    let systems = Systems::launched();
    assert_eq!(systems.says("north", &["call", "2.probe.0.0", "count", "1"]).ok(), "1\n");
    assert_eq!(systems.says("north", &["call", "2.probe.0.0", "count", "2"]).ok(), "2\n", "by another tool");
    assert_eq!(systems.says("south", &["call", "1.probe.0.0", "count", "3"]).ok(), "1\n", "the other way");
    let data = systems.says("north", &["echo", "2.probe.0.0", "beat", "--count", "3"]).ok();
    assert_eq!(data.lines().count(), 3, "{data}");
    let word = "x".repeat(900);
    let told = systems.says("north", &["call", "2.probe.0.0", "tell", "1", "2.5", &word, "true", "[1, 2, 3]"]).ok();
    assert!(told.contains(&word), "{told}");
    systems.stop();
}
