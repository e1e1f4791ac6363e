//! `rohrpost doctor` on the computer that runs the tests. Findings of other computers are tested beside its code.

use crate::harness::{OUTPUT, Place, probe, until};
use crate::network::NETWORK;
use serde_json::Value;

/// Its findings; the exit code reports a bad one.
fn examine(place: &Place, arguments: &[&str]) -> Vec<Value> {
    let said = place.say(&[&["doctor", "--json"], arguments].concat());
    let json: Value = serde_json::from_str(&said.out).unwrap_or_else(|error| panic!("{error}: {said:?}"));
    assert_eq!(said.code, Some(i32::from(json["state"] == "bad")), "{said:?}");
    json["findings"].as_array().unwrap().clone()
}

fn find<'a>(findings: &'a [Value], what: &str) -> &'a Value {
    findings.iter().find(|finding| finding["what"] == what).unwrap_or_else(|| panic!("no {what} in {findings:#?}"))
}

#[test]
fn this_computer_is_examined() {
    let place = Place::new();
    let config = place.config(&[OUTPUT, &probe("probe.0", "", "")]);
    let findings = examine(&place, &["--config", config.to_str().unwrap()]);
    for finding in &findings {
        assert!(!finding["is"].as_str().unwrap().is_empty() && !finding["why"].as_str().unwrap().is_empty());
        assert_eq!(finding["state"] == "ok", finding["fix"].is_null(), "what is not well can be fixed: {finding}");
    }
    assert_eq!(find(&findings, "kernel")["state"], "ok");
    let real_time = find(&findings, "real time")["is"].as_str().unwrap();
    assert!(real_time.ends_with("test.toml asks for none"), "{real_time}");
    let memory = find(&findings, "shared memory")["is"].as_str().unwrap();
    assert!(memory.contains("test.toml needs 8"), "two modules of 444 KiB: {memory}");
    let directory = find(&findings, "node directory")["is"].as_str().unwrap();
    assert!(directory.starts_with(place.memory().to_str().unwrap()), "{directory}");
    // For people, in the same words.
    let page = place.say(&["doctor"]).out;
    assert!(page.contains(" warnings, ") && page.contains("ok    kernel"), "{page}");
    place.assert_empty();
}

/// Both nodes are this computer, at addresses of the loopback device, without any other router.
#[test]
fn the_network_of_a_configuration_is_examined() {
    let place = Place::new();
    let node =
        |name: &str, address: &str, tools: &str| format!("[nodes.{name}]\naddress = \"{address}\"\ntools = {tools}\n");
    let nodes = |base: &str| node("base", base, "[0, 3]") + &node("arm", "127.251.7.2", "[4, 7]") + NETWORK;
    let module = probe("probe.0", "", "node = \"arm\"");
    let config = place.config_of("test", &nodes("127.251.7.1"), &[&module]);
    let findings = examine(&place, &["--config", config.to_str().unwrap(), "--node", "base"]);
    let is = |what: &str| find(&findings, what)["is"].as_str().unwrap();
    assert!(is("node address").starts_with("127.251.7.1"), "{}", is("node address"));
    assert_eq!((is("port of packages"), is("port of time")), ("UDP 21117, free", "UDP 21118, free"));
    assert_eq!(is("port of the rest"), "UDP 21119, free");
    assert_eq!(is("time stamps"), "sending and receiving");
    assert_eq!(is("peer"), "arm at 127.251.7.2: is there; no router runs on it yet");
    assert!(is("packet size").starts_with("1500 B of the 65"), "{}", is("packet size"));
    // A port in use, and an address that nobody has (RFC 5737).
    let taken = std::net::UdpSocket::bind("127.251.7.1:21118").unwrap();
    let findings = examine(&place, &["--config", config.to_str().unwrap(), "--node", "base"]);
    assert_eq!(find(&findings, "port of time")["is"], "UDP 21118, another program has it");
    assert_eq!(find(&findings, "port of time")["state"], "bad");
    drop(taken);
    let config = place.config_of("elsewhere", &nodes("192.0.2.1"), &[&module]);
    let findings = examine(&place, &["--config", config.to_str().unwrap(), "--node", "base"]);
    assert_eq!(find(&findings, "node address")["state"], "bad");
    let fix = find(&findings, "node address")["fix"].as_str().unwrap();
    assert!(fix.contains("base") && fix.contains("elsewhere.toml"), "{fix}");
    assert_eq!(find(&findings, "port of time")["is"], "UDP 21118, not tried");
    place.assert_empty();
}

