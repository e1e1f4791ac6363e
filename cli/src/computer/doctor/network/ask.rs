//! Probes how this computer is connected to the other nodes. Each peer gets one empty datagram, which a router ignores.

use crate::computer::doctor::lan::{LanView, PeerNode, Port, PortState, Reach, Stamps};
use nix::errno::Errno;
use nix::ifaddrs::getifaddrs;
use nix::net::if_::InterfaceFlags;
use nix::sys::socket::{
    ControlMessageOwned, MsgFlags, SockaddrStorage, TimestampingFlag, getsockopt, recvmsg, setsockopt, sockopt,
};
use rohrpost_config::{Installation, Node as NodeConfig};
use rohrpost_mailbox::{Node, node_directory};
use std::io::{ErrorKind, IoSliceMut};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::os::fd::AsRawFd;
use std::time::{Duration, Instant};

/// A peer without an answer after this time is silent.
const PATIENCE: Duration = Duration::from_secs(1);
const LOOK: Duration = Duration::from_millis(10);
/// Flag of a complete entry in the neighbour table.
const ATF_COM: u32 = 0x2;

/// The configuration's network as this computer sees it in the role of this node; none with only one node.
pub(in crate::computer::doctor) fn ask(installation: &Installation, node: &NodeConfig) -> Option<LanView> {
    let (network, address) = (installation.network?, node.address?);
    let is_here = UdpSocket::bind((address, 0)).is_ok();
    let ports = [
        ("port of packages", Some(network.port)),
        ("port of time", Some(network.time_port())),
        ("port of the rest", installation.rest_port()),
        ("port of replicas", installation.replica_port()),
    ];
    let state = |number| if is_here { try_port(address, number) } else { PortState::Unknown };
    let port = |(what, number): (_, Option<u16>)| number.map(|number| Port { what, number, state: state(number) });
    let ports = ports.into_iter().filter_map(port).collect();
    let launched =
        Node::open(&node_directory(&installation.name, &node.name)).is_ok_and(|node| node.launcher().is_some());
    let others = installation.nodes.iter().filter(|other| other.name != node.name);
    let probes: Vec<Probe> = others
        .filter_map(|other| {
            Some(Probe::begin(&other.name, is_here.then_some(address), (other.address?, network.port).into()))
        })
        .collect();
    let (peers, stamps) = wait(probes);
    Some(LanView {
        node: node.name.clone(),
        address,
        mtu: network.mtu,
        is_here,
        addresses: addresses(),
        ports,
        runs: launched,
        stamps,
        peers,
    })
}

fn try_port(address: IpAddr, port: u16) -> PortState {
    match UdpSocket::bind((address, port)) {
        Ok(_) => PortState::Free,
        Err(error) if error.kind() == ErrorKind::AddrInUse => PortState::InUse,
        Err(error) => PortState::Refused(error.to_string()),
    }
}

/// Addresses that others can reach, by device.
fn addresses() -> Vec<(String, IpAddr)> {
    let found = getifaddrs().into_iter().flatten().filter(|entry| !entry.flags.contains(InterfaceFlags::IFF_LOOPBACK));
    let ip = |address: SockaddrStorage| {
        let v4 = address.as_sockaddr_in().map(|v4| IpAddr::V4(v4.ip()));
        v4.or_else(|| address.as_sockaddr_in6().map(|v6| IpAddr::V6(v6.ip())))
    };
    let usable = |address: &IpAddr| !matches!(address, IpAddr::V6(v6) if v6.is_unicast_link_local());
    found.filter_map(|entry| Some((entry.interface_name, entry.address.and_then(ip).filter(usable)?))).collect()
}

/// A probe to a peer that is under way.
struct Probe {
    name: String,
    to: IpAddr,
    socket: Option<UdpSocket>,
    mtu: Option<u32>,
    reach: Option<Reach>,
    /// Whether the kernel accepts the option, and later whether it reported the transmit time.
    stamps: Result<bool, String>,
}

impl Probe {
    fn begin(name: &str, from: Option<IpAddr>, to: SocketAddr) -> Self {
        let any = if to.is_ipv4() { Ipv4Addr::UNSPECIFIED.into() } else { Ipv6Addr::UNSPECIFIED.into() };
        let mut probe =
            Self { name: name.into(), to: to.ip(), socket: None, mtu: None, reach: None, stamps: Ok(false) };
        let made = UdpSocket::bind((from.unwrap_or(any), 0)).and_then(|socket| {
            socket.set_nonblocking(true)?;
            let stamps = setsockopt(&socket, sockopt::Timestamping, &flags());
            probe.stamps = stamps.map(|()| false).map_err(|error| error.desc().into());
            socket.connect(to)?;
            probe.mtu = way(&socket, to.ip());
            socket.send(&[])?;
            Ok(socket)
        });
        match made {
            Ok(socket) => probe.socket = Some(socket),
            Err(error) => probe.reach = Some(refused(&error)),
        }
        probe
    }

