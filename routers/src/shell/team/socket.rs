//! The socket of a router of the team: of the group, or of this node alone.

use rohrpost_config::{Team, TeamReach};
use socket2::{Domain, Protocol, SockAddr, Socket, Type};
use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};
use std::os::fd::{AsFd, BorrowedFd};

/// Receive buffer in the kernel: hundreds of datagrams, while this thread waits for a processor.
const RECEIVE_BYTES: usize = 1 << 20;

/// How a router reaches others, and where.
pub(super) struct TeamSocketReach {
    pub(super) own: SocketAddr,
    pub(super) group: Option<Ipv4Addr>,
    /// By system, for those without a group.
    pub(super) peers: Box<[(u8, SocketAddr)]>,
}

impl TeamSocketReach {
    pub(super) fn new(team: &Team, own: IpAddr) -> Self {
        let group = match team.reach {
            TeamReach::Group(group) => Some(group),
            TeamReach::Peers { .. } => None,
        };
        let peers = team.peers().iter().map(|peer| (peer.system, peer.address)).collect();
        Self { own: SocketAddr::new(own, team.port), group, peers }
    }

    /// Where datagrams for a system go, or for all.
    pub(super) fn addresses(&self, system: u8) -> impl Iterator<Item = SocketAddr> {
        let group = self.group.map(|group| SocketAddr::new(group.into(), self.own.port()));
        let is_for = move |(peer, _): &&(u8, SocketAddr)| system == rohrpost_mailbox::ALL_SYSTEMS || *peer == system;
        group.into_iter().chain(self.peers.iter().filter(is_for).map(|(_, address)| *address))
    }
}

/// An open socket that never waits.
pub(super) struct TeamSocket(UdpSocket);

impl AsFd for TeamSocket {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

impl TeamSocket {
    /// Opens it; with a group it listens there alone, through the interface of the node's address.
    pub(super) fn open(reach: &TeamSocketReach) -> io::Result<Self> {
        let socket = Socket::new(Domain::for_address(reach.own), Type::DGRAM, Some(Protocol::UDP))?;
        socket.set_nonblocking(true)?;
        // As much as the system allows.
        let _ = socket.set_recv_buffer_size(RECEIVE_BYTES);
        match (reach.group, reach.own.ip()) {
            (Some(group), IpAddr::V4(own)) => {
                // Other programs of this computer may listen there as well.
                socket.set_reuse_address(true)?;
                socket.bind(&SockAddr::from(SocketAddr::new(group.into(), reach.own.port())))?;
                socket.join_multicast_v4(&group, &own)?;
                socket.set_multicast_if_v4(&own)?;
            }
            _ => socket.bind(&SockAddr::from(reach.own))?,
        }
        Ok(Self(socket.into()))
    }

    /// Sends a datagram.
    pub(super) fn send(&self, datagram: &[u8], to: SocketAddr) -> io::Result<()> {
        self.0.send_to(datagram, to).map(drop)
    }

    /// Takes a datagram that has come: how long it is, and its source.
    pub(super) fn receive(&self, room: &mut [u8]) -> io::Result<(usize, SocketAddr)> {
        self.0.recv_from(room)
    }
}
