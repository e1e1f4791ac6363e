//! The demo in time slots with its master's router killed: it is reported, and no package of a declared flow is lost,
//! but for what waited longer than it may while there was no router, or no slot.

use crate::harness::{Place, Robot, lacks_namespaces, runs, signal, wait};
use crate::process::{Running, Said};
use nix::sys::signal::Signal;
use rohrpost::common::GET_DATA;
use rohrpost::interface::DataPort;
use rohrpost::interfaces::RouterInterface;
use rohrpost::schema::Data;
use rohrpost::wire::{append, from_bytes};
use rohrpost_routers::inbound::SOCKET_MAX_NS;
use rohrpost_testbed::stalls::{Late, unless_stalled};
use std::collections::BTreeMap;
use std::panic::catch_unwind;
use std::path::Path;
use std::time::{Duration, Instant};

const CONFIG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/demo-tdma.toml");
const NODES: [&str; 3] = ["base", "brain", "desk"];
/// Modules here answer within this time.
const SOON: Duration = Duration::from_secs(2);
/// A router that lives for so long is started again without a longer pause.
const SETTLED_MS: u64 = 1200;

/// How often the master is killed: for a long run, `ROHRPOST_KILLS=100 cargo test --test e2e takeover`.
fn kills() -> usize {
    std::env::var("ROHRPOST_KILLS").ok().map_or(3, |kills| kills.parse().unwrap())
}

/// After so many cycles the others have a new master.
const CYCLES_MAX: u64 = 4;
/// The cycle of the configuration.
const CYCLE: Duration = Duration::from_millis(5);
/// A master that stands still for so long is replaced.
const REPLACED: Duration = CYCLE.saturating_mul(3);
/// The shortest time that a caller gives a call: the pilot's to its motor.
const CALL: Duration = Duration::from_millis(200);
/// Data that waited longer in the kernel for an absent router are not delivered.
const DATA: Duration = Duration::from_nanos(SOCKET_MAX_NS);

/// What came of the declared flows of a demo, of which one node left out so many slots at a kill.
///
/// A package that found no router, or no slot, for longer than it may wait is lost. How long that was at most the demo
/// itself reports: for so long a router was away, and so many slots a node then left out. Nothing else may be lost,
/// but for what a router had taken for a slot when it died: it holds that for less than a thousandth of the time.
/// Calls that were refused while the demo started are `before`.
fn check_losses(said: &str, kills: usize, left_out: u64, before: &Before, began: Instant) -> Result<(), Late> {
    let away = away(said).into_iter().max().unwrap_or_default();
    let gap = away + CYCLE * left_out as u32;
    let mut unexplained = 0;
    for Loss { row, lost, is_data, .. } in losses(said) {
        let lost = lost.saturating_sub(before.get(&counted_by(row)).copied().unwrap_or(0));
        let limit = if is_data { DATA } else { CALL };
        if gap <= limit {
            unexplained += lost;
        } else if lost > 0 && away <= limit {
            // In slots that were left out: by a computer that stood still, or by mistake.
            return Err(Late::now(format!("{left_out} slots were left out; {lost} lost: {row}"), began, REPLACED));
        }
    }
    assert!(unexplained <= kills as u64 / 20, "{unexplained} lost by {kills} kills, nothing for {gap:?}:\n{said}");
    Ok(())
}

/// Packages sealed to the dead incarnation are lost, and nothing can be sealed to the next before it has joined: of
/// each flow a second of eight, and for as long as the demo reports that there was no router, or no slot.
fn check_lost_of_sealed(said: &str, left_out: u64) {
    let gap = away(said).into_iter().max().unwrap_or_default() + CYCLE * left_out as u32;
    for Loss { row, packages, lost, .. } in losses(said) {
        let most = packages as f64 * (Duration::from_secs(1) + gap).as_secs_f64() / 8.0;
        assert!(lost as f64 <= most, "{lost} of {packages} lost, {most:.1} at most: {row}\n{said}");
    }
}

/// How long each router was away that died.
fn away(said: &str) -> Vec<Duration> {
    let words = said.split("); there again ").skip(1);
    words.map(|words| duration(words.split(" later").next().unwrap())).collect()
}