    /// Checks once; false when there is nothing more to wait for.
    fn look(&mut self) -> bool {
        let Some(socket) = &self.socket else { return false };
        if let Ok(told) = &mut self.stamps {
            *told |= left_at(socket);
        }
        if self.reach.is_none() {
            self.reach = match socket.recv(&mut [0; 64]) {
                Ok(_) => Some(Reach::Neighbour),
                Err(error) if error.kind() == ErrorKind::WouldBlock => None,
                Err(error) => Some(refused(&error)),
            };
        }
        self.reach.is_none() || self.stamps == Ok(false)
    }
}

fn flags() -> TimestampingFlag {
    TimestampingFlag::SOF_TIMESTAMPING_TX_SOFTWARE
        | TimestampingFlag::SOF_TIMESTAMPING_RX_SOFTWARE
        | TimestampingFlag::SOF_TIMESTAMPING_SOFTWARE
}

/// Whether the kernel has reported a datagram's transmit time.
fn left_at(socket: &UdpSocket) -> bool {
    let (mut buffer, mut control) = ([0; 64], vec![0; 512]);
    let mut parts = [IoSliceMut::new(&mut buffer)];
    let message =
        recvmsg::<SockaddrStorage>(socket.as_raw_fd(), &mut parts, Some(&mut control), MsgFlags::MSG_ERRQUEUE);
    let Ok(message) = message else { return false };
    message.cmsgs().is_ok_and(|mut parts| parts.any(|part| matches!(part, ControlMessageOwned::ScmTimestampsns(_))))
}

/// The path MTU, as far as this computer knows.
fn way(socket: &UdpSocket, to: IpAddr) -> Option<u32> {
    // nix does not have the corresponding option of IPv6.
    let mtu = to.is_ipv4().then(|| getsockopt(socket, sockopt::IpMtu).ok())??;
    u32::try_from(mtu).ok()
}

fn refused(error: &std::io::Error) -> Reach {
    match error.raw_os_error().map(Errno::from_raw) {
        Some(Errno::ECONNREFUSED) => Reach::NoRouter,
        Some(Errno::EHOSTUNREACH) => Reach::Silent,
        _ => Reach::NoWay(error.to_string()),
    }
}

/// Whether the neighbour table has a MAC for the address: then the computer answered ARP, whatever its firewall does
/// above.
fn is_neighbour(address: IpAddr) -> bool {
    let text = std::fs::read_to_string("/proc/self/net/arp").unwrap_or_default();
    let complete = |line: &str| {
        let mut words = line.split_whitespace();
        let is_it = words.next()?.parse() == Ok(address);
        let flags = u32::from_str_radix(words.nth(1)?.strip_prefix("0x")?, 16).ok()?;
        (is_it && flags & ATF_COM != 0).then_some(())
    };
    text.lines().any(|line| complete(line).is_some())
}

fn wait(mut probes: Vec<Probe>) -> (Vec<PeerNode>, Stamps) {
    let deadline = Instant::now() + PATIENCE;
    // No short circuit: all are checked each time.
    while probes.iter_mut().fold(false, |waits, probe| probe.look() | waits) && Instant::now() < deadline {
        std::thread::sleep(LOOK);
    }
    let stamps = match &probes[..] {
        probes if probes.iter().any(|probe| probe.stamps == Ok(true)) => Stamps::Both,
        probes => match probes.iter().find(|probe| probe.socket.is_some()).map(|probe| &probe.stamps) {
            None => Stamps::Unknown,
            Some(Ok(_)) => Stamps::NoSent,
            Some(Err(error)) => Stamps::None(error.clone()),
        },
    };
    let peer = |probe: Probe| PeerNode {
        name: probe.name,
        address: probe.to,
        mtu: probe.mtu,
        // No refusal came: there is a router that does not answer, a firewall, or no computer.
        reach: probe.reach.unwrap_or(if is_neighbour(probe.to) { Reach::Neighbour } else { Reach::Silent }),
    };
    (probes.into_iter().map(peer).collect(), stamps)
}
