//! Robots and a station that start from the team's map and hosts file alone, each on a computer of its own; and those
//! that have no part in it.

use crate::harness::{Place, assert_has, lab, until};
use crate::process::{Running, Said};
use rohrpost_routers::lab::Lab;
use serde_json::Value;
use std::path::PathBuf;

/// Ids in the hosts file, with gaps, and the computers.
const HOSTS: [(u8, &str, &str); 4] =
    [(0, "h0", "10.81.0.1"), (3, "h3", "10.81.0.4"), (5, "h5", "10.81.0.6"), (7, "h7", "10.81.0.8")];
const STATION: u8 = 5;
/// Another station, with keys of its own.
const STRANGER: u8 = 7;

const MAP: &str = "\
********************
*                  *
* ................ *
* .              . *
* .              . *
* ................ *
*                  *
********************
";

/// What stands in for the drivers: a world of one robot, and its body there.
fn drivers(id: u8, cell: &str) -> String {
    let system = id + 1;
    format!(
        "[[module]]\nname = \"arena.0\"\nbuiltin = \"arena\"\nsettings = {{ map = \"lab.map\", cell-m = 1.0, socket = \
         \"arena{id}.sock\", robots = [{{ id = {system}, cell = \"{cell}\" }}] }}\n[[module]]\nname = \
         \"motor.1\"\naliases = [\"odometry.0\", \"laser.0\"]\nbuiltin = \"body\"\nsettings = {{ arena = \
         \"arena{id}.sock\" }}\n[module.mailbox.commands]\nmax-age = \"100 ms\"\n\
         [module.stream.odometry]\nrecord = \"128 B\"\n"
    )
}

/// The computers, and what runs there.
struct Computers {
    place: Place,
    lab: Lab,
    running: Vec<(u8, Running)>,
}

impl Computers {
    fn new() -> Option<Self> {
        let lab = lab(HOSTS.iter().map(|(_, node, address)| (*node, *address)), "a team's programs")?;
        let place = Place::new();
        place.write("lab.map", MAP);
        let line = |(id, _, address): &(u8, &str, &str)| format!("{id} {address} {}\n", 5000 + 100 * u16::from(*id));
        let hosts: String = HOSTS.iter().map(line).collect();
        place.write("hosts", &hosts);
        place.say(&["keys", "new", place.path("team-keys").to_str().unwrap()]).ok();
        std::fs::create_dir(place.path("strange")).unwrap();
        place.write("strange/hosts", &hosts);
        place.say(&["keys", "new", place.path("strange/team-keys").to_str().unwrap()]).ok();
        for (id, cell) in [(0, "2,2"), (3, "17,5")] {
            place.write(&format!("host{id}.toml"), drivers(id, cell));
        }
        for id in [STATION, STRANGER] {
            place.write(&format!("host{id}.toml"), "# nothing besides\n");
        }
        Some(Self { place, lab, running: Vec::new() })
    }

    fn node(id: u8) -> &'static str {
        HOSTS.iter().find(|(host, ..)| *host == id).unwrap().1
    }

    fn config(&self, id: u8) -> PathBuf {
        self.place.path(&format!("host{id}.made-{id}.toml"))
    }

    /// Starts a program on its computer, and waits until its modules run.
    fn start(&mut self, id: u8, program: &[&str], hosts: &str) {
        let own = self.place.path(&format!("host{id}.toml"));
        let (id_text, own) = (id.to_string(), own.to_str().unwrap());
        let words = [program, &[&id_text, "lab.map", hosts, "--config", own, "--quiet"]].concat();
        let inside = self.lab.enter(Self::node(id)).unwrap();
        let program = self.place.start(&words);
        drop(inside);
        until(format!("host {id} runs"), || program.out().contains("runs: ") || program.err().contains("cannot"));
        self.running.push((id, program));
    }

    /// A person's command at a computer.
    fn says(&self, id: u8, words: &[&str]) -> Said {
        let config = self.config(id);
        self.place.say(&[words, &["--config", config.to_str().unwrap()]].concat())
    }

    fn state(&self, id: u8) -> Value {
        serde_json::from_str(self.says(id, &["team", "--json"]).out.trim()).unwrap_or_default()
    }

    /// Waits until a host hears these systems, and no others.
    fn hears(&self, id: u8, systems: &[u64]) {
        until(format!("host {id} hears {systems:?}"), || {
            let state = self.state(id);
            let members = state["members"].as_array().into_iter().flatten();
            members.filter(|it| it["fresh"] == true).filter_map(|it| it["robot"].as_u64()).eq(systems.iter().copied())
        });
    }

    /// Waits until a host knows objects like these: name and whether fake.
    fn knows(&self, id: u8, names: &[&str]) {
        until(format!("host {id} knows {names:?}"), || {
            let state = self.state(id);
            let name = |object: &Value| {
                let id = &object["id"];
                format!("{}-{}.{} {}", id["observer"], id["incarnation"], id["number"], object["fake"])
            };
            let known: Vec<String> = state["objects"].as_array().into_iter().flatten().map(name).collect();
            known == names
        });
    }

    fn end(&mut self, id: u8) -> Running {
        let at = self.running.iter().position(|(host, _)| *host == id).unwrap();
        self.running.remove(at).1
    }
}

