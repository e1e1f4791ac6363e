//! Accepted and refused programs at a TCP router: certificates, versions of TLS, digests. Both sides report the reason.

use crate::harness::{Place, probe, repository, until, wait};
use crate::process::Running;
use crate::systems::{NODES, OPEN, SEALED, SYSTEMS, Systems, check_crossing, configured};

/// Connects with a version of TLS that is too old.
const OLD_TLS: &str = "
import socket, ssl
context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
context.maximum_version = ssl.TLSVersion.TLSv1_2
context.wrap_socket(socket.create_connection(('ADDRESS', 21119), timeout=10))
";

#[test]
fn sealed_systems_meet_and_one_with_a_foreign_certificate_takes_no_part() {
    let Some(mut systems) = Systems::launched(SEALED) else { return };
    check_crossing(&systems);
    let said = systems.python("south", &["-c", &OLD_TLS.replace("ADDRESS", NODES[0].1)]).said();
    assert!(said.err.contains("PROTOCOL_VERSION"), "{said:?}");
    until("the TCP router says why", || systems.says("north", &["net"]).out.contains("an older TLS than 1.3"));
    // South's certificates are new, by another authority.
    systems.network.halt("south");
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

/// The answer of the TCP router to a program of a node's system that asks for these ranges one after the other.
fn objections(systems: &Systems, node: &str, own: &str, ranges: &[&str]) -> Vec<String> {
    let page = repository("tests/e2e/python/hijack.py");
    let digests = systems.robot(node).installation.digest().to_string();
    let arguments = [&[&page, NODES[0].1, "21119", &digests, own], ranges].concat();
    systems.python("south", &arguments).said().ok().lines().map(str::to_owned).collect()
}

#[test]
fn a_program_gets_no_name_of_the_files_nodes_and_no_part_of_what_another_hosts() {
    let Some(systems) = Systems::launched(OPEN) else { return };
    let [file, around, free] = ["1.96.0.0-1.96.0.255", "1.1.0.0-1.254.255.255", "1.96.9.0-1.96.9.255"];
    let own = objections(&systems, "north", "1.96.9.0", &[file, around, free]);
    let expected = [(file, 3), (around, 3), (free, 0)].map(|(range, objection)| format!("{range}: {objection}"));
    assert_eq!(own, expected, "names of the file's nodes");
    let [whole, inside, beside] = ["2.96.0.0-2.96.0.255", "2.96.0.1-2.96.0.1", "2.90.0.0-2.99.255.255"];
    let other = objections(&systems, "south", "2.96.9.0", &[whole, inside, beside]);
    let by = "node south of south";
    let expected =
        [(whole, 1), (inside, 1), (beside, 2)].map(|(range, objection)| format!("{range}: {objection} {by}"));
    assert_eq!(other, expected, "names that another hosts");
    check_crossing(&systems);
    systems.stop();
}

#[test]
fn a_robot_starts_without_its_certificates_and_takes_part_when_they_are_there() {
    let place = Place::new();
    let config = place.write("north.toml", configured("north", 1, SEALED).replace(NODES[0].1, "127.0.0.77"));
    let mut launch = place.launch(&config);
    let robot = place.robot(&config, "north", &mut launch);
    let wait_for = |launch: &mut Running, module, state| {
        until(format!("{module} is {state}"), || {
            launch.assert_runs();
            robot.state(module) == state
        });
    };
    wait_for(&mut launch, "probe.0", "on");
    assert_ne!((robot.state("tcp.255"), robot.state("tcp.0")), ("on", "on"), "there is no certificate");
    place.say(&["keys", "new", config.to_str().unwrap()]).ok();
    for module in ["tcp.255", "tcp.0"] {
        wait_for(&mut launch, module, "on");
    }
    place.end(&mut launch);
}

#[test]
fn a_third_with_a_certificate_of_another_installation_takes_no_part_and_both_sides_say_why() {
    let Some(mut systems) = Systems::launched(SEALED) else { return };
    let other = configured("arm", 3, SEALED).replace("installation = \"test\"", "installation = \"other\"");
    systems.place.write("arm.toml", other.replace("\"certificates\"", "\"others\""));
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