/// As the demo writes it.
fn duration(text: &str) -> Duration {
    let (number, unit) = text.split_once(' ').unwrap_or_else(|| panic!("{text}"));
    let unit = match unit {
        "µs" => 1e-6,
        "ms" => 1e-3,
        "s" => 1.0,
        _ => panic!("{text}"),
    };
    Duration::from_secs_f64(number.parse::<f64>().unwrap() * unit)
}

/// Slots that a node left out, of that which left out most, as the table at the end has it.
fn left_out(said: &str) -> u64 {
    let counters = ["late", "skipped", "silent"].map(|counter| slots(said, counter));
    let of = |node: usize| counters.iter().filter_map(|counts| counts.get(node)).sum();
    (0..NODES.len()).map(of).max().unwrap_or(0)
}

/// A counter of all nodes from the table of slots; none if it has no row, since it is 0 everywhere.
fn slots(said: &str, counter: &str) -> Vec<u64> {
    let slots = said.split("In time slots").nth(1).unwrap_or_else(|| panic!("no slots:\n{said}"));
    let row = slots.lines().find_map(|line| line.strip_prefix(counter)?.strip_prefix(' '));
    row.unwrap_or_default().split_whitespace().map(|count| count.parse().unwrap()).collect()
}

/// Losses that modules have counted so far: the module that counts, the other one, and whether they are data.
type Before = BTreeMap<(String, String, bool), u64>;

/// The losses of the modules that call and subscribe; none while one does not answer.
fn lost_so_far(robots: &[Robot; 3]) -> Option<Before> {
    let (brain, mut all) = (&robots[1], Before::new());
    let mut tool = brain.tool(SOON);
    let told = ["pilot.0", "mapper.0"].map(|by| (by, tool.exchange(brain.name(by))));
    tool.close();
    for (by, told) in told {
        for exchange in told.ok()? {
            *all.entry((by.to_owned(), exchange.module, exchange.data.is_some())).or_default() += exchange.lost;
        }
    }
    Some(all)
}

/// The module that counts a row of the table of losses, of which other one: the caller, or the receiver of data.
fn counted_by(row: &str) -> (String, String, bool) {
    let words: Vec<&str> = row.split_whitespace().collect();
    let [from, _, to, what, ..] = words[..] else { panic!("{row}") };
    let (by, of) = if what == "commands" { (from, to) } else { (to, from) };
    (by.into(), of.into(), what == "data")
}

/// A row of the table of losses from end to end.
struct Loss<'a> {
    row: &'a str,
    packages: u64,
    lost: u64,
    is_data: bool,
}

fn losses(said: &str) -> Vec<Loss<'_>> {
    let flows = said.split("from end to end").nth(1).unwrap_or_else(|| panic!("no flows:\n{said}"));
    let rows: Vec<&str> = flows.lines().skip(3).take_while(|line| !line.is_empty()).collect();
    assert!(rows.iter().any(|row| row.starts_with("laser.0 → pilot.0") && row.contains("data")), "{said}");
    assert!(rows.iter().any(|row| row.starts_with("pilot.0 → motor.0") && row.contains("commands")), "{said}");
    let loss = |row| {
        let words: Vec<&str> = str::split_whitespace(row).collect();
        let [.., packages, _, _, lost] = words[..] else { panic!("{row}") };
        let [packages, lost] = [packages, lost].map(|count| count.parse().unwrap());
        Loss { row, packages, lost, is_data: words.contains(&"data") }
    };
    rows.into_iter().map(loss).collect()
}

/// The report of a node's router, if it answers.
fn said<T: Data>(robot: &Robot, router: &str, port: DataPort<T>) -> Option<T> {
    let mut tool = robot.tool(SOON);
    let ask = |body: &mut Vec<u8>| append(body, &(port.number,));
    let read = |bytes: &[u8]| from_bytes::<(u64, T)>(bytes);
    let said = tool.call(robot.name(router), GET_DATA, RouterInterface::hash(), ask, read);
    tool.close();
    said.ok().map(|(_, said)| said)
}

/// The node that all take for the master, once they know the time and no router was just started.
fn settled(robots: &[Robot; 3]) -> Option<usize> {
    let mut masters = Vec::new();
    for (robot, index) in robots.iter().zip(0..) {
        let router = format!("router.{index}");
        let clock = said(robot, &router, RouterInterface::CLOCK)?;
        let links = said(robot, &router, RouterInterface::LINKS)?;
        masters.push(clock.error_ns.filter(|_| links.uptime_ms > SETTLED_MS).map(|_| clock.master)?);
    }
    masters.dedup();
    NODES.iter().position(|node| masters == [*node])
}

