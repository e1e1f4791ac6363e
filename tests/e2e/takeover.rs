//! The demo in time slots with its master's router killed: it is reported, and no package of a declared flow is lost,
//! but for what waited longer than it may while there was no router, or no slot.

mod losses;
mod waits;

use crate::harness::{Place, Robot, assert_has, lacks_namespaces, runs, signal, times, until, wait};
use crate::process::{Running, Said};
use losses::{Before, CYCLE, Kill, REPLACED, check_losses, check_lost_of_sealed, most_left_out};
use nix::sys::signal::Signal;
use rohrpost::interface::DataPort;
use rohrpost::interfaces::RouterInterface;
use rohrpost::schema::Data;
use rohrpost_testbed::stalls::{Late, unless_stalled};
use std::path::Path;
use std::time::{Duration, Instant};
use waits::Waits;

const CONFIG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/demo-tdma.toml");
const NODES: [&str; 3] = ["base", "brain", "desk"];
/// Modules here answer within this time.
const SOON: Duration = Duration::from_secs(2);
/// A router that has run for so long is not one that was just started.
const SETTLED_MS: u64 = 1200;
/// One that has run for so long is started again after the shortest pause, 10 ms. Launch doubles it for each death that
/// comes within ten seconds of the one before.
const STEADY_MS: u64 = 10_500;
/// So few deaths make a pause of 40 ms at most.
const FEW: usize = 3;
/// A demo that kills its master goes on for longer than this; a master is there again and settled before.
const WATCHED: Duration = Duration::from_secs(2);

/// After so many cycles the others have a new master.
const CYCLES_MAX: u64 = 4;

/// A counter of all nodes from the table of slots; none if it has no row, since it is 0 everywhere.
fn slots(said: &str, counter: &str) -> Vec<u64> {
    let slots = said.split("In time slots").nth(1).unwrap_or_else(|| panic!("no slots:\n{said}"));
    let row = slots.lines().find_map(|line| line.strip_prefix(counter)?.strip_prefix(' '));
    row.unwrap_or_default().split_whitespace().map(|count| count.parse().unwrap()).collect()
}

/// The losses of the modules that call and subscribe; none while one does not answer, and when the node has ended.
fn lost_so_far(robots: &[Robot; 3]) -> Option<Before> {
    let (brain, mut all) = (&robots[1], Before::new());
    let mut tool = brain.tool_if_there(SOON)?;
    let told = ["pilot.0", "mapper.0"].map(|by| (by, tool.exchange(brain.name(by))));
    tool.close();
    for (by, told) in told {
        for exchange in told.ok()? {
            *all.entry((by.to_owned(), exchange.module, exchange.data.is_some())).or_default() += exchange.lost;
        }
    }
    Some(all)
}

/// The report of a node's router, if it answers.
fn said<T: Data>(robot: &Robot, router: &str, port: DataPort<T>) -> Option<T> {
    let mut tool = robot.tool_if_there(SOON)?;
    let said = robot.newest(&mut tool, router, port);
    tool.close();
    said.ok().map(|(_, said)| said)
}

/// The node that all take for the master, once they know the time and each router has run for so long.
fn settled(robots: &[Robot; 3], ran_ms: u64) -> Option<usize> {
    let mut masters = Vec::new();
    for (robot, index) in robots.iter().zip(0..) {
        let router = format!("router.{index}");
        let clock = said(robot, &router, RouterInterface::CLOCK)?;
        let links = said(robot, &router, RouterInterface::LINKS)?;
        masters.push(clock.error_ns.filter(|_| links.uptime_ms > ran_ms).map(|_| clock.master)?);
    }
    masters.dedup();
    NODES.iter().position(|node| masters == [*node])
}

/// Slots that each node has left out so far; none while a router does not answer.
fn left_out_so_far(robots: &[Robot; 3]) -> Option<[u64; 3]> {
    let mut all = [0; 3];
    for (node, left_out) in all.iter_mut().enumerate() {
        let slots = said(&robots[node], &format!("router.{node}"), RouterInterface::SLOTS)?;
        *left_out = slots.late + slots.skipped + slots.silent;
    }
    Some(all)
}

