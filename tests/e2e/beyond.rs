//! Traffic through a TCP router, between systems and to each node of a LAN, and the cost of a killed TCP router.
//! Refused programs: `beyond_strangers`.

use crate::harness::{assert_has, halt, probe, signal, times, until, wait};
use crate::systems::{OPEN, SEALED, SYSTEMS, Systems, check_crossing, configured};
use nix::sys::signal::Signal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Each system lists what the other hosts, whichever runs the TCP router; without the TCP router the list says that it
/// is unknown.
fn check_lists(systems: &Systems) {
    for (node, module, by) in
        [("north", "2.probe.0", "node south of south"), ("south", "1.probe.0", "node north of north")]
    {
        let list = systems.says(node, &["list"]).ok();
        let is_there = list.lines().any(|line| line.starts_with(module) && line.ends_with(by));
        assert!(is_there, "no {module} by {by} at {node}:\n{list}");
    }
    systems.says("north", &["stop", "tcp.255"]).ok();
    until("south is away", || systems.client("south")["state"] != "up");
    for node in SYSTEMS {
        let list = systems.says(node, &["list"]).ok();
        assert!(list.contains("modules at the TCP router are not known: "), "{node}:\n{list}");
        assert!(systems.says(node, &["list", "--json"]).json()["beyond_silent"].is_string());
    }
}

#[test]
fn calls_and_data_cross_from_system_to_system() {
    let Some(systems) = Systems::launched(OPEN) else { return };
    check_crossing(&systems);
    for nobodys in ["2.probe.7.0", "9.probe.0.0"] {
        systems.says("north", &["call", nobodys, "count", "1"]).fails_with(["no router knows a way there"]);
    }
    systems.says("south", &["stop", "probe.0"]).ok();
    let said = systems.says("north", &["call", "2.probe.0.0", "count", "1"]);
    said.fails_with(["2.probe.0.0 does not run; start it in system 2"]);
    let shown = systems.says("north", &["net"]).ok();
    assert_has(&shown, ["TCP router", "up", "node south of south", "node north of north", "takes part"]);
    check_lists(&systems);
    systems.stop();
}

/// Packages of each class of a client, by outcome.
fn accounts(client: &serde_json::Value) -> Vec<(u64, u64)> {
    let ways = ["sent", "received"].map(|way| client[way].as_array().cloned().unwrap_or_default());
    let number = |value: &serde_json::Value| value.as_u64().unwrap_or_default();
    let account = |class: &serde_json::Value| {
        let lost = class["lost"].as_array().into_iter().flatten().map(|lost| number(&lost["packages"])).sum::<u64>();
        (number(&class["packages"]), number(&class["passed"]) + number(&class["replaced"]) + lost)
    };
    ways.iter().flatten().map(account).collect()
}

#[test]
fn a_tcp_router_that_is_killed_costs_a_gap_and_nothing_else() {
    let Some(systems) = Systems::launched(OPEN) else { return };
    let north = systems.robot("north");
    let clients = || SYSTEMS.map(|node| (systems.robot(node).pid("tcp.0"), systems.robot(node).pid("probe.0")));
    let (before, mut called, mut answered) = (clients(), 0, 0);
    // For a long run: `ROHRPOST_KILLS=100 cargo test --test e2e beyond::a_tcp_router`.
    for kill in 1..=times("ROHRPOST_KILLS", 3) {
        let server = north.pid("tcp.255");
        // Calls are in flight at any moment of it, and beats of both modules all the time.
        let is_killed = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(Duration::from_millis(kill * 7 % 50));
                signal(server, Signal::SIGKILL);
                is_killed.store(true, Ordering::Relaxed);
            });
            let first = called;
            while called < first + 20 || !is_killed.load(Ordering::Relaxed) {
                called += 1;
                answered += u32::from(systems.count(called).is_ok());
            }
        });
        north.wait_restarted("tcp.255", server);
        wait("a call that comes through", || {
            called += 1;
            systems.count(called).ok()
        });
        answered += 1;
        SYSTEMS.into_iter().for_each(|node| systems.wait_up(node));
        let reconnects = systems.client("south")["reconnects"].as_u64().unwrap();
        assert!(reconnects >= kill, "{reconnects} after {kill}");
    }
    assert_eq!(clients(), before, "nothing else was started again");
    let record = systems.place.record();
    let mut run: Vec<&str> = record.iter().filter_map(|line| line.split_once(" count ")).map(|(_, of)| of).collect();
    let runs = run.len();
    run.sort_unstable();
    run.dedup();
    assert_eq!(run.len(), runs, "each call is run at most once");
    assert!(answered as usize <= runs && runs <= called as usize, "{answered} of {called} answered, {runs} run");
    for node in SYSTEMS {
        // A moment without waiting packages; beats come and go all the time.
        let accounts = || Some(accounts(&systems.client(node))).filter(|accounts| !accounts.is_empty());
        let is_even = |accounts: &Vec<(u64, u64)>| accounts.iter().all(|(came, went)| came == went);
        wait(format!("{node} accounts for all"), || accounts().filter(is_even));
    }
    systems.stop();
}

