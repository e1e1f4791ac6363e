//! Systems that meet at a TCP router, each node in a network namespace of its own: `north` (system 1) runs it, `south` (system 2) reaches it.
//! Where system 1 has a LAN, `arm` is on it.

use crate::harness::{NETWORK, Place, Robot, probe, signal, skipped, wait};
use crate::probe::ProbingInterface;
use crate::process::{Running, Said};
use nix::sys::signal::Signal;
use rohrpost::CallError;
use rohrpost::macro_support::{append, from_bytes};
use rohrpost_routers::lab::{Lab, LabError, NodeSpec};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Head of all configurations but for the system.
const CLASSES: &str = r#"
[classes]
router = { id = 250 }
probe = { id = 96 }
tcp = { id = 64, text = "Carries packages beyond the LAN" }
output = { id = 32, text = "Collects what modules say" }
tool = { id = 16 }
[scheduling]
real-time-from = 256
"#;

/// Nodes, the first two of which are systems, and their addresses.
const NODES: [(&str, &str); 3] = [("north", "10.79.0.1"), ("south", "10.79.0.2"), ("arm", "10.79.0.3")];
const SYSTEMS: [&str; 2] = [NODES[0].0, NODES[1].0];
const OPEN: &str = "security = \"none\"";
const SEALED: &str = "security = \"tls\"\ncertificates = \"certificates\"";

/// Connects with a version of TLS that is too old.
const OLD_TLS: &str = "
import socket, ssl
context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
context.maximum_version = ssl.TLSVersion.TLSv1_2
context.wrap_socket(socket.create_connection(('ADDRESS', 21119), timeout=10))
";

/// Two systems of one installation.
struct Systems {
    // Dropped in this order: processes, what they left, their network.
    nodes: Vec<(&'static str, Running, Robot)>,
    place: Place,
    lab: Lab,
}

impl Systems {
    /// None launched. None at all, and said so, where namespaces are not permitted.
    fn new(security: &str) -> Option<Self> {
        let spec = |(name, address): (&str, &str)| NodeSpec { name: name.into(), address: address.parse().unwrap() };
        let lab = match Lab::new(&NODES.map(spec), 1500) {
            Ok(lab) => lab,
            Err(LabError::NotAllowed(error)) => {
                skipped(&format!("systems that meet (network namespaces: {error})"));
                return None;
            }
            Err(error) => panic!("{error}"),
        };
        let place = Place::new();
        for (system, id) in SYSTEMS.into_iter().zip(1..) {
            std::fs::write(place.path(&format!("{system}.toml")), configured(system, id, security)).unwrap();
        }
        Some(Self { nodes: Vec::new(), place, lab })
    }

    fn launched(security: &str) -> Option<Self> {
        let mut systems = Self::new(security)?;
        if security == SEALED {
            for node in SYSTEMS {
                systems.place.say(&["keys", "new", systems.config(node).to_str().unwrap()]).ok();
            }
        }
        SYSTEMS.into_iter().for_each(|node| systems.launch(node));
        SYSTEMS.into_iter().for_each(|node| systems.wait_up(node));
        Some(systems)
    }

    fn config(&self, node: &str) -> PathBuf {
        // It may be of a system of its own.
        let third = self.place.path("arm.toml");
        let system = if node == "arm" && !third.exists() { "north" } else { node };
        self.place.path(&format!("{system}.toml"))
    }

    /// Gives north a LAN, with `probe.1` on `arm`.
    fn with_lan(&self) {
        let config = self.config("north");
        let text = std::fs::read_to_string(&config).unwrap();
        let [(_, north), _, (_, arm)] = NODES;
        let nodes = format!(
            "[nodes.north]\naddress = \"{north}\"\ntools = [0, 15]\n[nodes.arm]\naddress = \"{arm}\"\ntools = [16, 31]\n{NETWORK}[tcp]"
        );
        let text = text.replace("[nodes.north]\n[tcp]", &nodes)
            + "node = \"north\"\n"
            + &probe("probe.1", "", "node = \"arm\"");
        std::fs::write(&config, text).unwrap();
    }

    /// `arm`, of a system of its own, takes no part, and both it and the TCP router say why.
    fn wait_refused(&self, here: &str, there: &str) {
        wait(format!("arm is refused: {here}"), || {
            let told = self.client("arm");
            (told["state"] != "up" && told["why"].as_str().is_some_and(|why| why.contains(here))).then_some(())
        });
        wait(format!("the TCP router refuses: {there}"), || {
            self.says("north", &["net"]).out.contains(there).then_some(())
        });
    }

