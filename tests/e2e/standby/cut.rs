//! Cut links: each side does what `check` says of it.

use super::{answered, config, heard, is_on, runs};
use crate::harness::{Place, assert_has, lab, until};
use crate::network::{NETWORK, Network};

const ADDRESSES: [(&str, &str); 3] = [("base", "10.79.6.1"), ("brain", "10.79.6.2"), ("desk", "10.79.6.3")];

#[test]
fn a_node_that_is_cut_off_is_off_and_without_the_witness_all_are() {
    let Some(lab) = lab(ADDRESSES, "modules with several nodes, and cut links") else { return };
    let place = Place::new();
    let config = config(&place, ADDRESSES.map(|(_, address)| address), NETWORK, &["probe.0"], super::SLOW);
    let mut lan = Network::new(place, config, Some(lab)).launched(&super::NODES);
    let said = lan.place.say(&["check", lan.config.to_str().unwrap()]);
    // Lines are folded.
    let said = said.out.split_whitespace().collect::<Vec<_>>().join(" ");
    let words = "else on desk, ready and off until then; a node that dies, or cannot reach base, is off within 900 ms, \
                 and the next begins; without base, which grants the lease, it stops everywhere";
    assert_has(&said, [words]);
    answered(&lan, "brain", "desk");
    let first = lan.robot("brain").pid("probe.0");
    lan.lab().cut("brain").unwrap();
    until("desk takes over", || {
        let has_begun = is_on(&lan, "desk");
        assert!(!has_begun || !runs(first), "two run");
        has_begun
    });
    heard(&lan);
    lan.lab().fix("brain").unwrap();
    until("brain stands by", || lan.robot("brain").state("probe.0") == "stands by");
    heard(&lan);
    assert!(is_on(&lan, "desk"), "the holder stays");

    lan.lab().cut("base").unwrap();
    until("it stops everywhere", || !is_on(&lan, "desk") && !is_on(&lan, "brain"));
    lan.lab().fix("base").unwrap();
    until("it goes on", || is_on(&lan, "desk") || is_on(&lan, "brain"));
    heard(&lan);

    lan.kill("base", true);
    until("it stops everywhere", || !is_on(&lan, "desk") && !is_on(&lan, "brain"));
    lan.launch("base");
    until("it goes on", || is_on(&lan, "desk") || is_on(&lan, "brain"));
    heard(&lan);
}
