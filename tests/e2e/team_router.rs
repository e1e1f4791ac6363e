//! Systems that reach each other without a server: three of them, each a node in a network namespace of its own.

use crate::harness::{Place, head, lab, probe, until};
use crate::network::Network;
use crate::probe::COUNT;
use crate::process::Said;
use serde_json::Value;
use std::ops::Deref;
use std::time::Duration;

/// Systems 1, 2 and 3, and their addresses.
const SYSTEMS: [(&str, &str); 3] = [("north", "10.79.1.1"), ("south", "10.79.1.2"), ("west", "10.79.1.3")];
const CLASSES: &str = "probe 96, team-router 65, tcp 64, output 32, tool 16";
const GROUP: &str = "group = \"239.79.0.1:21121\"\n";
const SEALED: &str = "security = \"keys\"\n";
const OPEN: &str = "security = \"none\"\n";

struct Team {
    network: Network,
}

impl Deref for Team {
    type Target = Network;

    fn deref(&self) -> &Network {
        &self.network
    }
}

impl Team {
    /// None is launched. `team`: keys of `[team]`; `more`: what stands before it. None, with a report, where namespaces
    /// are not permitted.
    fn new(team: impl Fn(u8) -> String, more: impl Fn(u8) -> String) -> Option<Self> {
        let lab = lab(SYSTEMS, "systems without a server")?;
        let place = Place::new();
        for ((system, address), id) in SYSTEMS.into_iter().zip(1..) {
            let head = head(CLASSES).replace("\"robot\"\nid = 1", &format!("\"{system}\"\nid = {id}"));
            let (team, more) = (team(id), more(id));
            let probe = probe("probe.0", "", "");
            let text = format!("{head}[nodes.{system}]\n{more}[team]\naddress = \"{address}\"\n{team}{probe}");
            place.write(&format!("{system}.toml"), text);
        }
        let config = place.path("north.toml");
        Some(Self { network: Network::new(place, config, Some(lab)) })
    }

    fn launched(team: impl Fn(u8) -> String) -> Option<Self> {
        let mut team = Self::new(team, |_| String::new())?;
        team.make_keys("team-keys");
        SYSTEMS.into_iter().for_each(|(system, _)| team.launch(system));
        Some(team)
    }

    fn make_keys(&self, folder: &str) {
        self.place.say(&["keys", "new", self.place.path(folder).to_str().unwrap()]).ok();
    }

    fn launch(&mut self, system: &'static str) {
        let config = self.place.path(&format!("{system}.toml"));
        self.network.launch_from(&config, &[system]);
    }

    fn says(&self, system: &str, arguments: &[&str]) -> Said {
        self.place.say_at(&self.place.path(&format!("{system}.toml")), system, arguments)
    }

    /// What `net` says of a system's router of the team.
    fn router(&self, system: &str) -> Value {
        let said = self.says(system, &["net", "--json"]);
        let told: Value = serde_json::from_str(said.out.trim()).unwrap_or_default();
        told[0]["team"].clone()
    }

    /// The systems that one hears, and that hear it.
    fn heard(&self, system: &str) -> Vec<u64> {
        let router = self.router(system);
        let nodes = router["nodes"].as_array().into_iter().flatten();
        let both = nodes.filter(|node| node["proven"] == true && node["hears_us"] == true);
        both.filter_map(|node| node["system"].as_u64()).collect()
    }

    fn wait_heard(&self, system: &str, others: &[u64]) {
        until(format!("{system} hears {others:?}"), || self.heard(system) == others);
    }

    fn wait_all(&self) {
        self.wait_heard("north", &[2, 3]);
        self.wait_heard("south", &[1, 3]);
        self.wait_heard("west", &[1, 2]);
    }

    /// A tool at a system counts at a module of this name.
    fn count(&self, system: &str, to: &str, number: u32) {
        let robot = self.robot(system);
        let mut tool = robot.tool(Duration::from_secs(1));
        robot.begin(&mut tool, to, COUNT, &(number,));
        tool.close();
    }

    fn times(&self, number: u32) -> usize {
        self.place.counted().into_iter().filter(|counted| *counted == number).count()
    }

