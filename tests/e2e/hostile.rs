//! The demo's robot, while a hostile node of its LAN, with the key, and a hostile teammate, with a certificate, attack
//! it: it drives as before, each attempt is counted by cause, and no process takes more memory.
//!
//! Both are programs in Python that know the pages of the book alone (`python/node.py`, `python/teammate.py`). For the
//! whole minute: `ROHRPOST_HOSTILE_SECONDS=60 cargo test -p rohrpost-cli --test e2e hostile`.

use crate::harness::{PATIENCE, Place, Robot, lab, repository, times};
use crate::network::Network;
use crate::process::Running;
use rohrpost::common::GET_DATA;
use rohrpost::interfaces::{LaserInterface, WheelsInterface};
use rohrpost::types::Odometry;
use rohrpost::wire::{append, from_bytes};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

const NODES: [(&str, &str); 4] =
    [("base", "10.77.0.1"), ("brain", "10.77.0.2"), ("desk", "10.77.0.3"), ("away", "10.77.0.9")];
/// Running processes of the robot; `desk` is the hostile node's place.
const RUNNING: [&str; 2] = ["base", "brain"];
const SECURITY: &str = "security = \"keys\"\n[tcp]\nsecurity = \"tls\"\ncertificates = \"certificates\"\n\
    address = \"10.77.0.1\"\n\
                        server = \"base\"\n[access]\nmotor = [\"pilot\"]\n\
                        odometry = [\"pilot\", \"mapper\", \"tool\"]\n\
                        laser = [\"pilot\", \"mapper\", \"tool\"]\ncamera = [\"tool\"]\n";
/// Allowed growth of a process: its bounded queues and tables.
const GROWTH_KIB_MAX: u64 = 16 << 10;

struct Field {
    network: Network,
}

impl Field {
    fn launched() -> Option<Self> {
        let lab = lab(NODES, "hostile programs beside the demo")?;
        let place = Place::new();
        let config = place.write("robot.toml", robot());
        place.copy("config/building.map");
        // The teammate's certificate is signed by the same authority, for a node of another system.
        let teammate = robot().replace("id = 1\n", "id = 2\n").replace("name = \"robot\"", "name = \"mate\"");
        let teammate = teammate.replace("server = \"base\"\n", "").replace("nodes.desk", "nodes.evil");
        place.write("mate.toml", teammate.replace("\"desk\"", "\"evil\""));
        for file in ["robot.toml", "mate.toml"] {
            place.say(&["keys", "new", place.path(file).to_str().unwrap()]).ok();
        }
        Some(Self { network: Network::new(place, config, Some(lab)).launched(&RUNNING) })
    }

    fn robot(&self) -> &Robot {
        self.network.robot("base")
    }

    fn python(&self, node: &str, program: &str, arguments: &[&str]) -> Running {
        let page = repository(&format!("tests/e2e/python/{program}"));
        self.network.python(node, &[&[&*page], arguments].concat())
    }

    /// The hostile node and the hostile teammate, taking part.
    fn attacked(&self, seconds: u64) -> [Running; 2] {
        let digest = self.robot().installation.digest();
        let network = self.robot().installation.network.as_ref().unwrap();
        let (seconds, port, lan) = (seconds.to_string(), network.port.to_string(), format!("{:x}", digest.lan()));
        let (laser, both) = (format!("{:x}", LaserInterface::hash()), digest.to_string());
        let addresses = [NODES[0].1, NODES[1].1, NODES[2].1];
        let node = [&[&seconds, &lan, &port, "keys/udp.keys", &laser, "2"][..], &addresses].concat();
        let teammate = [&seconds, NODES[0].1, "21119", &both, "2", &laser, "certificates", "evil.system-2"];
        let mut all = [self.python("desk", "node.py", &node), self.python("away", "teammate.py", &teammate)];
        all.iter_mut().for_each(|program| program.wait_for("takes part"));
        all
    }

    /// The distance that the robot's wheels drive in this time, m.
    fn drives(&self, time: Duration) -> f64 {
        let mut tool = self.robot().tool(PATIENCE);
        let odometry = self.robot().name("odometry.0");
        let (began, mut last, mut driven_m) = (Instant::now(), None, 0.0);
        while began.elapsed() < time {
            let write = |body: &mut Vec<u8>| append(body, &(WheelsInterface::ODOMETRY.number,));
            let now = tool.call(odometry, GET_DATA, WheelsInterface::hash(), write, |bytes| from_bytes(bytes));
            let (_stamp_ns, now): (u64, Odometry) = now.unwrap();
            let (x_m, y_m) = last.replace((now.pose.x_m, now.pose.y_m)).unwrap_or((now.pose.x_m, now.pose.y_m));
            driven_m += (now.pose.x_m - x_m).hypot(now.pose.y_m - y_m);
            std::thread::sleep(Duration::from_millis(200));
        }
        tool.close();
        driven_m
    }

    /// Memory of each process of the robot, KiB.
    fn memory(&self) -> BTreeMap<u32, u64> {
        let pids = self.network.nodes.iter().flat_map(|(.., robot)| robot.pids());
        pids.map(|pid| (pid, resident_kib(pid))).collect()
    }

    fn stop(self) {
        self.network.stop();
    }
}

fn resident_kib(pid: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:")).unwrap();
    line.trim().trim_end_matches(" kB").parse().unwrap()
}

