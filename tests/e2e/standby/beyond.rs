//! A node that only the TCP router reaches: what it calls and hears follows the holder, too.

use super::{CALL, NODES, SLOW, UNWILLING, again, die, heard, is_on, modules, suspended};
use crate::harness::{Place, head, until};
use crate::network::{NETWORK, Network, addresses, nodes};
use crate::probe::{ProbingInterface, WORK};
use crate::systems::CLASSES;
use rohrpost::interfaces::TcpInterface;
use rohrpost::wire::{append, from_bytes};
use rohrpost::{CallError, Fault};
use std::time::Duration;

/// A caller repeats a call of this timeout after a third of it: by then the next node has taken over.
const REPEATED: Duration = Duration::from_secs(12);

const FAR: &str = "[nodes.far]\nnetwork = \"tcp\"\ntools = [48, 63]\n";

/// The nodes of a LAN, on which probe.0 moves, and probe.9 on `far`. Base runs the TCP router.
fn launched(settings: &str) -> Network {
    let ([base, brain], [desk, _]) = (addresses(), addresses());
    let place = Place::new();
    let lan = nodes(NODES.into_iter().zip([&base, &brain, &desk]));
    let tcp = format!("[tcp]\nsecurity = \"none\"\naddress = \"{base}\"\nserver = \"base\"\n");
    let modules = modules("far", &["probe.0"], settings);
    let text = [head(CLASSES).as_str(), &lan, FAR, NETWORK, &tcp, &modules].concat();
    let config = place.write("test.toml", text);
    Network::new(place, config, None).launched(&["base", "far", "brain", "desk"])
}

/// Calls from beyond come through.
fn answered(lan: &Network, holder: &str) {
    until(format!("{holder} answers"), || is_on(lan, holder) && lan.robot("far").count("probe.0", 1, CALL).is_ok());
}

#[test]
fn a_node_beyond_the_tcp_router_goes_on_when_the_next_node_takes_over() {
    let mut lan = launched(SLOW);
    answered(&lan, "brain");
    heard(&lan);
    let kept = [("base", "tcp.255"), ("far", "tcp.3"), ("far", "probe.9")];
    let pids = |lan: &Network| kept.map(|(node, module)| lan.robot(node).pid(module));
    let before = pids(&lan);
    // A call that is under way. The caller repeats it to the next holder, which must not run it again.
    let (mut tool, name) = (lan.robot("far").tool(CALL), lan.robot("far").name("probe.0"));
    let write = |body: &mut Vec<u8>| append(body, &(60_000_u64,));
    let call = tool.link.begin(name, WORK, ProbingInterface::hash(), REPEATED, write).unwrap();
    until("it works", || lan.place.recorded("work begins") == 1);
    die(&lan, "brain");
    answered(&lan, "desk");
    let ended = tool.link.wait(call, |bytes| from_bytes::<()>(bytes));
    tool.close();
    assert!(matches!(ended, Err(CallError::Fault(_, Fault::Interrupted))), "{ended:?}");
    assert_eq!(lan.place.recorded("work begins"), 1, "it is not run again");
    heard(&lan);
    again(&mut lan, "brain");
    lan.halt("desk");
    answered(&lan, "brain");
    heard(&lan);
    assert_eq!(pids(&lan), before, "nothing else was started again");
}

#[test]
fn a_suspended_holder_is_refused_by_the_tcp_router() {
    suspended(launched(UNWILLING), "far", foreign);
}

/// Packages that the TCP router refused, since they came from a node that does not have their sender.
fn foreign(lan: &Network) -> u64 {
    let mut tool = lan.robot("base").tool(CALL);
    let (_, clients) = lan.robot("base").newest(&mut tool, "tcp.255", TcpInterface::CLIENTS).unwrap();
    tool.close();
    let lost = clients.classes.iter().flat_map(|class| &class.lost);
    lost.filter(|lost| lost.cause == "foreign").map(|lost| lost.packages).sum()
}
