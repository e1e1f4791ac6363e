//! Large records and poses of a robot on its laptop, `far`, which only the TCP router reaches, by a line that is too
//! narrow for them: what comes is whole and the newest, poses do not wait for pictures, and an outage costs a gap.
//!
//! How many come is for the line to say; what is compared is poses with pictures.

use crate::harness::{Place, head, lab, until, wait};
use crate::network::Network;
use crate::replicas_lossy::{Follower, Right, entry, is_picture, is_pose};
use serde_json::Value;

/// A picture of 4 MiB takes more than a second, and a new one is taken each 150 ms.
const NARROW: &str = "rate=3MiB,delay=5ms,seed=23";
const NODES: [(&str, &str); 2] = [("base", "10.79.3.1"), ("far", "10.79.3.2")];
const STREAMS: [&str; 3] = ["camera.0/picture", "localiser.0/pose", "localiser.1/pose"];
const PICTURES: u64 = 40;
const POSES: u64 = 1200;
/// For each picture so many poses come at least: if they waited for pictures, there were hardly more of them.
const POSES_A_PICTURE: u64 = 10;

const CLASSES: &str = "router 250, localiser 128, camera 96, tcp 64, output 32, tool 16";
const CONFIG: &str = r#"
[nodes.base]
tools = [0, 15]
[nodes.far]
network = "tcp"
tools = [32, 47]
[tcp]
security = "tls"
certificates = "certificates"
address = "10.79.3.1"
server = "base"
[[replica]]
stream = "camera.0/picture"
to = ["far"]
delay-alarm = "60 s"
[[replica]]
stream = "localiser.0/pose"
to = ["far"]
delay-alarm = "60 s"
[[replica]]
stream = "localiser.1/pose"
to = ["base"]
delay-alarm = "60 s"
"#;

struct Laptop {
    // Dropped in this order.
    /// By stream: its node, its module, how many records it was told to write, and a reader on the other node.
    streams: [(&'static str, &'static str, u64, Follower); 3],
    network: Network,
}

impl Laptop {
    /// None, with a report, where namespaces are not permitted.
    fn launched() -> Option<Self> {
        let lab = lab(NODES, "replicas on a laptop")?;
        let place = Place::new();
        let modules = [("camera.0", "base"), ("localiser.0", "base"), ("localiser.1", "far")];
        let modules = modules.map(|(name, node)| entry(name, node)).concat();
        let config = place.write("robot.toml", [&head(CLASSES), CONFIG, &modules].concat());
        place.say(&["keys", "new", config.to_str().unwrap()]).ok();
        let network = Network::new(place, config, Some(lab)).impaired(NARROW).launched(&["base", "far"]);
        let follow =
            |node, reader, module, is_right| (node, module, 0, Follower::new(network.robot(reader), module, is_right));
        let streams = [
            follow("base", "far", "camera.0", is_picture as Right),
            follow("base", "far", "localiser.0", is_pose),
            follow("far", "base", "localiser.1", is_pose),
        ];
        Some(Self { streams, network })
    }

    /// Has a module write so many more.
    fn feed(&mut self, at: usize, count: u64) {
        let (node, module, ref mut fed, _) = self.streams[at];
        *fed += count;
        self.network.says(node, &["call", module, "feed", &count.to_string()]).ok();
    }

    /// Has all write so many more, until the last of these has come.
    fn write(&mut self, counts: [u64; 3]) {
        (0..).zip(counts).for_each(|(at, count)| self.feed(at, count));
        self.wait_for_all();
    }

    /// Until the last of all has come: it waits where it was written until it may leave.
    fn wait_for_all(&mut self) {
        until("the last of all has come", || {
            self.streams.iter_mut().for_each(|(.., follower)| follower.follow());
            let has_come = |(_, _, fed, follower): &(_, _, u64, Follower)| follower.newest == Some(fed - 1);
            self.streams.iter().all(has_come)
        });
    }

    /// What an end says of a replica.
    fn state(&self, node: &str, side: &str, stream: &str) -> Option<Value> {
        let net = self.network.net(node);
        net["replicas"][side].as_array()?.iter().find(|state| state["stream"] == stream).cloned()
    }

    fn stop(self) {
        drop(self.streams);
        self.network.stop();
    }
}

#[test]
fn a_laptop_has_whole_pictures_and_fresh_poses_by_a_line_that_is_too_narrow_and_an_outage_costs_a_gap() {
    let Some(mut laptop) = Laptop::launched() else { return };
    laptop.write([1, 1, 1]);
    laptop.write([PICTURES, POSES, POSES]);
    let told: Vec<[u64; 2]> = laptop.streams.iter().map(|(.., follower)| follower.told()).collect();
    assert!(told.iter().all(|[newest, told]| *told == newest + 1), "each is read or told as lost: {told:?}");
    let [pictures, poses, back] = [0, 1, 2].map(|at: usize| laptop.streams[at].3.records);
    eprintln!("{pictures} pictures, {poses} poses, {back} poses back");
    assert!((3..PICTURES).contains(&pictures), "the line is too narrow for all, and wide enough for some");
    assert!(poses >= POSES_A_PICTURE * pictures, "{poses} poses beside {pictures} pictures");
    for (stream, [from, to], records) in [
        (STREAMS[0], ["base", "far"], pictures),
        (STREAMS[1], ["base", "far"], poses),
        (STREAMS[2], ["far", "base"], back),
    ] {
        let [sent, came] = [(from, "sent"), (to, "received")].map(|(node, side)| {
            wait("both ends count what came", || {
                laptop.state(node, side, stream).filter(|state| state["records"].as_u64() >= Some(records))
            })
        });
        assert_eq!((&sent["node"], &came["node"]), (&to.into(), &from.into()), "{sent} {came}");
        assert_eq!(came["records"], records, "each record that came was read: {came}");
    }
    let list = ["stream", "list", "--config", laptop.network.config.to_str().unwrap(), "--node", "far"];
    let listed = laptop.network.place.say(&list).ok();
    let from_base = |line: &str| line.starts_with("camera.0") && line.contains("from node base");
    assert!(listed.lines().any(from_base), "{listed}");

    laptop.feed(0, PICTURES);
    laptop.network.lab().cut("far").unwrap();
    until("far is away", || laptop.network.net("far")["beyond"]["state"] == "away");
    laptop.feed(1, 100);
    laptop.network.lab().fix("far").unwrap();
    laptop.wait_for_all();
    laptop.write([1, 100, 100]);
    let told: Vec<[u64; 2]> = laptop.streams.iter().map(|(.., follower)| follower.told()).collect();
    assert!(told.iter().all(|[newest, told]| *told == newest + 1), "each is read or told as lost: {told:?}");
    laptop.stop();
}
