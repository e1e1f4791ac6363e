//! A robot's laptop, `far`, by a bad Wi-Fi: the robot publishes more than the link carries, and the laptop follows in a
//! mailbox that keeps the newest only.

use crate::harness::{PATIENCE, Place, head, lab, probe, until, wait};
use crate::network::Network;
use std::collections::HashSet;

/// Carries 64 KiB a second; the robot publishes 156 KiB.
const BAD: &str = "rate=64KiB,delay=20ms,jitter=10ms,loss=0.5%,seed=7";
const BLOB: &str = "blob-hz = 40.0, blob-bytes = 4000";
/// Older ones are dropped: without newer ones in their place, all would have about this age.
const WAIT_MAX_US: u64 = rohrpost_routers::session::WAIT_MAX_NS / 1000;
/// Blobs that are looked at.
const BLOBS: usize = 40;
const NODES: [(&str, &str); 2] = [("base", "10.79.2.1"), ("far", "10.79.2.2")];
/// Tools are more important than the followed data.
const CLASSES: &str = "router 250, probe 96, tcp 64, output 32, tool 16, screen 10";
const CONFIG: &str = r#"
[nodes.base]
tools = [0, 15]
[nodes.far]
network = "tcp"
tools = [32, 47]
[tcp]
security = "none"
address = "10.79.2.1"
server = "base"
"#;

/// None, with a report, where namespaces are not permitted.
fn launched() -> Option<Network> {
    let lab = lab(NODES, "a laptop by a bad Wi-Fi")?;
    let place = Place::new();
    let keys = "node = \"far\"\naliases = [\"probe.1\"]\ncalls = [\"probe.0\"]";
    let modules = [probe("probe.0", BLOB, "node = \"base\""), probe("screen.0", "watches = \"probe.0\"", keys)];
    let config = place.write("robot.toml", [&head(CLASSES), CONFIG, &modules.concat()].concat());
    Some(Network::new(place, config, Some(lab)).impaired(BAD).launched(&["base", "far"]))
}

/// Packages that newer ones replaced while they waited for the laptop.
fn replaced(wifi: &Network) -> u64 {
    let net = wifi.net("base");
    let classes = net["clients"]["classes"].as_array().into_iter().flatten();
    classes.filter(|class| class["class"] == 10).filter_map(|class| class["replaced"].as_u64()).sum()
}

/// Numbers and ages (µs) of all blobs that came.
fn blobs(wifi: &Network) -> Vec<(u64, u64)> {
    let record = wifi.place.record();
    let parse = |line: &String| {
        let (number, age) = line.strip_prefix("screen.0 blob ")?.split_once(' ')?;
        Some((number.parse().unwrap(), age.parse().unwrap()))
    };
    record.iter().filter_map(parse).collect()
}

/// Received data are fresh from now on, though more is published than the link carries.
fn check_fresh(wifi: &Network) {
    let (seen, before) = (blobs(wifi).len(), replaced(wifi));
    until("blobs come, and newer ones took the place of older ones", || {
        blobs(wifi).len() >= seen + BLOBS && replaced(wifi) > before
    });
    let mut ages: Vec<u64> = blobs(wifi)[seen..].iter().map(|(_, age_us)| *age_us).collect();
    ages.sort_unstable();
    eprintln!("ages: {} {} {} µs; replaced: {}", ages[0], ages[ages.len() / 2], ages[ages.len() - 1], replaced(wifi));
    assert!(ages[ages.len() * 3 / 4] < WAIT_MAX_US, "most are younger than what waited in a queue: {ages:?}");
}

/// Commands both ways, one after the other: each is answered.
fn check_commands(wifi: &Network, first: u32) {
    let far = wifi.robot("far");
    for number in first..first + 10 {
        let counted = far.count("probe.0", number, PATIENCE);
        assert!(counted.is_ok(), "{number}: {counted:?}");
    }
    assert_eq!(wifi.says("base", &["call", "screen.0", "status"]).code, Some(0));
}

#[test]
fn by_a_bad_wifi_what_comes_is_fresh_and_an_outage_costs_a_gap_and_nothing_else() {
    let Some(wifi) = launched() else { return };
    until("blobs are replaced", || replaced(&wifi) > 0);
    check_fresh(&wifi);
    check_commands(&wifi, 0);
    let shown = wifi.says("base", &["net"]).out;
    let is_replaced =
        |line: &str| line.starts_with("TCP router") && line.split_whitespace().any(|word| word == "screen");
    assert!(shown.contains("replaced") && shown.lines().any(is_replaced), "{shown}");

    let modules = || [("base", "probe.0"), ("far", "screen.0")].map(|(node, module)| wifi.robot(node).pid(module));
    let (before, outages) = (modules(), wait("net tells", || wifi.net("far")["beyond"]["outages"].as_u64()));
    wifi.lab().cut("far").unwrap();
    until("far is away", || wifi.net("far")["beyond"]["state"] == "away");
    wifi.lab().fix("far").unwrap();
    until("far takes part again, and says that it was away", || {
        let beyond = wifi.net("far")["beyond"].clone();
        beyond["state"] == "up" && beyond["outages"].as_u64() > Some(outages)
    });
    check_fresh(&wifi);
    check_commands(&wifi, 10);
    assert_eq!(modules(), before, "nothing was started again");
    let numbers: Vec<u64> = blobs(&wifi).iter().map(|(number, _)| *number).collect();
    assert!(numbers.is_sorted_by(|one, next| one < next), "none twice, and none behind a newer one: {numbers:?}");
    let longest = numbers.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap();
    // After three seconds and more the loss of the peer is noticed.
    assert!(longest > 40 * 3, "{longest} blobs are the gap of the outage");
    let counted = wifi.place.counted();
    assert_eq!((counted.len(), counted.iter().collect::<HashSet<_>>().len()), (20, 20), "each command ran once");
    wifi.stop();
}
