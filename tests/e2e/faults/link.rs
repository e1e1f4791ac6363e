//! The cable is unplugged and plugged in again; and a cable with one broken direction.

use super::Field;
use rohrpost::Fault;
use rohrpost::interfaces::LinkState;

#[test]
fn a_cut_link_is_reported_at_both_ends_and_carries_as_before_once_it_is_fixed() {
    let Some(field) = Field::launched() else { return };
    for round in 1..=2 {
        field.lab().cut("arm").unwrap();
        for (node, peer, module) in [("base", "arm", "probe.1"), ("arm", "base", "probe.0")] {
            field.wait_for_state(node, peer, LinkState::Silent);
            assert_eq!(field.fault(node, module), Fault::NodeSilent { node: peer.into() });
        }
        field.wait_told("router.0", &["node arm", "is silent"], round);
        field.lab().fix("arm").unwrap();
        field.wait_counted("base", "probe.1", round as u32);
        field.wait_counted("arm", "probe.0", round as u32);
        // Otherwise the state of this cut would be taken for that of the next.
        field.wait_for_state("base", "arm", LinkState::Alive);
        field.wait_for_state("arm", "base", LinkState::Alive);
        field.wait_told("router.0", &["node arm", "is heard"], round + 1);
    }
    for (node, peer) in [("base", "arm"), ("arm", "base")] {
        assert_eq!(field.peer(node, peer).counters.restarts, 0, "the same routers as before");
    }
    for module in ["probe.0", "probe.1"] {
        assert!(!field.counted(module).contains(&super::NEVER), "{module}: what was answered with a fault was run");
    }
    field.stop();
}

#[test]
fn of_a_link_with_one_direction_each_end_says_what_it_knows() {
    let Some(mut field) = Field::new(2, "") else { return };
    field.launch_deaf(&["base"]);
    // All that arm sends is lost; what base sends comes.
    field.network.impair = "loss=100%,seed=7";
    field.launch_deaf(&["arm"]);
    field.wait_for_state("base", "arm", LinkState::Silent);
    field.wait_for_state("arm", "base", LinkState::Unheard);
    assert_eq!(field.fault("base", "probe.1"), Fault::NodeSilent { node: "arm".into() });
    let deaf = field.fault("arm", "probe.0");
    assert_eq!(deaf, Fault::NodeDeaf { node: "base".into() });
    assert!(deaf.to_string().contains("node base is heard, but does not hear"), "{deaf}");
    assert_eq!(field.place.counted().len(), 0, "nothing was run");

    field.network.halt("arm");
    field.network.impair = "";
    field.launch(&["arm"]);
    field.wait_counted("base", "probe.1", 1);
    field.wait_counted("arm", "probe.0", 2);
    field.stop();
}
