//! A module with several nodes: one runs it, the next takes over when that one's computer is gone, and never two do.

mod beyond;
mod cut;
mod deaths;

use crate::harness::{Place, probe, repository, runs, signal, until, wait};
use crate::network::{NETWORK, Network, addresses, at, nodes};
use crate::process::Running;
use nix::sys::signal::Signal;
use rohrpost::interfaces::{ControlMode, ControlState, RouterInterface, SupervisorInterface};
use rohrpost::wire::from_bytes;
use rohrpost_mailbox::{ModuleState, ParticipantInfo};
use std::path::PathBuf;
use std::time::{Duration, Instant};

const CALL: Duration = Duration::from_secs(1);

/// Node base grants, brain is the first choice for probe.0, and desk the second.
fn launched() -> Network {
    launched_with(&["probe.0"], SLOW)
}

/// Nodes for these modules, which all move, with these settings.
fn launched_with(moving: &[&str], settings: &str) -> Network {
    let ([base, brain], [desk, _]) = (addresses(), addresses());
    let place = Place::new();
    let config = config(&place, [&base, &brain, &desk], NETWORK, moving, settings);
    Network::new(place, config, None).launched(&NODES)
}

/// How often what moves publishes.
const SLOW: &str = "rate-hz = 20.0";

/// In the order in which they are launched.
const NODES: [&str; 3] = ["base", "brain", "desk"];

/// `network`: that section, and further ones. Each of the modules that move calls probe.9 of base, and it calls
/// probe.0.
fn config(place: &Place, [base, brain, desk]: [&str; 3], network: &str, moving: &[&str], settings: &str) -> PathBuf {
    let table = nodes([("base", base), ("brain", brain), ("desk", desk)]) + network;
    place.config_of("test", &table, &[&modules("base", moving, settings)])
}

/// Tables of probe.9, on this node, and of what moves.
fn modules(node: &str, moving: &[&str], settings: &str) -> String {
    let stays = "rate-hz = 20.0, hears = \"probe.0\"";
    let moves = format!("hears = \"probe.9\", {settings}");
    let keys = "nodes = [\"brain\", \"desk\"]\nwitness = \"base\"\ncalls = [\"probe.9\"]";
    let moving: String = moving.iter().map(|name| probe(name, &moves, keys)).collect();
    at(node, &probe("probe.9", stays, "calls = [\"probe.0\"]")) + &moving
}

/// All processes of a node at once, as its power goes: none of them sees another one die.
fn die(lan: &Network, node: &str) {
    let dead = all(lan, node);
    dead.iter().for_each(|pid| signal(*pid, Signal::SIGSTOP));
    dead.iter().for_each(|pid| signal(*pid, Signal::SIGKILL));
}

/// Launches a node that has died; it stands by.
fn again(lan: &mut Network, node: &'static str) {
    let command = lan.place.command(&["launch", lan.config.to_str().unwrap(), "--node", node]);
    let mut launch = lan.inside(node, || Running::start(command));
    let robot = lan.place.robot(&lan.config, node, &mut launch);
    // On if the holder lost its lease meanwhile: the caller sees to that.
    until(format!("{node} is back"), || ["stands by", "on"].contains(&robot.state("probe.0")));
    *lan.nodes.iter_mut().find(|(name, ..)| *name == node).unwrap() = (node, launch, robot);
}

/// Whether the module is on at a node.
fn is_on(lan: &Network, node: &str) -> bool {
    is_on_there(lan, "probe.0", node)
}

fn is_on_there(lan: &Network, module: &str, node: &str) -> bool {
    let process = lan.robot(node).process(module);
    process.is_some_and(|process| process.state == Some(ModuleState::On) && runs(process.pid))
}

/// Calls come through, and never are two on.
fn answered(lan: &Network, holder: &str, other: &str) {
    until(format!("{holder} answers"), || {
        assert!(!(is_on(lan, holder) && is_on(lan, other)), "two are on");
        is_on(lan, holder) && lan.robot("base").count("probe.0", 1, CALL).is_ok()
    });
}

/// What moves hears probe.9, to which its subscription is a call, and is heard by it.
fn heard(lan: &Network) {
    let count = |by: &str| lan.place.record().iter().filter(|line| line.starts_with(by)).count();
    let before = ["probe.0 each", "probe.9 each"].map(|by| (by, count(by)));
    until("they hear each other", || before.iter().all(|(by, before)| count(by) > before + 2));
}

/// All processes of a node.
fn all(lan: &Network, node: &str) -> Vec<u32> {
    let mut all = vec![lan.launcher(node).pid()];
    all.extend(lan.robot(node).pids());
    all
}