/// The demo with its master's router killed again and again.
struct Killed {
    said: Said,
    kills: Vec<Kill>,
    /// Before the first kill.
    lost_before: Before,
}

/// A demo of which all nodes run; none where there are no namespaces.
fn started(place: &Place, arguments: &[&str]) -> Option<(Running, [Robot; 3])> {
    let mut demo = place.start(arguments);
    until("all nodes run, or cannot", || {
        let all = NODES.iter().all(|node| demo.out().contains(&format!("node {node} of demo-tdma runs")));
        all || demo.ended().is_some()
    });
    if lacks_namespaces(&demo.err()) {
        return None;
    }
    Some((demo, NODES.map(|node| place.robot_at(Path::new(CONFIG), node))))
}

fn killed_again(place: &Place) -> Option<Killed> {
    let (demo, robots) = started(place, &["demo", "--nodes", "3", "--tdma", "--no-gui", "--quiet", "-v"])?;
    // For a long run: `ROHRPOST_KILLS=100 cargo test --test e2e takeover`.
    let times = times("ROHRPOST_KILLS", FEW);
    let ran_ms = if times > FEW { STEADY_MS } else { SETTLED_MS };
    let mut kills = Vec::new();
    wait("one master", || settled(&robots, ran_ms));
    let lost_before = wait("losses so far", || lost_so_far(&robots));
    for _ in 0..times {
        let before = wait("slots", || left_out_so_far(&robots));
        let looked = Instant::now();
        let master = wait("one master", || settled(&robots, ran_ms));
        let (robot, router) = (&robots[master], format!("router.{master}"));
        let pid = robot.pid(&router);
        let (waits, ran) = (Waits::above(pid), Instant::now());
        signal(pid, Signal::SIGKILL);
        let dead = Instant::now();
        let waited = waits.until_it_is_back(robot.wait_restarted(&router, pid).pid);
        wait("one master again", || settled(&robots, ran_ms));
        let left_out = most_left_out(before, master, wait("slots", || left_out_so_far(&robots)));
        kills.push(Kill { looked, ran, dead, settled: Instant::now(), left_out, waited });
    }
    drop(robots);
    demo.signal(Signal::SIGINT);
    Some(Killed { said: demo.said(), kills, lost_before })
}

#[test]
fn killed_again_and_again_the_master_costs_no_package_of_a_declared_flow() {
    unless_stalled(|_| {
        let place = Place::new();
        let Some(Killed { said, kills, lost_before }) = killed_again(&place) else { return Ok(()) };
        assert_eq!(said.code, Some(0), "{said:?}");
        let said = said.out;
        assert!(said.contains("from before its death are lost") && said.contains("the accounts balance\n"), "{said}");
        println!(
            "{}",
            said.lines()
                .filter(|line| line.contains(" → ") || line.contains("there again"))
                .collect::<Vec<_>>()
                .join("\n")
        );
        let (_, events) = said.split_once("The router of ").unwrap_or_else(|| panic!("no deaths:\n{said}"));
        let events: Vec<&str> = events.split("The router of ").collect();
        assert_eq!(events.len(), kills.len(), "{said}");
        assert!(events.iter().all(|event| event.contains("not by this command); there again ")), "{said}");
        place.assert_empty();
        // A master that stood still just before was another's slave when it was killed.
        for (event, Kill { looked, dead, .. }) in events.iter().zip(&kills) {
            if !event.contains("It was the master. ") {
                let what = format!("not the master when it was killed: {event}");
                return Err(Late { what, since: *looked, until: *dead, by: REPLACED });
            }
        }
        check_losses(&said, &kills, &lost_before)
    });
}