    fn launch(&mut self, node: &'static str) {
        let command = self.place.command(&["launch", self.config(node).to_str().unwrap(), "--node", node]);
        let mut launch = {
            let _inside = self.lab.enter(node).unwrap();
            Running::start(command)
        };
        let robot = self.place.robot(&self.config(node), node, &mut launch);
        robot.wait_on(&mut launch);
        self.nodes.push((node, launch, robot));
    }

    /// What `net` says of a node's client of the TCP router.
    fn client(&self, node: &str) -> serde_json::Value {
        let said = self.says(node, &["net", "--json"]);
        let told: serde_json::Value = serde_json::from_str(said.out.trim()).unwrap_or_default();
        told[0]["beyond"].clone()
    }

    fn wait_up(&self, node: &str) {
        wait(format!("{node} takes part"), || (self.client(node)["state"] == "up").then_some(()));
    }

    /// A command of a person at a node.
    fn says(&self, node: &str, arguments: &[&str]) -> Said {
        self.place.say_at(&self.config(node), node, arguments)
    }

    /// A program that is no node, at `south`'s computer, in a system of its own.
    fn foreign(&self, system: u8, order: &str, certificates: &[&str]) -> Running {
        let common = format!("{:x}", self.robot("north").installation.digest().common);
        let page = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/e2e/foreign.py");
        let system = system.to_string();
        let arguments = [page, NODES[0].1, "21119", &common, &system, order, "1.96.0.0"];
        self.python(&[&arguments, certificates].concat())
    }

    /// Python at `south`'s computer.
    fn python(&self, arguments: &[&str]) -> Running {
        let mut command = Command::new("python3");
        command.args(arguments).current_dir(self.place.path(""));
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let _inside = self.lab.enter("south").unwrap();
        Running::start(command)
    }

    fn robot(&self, node: &str) -> &Robot {
        &self.nodes.iter().find(|(known, ..)| *known == node).unwrap().2
    }

    /// What counting at `south` brings, called from `north`.
    fn count(&self, number: u32) -> Result<u64, CallError> {
        let north = self.robot("north");
        let mut tool = north.tool(Duration::from_secs(1));
        let write = |body: &mut Vec<u8>| append(body, &(number,));
        let (probe, hash) = (north.name("2.probe.0.0"), ProbingInterface::hash());
        let counted = tool.call(probe, crate::probe::COUNT, hash, write, |bytes| from_bytes(bytes));
        tool.close();
        counted
    }

