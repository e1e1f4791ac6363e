//! Teams of real processes: robots of systems of their own, each on a computer of its own.

mod intruders;
mod stranger;
mod two_files;

use crate::exact::replayed;
use crate::harness::{Place, assert_has, head, lab, times, until};
use crate::network::Network;
use crate::process::Said;
use rohrpost_testbed::stalls::{Late, unless_stalled};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Names of computers and their addresses; the robot's number is its place here, from 1.
const ROBOTS: [(&str, &str); 8] = [
    ("r1", "10.80.0.1"),
    ("r2", "10.80.0.2"),
    ("r3", "10.80.0.3"),
    ("r4", "10.80.0.4"),
    ("r5", "10.80.0.5"),
    ("r6", "10.80.0.6"),
    ("r7", "10.80.0.7"),
    ("r8", "10.80.0.8"),
];

/// Robots with a module of class `team` each, and no other.
struct Robots {
    network: Network,
    count: usize,
}

fn number(node: &str) -> u64 {
    node[1..].parse().unwrap()
}

impl Robots {
    /// None is launched yet. `way` makes the section by which a robot reaches the others.
    fn new(count: usize, way: impl Fn(&str) -> String) -> Option<Self> {
        Self::of(count, "", |node| {
            let id = number(node);
            let settings = format!("start = {{ x-m = {id}.0, y-m = 0.0 }}, store = \"incarnation-{node}\"");
            format!("{}{}", way(node), team_module(&settings))
        })
    }

    /// Robots with further classes, each with these sections and modules.
    fn of(count: usize, classes: &str, rest: impl Fn(&str) -> String) -> Option<Self> {
        let lab = lab(ROBOTS[..count].iter().copied(), "teams")?;
        let place = Place::new();
        for (node, _) in &ROBOTS[..count] {
            let id = number(node);
            let head = head(&format!("{classes}team 120, team-router 100, tcp 64, output 32, logd 24, tool 16"));
            let head = head.replace("\"robot\"\nid = 1", &format!("\"{node}\"\nid = {id}"));
            let text = format!("{head}[nodes.{node}]\n{}", rest(node));
            place.write(&format!("{node}.toml"), text);
        }
        let config = place.path("r1.toml");
        Some(Self { network: Network::new(place, config, Some(lab)), count })
    }

    fn nodes(&self) -> impl Iterator<Item = &'static str> + use<> {
        ROBOTS[..self.count].iter().map(|(node, _)| *node)
    }

    fn config(&self, node: &str) -> PathBuf {
        self.network.place.path(&format!("{node}.toml"))
    }

    fn launch(&mut self, node: &'static str) {
        self.network.launch_from(&self.config(node), &[node]);
    }

    fn says(&self, node: &str, arguments: &[&str]) -> Said {
        self.network.place.say_at(&self.config(node), node, arguments)
    }

    /// What robots say of their team, asked at the same time.
    fn states(&self, nodes: &[&str]) -> Vec<Value> {
        std::thread::scope(|scope| {
            let ask = |node| scope.spawn(move || serde_json::from_str(self.says(node, &["team", "--json"]).out.trim()));
            let asked: Vec<_> = nodes.iter().map(|node| ask(*node)).collect();
            asked.into_iter().map(|asked| asked.join().unwrap().unwrap_or_default()).collect()
        })
    }

    /// Waits until these robots are one group that agrees; their states.
    fn agree(&self, nodes: &[&str]) -> Vec<Value> {
        let all: BTreeSet<u64> = nodes.iter().map(|node| number(node)).collect();
        let mut states = Vec::new();
        until(format!("{nodes:?} agree"), || {
            states = self.states(nodes);
            let digests: BTreeSet<&str> = states.iter().filter_map(|state| state["view_digest"].as_str()).collect();
            digests.len() == 1 && states.iter().all(|state| is_of(state, &all))
        });
        states
    }
}

fn team_module(settings: &str) -> String {
    format!("[[module]]\nname = \"team.0\"\nbuiltin = \"team\"\nsettings = {{ {settings} }}\n")
}