/// A program calls, subscribes and is called.
fn check_foreign(systems: &Systems, system: u8, order: &str, certificates: &[&str]) {
    let mut program = systems.foreign(&format!("{system}.96.0.0"), order, certificates);
    for line in ["takes part", "counted ", "heard 3 beats"] {
        program.wait_for(line);
    }
    let module = format!("{system}.probe.0.0");
    assert_eq!(systems.says("north", &["call", &module, "double", "21"]).ok(), "42\n", "{order}");
    program.wait_for("doubled 21");
    // A certificate names the program before its hello does.
    let name = if certificates.is_empty() { "a program in Python" } else { "node python of system 5" };
    until(format!("{module} in the list"), || {
        let list = systems.says("north", &["list"]).ok();
        list.lines().any(|line| line.starts_with(&module) && line.ends_with(name))
    });
    systems.says("north", &["call", &module]).ok_with(["double <number: u32> -> u32"]);
}

#[test]
fn a_program_written_from_the_page_alone_takes_part_in_both_byte_orders() {
    let Some(systems) = Systems::launched(OPEN) else { return };
    check_foreign(&systems, 3, "little", &[]);
    check_foreign(&systems, 4, "big", &[]);
    systems.stop();
    let Some(systems) = Systems::launched(SEALED) else { return };
    let file = systems.place.write("python.toml", configured("python", 5, SEALED));
    systems.place.say(&["keys", "new", file.to_str().unwrap()]).ok();
    check_foreign(&systems, 5, "big", &["certificates", "python.system-5"]);
    systems.stop();
}

/// Its class is in the file, its instance is not.
#[test]
fn a_program_of_the_own_system_that_the_file_does_not_know_is_reached_by_its_name() {
    let Some(systems) = Systems::launched(OPEN) else { return };
    let mut program = systems.foreign("1.96.7.0", "little", &[]);
    program.wait_for("takes part");
    until("probe.7 in the list", || {
        let list = systems.says("north", &["list"]).ok();
        list.lines().any(|line| line.starts_with("probe.7 ") && line.ends_with("a program in Python"))
    });
    assert_eq!(systems.says("north", &["call", "probe.7", "double", "21"]).ok(), "42\n");
    program.wait_for("doubled 21");
    let told = systems.says("north", &["call", "probe.8", "double", "21"]).fails();
    assert!(told.contains("the configuration has no module `probe.8`"), "nobody hosts it: {told}");
    for module in ["probe.7", "2.probe.0.0"] {
        let said = systems.says("north", &["hz", module, "--count", "1"]);
        said.fails_with(["is beyond this system's nodes", "`rohrpost echo"]);
    }
    systems.stop();
}

#[test]
fn each_node_of_a_lan_is_reached_from_beyond_and_the_lan_goes_on_without_the_tcp_router() {
    let Some(mut systems) = Systems::new(OPEN) else { return };
    systems.with_lan();
    for node in ["north", "arm", "south"] {
        systems.launch(node);
    }
    for node in ["north", "arm", "south"] {
        until(format!("{node} takes part"), || systems.client(node)["state"] == "up");
    }
    assert_eq!(systems.says("south", &["call", "1.probe.1.0", "count", "1"]).ok(), "1\n", "on the arm");
    assert_eq!(systems.says("south", &["call", "1.probe.0.0", "count", "2"]).ok(), "1\n");
    assert_eq!(systems.says("arm", &["call", "2.probe.0.0", "count", "3"]).ok(), "1\n");
    systems.says("north", &["stop", "tcp.255"]).ok();
    until("the arm has noticed", || systems.client("arm")["state"] != "up");
    until("a call over the LAN", || systems.says("north", &["call", "probe.1", "count", "4"]).code == Some(0));
    systems.stop();
}

#[test]
fn a_package_to_all_systems_comes_once_to_each_whatever_the_path() {
    let Some(mut systems) = Systems::new(OPEN) else { return };
    systems.with_lan();
    let south = std::fs::read_to_string(systems.config("south")).unwrap() + &probe("probe.1", "", "");
    std::fs::write(systems.config("south"), south).unwrap();
    for node in ["north", "arm", "south"] {
        systems.launch(node);
    }
    for node in ["north", "arm", "south"] {
        systems.wait_up(node);
    }
    let times = |number: u32| systems.place.counted().into_iter().filter(|counted| *counted == number).count();
    for (node, number) in [("north", 100), ("arm", 200), ("south", 300)] {
        let robot = systems.robot(node);
        let mut tool = robot.tool(Duration::from_secs(1));
        robot.begin(&mut tool, "255.probe.1.0", crate::probe::COUNT, &(number,));
        until(format!("both count what came from {node}"), || times(number) >= 2);
        tool.close();
        // Packages by either path would arrive after a duplicate.
        for (further, module) in [(1, "1.probe.1.0"), (2, "2.probe.1.0")] {
            let counted = || systems.says(node, &["call", module, "count", &(number + further).to_string()]).code;
            until(format!("{module} counts from {node}"), || counted() == Some(0));
        }
        assert_eq!(times(number), 2, "once in each system, from {node}: {:?}", systems.place.record());
    }
    // On the LAN it takes the path over the LAN, also while the TCP router is away.
    halt(systems.robot("north").pid("tcp.255"));
    let mut tool = systems.robot("north").tool(Duration::from_secs(1));
    systems.robot("north").begin(&mut tool, "255.probe.1.0", crate::probe::COUNT, &(400_u32,));
    until("arm counts", || times(400) == 1);
    tool.close();
    signal(systems.robot("north").pid("tcp.255"), Signal::SIGCONT);
    systems.stop();
}
