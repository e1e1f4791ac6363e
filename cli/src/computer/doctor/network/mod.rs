//! The network between the nodes of a configuration: address, ports, packet size, peers, time stamps.

mod ask;

pub(super) use ask::ask;

use super::finding::{Finding, Grade};
use super::lan::{LanView, PeerNode, Port, PortState, Reach, Stamps};
use super::machine::{Machine, Needs};

/// The receive buffer that a router requests, for datagrams that arrive while it does not read.
const RECEIVE_BYTES: u64 = 8 << 20;
/// With a smaller buffer, a burst of one large package from each of a few nodes is lost.
const RECEIVE_BYTES_LEAST: u64 = 1 << 20;

pub(super) fn findings(machine: &Machine, needs: &Needs) -> Vec<Finding> {
    let Some(lan) = &machine.asked.lan else { return Vec::new() };
    let from = needs.from.as_ref().map(|path| path.display().to_string()).unwrap_or_default();
    let mut findings = vec![address(lan, &from)];
    findings.extend(lan.ports.iter().map(|port| self::port(lan, port, &from)));
    findings.extend(buffers(machine));
    findings.extend(stamps(lan));
    // From another computer the ways to the peers are others.
    if lan.is_here {
        for peer in &lan.peers {
            findings.push(reach(peer, lan));
            findings.extend(mtu(peer, lan, &from));
        }
    }
    findings
}

fn address(lan: &LanView, from: &str) -> Finding {
    let (what, why) = ("node address", "other nodes send to it, and accept datagrams only from it");
    if lan.is_here {
        let device = lan.addresses.iter().find(|(_, address)| *address == lan.address);
        let device = device.map_or(String::new(), |(device, _)| format!(", device {device}"));
        return Finding::ok(what, format!("{}{device}", lan.address), why);
    }
    let others: Vec<String> = lan.addresses.iter().map(|(device, address)| format!("{address} ({device})")).collect();
    let others = if others.is_empty() { "none".into() } else { others.join(", ") };
    Finding::not(
        Grade::Bad,
        what,
        format!("{} is not one of this computer, which has {others}", lan.address),
        why,
        format!(
            "run it on node {}'s own computer, or `--node` with the name of this one; or correct `address` in {from}; \
             or give this computer the address: sudo ip address add {}/24 dev DEVICE",
            lan.node, lan.address
        ),
    )
}

fn port(lan: &LanView, port: &Port, from: &str) -> Finding {
    let what = port.what;
    let why = "the node's router takes datagrams there; a firewall must let them in from all nodes";
    let number = port.number;
    match &port.state {
        PortState::Free => Finding::ok(what, format!("UDP {number}, free"), why),
        PortState::InUse if lan.runs => Finding::ok(what, format!("UDP {number}, this node's router has it"), why),
        PortState::InUse => Finding::not(
            Grade::Bad,
            what,
            format!("UDP {number}, another program has it"),
            why,
            format!(
                "`ss -ulpn sport = {number}` names the program: stop it, or write another `port` into [network] of \
                 {from}, the same on all nodes"
            ),
        ),
        PortState::Unknown => Finding::not(
            Grade::Warn,
            what,
            format!("UDP {number}, not tried"),
            why,
            "fix the node's address first, then check again",
        ),
        PortState::Refused(error) => Finding::not(
            Grade::Bad,
            what,
            format!("UDP {number}, refused: {error}"),
            why,
            format!("write another `port` into [network] of {from}"),
        ),
    }
}

fn buffers(machine: &Machine) -> Option<Finding> {
    let (what, why) = (
        "socket buffers",
        "they hold datagrams that arrive while the router's thread waits for a core; without room, datagrams are lost",
    );
    let limit = machine.number("/proc/sys/net/core/rmem_max")?;
    let is = format!("at most {} KiB without root rights", limit >> 10);
    Some(if limit >= RECEIVE_BYTES_LEAST {
        Finding::ok(what, is, why)
    } else {
        Finding::not(Grade::Warn, what, is, why, format!("sudo sysctl -w net.core.rmem_max={RECEIVE_BYTES}"))
    })
}

fn stamps(lan: &LanView) -> Option<Finding> {
    let (what, why) = (
        "time stamps",
        "the kernel's time stamps of sending and reception compare the nodes' clocks; else a thread's less exact ones",
    );
    let fix = "another network device, or its newer driver: `ethtool -T DEVICE` must say software-transmit and \
        software-receive";
    Some(match &lan.stamps {
        Stamps::Both => Finding::ok(what, "sending and receiving", why),
        Stamps::NoSent => Finding::not(Grade::Warn, what, "receiving only", why, fix),
        Stamps::None(error) => Finding::not(Grade::Warn, what, format!("none ({error})"), why, fix),
        Stamps::Unknown => return None,
    })
}

fn reach(peer: &PeerNode, lan: &LanView) -> Finding {
    let (what, why) = ("peer", "each node's router sends to each other one");
    let node = format!("{} at {}", peer.name, peer.address);
    match &peer.reach {
        Reach::NoRouter => Finding::ok(what, format!("{node}: is there; no router runs on it yet"), why),
        Reach::Neighbour => Finding::ok(what, format!("{node}: is there"), why),
        Reach::Silent => Finding::not(
            Grade::Warn,
            what,
            format!("{node}: does not answer"),
            why,
            format!(
                "switch it on; look after cables and `ping {}`; a firewall must let UDP {} through (there: \
                 `sudo nft list ruleset`)",
                peer.address,
                lan.ports.iter().map(|port| port.number.to_string()).collect::<Vec<_>>().join(", ")
            ),
        ),
        Reach::NoWay(error) => Finding::not(
            Grade::Bad,
            what,
            format!("{node}: {error}"),
            why,
            format!("an address in the same network as {}, or a route: `ip route get {}`", lan.address, peer.address),
        ),
    }
}

fn mtu(peer: &PeerNode, lan: &LanView, from: &str) -> Option<Finding> {
    let (what, why) = ("packet size", "a datagram larger than the path's MTU is lost, or refused by the kernel");
    // Where nobody answers, the kernel knows of another way at most, such as that to the Internet.
    let way = peer.mtu.filter(|_| matches!(peer.reach, Reach::NoRouter | Reach::Neighbour))?;
    Some(if way >= lan.mtu.into() {
        Finding::ok(what, format!("{} B of the {way} B that go to {}", lan.mtu, peer.name), why)
    } else {
        Finding::not(
            Grade::Bad,
            what,
            format!("{} B, and only {way} B go to {}", lan.mtu, peer.name),
            why,
            format!("write `mtu = {way}` into [network] of {from}; or sudo ip link set dev DEVICE mtu {}", lan.mtu),
        )
    })
}