    fn stop(mut self) {
        for (_, mut launch, robot) in self.nodes.drain(..) {
            drop(robot);
            launch.stop();
        }
        self.place.assert_empty();
    }
}

fn configured(node: &str, id: u8, security: &str) -> String {
    let (server, address) = (if id == 1 { "server = \"north\"\n" } else { "" }, NODES[0].1);
    // South's module follows north's.
    let hears = if id == 2 { ", hears = \"1.probe.0.0\"" } else { "" };
    format!(
        "installation = \"test\"\n[system]\nname = \"{node}\"\nid = {id}\n{CLASSES}[nodes.{node}]\n[tcp]\n{security}\naddress = \"{address}\"\n\
         {server}{}",
        probe("probe.0", &format!("rate-hz = 20.0{hears}"), "")
    )
}

/// What crosses, both ways.
fn check_crossing(systems: &Systems) {
    assert_eq!(systems.says("north", &["call", "2.probe.0.0", "count", "1"]).ok(), "1\n");
    assert_eq!(systems.says("north", &["call", "2.probe.0.0", "count", "2"]).ok(), "2\n", "by another tool");
    assert_eq!(systems.says("south", &["call", "1.probe.0.0", "count", "3"]).ok(), "1\n", "the other way");
    let hears = || systems.place.record().iter().any(|line| line.starts_with("probe.0 each "));
    wait("beats of the other system's module", || hears().then_some(()));
    let data = systems.says("north", &["echo", "2.probe.0.0", "beat", "--count", "3"]).ok();
    assert_eq!(data.lines().count(), 3, "{data}");
    let word = "x".repeat(900);
    let told = systems.says("north", &["call", "2.probe.0.0", "tell", "1", "2.5", &word, "true", "[1, 2, 3]"]).ok();
    assert!(told.contains(&word), "{told}");
}

#[test]
fn calls_and_data_cross_from_system_to_system() {
    let Some(systems) = Systems::launched(OPEN) else { return };
    check_crossing(&systems);
    for nobodys in ["2.probe.7.0", "9.probe.0.0"] {
        let told = systems.says("north", &["call", nobodys, "count", "1"]).fails();
        assert!(told.contains("no router knows a way there"), "{told}");
    }
    systems.says("south", &["stop", "probe.0"]).ok();
    let told = systems.says("north", &["call", "2.probe.0.0", "count", "1"]).fails();
    assert!(told.contains("2.probe.0.0 does not run; start it in system 2"), "{told}");
    let shown = systems.says("north", &["net"]).ok();
    for words in ["TCP router", "up", "node south of south", "node north of north", "takes part"] {
        assert!(shown.contains(words), "no `{words}` in:\n{shown}");
    }
    systems.stop();
}

/// How often the TCP router is killed: for a long run, `ROHRPOST_KILLS=100 cargo test --test e2e beyond::a_tcp_router`.
fn kills() -> u64 {
    std::env::var("ROHRPOST_KILLS").ok().map_or(3, |kills| kills.parse().unwrap())
}

/// Of each class of a client, what came and what became of it.
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
    for kill in 1..=kills() {
        let server = north.pid("tcp.255");
        // Calls are under way at any moment of it, and beats of both modules all the time.
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
    let times = run.len();
    run.sort_unstable();
    run.dedup();
    assert_eq!(run.len(), times, "each call is run at most once");
    assert!(answered as usize <= times && times <= called as usize, "{answered} of {called} answered, {times} run");
    for node in SYSTEMS {
        // A moment in which nothing waits: beats come and go all the time.
        let accounts = || Some(accounts(&systems.client(node))).filter(|accounts| !accounts.is_empty());
        let is_even = |accounts: &Vec<(u64, u64)>| accounts.iter().all(|(came, went)| came == went);
        wait(format!("{node} accounts for all"), || accounts().filter(is_even));
    }
    systems.stop();
}

#[test]
fn sealed_systems_meet_and_one_with_a_foreign_certificate_takes_no_part() {
    let Some(mut systems) = Systems::launched(SEALED) else { return };
    check_crossing(&systems);
    let said = systems.python(&["-c", &OLD_TLS.replace("ADDRESS", NODES[0].1)]).said();
    assert!(said.err.contains("PROTOCOL_VERSION"), "{said:?}");
    wait("the TCP router says why", || {
        systems.says("north", &["net"]).out.contains("an older TLS than 1.3").then_some(())
    });
    // South's certificates are made anew, by another authority.
    let (_, mut south, robot) = systems.nodes.pop().unwrap();
    drop(robot);
    south.stop();
    let config = systems.config("south");
    let text = std::fs::read_to_string(&config).unwrap();
    std::fs::write(&config, text.replace("\"certificates\"", "\"others\"")).unwrap();
    systems.place.say(&["keys", "new", config.to_str().unwrap()]).ok();
    systems.launch("south");
    let why = wait("why it takes no part", || {
        let why = systems.client("south")["why"].as_str().map(str::to_owned);
        why.filter(|why| why.contains("foreign"))
    });
    assert!(why.contains("ca.pem"), "{why}");
    let shown = systems.says("north", &["net"]).ok();
    assert!(shown.contains("refuses this end's certificate as foreign"), "the TCP router says it, too:\n{shown}");
    systems.stop();
}

#[test]
fn a_robot_starts_without_its_certificates_and_takes_part_when_they_are_there() {
    let place = Place::new();
    let config = place.path("north.toml");
    std::fs::write(&config, configured("north", 1, SEALED).replace(NODES[0].1, "127.0.0.77")).unwrap();
    let mut launch = place.launch(&config);
    let robot = place.robot(&config, "north", &mut launch);
    let wait_for = |launch: &mut Running, module, state| {
        wait(format!("{module} is {state}"), || {
            launch.assert_runs();
            (robot.state(module) == state).then_some(())
        });
    };
    wait_for(&mut launch, "probe.0", "on");
    assert_ne!((robot.state("tcp.255"), robot.state("tcp.0")), ("on", "on"), "there is no certificate");
    place.say(&["keys", "new", config.to_str().unwrap()]).ok();
    for module in ["tcp.255", "tcp.0"] {
        wait_for(&mut launch, module, "on");
    }
    drop(robot);
    launch.stop();
    place.assert_empty();
}

/// A program calls, subscribes and is called.
fn check_foreign(systems: &Systems, system: u8, order: &str, certificates: &[&str]) {
    let mut program = systems.foreign(system, order, certificates);
    for line in ["takes part", "counted ", "heard 3 beats"] {
        program.wait_for(line);
    }
    let module = format!("{system}.probe.0.0");
    assert_eq!(systems.says("north", &["call", &module, "double", "21"]).ok(), "42\n", "{order}");
    program.wait_for("doubled 21");
    // A certificate says who it is, before it says so itself.
    let name = if certificates.is_empty() { "a program in Python" } else { "node python of system 5" };
    wait(format!("{module} in the list"), || {
        let list = systems.says("north", &["list"]).ok();
        list.lines().any(|line| line.starts_with(&module) && line.ends_with(name)).then_some(())
    });
    let said = systems.says("north", &["call", &module]).ok();
    assert!(said.contains("double <number: u32> -> u32"), "{said}");
}

#[test]
fn a_program_written_from_the_page_alone_takes_part_in_both_byte_orders() {
    let Some(systems) = Systems::launched(OPEN) else { return };
    check_foreign(&systems, 3, "little", &[]);
    check_foreign(&systems, 4, "big", &[]);
    systems.stop();
    let Some(systems) = Systems::launched(SEALED) else { return };
    let file = systems.place.path("python.toml");
    std::fs::write(&file, configured("python", 5, SEALED)).unwrap();
    systems.place.say(&["keys", "new", file.to_str().unwrap()]).ok();
    check_foreign(&systems, 5, "big", &["certificates", "python.system-5"]);
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
        wait(format!("{node} takes part"), || (systems.client(node)["state"] == "up").then_some(()));
    }
    assert_eq!(systems.says("south", &["call", "1.probe.1.0", "count", "1"]).ok(), "1\n", "on the arm");
    assert_eq!(systems.says("south", &["call", "1.probe.0.0", "count", "2"]).ok(), "1\n");
    assert_eq!(systems.says("arm", &["call", "2.probe.0.0", "count", "3"]).ok(), "1\n");
    systems.says("north", &["stop", "tcp.255"]).ok();
    wait("the arm has noticed", || (systems.client("arm")["state"] != "up").then_some(()));
    wait("a call over the LAN", || {
        (systems.says("north", &["call", "probe.1", "count", "4"]).code == Some(0)).then_some(())
    });
    systems.stop();
}