#[test]
fn robots_and_a_station_work_from_two_files_and_strangers_take_no_part() {
    let Some(mut computers) = Computers::new() else { return };
    computers.start(0, &["wormhole"], "hosts");
    computers.start(3, &["wormhole"], "hosts");
    computers.start(STATION, &["station", "start"], "hosts");
    computers.start(STRANGER, &["station", "start"], "strange/hosts");
    computers.hears(STATION, &[1, 4]);
    computers.hears(0, &[4, 6]);
    // Other keys: nobody hears them, and both ends say so.
    computers.hears(STRANGER, &[]);
    computers.says(STRANGER, &["station", "quit", "--all"]).fails_with(["no robot is heard now"]);
    computers.says(STRANGER, &["station", "fake", "set", "5.5", "5.5"]).ok();
    until("the robots tell of another key", || computers.says(0, &["net"]).out.contains("unsealed"));
    let told = computers.says(STRANGER, &["halt", "--all"]).fails();
    assert_has(&told, ["--all: no other system is heard"]);
    // A fake intruder is one for all robots, and marked.
    let name = computers.says(STATION, &["station", "fake", "set", "9.5", "5.5", "--json"]).json()["name"].clone();
    let name = name.as_str().unwrap();
    let known = format!("{name} true");
    computers.knows(0, &[&known]);
    computers.knows(3, &[&known]);
    assert_has(&computers.says(3, &["team"]).out, ["made up"]);
    computers.says(STATION, &["station", "fake", "set", "0.5", "0.5"]).fails_with(["on no path of the map"]);
    until("both block it", || {
        let told: Value =
            serde_json::from_str(&computers.says(STATION, &["station", "info", "--json"]).out).unwrap_or_default();
        let told = told.as_array().cloned().unwrap_or_default();
        let blocks = |it: &Value| it["answer"] == "done" && it["text"].as_str().unwrap().starts_with("blocking at ");
        told.len() == 2 && told.iter().all(blocks)
    });
    computers.says(STATION, &["station", "fake", "move", name, "5.5", "5.5"]).ok();
    computers.says(STATION, &["station", "fake", "remove", name]).ok();
    computers.knows(0, &[]);
    computers.says(STATION, &["station", "fake", "remove", name]).fails_with(["has made up no such intruder"]);
    // A robot has something to say.
    computers.says(3, &["call", "payload.0", "say", "the door is closed"]).ok();
    until("the station has heard it", || {
        computers
            .says(STATION, &["echo", "station.0", "state", "--json", "--count", "1"])
            .out
            .contains("the door is closed")
    });
    // All robots stand until they are let go.
    let halted = computers.says(STATION, &["halt", "--all"]).ok();
    assert_has(&halted, ["halted: 1.wormhole.0", "halted: 4.wormhole.0"]);
    assert_has(&computers.says(STATION, &["resume", "--all"]).ok(), ["free: 1.wormhole.0", "free: 4.wormhole.0"]);
    // One ends, then all.
    computers.says(STATION, &["station", "quit", "4"]).ok_with(["robot 4: ends"]);
    let mut ended = computers.end(3);
    assert!(ended.end().success(), "{}{}", ended.out(), ended.err());
    computers.hears(STATION, &[1]);
    computers.says(STATION, &["station", "quit", "4"]).fails_with(["robot 4 is not heard now"]);
    computers.says(STATION, &["station", "quit", "--all"]).ok_with(["robot 1: ends"]);
    let mut ended = computers.end(0);
    assert!(ended.end().success(), "{}{}", ended.out(), ended.err());
    for id in [STATION, STRANGER] {
        computers.end(id).stop();
    }
    computers.place.assert_empty();
}

#[test]
fn mistakes_of_the_two_files_are_told_with_line_column_and_what_would_be_right() {
    let place = Place::new();
    place.write("lab.map", MAP);
    place.write("bad.map", MAP.replacen('.', "#", 1));
    place.write("hosts", "0 127.0.0.1 5000\n3 127.0.0.1 5100\n");
    place.write("bad", "0 127.0.0.1 5000\n1 127.0.0.1 5001\n2 robot 5200\n");
    for (words, told) in [
        (
            &["1", "lab.map", "hosts", "--insecure"][..],
            "hosts: line 3, column 1: host 1 is missing; add a line `1 ADDRESS PORT`, or start one of those: 0, 3\n",
        ),
        (
            &["0", "bad.map", "hosts", "--insecure"],
            "bad.map: line 3, column 3: `#` is no square; expected `*` (wall), `.` (path), a blank (neither), `R` \
             (robot) or `I` (intruder)\n",
        ),
        (
            &["0", "lab.map", "bad", "--insecure"],
            "bad: line 2, column 13: port 5001 of 127.0.0.1 is too near to that of host 0, 5000 in line 1; several are \
             taken upward from each, so leave a gap, for example 5100\nbad: line 3, column 3: `robot` is not the IP \
             address of one computer; write for example 10.10.5.45\n",
        ),
        (&["0", "no.map", "hosts", "--insecure"], "no.map: No such file or directory (os error 2)\n"),
    ] {
        for program in [&["wormhole"][..], &["station", "start"]] {
            assert_eq!(place.say(&[program, words].concat()).fails(), told);
        }
    }
    let told = place.say(&["wormhole", "0", "lab.map", "hosts"]).fails();
    assert_has(&told, ["no keys: ", "team-keys is not there; `rohrpost keys new ", "--insecure anyone on the network"]);
}
