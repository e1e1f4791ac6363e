//! A robot's laptop, `far`, by a bad Wi-Fi: the robot publishes more than the link carries, and the laptop follows in a
//! mailbox that keeps the newest only.

use crate::harness::{PATIENCE, Place, Robot, lab, probe, wait};
use crate::probe::{COUNT, ProbingInterface};
use crate::process::Running;
use rohrpost::wire::{append, from_bytes};
use rohrpost_routers::lab::Lab;
use std::collections::HashSet;
use std::path::PathBuf;

/// Carries 64 KiB a second; the robot publishes 156 KiB.
const BAD: &str = "rate=64KiB,delay=20ms,jitter=10ms,loss=0.5%,seed=7";
const BLOB: &str = "blob-hz = 40.0, blob-bytes = 4000";
/// Older ones are dropped: without newer ones in their place, all would have about this age.
const WAIT_MAX_US: u64 = rohrpost_routers::session::WAIT_MAX_NS / 1000;
/// Blobs that are looked at.
const BLOBS: usize = 40;
const NODES: [(&str, &str); 2] = [("base", "10.79.2.1"), ("far", "10.79.2.2")];
/// Tools are more important than the followed data.
const CONFIG: &str = r#"
installation = "test"
[system]
name = "robot"
id = 1
[classes]
router = { id = 250 }
probe = { id = 96 }
tcp = { id = 64, text = "Carries packages beyond the LAN" }
output = { id = 32, text = "Collects what modules say" }
tool = { id = 16 }
screen = { id = 10 }
[scheduling]
real-time-from = 256
[nodes.base]
tools = [0, 15]
[nodes.far]
network = "tcp"
tools = [32, 47]
[tcp]
security = "none"
address = "10.79.2.1"
server = "base"
"#;

struct Wifi {
    // Dropped in this order: processes, what they left, their network.
    nodes: Vec<(&'static str, Running, Robot)>,
    place: Place,
    config: PathBuf,
    lab: Lab,
}

impl Wifi {
    /// None, with a report, where namespaces are not permitted.
    fn launched() -> Option<Self> {
        let lab = lab(NODES, "a laptop by a bad Wi-Fi")?;
        let place = Place::new();
        let config = place.path("robot.toml");
        let modules = [
            probe("probe.0", BLOB, "node = \"base\""),
            probe(
                "screen.0",
                "watches = \"probe.0\"",
                "node = \"far\"\naliases = [\"probe.1\"]\ncalls = [\"probe.0\"]",
            ),
        ];
        std::fs::write(&config, format!("{CONFIG}{}", modules.concat())).unwrap();
        let mut wifi = Self { nodes: Vec::new(), place, config, lab };
        for (node, _) in NODES {
            wifi.launch(node);
        }
        Some(wifi)
    }

    fn launch(&mut self, node: &'static str) {
        let mut command = self.place.command(&["launch", self.config.to_str().unwrap(), "--node", node]);
        command.env("ROHRPOST_IMPAIR", BAD);
        let mut launch = {
            let _inside = self.lab.enter(node).unwrap();
            Running::start(command)
        };
        let robot = self.place.robot(&self.config, node, &mut launch);
        robot.wait_on(&mut launch);
        self.nodes.push((node, launch, robot));
    }

    fn robot(&self, node: &str) -> &Robot {
        &self.nodes.iter().find(|(known, ..)| *known == node).unwrap().2
    }

    /// The output of `net` about a node.
    fn net(&self, node: &str) -> serde_json::Value {
        let said = self.place.say_at(&self.config, node, &["net", "--json"]);
        let told: serde_json::Value = serde_json::from_str(said.out.trim()).unwrap_or_default();
        told.as_array().and_then(|all| all.iter().find(|told| told["node"] == node)).cloned().unwrap_or_default()
    }

    /// Packages that newer ones replaced while they waited for the laptop.
    fn replaced(&self) -> u64 {
        let net = self.net("base");
        let classes = net["clients"]["classes"].as_array().into_iter().flatten();
        classes.filter(|class| class["class"] == 10).filter_map(|class| class["replaced"].as_u64()).sum()
    }

