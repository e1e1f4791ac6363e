//! A replica on a sealed network, beside a node of it that has the key and sends what it likes to the port of replicas.

use crate::harness::{repository, until};
use crate::network::{NETWORK, Network, addresses};
use crate::process::Running;
use crate::replicas::{Follower, compare, feed_through, launched_at};
use std::collections::BTreeMap;

/// The hostile node: a program in Python that knows the pages of the book alone, in the place of `desk`.
fn hostile(pair: &Network, addresses: &[&str; 3]) -> Running {
    let page = repository("tests/e2e/python/replica_node.py");
    let installation = &pair.robot("base").installation;
    let (lan, port) = (format!("{:x}", installation.digest().lan()), installation.network.unwrap().port.to_string());
    let arguments = [&[&*page, &lan, &port, "keys/udp.keys", "2", "1"][..], addresses].concat();
    let mut hostile = pair.python("desk", &arguments);
    hostile.wait_for("takes part");
    hostile
}

/// What the router of `brain` did not take, by cause: of parts, and of datagrams that were not opened.
fn refused(pair: &Network) -> BTreeMap<String, u64> {
    let of_brain = pair.net("brain");
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
    let pair = launched_at(&[base.clone(), brain.clone()], &network);
    let (mut here, mut there) = (Follower::new(pair.robot("base")), Follower::new(pair.robot("brain")));
    feed_through(&pair, 20, [&mut here, &mut there]);
    let hostile = hostile(&pair, &[&base, &brain, &desk]);
    until("each kind of attempt is counted under its own cause", || {
        let refused = refused(&pair);
        ["foreign", "replay", "forged", "unsealed"].iter().all(|cause| refused.contains_key(*cause))
    });
    feed_through(&pair, 60, [&mut here, &mut there]);
    compare(&here, &there);
    drop((here, there, hostile));
    pair.stop();
}