/// Slots that each node has left out so far.
fn left_out_so_far(robots: &[Robot; 3]) -> [u64; 3] {
    let of = |node: usize| {
        let slots = wait("slots", || said(&robots[node], &format!("router.{node}"), RouterInterface::SLOTS));
        slots.late + slots.skipped + slots.silent
    };
    [0, 1, 2].map(of)
}

/// The demo with its master's router killed again and again.
struct Killed {
    said: Said,
    /// When one was found to be the master, and was killed.
    kills: Vec<[Instant; 2]>,
    /// Slots that one node left out from a kill until all was settled, at most.
    left_out: u64,
    /// Before the first kill.
    lost_before: Before,
}

/// A demo of which all nodes run; none where there are no namespaces.
fn started(place: &Place, arguments: &[&str]) -> Option<(Running, [Robot; 3])> {
    let mut demo = Running::start(place.command(arguments));
    wait("all nodes run, or cannot", || {
        let all = NODES.iter().all(|node| demo.out().contains(&format!("node {node} of demo-tdma runs")));
        (all || demo.ended().is_some()).then_some(())
    });
    if lacks_namespaces(&demo.err()) {
        return None;
    }
    Some((demo, NODES.map(|node| place.robot_at(Path::new(CONFIG), node))))
}

fn killed_again(place: &Place) -> Option<Killed> {
    let (demo, robots) = started(place, &["demo", "--nodes", "3", "--tdma", "--no-gui", "--quiet", "-v"])?;
    let (mut kills, mut left_out) = (Vec::new(), 0);
    wait("one master", || settled(&robots));
    let lost_before = wait("losses so far", || lost_so_far(&robots));
    for _ in 0..self::kills() {
        let mut before = left_out_so_far(&robots);
        let looked = Instant::now();
        let master = wait("one master", || settled(&robots));
        let (robot, router) = (&robots[master], format!("router.{master}"));
        let pid = robot.pid(&router);
        signal(pid, Signal::SIGKILL);
        kills.push([looked, Instant::now()]);
        robot.wait_restarted(&router, pid);
        wait("one master again", || settled(&robots));
        before[master] = 0;
        let after = left_out_so_far(&robots);
        left_out = before.iter().zip(after).map(|(before, after)| after - before).fold(left_out, u64::max);
    }
    drop(robots);
    demo.signal(Signal::SIGINT);
    Some(Killed { said: demo.said(), kills, left_out, lost_before })
}

#[test]
fn killed_again_and_again_the_master_costs_no_package_of_a_declared_flow() {
    unless_stalled(|_| {
        let (place, began) = (Place::new(), Instant::now());
        let Some(Killed { said, kills, left_out, lost_before }) = killed_again(&place) else { return Ok(()) };
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
        for (event, [looked, killed]) in events.iter().zip(kills) {
            if !event.contains("It was the master. ") {
                let what = format!("not the master when it was killed: {event}");
                return Err(Late { what, since: looked, until: killed, by: REPLACED });
            }
        }
        check_losses(&said, self::kills(), left_out, &lost_before, began)
    });
}

/// A demo that kills its master, and ends without failure; with what was lost before that. None where there are no
/// namespaces.
fn ended_well(place: &Place, arguments: &[&str]) -> Option<(Said, Before)> {
    let (mut demo, robots) = started(place, arguments)?;
    let pid = |node: usize| robots[node].process(&format!("router.{node}")).map(|router| router.pid);
    let (pids, mut before) = ([0, 1, 2].map(pid), Before::new());
    let all_run = || [0, 1, 2].map(pid) == pids && pids.iter().flatten().all(|pid| runs(*pid));
    wait("a router dies", || {
        let lost = lost_so_far(&robots);
        if !all_run() || demo.ended().is_some() {
            return Some(());
        }
        before = lost.unwrap_or_default();
        None
    });
    drop(robots);
    let said = demo.said();
    assert_eq!(said.code, Some(0), "{said:?}");
    Some((said, before))
}

