//! A replica on a sealed network, beside a node of it that has the key and sends what it likes to the port of replicas.

use crate::harness::{NETWORK, wait};
use crate::lan::addresses;
use crate::process::Running;
use crate::replicas::{Follower, Pair, compare};
use serde_json::Value;
use std::collections::BTreeMap;
use std::process::{Command, Stdio};

/// The hostile node: a program in Python that knows the pages of the book alone, in the place of `desk`.
fn hostile(pair: &Pair, addresses: &[&str; 3]) -> Running {
    let page = format!("{}/../tests/e2e/python/replica_node.py", env!("CARGO_MANIFEST_DIR"));
    let installation = &pair.base.1.installation;
    let (lan, port) = (format!("{:x}", installation.digest().lan()), installation.network.unwrap().port.to_string());
    let mut command = Command::new("python3");
    command.args(["-B", &page, &lan, &port, "keys/udp.keys", "2", "1"]).args(addresses);
    command.current_dir(pair.place.path("")).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut hostile = Running::start(command);
    hostile.wait_for("takes part");
    hostile
}

/// What the router of `brain` did not take, by cause: of parts, and of datagrams that were not opened.
fn refused(pair: &Pair) -> BTreeMap<String, u64> {
    // `desk` has no router that tells.
    let told = pair.place.say_at(&pair.config, "brain", &["net", "--json"]).out;
    let told: Value = serde_json::from_str(told.trim()).unwrap();
    let of_brain = told.as_array().unwrap().iter().find(|report| report["node"] == "brain").unwrap();
    let parts = of_brain["replicas"]["received"][0]["lost"].as_array().into_iter().flatten();
    let rejected = of_brain["links"]["rejections"].as_array().into_iter().flatten();
    let counts = parts.map(|cause| (cause, "times")).chain(rejected.map(|cause| (cause, "datagrams")));
    counts.map(|(cause, count)| (cause["cause"].as_str().unwrap().into(), cause[count].as_u64().unwrap())).collect()
}

#[test]
fn on_a_sealed_network_records_arrive_beside_parts_that_others_send() {
    let [base, brain] = addresses();
    let (lan, host) = base.rsplit_once('.').unwrap();
    let desk = format!("{lan}.{}", host.parse::<u8>().unwrap() + 2);
    let network = NETWORK.replace("none", "keys");
    let network = format!("[nodes.desk]\naddress = \"{desk}\"\ntools = [32, 47]\n{network}");
    let pair = Pair::launched_at(&[base.clone(), brain.clone()], &network);
    let (mut here, mut there) = (Follower::new(&pair.base.1), Follower::new(&pair.brain.1));
    pair.feed_through(20, [&mut here, &mut there]);
    let hostile = hostile(&pair, &[&base, &brain, &desk]);
    wait("each kind of attempt is counted under its own cause", || {
        let refused = refused(&pair);
        ["foreign", "replay", "forged", "unsealed"].iter().all(|cause| refused.contains_key(*cause)).then_some(())
    });
    pair.feed_through(60, [&mut here, &mut there]);
    compare(&here, &there);
    drop((here, there, hostile));
    pair.stop().assert_empty();
}