/// Whether a robot says that it is in this group, and that all views in it are equal.
fn is_of(state: &Value, all: &BTreeSet<u64>) -> bool {
    let members = state["members"].as_array().into_iter().flatten();
    let fresh = members.filter(|member| member["fresh"] == true).filter_map(|member| member["robot"].as_u64());
    let group: BTreeSet<u64> = fresh.chain(state["robot"].as_u64()).collect();
    let ends = [&state["leader"], &state["group"]].map(Value::as_u64);
    group == *all && ends == [all.first().copied(), all.last().copied()] && state["views_equal"] == true
}

/// The TCP router on the first robot.
fn by_tcp(node: &str) -> String {
    let server = if node == "r1" { "server = \"r1\"\n" } else { "" };
    format!("[tcp]\nsecurity = \"none\"\naddress = \"{}\"\n{server}", ROBOTS[0].1)
}

/// One multicast group, and no server.
fn by_multicast(node: &str) -> String {
    by_group(node, "security = \"none\"")
}

/// Folder of the team's keys, the default.
const KEYS: &str = "team-keys";

fn by_sealed_multicast(node: &str) -> String {
    by_group(node, "security = \"keys\"")
}

fn by_group(node: &str, security: &str) -> String {
    let (_, address) = ROBOTS.into_iter().find(|(name, _)| *name == node).unwrap();
    format!("[team]\ngroup = \"239.80.0.1:21121\"\naddress = \"{address}\"\n{security}\n")
}

/// The last robot keeps a journal.
const RECORDED: &str = "[record]\ndirectory = \"recordings\"\nexact = [\"team.0\"]\nleave-free = \"0 B\"\nflush = \"20 \
                        ms\"\n[[module]]\nname = \"logd.0\"\nbuiltin = \"logd\"\nstop-within = \"60 s\"\n";

#[test]
fn robots_that_meet_by_the_tcp_router_agree_on_group_and_objects_and_repeat_it_exactly() {
    let way = |node: &str| by_tcp(node) + if node == "r3" { RECORDED } else { "" };
    let Some(mut robots) = Robots::new(3, way) else { return };
    let nodes: Vec<&'static str> = robots.nodes().collect();
    nodes.iter().for_each(|node| robots.launch(node));
    robots.agree(&nodes);
    let id = robots.says("r2", &["call", "--json", "team.0", "add_fake", "4.5", "-2"]).json();
    assert_eq!(id["observer"], 2, "{id}");
    until("all see it", || {
        robots.states(&nodes).iter().all(|state| state["objects"].as_array().is_some_and(|it| it.len() == 1))
    });
    let states = robots.agree(&nodes);
    let object = &states[2]["objects"][0];
    assert_eq!(
        (&object["x_m"], &object["y_m"], &object["fake"]),
        (&4.5.into(), &(-2.0).into(), &true.into()),
        "{object}"
    );
    let shown = robots.says("r3", &["team"]).ok();
    assert_has(&shown, ["group 3 of 3 robots, led by robot 1; views are equal", "direct", "made up"]);
    let refused = robots.says("r3", &["call", "team.0", "end_fake", &id.to_string()]);
    assert_eq!(refused.code, Some(1));
    assert_has(&refused.out, ["has made up no such intruder"]);
    robots.says("r2", &["call", "team.0", "end_fake", &id.to_string()]).ok();
    until("it is gone", || robots.states(&nodes).iter().all(|state| state["objects"] == json!([])));
    let before = robots.agree(&nodes);
    robots.network.kill("r2", true);
    robots.launch("r2");
    let after = robots.agree(&nodes);
    assert!(after[1]["incarnation"].as_u64() > before[1]["incarnation"].as_u64(), "{after:#?}");
    let place = robots.network.stop();
    let runs = replayed(&place, &place.path("recordings/r3-0001.mcap"), &["team.0"]);
    assert!(runs.iter().all(|run| run["result"] == "identical" && run["outputs"].as_u64() > Some(20)), "{runs:#?}");
    assert_eq!(runs.len(), 1);
}

/// Length of a beat, the default.
const BEAT: Duration = Duration::from_millis(500);
/// Beats until all know leader and group, after a merge without loss; more where robots fell silent.
const MERGE_BEATS: u64 = 2;
const AGE_BEATS: u64 = 8;
/// Beats until views are equal then, and until all have heard that.
const VIEW_BEATS: u64 = 4;
/// From knowing to the beat that publishes it; and from the event until counters are read.
const LOOK_BEATS: u64 = 2;