/// A demo that kills its master, and ends without failure; with what was lost before that. None where there are no
/// namespaces.
fn ended_well(place: &Place, arguments: &[&str]) -> Option<(Said, Kill, Before)> {
    let (mut demo, robots) = started(place, arguments)?;
    let pid = |node: usize| robots[node].process(&format!("router.{node}")).map(|router| router.pid);
    let pids = wait("routers", || Some([pid(0)?, pid(1)?, pid(2)?]));
    let is_dead = |node: &usize| pid(*node) != Some(pids[*node]) || !runs(pids[*node]);
    let above = || pids.map(Waits::above);
    let (mut ran, mut waits, mut lost, mut left_out) = (Instant::now(), above(), Before::new(), [0; 3]);
    let node = wait("a router dies", || {
        let (lost_now, left_out_now) = (lost_so_far(&robots), left_out_so_far(&robots));
        let (waits_now, now) = (above(), Instant::now());
        if let Some(node) = [0, 1, 2].into_iter().find(is_dead) {
            return Some(node);
        }
        (ran, waits) = (now, waits_now);
        left_out = left_out_now.unwrap_or(left_out);
        if let Some(now) = lost_now {
            lost = now;
        }
        assert!(demo.ended().is_none(), "no router died: {}", demo.out());
        None
    });
    let (dead, mut last, mut waited) = (Instant::now(), left_out, None);
    wait("one master again", || {
        let back = pid(node).filter(|pid| *pid != pids[node]);
        waited = waited.or(back.map(|pid| waits[node].until_it_is_back(pid)));
        last = left_out_so_far(&robots).unwrap_or(last);
        let is_over = dead.elapsed() > WATCHED || demo.ended().is_some();
        settled(&robots, SETTLED_MS).map(drop).or(is_over.then_some(()))
    });
    let settled = Instant::now();
    drop(robots);
    let said = demo.said();
    assert_eq!(said.code, Some(0), "{said:?}");
    let left_out = most_left_out(left_out, node, last);
    let waited = waited.unwrap_or_default();
    Some((said, Kill { looked: ran, ran, dead, settled, left_out, waited }, lost))
}

#[test]
fn the_demo_kills_its_master_if_it_is_to_and_tells_what_came_of_it() {
    unless_stalled(|_| {
        let place = Place::new();
        let arguments =
            ["demo", "--nodes", "3", "--tdma", "--seconds", "6", "--no-gui", "--quiet", "-v", "--kill-master"];
        let Some((Said { out: said, .. }, kill, before)) = ended_well(&place, &arguments) else { return Ok(()) };
        assert_has(
            &said,
            ["killed on purpose); there again ", "It was the master. ", " after its last.\n", "Master at the end: "],
        );
        assert!(said.contains("from before its death are lost") && said.contains("the accounts balance\n"), "{said}");
        place.assert_empty();
        check_losses(&said, std::slice::from_ref(&kill), &before)?;
        let next = said.lines().find_map(|line| line.split("from the sync on that came ").nth(1));
        let cycles = next.and_then(|cycles| cycles.split(' ').next()).unwrap_or_else(|| panic!("{said}"));
        let beyond = cycles.parse::<u64>().unwrap().saturating_sub(CYCLES_MAX) as u32;
        if beyond > 0 {
            return Err(kill.late(format!("master after {cycles} cycles"), kill.settled, CYCLE * beyond));
        }
        Ok(())
    });
}

/// With sealing, its next incarnation knows no peer, and hears the time before any peer has proved that it lives.
#[test]
fn a_master_that_seals_joins_again_and_so_did_all_at_the_beginning() {
    unless_stalled(|_| {
        let place = Place::new();
        let arguments =
            ["demo", "--nodes", "3", "--tdma", "--secure", "--seconds", "8", "--no-gui", "-v", "--kill-master"];
        let Some((Said { out, err, .. }, kill, _)) = ended_well(&place, &arguments) else { return Ok(()) };
        assert!(err.contains("is sealed with") || out.contains("is sealed with"), "{out}{err}");
        assert_has(
            &out,
            [
                "killed on purpose); there again ",
                "It was the master. ",
                "Master at the end: ",
                "the accounts balance\n",
            ],
        );
        let used = slots(&out, "used");
        assert!(used.len() == NODES.len() && used.iter().all(|used| *used > 10), "slots used: {used:?}");
        place.assert_empty();
        check_lost_of_sealed(&out, &kill)
    });
}
