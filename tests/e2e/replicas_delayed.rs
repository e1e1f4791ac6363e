//! A network with a steady delay: each clock's bound is as large as the delay, and it is told nevertheless.

use crate::harness::{OUTPUT, Place, head, wait};
use crate::network::{NETWORK, Network, addresses, at, nodes};
use crate::replicas_lossy::{CLASSES, entry};

const REPLICA: &str = "[[replica]]\nstream = \"localiser.0/pose\"\nto = [\"brain\"]\n";

#[test]
fn a_steady_delay_above_the_alarm_is_told_with_its_length() {
    let (place, [base, brain]) = (Place::new(), addresses());
    let nodes = nodes([("base", &base), ("brain", &brain)]);
    let modules = [at("brain", OUTPUT), entry("localiser.0", "base")].concat();
    let config = place.write("test.toml", [&head(CLASSES), &nodes, NETWORK, &modules, REPLICA].concat());
    let network = Network::new(place, config, None).impaired("delay=20ms").launched(&["base", "brain"]);
    let clock = || {
        let told = network.says("brain", &["time", "--json"]).out;
        let nodes: serde_json::Value = serde_json::from_str(&told).ok()?;
        let round_trip_ns = nodes["nodes"][0]["clock"]["round_trip_ns"].as_u64()?;
        Some((round_trip_ns, nodes["nodes"][0]["clock"]["error_ns"].as_u64()?))
    };
    let (round_trip_ns, bound_ns) = wait("brain has measured the time", clock);
    assert!(round_trip_ns >= 40_000_000 && bound_ns >= 15_000_000, "{round_trip_ns} ns, bound {bound_ns} ns");
    let line = wait("the log tells the delay", || {
        network.says("base", &["call", "localiser.0", "feed", "200"]).ok();
        let log = network.says("brain", &["log"]).out;
        let line = log.lines().find(|line| line.contains("records of localiser.0/pose came more than 5ms"));
        line.map(str::to_owned)
    });
    let delay_ms = line.rsplit_once("the last after ").and_then(|(_, delay)| delay.split_once("ms"));
    let delay_ms: f64 = delay_ms.unwrap_or_else(|| panic!("{line}")).0.parse().unwrap();
    assert!(delay_ms >= 10.0, "{line}");
    network.stop();
}
