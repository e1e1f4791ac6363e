//! Nodes that only the TCP router reaches, such as a robot's laptop: all nodes of the file in namespaces of their own,
//! `base` and `arm` on a LAN, `far` on a link of its own to `base`.

use crate::harness::{PATIENCE, Place, head, probe, until, wait};
use crate::network::{launched_all, nodes};
use crate::process::{Running, Said};
use crate::systems::CLASSES;
use rohrpost_mailbox::{SystemClock, monotonic_ns};
use std::path::PathBuf;

const FAR: &str = "[nodes.far]\nnetwork = \"tcp\"\ntools = [32, 47]\n";
const OPEN: &str = "[network]\nsecurity = \"none\"\n[tcp]\nsecurity = \"none\"\n";
const SEALED: &str = "[network]\nsecurity = \"keys\"\n[tcp]\nsecurity = \"tls\"\ncertificates = \"certificates\"\n";

struct Field {
    place: Place,
    config: PathBuf,
    launch: Running,
    nodes: Vec<&'static str>,
}

impl Field {
    /// probe.0 on `base`, which follows far's, probe.1 on `arm` if it is there, probe.2 on `far`, which follows base's.
    /// None where namespaces are not permitted.
    fn launched(nodes: &[&'static str], lan: &str, security: &str) -> Option<Self> {
        let place = Place::new();
        let mut modules = vec![
            probe("probe.0", "rate-hz = 20.0, hears = \"probe.2\"", "node = \"base\"\ncalls = [\"probe.2\"]"),
            probe("probe.2", "rate-hz = 20.0, hears = \"probe.0\"", "node = \"far\"\ncalls = [\"probe.0\"]"),
        ];
        if nodes.contains(&"arm") {
            modules.push(probe("probe.1", "", "node = \"arm\""));
        }
        let text = format!(
            "{}{FAR}{lan}{security}address = \"192.168.7.1\"\nserver = \"base\"\n{}",
            head(CLASSES),
            modules.concat()
        );
        let config = place.write("robot.toml", text);
        if security == SEALED {
            place.say(&["keys", "new", config.to_str().unwrap()]).ok();
        }
        let launch = launched_all(&place, &config, nodes, &[])?;
        Some(Self { place, config, launch, nodes: nodes.to_vec() })
    }

    fn says(&self, node: &str, arguments: &[&str]) -> Said {
        self.place.say_at(&self.config, node, arguments)
    }

    /// The view of a tool for all nodes.
    fn shows(&self, arguments: &[&str]) -> Said {
        self.place.say(&[arguments, &["--config", self.config.to_str().unwrap()]].concat())
    }

    /// The result of a call, as soon as one succeeds.
    fn calls(&self, node: &str, module: &str) {
        until(format!("{module} from {node}"), || self.says(node, &["call", module, "count", "1"]).code == Some(0));
    }

    fn heard(&self, module: &str) -> usize {
        let head = format!("{module} each ");
        self.place.record().iter().filter(|line| line.starts_with(&head)).count()
    }

    /// Waits until data arrive both ways between `base` and `far`.
    fn wait_heard(&self) {
        let before = ["probe.0", "probe.2"].map(|module| self.heard(module));
        until("beats both ways", || {
            let now = ["probe.0", "probe.2"].map(|module| self.heard(module));
            now[0] > before[0] && now[1] > before[1]
        });
    }

    fn check_talk(&self) {
        for (node, module) in [("base", "probe.2"), ("far", "probe.0"), ("far", "probe.1"), ("arm", "probe.2")] {
            if self.nodes.contains(&node) && (self.nodes.contains(&"arm") || module != "probe.1") {
                self.calls(node, module);
            }
        }
        self.wait_heard();
    }

    /// All tools show it.
    fn check_tools(&self) {
        let list = self.shows(&["list"]).ok();
        for module in ["probe.0", "probe.2", "tcp.0", "tcp.255"] {
            let line = list.lines().find(|line| line.starts_with(&format!("{module} "))).unwrap_or_default();
            assert!(line.contains(" on "), "{module}:\n{list}");
        }
        until("far is up", || {
            let net = self.shows(&["net"]).out;
            net.lines().any(|line| line.starts_with("far ") && line.contains(" up "))
        });
        let time = || self.shows(&["time"]);
        let told = wait("far has the time", || Some(time()).filter(|told| told.code == Some(0))).ok();
        assert!(told.lines().any(|line| line.starts_with("far ") && line.contains("by TCP")), "{told}");
        let json = self.shows(&["time", "--json"]).json();
        let far = json["nodes"].as_array().unwrap().iter().find(|node| node["node"] == "far").unwrap();
        let error_ns = far["beyond"]["error_ns"].as_u64().unwrap();
        // All clocks are one computer's, so the stated error is an upper bound.
        let clocks = ["base", "far"].map(|node| SystemClock::open(&self.place.robot_at(&self.config, node).node));
        let now = monotonic_ns();
        let [base, far] = clocks.map(|clock| clock.at(now));
        let (off, bound) = (base.ns.abs_diff(far.ns), base.error + far.error);
        assert!(u128::from(off) <= bound.as_nanos(), "{off} ns off, at most {bound:?} as they say");
        assert!(error_ns > 0 && bound < PATIENCE, "{error_ns}");
        until("beats are in the graph", || {
            let graph = self.shows(&["graph", "--seconds", "1"]).ok();
            let edge = |from: &str, to: &str| {
                graph.lines().any(|line| line.split_whitespace().take(2).eq([from, to]) && line.contains("beat"))
            };
            edge("probe.0", "probe.2") && edge("probe.2", "probe.0")
        });
    }

    /// The counts of far's client of the TCP router, if it answers.
    fn beyond(&self) -> Option<serde_json::Value> {
        let told: serde_json::Value = serde_json::from_str(self.shows(&["net", "--json"]).out.trim()).ok()?;
        let far = told.as_array()?.iter().find(|node| node["node"] == "far")?;
        Some(far["beyond"].clone())
    }

    fn stop(mut self) {
        self.launch.stop();
        self.place.assert_empty();
    }
}

/// A LAN of `base` and `arm`.
fn two() -> String {
    nodes([("base", "10.77.0.1"), ("arm", "10.77.0.2")]) + "[time]\nsource = \"master\"\n"
}

#[test]
fn a_laptop_of_a_robot_with_one_computer_calls_hears_and_is_called() {
    let Some(field) = Field::launched(
        &["base", "far"],
        "[nodes.base]\ntools = [0, 15]\n",
        &OPEN.replace("[network]\nsecurity = \"none\"\n", ""),
    ) else {
        return;
    };
    field.check_talk();
    field.check_tools();
    field.stop();
}

#[test]
fn sealed_it_reaches_all_nodes_of_a_lan_and_an_outage_costs_a_gap() {
    let Some(field) = Field::launched(&["base", "arm", "far"], &two(), SEALED) else { return };
    field.check_talk();
    field.check_tools();
    let before = wait("far counts outages", || field.beyond()?["outages"].as_u64());
    let server = field.place.robot_at(&field.config, "base");
    server.kill("tcp.255");
    field.check_talk();
    let (began_ns, ended_ns) = wait("it says how long it was away", || {
        let beyond = field.beyond()?;
        // A busy computer may have caused earlier ones.
        beyond["outages"].as_u64().filter(|outages| *outages > before)?;
        Some((beyond["outage"]["began_ns"].as_u64()?, beyond["outage"]["ended_ns"].as_u64()?))
    });
    assert!(began_ns < ended_ns, "{began_ns} to {ended_ns}");
    until("it says so in words", || {
        let net = field.shows(&["net"]).out;
        net.lines().any(|line| line.starts_with("far ") && line.contains("  took "))
    });
    field.stop();
}