/// The file's security settings are shown, as text and as JSON, and whether their requirements are met.
#[test]
fn the_security_of_a_configuration_is_told() {
    let place = Place::new();
    let nodes = |security: &str, tcp: &str| {
        let node = |name: &str, host: u8, tools: &str| {
            format!("[nodes.{name}]\naddress = \"127.251.8.{host}\"\ntools = {tools}\n")
        };
        let text = node("base", 1, "[0, 3]") + &node("arm", 2, "[4, 7]");
        format!(
            "{text}[network]\nsecurity = \"{security}\"\n[tcp]\naddress = \"127.251.8.1\"\n{tcp}\n[time]\n\
             source = \"master\"\n"
        )
    };
    let module = probe("probe.0", "", "node = \"arm\"");
    let config = |security: &str, tcp: &str| {
        let file = place.config_of("test", &nodes(security, tcp), &[&module]);
        // The class of clients of the TCP router, which other tests do not need.
        let text = std::fs::read_to_string(&file).unwrap().replacen("[classes]", "[classes]\ntcp = { id = 249 }", 1);
        std::fs::write(&file, text).unwrap();
        file
    };
    let told = |file: &std::path::Path| {
        let file = file.to_str().unwrap();
        let findings = examine(&place, &["--config", file, "--node", "base"]);
        let page = place.say(&["doctor", "--config", file, "--node", "base"]).out;
        ["network security", "TCP security"].map(|what| {
            let found = find(&findings, what);
            let (state, is) = (found["state"].as_str().unwrap(), found["is"].as_str().unwrap());
            assert!(page.contains(&format!("{state:4}  {what:<18}{is}\n")), "{what}: {found} and {page}");
            (state.to_owned(), is.to_owned())
        })
    };
    let open = config("none", "security = \"none\"");
    for (state, is) in told(&open) {
        assert_eq!((&*state, is.starts_with("none, as ")), ("warn", true), "{is}");
    }
    let sealed = config("keys", "security = \"tls\"\ncertificates = \"certificates\"");
    let [lan, tcp] = told(&sealed);
    assert!(lan.0 == "bad" && lan.1.contains("udp.keys"), "{lan:?}");
    assert!(tcp.0 == "bad" && tcp.1.contains("certificates/ca.pem"), "{tcp:?}");
    assert_eq!(place.say(&["keys", "new", sealed.to_str().unwrap()]).code, Some(0));
    let [lan, tcp] = told(&sealed);
    assert!(lan.0 == "ok" && lan.1.starts_with("key 1 of ") && lan.1.contains("udp.keys"), "{lan:?}");
    assert!(tcp.0 == "ok" && tcp.1.starts_with("TLS 1.3 with certificates in "), "{tcp:?}");
    // For another node, nothing is needed here.
    for file in ["arm.system-1.pem", "arm.system-1.key"] {
        std::fs::remove_file(place.path("certificates").join(file)).unwrap();
    }
    assert_eq!(told(&sealed)[1].0, "ok");
    std::fs::remove_file(place.path("certificates").join("base.system-1.key")).unwrap();
    let [_, tcp] = told(&sealed);
    assert!(tcp.0 == "bad" && tcp.1.contains("base.system-1.key"), "{tcp:?}");
}

/// The bridge may have been launched with another PATH.
#[test]
fn a_bridge_that_runs_is_found() {
    let place = Place::new();
    let bridge = place.path("bin/rohrpost-gui-bridge");
    std::fs::create_dir(bridge.parent().unwrap()).unwrap();
    std::fs::copy(std::env::current_exe().unwrap(), &bridge).unwrap();
    let found = |arguments: &[&str]| find(&examine(&place, arguments), "GUI bridge").clone();
    let module =
        probe("probe.0", "", "").replace(std::env::current_exe().unwrap().to_str().unwrap(), "bin/rohrpost-gui-bridge");
    assert!(module.contains("[\"bin/"), "{module}");
    let config = place.config(&[&module]);
    // A bridge of the tests' own may be on the PATH; this one is not.
    assert_ne!(found(&[])["is"], bridge.to_str().unwrap());
    assert_eq!(found(&["--config", config.to_str().unwrap()])["is"], bridge.to_str().unwrap());
    let (_launch, robot) = place.launched(&[&module]);
    let is = format!("{}, process {}", bridge.display(), robot.pid("probe.0"));
    assert_eq!(found(&[])["is"], is.as_str());
}

#[test]
fn waking_up_is_measured() {
    let place = Place::new();
    let findings = examine(&place, &["--measure"]);
    let is = find(&findings, "wake-up")["is"].as_str().unwrap();
    assert!(is.contains("of 1000 under "), "{is}");
}

#[test]
fn what_a_crash_left_is_found() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let findings = examine(&place, &[]);
    assert_eq!(find(&findings, "node")["state"], "ok");
    assert!(find(&findings, "node")["is"].as_str().unwrap().contains(&format!("launched by process {}", launch.pid())));
    launch.kill();
    until("its modules end", || robot.pids().is_empty());
    let findings = examine(&place, &[]);
    assert_eq!(
        (&find(&findings, "node")["state"], &find(&findings, "node")["fix"]),
        (&"warn".into(), &"rohrpost clean".into())
    );
    let cleaned = place.say(&["clean", "--json"]).json();
    assert_eq!(cleaned["nodes"][0]["removed"], true);
    assert!(examine(&place, &[]).iter().all(|finding| finding["what"] != "node"));
    place.assert_empty();
}