#[test]
fn the_demo_kills_its_master_if_it_is_to_and_tells_what_came_of_it() {
    unless_stalled(|_| {
        let (place, began) = (Place::new(), Instant::now());
        let arguments =
            ["demo", "--nodes", "3", "--tdma", "--seconds", "6", "--no-gui", "--quiet", "-v", "--kill-master"];
        let Some((Said { out: said, .. }, before)) = ended_well(&place, &arguments) else { return Ok(()) };
        for words in
            ["killed on purpose); there again ", "It was the master. ", " after its last.\n", "Master at the end: "]
        {
            assert!(said.contains(words), "no `{words}`:\n{said}");
        }
        assert!(said.contains("from before its death are lost") && said.contains("the accounts balance\n"), "{said}");
        place.assert_empty();
        check_losses(&said, 1, left_out(&said), &before, began)?;
        let next = said.lines().find_map(|line| line.split("from the sync on that came ").nth(1));
        let cycles = next.and_then(|cycles| cycles.split(' ').next()).unwrap_or_else(|| panic!("{said}"));
        let beyond = cycles.parse::<u64>().unwrap().saturating_sub(CYCLES_MAX) as u32;
        if beyond > 0 {
            return Err(Late::now(format!("master after {cycles} cycles"), began, CYCLE * beyond));
        }
        Ok(())
    });
}

/// With sealing, its next incarnation knows no peer, and hears the time before any peer has proved that it lives.
#[test]
fn a_master_that_seals_joins_again_and_so_did_all_at_the_beginning() {
    let place = Place::new();
    let arguments = ["demo", "--nodes", "3", "--tdma", "--secure", "--seconds", "8", "--no-gui", "-v", "--kill-master"];
    let Some((Said { out, err, .. }, _)) = ended_well(&place, &arguments) else { return };
    assert!(err.contains("is sealed with") || out.contains("is sealed with"), "{out}{err}");
    for words in
        ["killed on purpose); there again ", "It was the master. ", "Master at the end: ", "the accounts balance\n"]
    {
        assert!(out.contains(words), "no `{words}`:\n{out}");
    }
    let used = slots(&out, "used");
    assert!(used.len() == NODES.len() && used.iter().all(|used| *used > 10), "slots used: {used:?}");
    check_lost_of_sealed(&out, left_out(&out));
    place.assert_empty();
}

/// The end of a demo with a kill, after which the router was away for so long; so many commands were lost, and data.
fn sample(away: &str, commands: u64, data: u64) -> String {
    format!(
        "The router of base died 3.0 s after the beginning (process 7, killed on purpose); there again {away} later \
         (process 8).\n\nDeclared flows from end to end\n\n\
         flow                   what       packages  sent again  too late  lost\n\
         laser.0 → pilot.0      data scan        62           -         -  {data}\n\
         pilot.0 → motor.0      commands         63           0         0  {commands}\n\n"
    )
}

#[test]
fn a_loss_that_nothing_explains_is_found_however_many_slots_were_left_out() {
    let check = |away, commands, data, left_out| {
        let said = sample(away, commands, data);
        catch_unwind(|| check_losses(&said, 1, left_out, &Before::new(), Instant::now()).map_err(|late| late.by))
            .map_err(drop)
    };
    assert_eq!(check("44 ms", 0, 0, 1000), Ok(Ok(())));
    assert_eq!(check("44 ms", 1, 0, 31), Err(()), "it was repeated in time");
    assert_eq!(check("250 ms", 1, 0, 0), Ok(Ok(())), "no router for longer than a call takes");
    assert_eq!(check("250 ms", 0, 1, 0), Err(()), "data wait for longer than that");
    assert_eq!(check("44 ms", 1, 0, 40), Ok(Err(REPLACED)), "a stall has to explain the slots");
    assert_eq!(check("44 ms", 0, 1, 80), Ok(Err(REPLACED)));
    let before = Before::from([(("pilot.0".into(), "motor.0".into(), false), 1)]);
    assert_eq!(check_losses(&sample("44 ms", 1, 0), 1, 0, &before, Instant::now()), Ok(()), "not by the kill");
    let sealed = |lost| catch_unwind(|| check_lost_of_sealed(&sample("44 ms", lost, 0), 0)).is_ok();
    assert_eq!([0, 8, 9].map(sealed), [true, true, false], "a second of eight");
}