/// Runs and counters of robots, by number.
type Counters = BTreeMap<u64, (u64, u64)>;

fn counters(states: &[Value]) -> Counters {
    let of = |state: &Value, key: &str| state[key].as_u64().unwrap_or_default();
    states.iter().map(|state| (of(state, "robot"), (of(state, "incarnation"), of(state, "counter")))).collect()
}

impl Robots {
    /// Waits until these robots agree; those of `counted` within so many of their beats since then.
    fn agree_within(
        &self,
        what: &str,
        [nodes, counted]: [&[&str]; 2],
        beats: u64,
        before: &Counters,
        since: Instant,
    ) -> Result<(), Late> {
        let states = self.agree(nodes);
        for state in states.iter().filter(|state| counted.iter().any(|node| state["robot"] == number(node))) {
            let (run, counter) = before.get(&state["robot"].as_u64().unwrap()).copied().unwrap_or_default();
            let counter = if state["incarnation"] == run { counter } else { 0 };
            for (settled, beats) in [("settled", beats), ("views_settled", beats + VIEW_BEATS)] {
                let counted = state[settled].as_u64().unwrap().saturating_sub(counter);
                if counted > beats {
                    let what =
                        format!("{what}: {settled} of {} after {counted} beats, promised {beats}", state["robot"]);
                    return Err(Late::now(what, since, BEAT / 2));
                }
            }
        }
        Ok(())
    }

    fn all_counters(&self) -> Counters {
        counters(&self.states(&self.nodes().collect::<Vec<_>>()))
    }

    /// Each of these robots makes up an intruder, so that their views differ from those of others.
    fn add_objects(&self, nodes: &[&str], round: u64) {
        for node in nodes {
            let place = [number(node), round].map(|part| part.to_string());
            self.says(node, &["call", "team.0", "add_fake", &place[0], &place[1]]).ok();
        }
    }

    /// Divides the robots and kills one; joins all and starts it again.
    fn round(&mut self, round: u64) -> Result<(), Late> {
        let nodes: Vec<&'static str> = self.nodes().collect();
        let count = nodes.len();
        let first = round as usize * 3;
        let victim = nodes[first % count];
        let far: Vec<&str> = (1..=count / 2).map(|step| nodes[(first + step) % count]).collect();
        let near: Vec<&str> = nodes.iter().copied().filter(|node| !far.contains(node) && *node != victim).collect();
        let since = Instant::now();
        self.network.lab().divide(&far).unwrap();
        self.network.kill(victim, true);
        let before = self.all_counters();
        self.add_objects(&[far[0], near[0]], round);
        for part in [&far, &near] {
            self.agree_within("divided", [part, part], AGE_BEATS + MERGE_BEATS + LOOK_BEATS, &before, since)?;
        }
        let since = Instant::now();
        self.network.lab().unite(&far).unwrap();
        let before = self.all_counters();
        let alive: Vec<&str> = nodes.iter().copied().filter(|node| *node != victim).collect();
        self.agree_within("joined", [&alive, &alive], MERGE_BEATS + LOOK_BEATS, &before, since)?;
        let since = Instant::now();
        let before = self.all_counters();
        self.launch(victim);
        self.agree_within("started again", [&nodes, &[victim]], MERGE_BEATS + LOOK_BEATS, &before, since)?;
        let states = self.agree(&nodes);
        let objects = |state: &Value| state["objects"].as_array().map(Vec::len);
        assert!(states.iter().all(|state| objects(state) == Some(2 * (round as usize + 1))), "{states:#?}");
        Ok(())
    }
}

/// For a long run: `ROHRPOST_TEAM_ROUNDS=50 cargo test -p rohrpost-cli --test e2e team::eight`.
#[test]
fn eight_robots_agree_within_the_stated_beats_however_they_are_cut_and_killed() {
    unless_stalled(|_| {
        let Some(mut robots) = Robots::new(ROBOTS.len(), by_multicast) else { return Ok(()) };
        let nodes: Vec<&'static str> = robots.nodes().collect();
        nodes.iter().for_each(|node| robots.launch(node));
        robots.agree(&nodes);
        for round in 0..times("ROHRPOST_TEAM_ROUNDS", 2) {
            robots.round(round)?;
        }
        robots.network.stop();
        Ok(())
    });
}