    /// Numbers and ages (µs) of all blobs that came.
    fn blobs(&self) -> Vec<(u64, u64)> {
        let record = self.place.record();
        let parse = |line: &String| {
            let (number, age) = line.strip_prefix("screen.0 blob ")?.split_once(' ')?;
            Some((number.parse().unwrap(), age.parse().unwrap()))
        };
        record.iter().filter_map(parse).collect()
    }

    /// Received data are fresh from now on, though more is published than the link carries.
    fn check_fresh(&self) {
        let (seen, replaced) = (self.blobs().len(), self.replaced());
        wait("blobs come, and newer ones took the place of older ones", || {
            (self.blobs().len() >= seen + BLOBS && self.replaced() > replaced).then_some(())
        });
        let mut ages: Vec<u64> = self.blobs()[seen..].iter().map(|(_, age_us)| *age_us).collect();
        ages.sort_unstable();
        eprintln!(
            "ages: {} {} {} µs; replaced: {}",
            ages[0],
            ages[ages.len() / 2],
            ages[ages.len() - 1],
            self.replaced()
        );
        assert!(ages[ages.len() * 3 / 4] < WAIT_MAX_US, "most are younger than what waited in a queue: {ages:?}");
    }

    /// Commands both ways, one after the other: each is answered.
    fn check_commands(&self, first: u32) {
        let far = self.robot("far");
        let mut tool = far.tool(PATIENCE);
        for number in first..first + 10 {
            let write = |body: &mut Vec<u8>| append(body, &(number,));
            let hash = ProbingInterface::hash();
            let counted = tool.call(far.name("probe.0"), COUNT, hash, write, |bytes| from_bytes::<u64>(bytes));
            assert!(counted.is_ok(), "{number}: {counted:?}");
        }
        tool.close();
        assert_eq!(self.place.say_at(&self.config, "base", &["call", "screen.0", "status"]).code, Some(0));
    }

    fn stop(mut self) {
        for (_, mut launch, robot) in self.nodes.drain(..).rev() {
            drop(robot);
            launch.stop();
        }
        self.place.assert_empty();
    }
}

#[test]
fn by_a_bad_wifi_what_comes_is_fresh_and_an_outage_costs_a_gap_and_nothing_else() {
    let Some(wifi) = Wifi::launched() else { return };
    wait("blobs are replaced", || (wifi.replaced() > 0).then_some(()));
    wifi.check_fresh();
    wifi.check_commands(0);
    let shown = wifi.place.say_at(&wifi.config, "base", &["net"]).out;
    let replaced = |line: &str| line.starts_with("TCP router") && line.split_whitespace().any(|word| word == "screen");
    assert!(shown.contains("replaced") && shown.lines().any(replaced), "{shown}");

    let modules = || [("base", "probe.0"), ("far", "screen.0")].map(|(node, module)| wifi.robot(node).pid(module));
    let (before, outages) = (modules(), wait("net tells", || wifi.net("far")["beyond"]["outages"].as_u64()));
    wifi.lab.cut("far").unwrap();
    wait("far is away", || (wifi.net("far")["beyond"]["state"] == "away").then_some(()));
    wifi.lab.fix("far").unwrap();
    wait("far takes part again, and says that it was away", || {
        let beyond = wifi.net("far")["beyond"].clone();
        (beyond["state"] == "up" && beyond["outages"].as_u64() > Some(outages)).then_some(())
    });
    wifi.check_fresh();
    wifi.check_commands(10);
    assert_eq!(modules(), before, "nothing was started again");
    let numbers: Vec<u64> = wifi.blobs().iter().map(|(number, _)| *number).collect();
    assert!(numbers.is_sorted_by(|one, next| one < next), "none twice, and none behind a newer one: {numbers:?}");
    let longest = numbers.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap();
    // After three seconds and more the loss of the peer is noticed.
    assert!(longest > 40 * 3, "{longest} blobs are the gap of the outage");
    let counted = wifi.place.counted();
    assert_eq!((counted.len(), counted.iter().collect::<HashSet<_>>().len()), (20, 20), "each command ran once");
    wifi.stop();
}
