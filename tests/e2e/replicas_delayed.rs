//! A network with a steady delay: each clock's bound is as large as the delay, and it is told nevertheless.

use crate::harness::{NETWORK, OUTPUT, Place, program, wait};
use crate::lan::addresses;
use crate::process::Running;
use crate::replicas_lossy::HEAD;

const REPLICA: &str = "[[replica]]\nstream = \"localiser.0/pose\"\nto = [\"brain\"]\n";

#[test]
fn a_steady_delay_above_the_alarm_is_told_with_its_length() {
    let place = Place::new();
    let config = place.path("test.toml");
    let [base, brain] = addresses();
    let nodes = format!(
        "[nodes.base]\naddress = \"{base}\"\ntools = [0, 15]\n[nodes.brain]\naddress = \"{brain}\"\ntools = [16, 31]\n"
    );
    let localiser = format!(
        "[[module]]\nname = \"localiser.0\"\nnode = \"base\"\nprogram = {}\n[module.stream.pose]\nrecord = \"128 B\"\n\
         keep = 256\n",
        program("replicas_lossy::localiser")
    );
    let output = OUTPUT.replacen("[[module]]\n", "[[module]]\nnode = \"brain\"\n", 1);
    std::fs::write(&config, [HEAD, &nodes, NETWORK, &output, &localiser, REPLICA].concat()).unwrap();
    let mut launches = ["base", "brain"].map(|node| {
        let mut command = place.command(&["launch", config.to_str().unwrap(), "--node", node]);
        command.env("ROHRPOST_IMPAIR", "delay=20ms");
        let mut launch = Running::start(command);
        let robot = place.robot(&config, node, &mut launch);
        robot.wait_on(&mut launch);
        (launch, robot)
    });
    let clock = || {
        let told = place.say_at(&config, "brain", &["time", "--json"]).out;
        let nodes: serde_json::Value = serde_json::from_str(&told).ok()?;
        let round_trip_ns = nodes["nodes"][0]["clock"]["round_trip_ns"].as_u64()?;
        Some((round_trip_ns, nodes["nodes"][0]["clock"]["error_ns"].as_u64()?))
    };
    let (round_trip_ns, bound_ns) = wait("brain has measured the time", clock);
    assert!(round_trip_ns >= 40_000_000 && bound_ns >= 15_000_000, "{round_trip_ns} ns, bound {bound_ns} ns");
    let line = wait("the log tells the delay", || {
        place.say_at(&config, "base", &["call", "localiser.0", "feed", "200"]).ok();
        let log = place.say_at(&config, "brain", &["log"]).out;
        let line = log.lines().find(|line| line.contains("records of localiser.0/pose came more than 5ms"));
        line.map(str::to_owned)
    });
    let delay_ms = line.rsplit_once("the last after ").and_then(|(_, delay)| delay.split_once("ms"));
    let delay_ms: f64 = delay_ms.unwrap_or_else(|| panic!("{line}")).0.parse().unwrap();
    assert!(delay_ms >= 10.0, "{line}");
    launches.iter_mut().rev().for_each(|(launch, _)| drop(launch.stop()));
}