/// The demo's robot on three nodes, sealed, with a TCP router; without drawing, and with its lines collected on a
/// running node.
fn robot() -> String {
    let text = include_str!("../../config/demo-nodes.toml");
    let (text, _) = text.split_once("# A program of its own").unwrap();
    let (open, _) = text.split_once("security = \"none\"").unwrap();
    let rate = text.split_once("rate = ").unwrap().1;
    let text = format!("{open}security = \"keys\"\nrate = {rate}");
    let tcp = SECURITY.strip_prefix("security = \"keys\"\n").unwrap();
    let text = text.replace("node = \"desk\"", "node = \"brain\"").replace("[time]\n", &format!("{tcp}[time]\n"));
    text.replace("[nodes.base]", "tcp = { id = 64, text = \"Carries packages beyond the LAN\" }\n\n[nodes.base]")
}

#[test]
fn a_robot_drives_as_before_beside_a_hostile_node_and_a_hostile_teammate() {
    let Some(field) = Field::launched() else { return };
    let seconds = times("ROHRPOST_HOSTILE_SECONDS", 20);
    let time = Duration::from_secs(seconds);
    field.drives(Duration::from_secs(3));
    let (before, alone_m) = (field.memory(), field.drives(time / 2));
    let mut hostile = field.attacked(seconds);
    let beside_m = field.drives(time / 2);
    let tried: Vec<BTreeMap<String, u64>> = hostile
        .iter_mut()
        .map(|program| {
            program.wait_for("}");
            serde_json::from_str(program.out().lines().last().unwrap()).unwrap()
        })
        .collect();
    assert!(beside_m > alone_m / 2.0, "{beside_m:.1} m beside them, {alone_m:.1} m alone");
    let after = field.memory();
    assert_eq!(before.keys().collect::<Vec<_>>(), after.keys().collect::<Vec<_>>(), "no process was started again");
    for (pid, kib) in after {
        assert!(kib < before[&pid] + GROWTH_KIB_MAX, "process {pid} has {kib} KiB, and had {}", before[&pid]);
    }
    check_counted(&field, &tried);
    check_said(&field);
    drop(hostile);
    field.stop();
}

/// Counts of routers by cause, anywhere in the output of `net`.
fn causes(told: &serde_json::Value, sums: &mut BTreeMap<String, u64>) {
    match told {
        serde_json::Value::Array(all) => all.iter().for_each(|each| causes(each, sums)),
        serde_json::Value::Object(fields) => {
            let count = ["packages", "datagrams"].iter().find_map(|name| fields.get(*name)?.as_u64());
            if let (Some(cause), Some(count)) = (fields.get("cause").and_then(serde_json::Value::as_str), count) {
                *sums.entry(cause.into()).or_default() += count;
            }
            fields.values().for_each(|each| causes(each, sums));
        }
        _ => {}
    }
}

/// Each kind of attempt is counted under its own cause, where it was refused.
fn check_counted(field: &Field, tried: &[BTreeMap<String, u64>]) {
    let mut sums = BTreeMap::new();
    let told: serde_json::Value =
        serde_json::from_str(field.network.says("base", &["net", "--json"]).out.trim()).unwrap();
    causes(&told, &mut sums);
    let mut tool = field.robot().tool(PATIENCE);
    for module in ["pilot.0", "laser.0", "mapper.0"] {
        let refused = tool.status(field.robot().name(module)).unwrap().refused;
        let counts = [
            ("unasked", refused.unasked + refused.other_publisher + refused.other_number + refused.earlier_incarnation),
            ("no-place", refused.no_place),
            ("malformed", refused.malformed),
        ];
        counts.into_iter().for_each(|(cause, count)| *sums.entry(format!("{module} {cause}")).or_default() += count);
    }
    tool.close();
    let lines = field.network.says("base", &["call", "output.0", "refused", "--json"]).ok();
    let lines: BTreeMap<String, u64> = serde_json::from_str(&lines).unwrap();
    sums.extend(lines.into_iter().map(|(cause, count)| (format!("output.0 {cause}"), count)));
    for (attempts, cause) in [
        (&["scan"][..], "pilot.0 unasked"),
        (&["scan-as-laser"], "foreign-name"),
        (&["drive"], "not-allowed"),
        (&["transit", "tunnel"], "routers-own"),
        (&["line-as-motor"], "output.0 foreign_name"),
        (&["line-flood"], "output.0 beyond_share"),
        (&["line-future"], "output.0 ahead"),
        (&["line-lost"], "output.0 losses"),
        (&["call-forever"], "pilot.0 no-place"),
        (&["lease-forever"], "laser.0 no-place"),
        (&["absent"], "no-mailbox"),
        (&["far-class"], "mapper.0 malformed"),
        (&["junk"], "unsealed"),
    ] {
        let tries: u64 = tried.iter().flat_map(|all| attempts.iter().filter_map(|attempt| all.get(*attempt))).sum();
        assert!(tries > 10, "{attempts:?} was tried {tries} times");
        assert!(
            sums.get(cause).is_some_and(|count| *count > 0),
            "{attempts:?}: nothing counted as {cause} in {sums:?}"
        );
    }
    assert!(tried[1]["registration refused"] > 0, "{tried:?}");
}

/// A hostile module's text has no effect on the terminal.
fn check_said(field: &Field) {
    for arguments in [&["call", "2.mapper.0.0"][..], &["status", "2.mapper.0.0"], &["list"], &["log", "--last", "50"]] {
        let said = field.network.says("base", arguments);
        let is_raw = |c: &char| c.is_control() && *c != '\n' && *c != '\t' || *c == '\u{202e}';
        for text in [&said.out, &said.err] {
            assert_eq!(text.chars().find(is_raw), None, "{arguments:?}: {text:?}");
        }
    }
}