#[test]
fn the_next_node_takes_over_from_a_dead_computer_and_keeps_the_module() {
    let mut lan = launched();
    answered(&lan, "brain", "desk");
    until("desk stands by", || lan.robot("desk").state("probe.0") == "stands by");
    lan.place.say(&["list"]).ok_with(["probe.0   brain  on", "probe.0   desk   standby"]);
    lan.place.say(&["status", "probe.0"]).ok_with(["probe.0  brain  on", "probe.0  desk   standby"]);
    let pid = lan.robot("desk").pid("probe.0");
    heard(&lan);
    die(&lan, "brain");
    answered(&lan, "desk", "brain");
    assert_eq!(lan.robot("desk").pid("probe.0"), pid, "the process that stood by");
    heard(&lan);
    let said = lan.launcher("desk").out() + &lan.launcher("desk").err();
    assert!(!said.contains("could not be switched on"), "{said}");

    again(&mut lan, "brain");
    for number in 0..20 {
        until("a call comes through", || lan.robot("base").count("probe.0", number, CALL).is_ok());
        assert_eq!((lan.robot("desk").pid("probe.0"), is_on(&lan, "brain")), (pid, false), "the holder stays");
    }
    lan.kill("desk", true);
    until("brain takes over again", || is_on(&lan, "brain"));
    heard(&lan);
}

#[test]
fn a_holder_that_cannot_renew_is_off_before_the_next_begins() {
    let mut lan = launched();
    answered(&lan, "brain", "desk");
    let first = lan.robot("brain").pid("probe.0");
    // A takeover begins it as configured. Launch of brain has seen that it is off when it says so.
    lan.says("brain", &["call", "probe.0", "off"]).ok();
    lan.says("brain", &["start", "probe.0"]).fails_with(["probe.0 runs already, and is off"]);
    // The module itself goes on: a timer of the kernel ends it.
    lan.launcher("brain").signal(Signal::SIGSTOP);
    until("desk takes over", || {
        let has_begun = is_on(&lan, "desk");
        assert!(!has_begun || !runs(first), "two run");
        has_begun
    });
    answered(&lan, "desk", "brain");
    lan.launcher("brain").signal(Signal::SIGCONT);
    for number in 0..20 {
        until("a call comes through", || lan.robot("base").count("probe.0", number, CALL).is_ok());
        assert!(!is_on(&lan, "brain"), "the holder stays");
    }
    // It stands by as before: its own timer has ended it, and no failure.
    lan.kill("desk", true);
    until("brain takes over again", || is_on(&lan, "brain"));
}

#[test]
fn a_suspended_holder_is_off_when_it_goes_on_and_is_refused() {
    suspended(launched_with(&["probe.0"], UNWILLING), "base", |lan| foreign(lan, "base"));
}

/// When it goes on it is asked to end, and sends until it is ended.
const UNWILLING: &str = "ignore-stop = true, rate-hz = 200.0";

/// Suspends the first holder until the next one has taken over. `caller`: a node that calls it; `refused`: how many
/// packages of a former holder were refused on the way to probe.9.
fn suspended(mut lan: Network, caller: &str, refused: impl Fn(&Network) -> u64) {
    let is_reached = |lan: &Network| lan.robot(caller).count("probe.0", 1, CALL).is_ok();
    until("brain answers", || is_on(&lan, "brain") && is_reached(&lan));
    let first = lan.robot("brain").pid("probe.0");
    let beats = || {
        let record = lan.place.record().into_iter();
        record.filter_map(|line| line.strip_prefix("probe.9 each ")?.parse().ok()).collect::<Vec<u64>>()
    };
    until("it is heard for a while", || beats().last().is_some_and(|beat| *beat > 600));
    let suspended = all(&lan, "brain");
    suspended.iter().for_each(|pid| signal(*pid, Signal::SIGSTOP));
    until("desk answers", || lan.robot("desk").state("probe.0") == "on" && is_reached(&lan));
    until("desk is heard", || beats().last().is_some_and(|beat| *beat < 600));
    let (refused_before, before) = (refused(&lan), beats().len());
    suspended.iter().for_each(|pid| signal(*pid, Signal::SIGCONT));
    until("its process ends", || !runs(first));
    until("what it sent is refused and counted", || refused(&lan) > refused_before);
    let after = beats().split_off(before);
    assert!(after.is_sorted() && after.iter().all(|beat| *beat < 600), "nothing of it passed: {after:?}");
    for _ in 0..20 {
        until("a call comes through", || is_reached(&lan));
        assert!(!is_on(&lan, "brain"), "the holder stays");
    }
    // It stands by as before: its own timer has ended it, and no failure.
    lan.kill("desk", true);
    until("brain takes over again", || is_on(&lan, "brain"));
}

/// Packages that a node's router refused, since they came from a node that does not have their sender.
fn foreign(lan: &Network, node: &str) -> u64 {
    let (robot, mut tool) = (lan.robot(node), lan.robot(node).tool(CALL));
    let (_, links) = robot.newest(&mut tool, "router.0", RouterInterface::LINKS).unwrap();
    tool.close();
    let lost = links.classes.iter().flat_map(|class| &class.lost);
    lost.filter(|lost| lost.cause == "foreign-name").map(|lost| lost.packages).sum()
}