    /// Packages for all systems come to each once, and those for one system to that.
    fn check_crossing(&self) {
        for ((system, _), number) in SYSTEMS.into_iter().zip([100, 200, 300]) {
            self.count(system, "255.probe.0.0", number);
            until(format!("all count what came from {system}"), || self.times(number) >= 3);
            // A duplicate would have come before these.
            for other in ["1.probe.0.0", "2.probe.0.0", "3.probe.0.0"] {
                let counts = || self.says(system, &["call", other, "count", &(number + 1).to_string()]).code == Some(0);
                until(format!("{other} answers {system}"), counts);
            }
            assert_eq!(self.times(number), 3, "once in each system: {:?}", self.place.record());
        }
    }
}

#[test]
fn systems_find_each_other_by_multicast_without_a_server() {
    let Some(team) = Team::launched(|_| format!("{SEALED}{GROUP}")) else { return };
    team.wait_all();
    team.check_crossing();
    let told = team.says("north", &["net"]).ok();
    assert!(told.contains("10.79.1.2:21121") && told.contains("both ways") && told.contains(", sealed"), "{told}");
    team.network.stop();
}

#[test]
fn a_restarted_router_is_heard_again_and_a_stranger_with_another_key_never() {
    let Some(mut team) = Team::new(
        |id| format!("{SEALED}{GROUP}{}", if id == 3 { "keys = \"other-keys\"\n" } else { "" }),
        |_| String::new(),
    ) else {
        return;
    };
    team.make_keys("team-keys");
    team.make_keys("other-keys");
    SYSTEMS.into_iter().for_each(|(system, _)| team.launch(system));
    team.wait_heard("north", &[2]);
    team.wait_heard("south", &[1]);
    team.robot("north").kill("team-router.0");
    team.wait_heard("north", &[2]);
    team.wait_heard("south", &[1]);
    team.count("west", "255.probe.0.0", 7);
    team.count("north", "255.probe.0.0", 8);
    until("south counts", || team.times(8) == 2);
    until("west refuses what it cannot open", || team.router("west")["refused"][0]["cause"] == "unsealed");
    assert_eq!(team.heard("west"), [0; 0]);
    assert_eq!(team.times(7), 1, "west alone: {:?}", team.place.record());
    team.network.stop();
}

#[test]
fn known_peers_reach_each_other_without_multicast() {
    let hosts = "# all\n1 10.79.1.1\n2 10.79.1.2\n3 10.79.1.3\n";
    let peers = |id: u8| {
        let others = SYSTEMS.into_iter().zip(1..).filter(|(_, other)| *other != id);
        others.map(|((_, address), other)| format!("{other} = \"{address}\", ")).collect::<String>()
    };
    let by_file =
        |id: u8| if id == 3 { "peers = \"hosts\"\n".into() } else { format!("peers = {{ {} }}\n", peers(id)) };
    let Some(mut team) = Team::new(|id| format!("{OPEN}{}", by_file(id)), |_| String::new()) else { return };
    team.place.write("hosts", hosts);
    let refused = team.place.say(&["check", team.place.path("west.toml").to_str().unwrap()]);
    assert!(refused.code == Some(1) && refused.err.contains("hosts:4: system 3 is this one"), "{refused:?}");
    team.place.write("hosts", hosts.replace("3 10.79.1.3\n", ""));
    SYSTEMS.into_iter().for_each(|(system, _)| team.launch(system));
    team.wait_all();
    team.check_crossing();
    team.network.stop();
}

#[test]
fn what_comes_by_the_tcp_router_and_by_the_team_is_delivered_once() {
    let [(_, north), ..] = SYSTEMS;
    let tcp = |id: u8| {
        let server = if id == 1 { "server = \"north\"\n" } else { "" };
        format!("[tcp]\n{OPEN}address = \"{north}\"\n{server}")
    };
    let Some(mut team) = Team::new(|_| format!("{SEALED}{GROUP}"), tcp) else { return };
    team.make_keys("team-keys");
    SYSTEMS.into_iter().for_each(|(system, _)| team.launch(system));
    team.wait_all();
    for (system, _) in SYSTEMS {
        until(format!("{system} takes part"), || {
            let said = team.says(system, &["net", "--json"]);
            serde_json::from_str::<Value>(said.out.trim()).unwrap_or_default()[0]["beyond"]["state"] == "up"
        });
    }
    team.check_crossing();
    until("the second copies are counted", || team.router("south")["copies"].as_u64() >= Some(2));
    team.network.stop();
}