#[test]
fn a_third_with_a_certificate_of_another_installation_takes_no_part_and_both_sides_say_why() {
    let Some(mut systems) = Systems::launched(SEALED) else { return };
    let other = configured("arm", 3, SEALED).replace("installation = \"test\"", "installation = \"other\"");
    std::fs::write(systems.place.path("arm.toml"), other.replace("\"certificates\"", "\"others\"")).unwrap();
    systems.place.say(&["keys", "new", systems.config("arm").to_str().unwrap()]).ok();
    systems.launch("arm");
    systems.wait_refused("certificate is foreign", "refuses this end's certificate as foreign");
    assert_eq!(systems.says("arm", &["call", "1.probe.0.0", "count", "1"]).code, Some(1), "nothing goes there");
    check_crossing(&systems);
    systems.stop();
}

#[test]
fn installations_with_the_same_classes_meet_whatever_else_differs_but_one_system_is_one_file() {
    let Some(mut systems) = Systems::new(OPEN) else { return };
    let south = configured("south", 2, OPEN).replace("installation = \"test\"", "installation = \"other\"");
    std::fs::write(systems.config("south"), south + &probe("probe.3", "", "")).unwrap();
    // A third has south's system, and other modules.
    std::fs::write(systems.place.path("arm.toml"), configured("arm", 2, OPEN).replace("\"arm\"\nid", "\"south\"\nid"))
        .unwrap();
    SYSTEMS.into_iter().for_each(|node| systems.launch(node));
    SYSTEMS.into_iter().for_each(|node| systems.wait_up(node));
    let digests = SYSTEMS.map(|node| systems.robot(node).installation.digest());
    assert!(digests[0].common == digests[1].common && digests[0].system != digests[1].system);
    check_crossing(&systems);
    systems.launch("arm");
    let [mine, theirs] =
        ["arm", "south"].map(|node| format!("{:016x}", systems.robot(node).installation.digest().system));
    systems.wait_refused(&format!("the system's digest here is {mine}, that of node south of south {theirs}"), &mine);
    assert_eq!(systems.says("north", &["call", "2.probe.3.0", "count", "9"]).ok(), "1\n", "south goes on");
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
        wait(format!("both count what came from {node}"), || (times(number) >= 2).then_some(()));
        tool.close();
        // What follows by either path would come behind a second copy.
        for (further, module) in [(1, "1.probe.1.0"), (2, "2.probe.1.0")] {
            let counted = || systems.says(node, &["call", module, "count", &(number + further).to_string()]).code;
            wait(format!("{module} counts from {node}"), || (counted() == Some(0)).then_some(()));
        }
        assert_eq!(times(number), 2, "once in each system, from {node}: {:?}", systems.place.record());
    }
    systems.stop();
}