#[test]
fn many_modules_move_at_once_with_one_question() {
    let modules = ["probe.0", "probe.1", "probe.2", "probe.3", "probe.4", "probe.5", "probe.6"];
    let mut lan = launched_with(&modules, SLOW);
    let on_at = |lan: &Network, node: &str| {
        let answers = |name: &&str| lan.robot("base").count(name, 1, CALL).is_ok();
        until(format!("all are on at {node}"), || modules.iter().all(|name| lan.robot(node).state(name) == "on"));
        until(format!("all answer from {node}"), || modules.iter().all(answers));
        modules.map(|name| lan.robot(node).pid(name))
    };
    let pids = on_at(&lan, "brain");
    for _ in 0..20 {
        assert_eq!(on_at(&lan, "brain"), pids, "their leases are renewed");
    }
    lan.kill("brain", true);
    on_at(&lan, "desk");
}

#[test]
fn a_person_stops_and_starts_it_at_the_node_that_is_named() {
    let mut lan = launched();
    answered(&lan, "brain", "desk");
    lan.says("brain", &["stop", "probe.0"]).ok_with(["probe.0 is stopped", "rohrpost start probe.0 --node brain"]);
    answered(&lan, "desk", "brain");
    lan.says("brain", &["start", "probe.0"]).ok_with(["probe.0 stands by on node brain"]);
    lan.says("desk", &["restart", "probe.0"]).ok_with(["probe.0 runs and is on"]);
    assert!(!is_on(&lan, "brain"), "the holder stays");
    // In order: the lease is given back.
    lan.halt("desk");
    until("brain takes over", || is_on(&lan, "brain") && lan.robot("base").count("probe.0", 1, CALL).is_ok());
}

#[test]
fn a_process_that_stood_by_and_ended_stands_by_again_and_takes_over() {
    let lan = launched();
    answered(&lan, "brain", "desk");
    let stands_by = |before: u32| {
        let process = || lan.robot("desk").process("probe.0");
        let is_there =
            |process: &ParticipantInfo| process.state == Some(ModuleState::StandsBy) && process.pid != before;
        wait("desk stands by", || process().filter(is_there)).pid
    };
    let mut pid = stands_by(0);
    // As by a crash; and with 0, as one that has done its work.
    for how in [Signal::SIGKILL, Signal::SIGTERM] {
        signal(pid, how);
        pid = stands_by(pid);
    }
    lan.says("desk", &["stop", "probe.0"]).ok_with(["probe.0 is stopped"]);
    lan.says("desk", &["start", "probe.0"]).ok_with(["probe.0 stands by on node desk"]);
    pid = stands_by(pid);
    assert!(is_on(&lan, "brain"), "the holder stays");
    die(&lan, "brain");
    answered(&lan, "desk", "brain");
    assert_eq!(lan.robot("desk").pid("probe.0"), pid, "the process that stood by");
    // At the holder its policy has it start again, with its names at once.
    lan.robot("desk").kill("probe.0");
    answered(&lan, "desk", "brain");
    heard(&lan);
}

#[test]
fn no_other_node_does_again_what_is_done() {
    let mut lan = launched();
    answered(&lan, "brain", "desk");
    let leases = Duration::from_secs(2);
    lan.says("base", &["call", "probe.0", "leave", "0"]).ok();
    until("it has ended", || lan.robot("brain").process("probe.0").is_none());
    let since = Instant::now();
    while since.elapsed() < leases {
        assert!(!is_on(&lan, "desk"), "desk does it again");
        std::thread::sleep(Duration::from_millis(20));
    }
    lan.says("brain", &["start", "probe.0"]).ok_with(["probe.0 runs and is on"]);
    lan.halt("brain");
    until("desk takes over", || is_on(&lan, "desk"));
}

/// The motor and its wormhole on base; desk is launched before brain, so runs have lower numbers there.
#[test]
fn a_supervised_robot_goes_on_when_the_computer_of_its_program_dies() {
    let place = Place::new();
    place.copy("config/building.map");
    let ([base, brain], [desk, _]) = (addresses(), addresses());
    let table = nodes([("base", base), ("brain", brain), ("desk", desk)]) + NETWORK;
    let text = std::fs::read_to_string(repository("config/demo-supervised.toml")).unwrap();
    let mut text = text.replace("[nodes.main]\n", &table);
    for (from, to) in [
        ("motor = { id", "router = { id = 250 }\nmotor = { id"),
        ("[[module]]\n", "[[module]]\nnode = \"base\"\n"),
        ("node = \"base\"\nname = \"pilot.0\"", "nodes = [\"brain\", \"desk\"]\nname = \"pilot.0\""),
    ] {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    let config = place.write("robot.toml", text);
    let lan = Network::new(place, config, None).launched(&["base", "desk", "brain"]);
    let mut tool = lan.robot("base").tool(CALL);
    let mut active = |gained: u64| {
        until(format!("control is gained for the {gained}th time"), || {
            let name = lan.robot("base").name("wormhole.0");
            let state =
                tool.call(name, 23, SupervisorInterface::hash(), |_| Ok(()), |bytes| from_bytes::<ControlState>(bytes));
            state.is_ok_and(|state| state.mode == ControlMode::Active && state.gained >= gained)
        });
    };
    active(1);
    die(&lan, if is_on_there(&lan, "pilot.0", "desk") { "desk" } else { "brain" });
    active(2);
}
