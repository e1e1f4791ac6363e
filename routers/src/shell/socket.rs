//! Sockets of a node's router: one for datagrams to the node's address and port, and one to each peer.
//!
//! Those to peers are connected: the kernel reports when nothing listens. The address, not the port, identifies a node.

use super::failure::Failure;
use super::filter;
use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::socket::{ControlMessageOwned, MsgFlags, SockaddrStorage, recvmsg, setsockopt, sockopt};
use nix::sys::time::TimeValLike;
use rohrpost_mailbox::realtime_ns;
use socket2::{Domain, Protocol, SockRef, Socket, Type};
use std::io::{self, IoSlice, IoSliceMut};
use std::net::{IpAddr, Shutdown, SocketAddr, UdpSocket};
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Receive buffer in the kernel: a hundredth of a second of 10 Gbit/s, including the kernel's overhead for small
/// datagrams.
const RECEIVE_BYTES: usize = 8 << 20;
/// The same for what is not real time: packages that wait longer than this takes at 100 MiB/s are late, and the reader
/// may have to wait itself.
pub(super) const REST_BYTES: usize = 2 << 20;
/// The same for parts of replicas: records are large.
pub(super) const REPLICA_BYTES: usize = 8 << 20;
/// Expedited forwarding (RFC 3246), for switches and radios that know it; and the highest priority in this computer's
/// own queues that needs no rights.
const TRAFFIC_CLASS: u32 = 46 << 2;
const PRIORITY: u32 = 6;
/// Reading ends after this long without a datagram. A timeout in the kernel costs less than a sleep.
pub(super) const LISTEN: Duration = Duration::from_millis(100);
/// The same while something is due that nothing may announce: the kernel makes a tick or two of it.
pub(super) const LISTEN_SHORTLY: Duration = Duration::from_millis(1);
/// Room for a stamp and a count, and the kernel's heads of them.
const CONTROL_BYTES: usize = 64;
/// Pause after a failed read.
const PAUSE: Duration = Duration::from_millis(1);

/// Why a router cannot use its address.
#[derive(Debug, thiserror::Error)]
pub enum SocketError {
    /// Another process uses it.
    #[error(
        "{0} is in use: does the router of this node run already, its launch (which keeps this for it), or another \
         program? Stop it, or choose another `port` in [network], the same on all nodes"
    )]
    InUse(SocketAddr),
    /// It is another computer's address.
    #[error(
        "{0} is no address of this computer: launch this node on the computer that has it, or correct its `address` in \
         the configuration (`ip addr` shows which there are)"
    )]
    NotHere(SocketAddr),
    /// The inherited socket is not bound to the router's address.
    #[error("the socket that was handed to this router is bound to {1}, and not to {0}; launch the node anew")]
    Strange(SocketAddr, String),
    /// Another error of the system.
    #[error("{1} for {0}: {2}")]
    Io(SocketAddr, &'static str, io::Error),
}

/// Result of a read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Received {
    /// A datagram.
    Datagram {
        /// How long it is.
        bytes: usize,
        /// Source address.
        source: IpAddr,
        /// How long it has waited in the kernel until now, ns; 0 if the kernel did not say.
        waited_ns: u64,
        /// Datagrams that the kernel had dropped at this socket when it came, modulo 2^32: of strangers, or because the
        /// socket was full.
        dropped: u32,
    },
    /// Nothing came for [`LISTEN`].
    Nothing,
    /// The socket was closed.
    Closed,
}

/// Sockets of a node's router for a process that keeps them while routers come and go
/// ([`Parts::sockets`](super::Parts)): of this port, of the port for what is not real time, and of that for replicas.
/// Datagrams that come meanwhile wait in the kernel, with their time of arrival; those that wait too long are dropped.
/// From the first socket on that cannot be opened now the rest is missing: each router opens these itself, or reports
/// why it cannot.
pub fn listen(own: IpAddr, (port, others): (u16, [Option<u16>; 2]), peers: &[IpAddr]) -> Vec<OwnedFd> {
    let others = others.into_iter().zip([REST_BYTES, REPLICA_BYTES]).filter_map(|(port, bytes)| Some((port?, bytes)));
    let ports = std::iter::once((port, RECEIVE_BYTES)).chain(others);
    let open = |(port, bytes)| InSocket::open((own, port).into(), peers, bytes).map(|inside| inside.socket.into());
    ports.map_while(|port| open(port).ok()).collect()
}

/// Takes datagrams from all peers.
pub(super) struct InSocket {
    socket: UdpSocket,
    port: u16,
    closed: AtomicBool,
    /// Another process has it too, and keeps it for later routers.
    is_kept: bool,
    /// Receive buffer in the kernel, bytes; less than asked for if the system's limit is lower.
    pub(super) receive_bytes: usize,
}

impl InSocket {
    /// Wanted receive buffer.
    pub(super) const WANTED_BYTES: usize = RECEIVE_BYTES;

    /// Binds the node's own address and port, exclusively. It takes only datagrams from `peers`.
    pub(super) fn open(own: SocketAddr, peers: &[IpAddr], bytes: usize) -> Result<Self, SocketError> {
        let socket = new_socket(own).map_err(|error| SocketError::Io(own, "making a socket", error))?;
        bind(&socket, own)?;
        Self::of(socket, own, (peers, bytes), false)
    }

    /// A socket that is kept for all routers of this node, one after the other: see [`listen`]. Without one opens it.
    pub(super) fn kept(
        socket: Option<OwnedFd>,
        own: SocketAddr,
        peers: &[IpAddr],
        bytes: usize,
    ) -> Result<Self, SocketError> {
        let Some(socket) = socket.map(Socket::from) else { return Self::open(own, peers, bytes) };
        let bound =
            socket.local_addr().map_err(|error| SocketError::Io(own, "looking at the socket that is kept", error))?;
        match bound.as_socket() {
            Some(bound) if bound == own => Self::of(socket, own, (peers, bytes), true),
            bound => Err(SocketError::Strange(own, bound.map_or("nothing".into(), |bound| bound.to_string()))),
        }
    }

    fn of(
        socket: Socket,
        own: SocketAddr,
        (peers, bytes): (&[IpAddr], usize),
        is_kept: bool,
    ) -> Result<Self, SocketError> {
        let failed = |what| move |error: io::Error| SocketError::Io(own, what, error);
        filter::take_only_from(&socket, peers).map_err(failed("SO_ATTACH_FILTER"))?;
        if setsockopt(&socket, sockopt::RcvBufForce, &bytes).is_err() {
            // Without the right to go beyond the limit, up to the limit.
            socket.set_recv_buffer_size(bytes).map_err(failed("SO_RCVBUF"))?;
        }
        // The kernel reports twice the requested size: it includes its own overhead.
        let receive_bytes = socket.recv_buffer_size().map_err(failed("SO_RCVBUF"))? / 2;
        setsockopt(&socket, sockopt::ReceiveTimestampns, &true).map_err(|e| failed("SO_TIMESTAMPNS")(e.into()))?;
        setsockopt(&socket, sockopt::RxqOvfl, &1).map_err(|e| failed("SO_RXQ_OVFL")(e.into()))?;
        socket.set_read_timeout(Some(LISTEN)).map_err(failed("SO_RCVTIMEO"))?;
        Ok(Self { socket: socket.into(), port: own.port(), closed: AtomicBool::new(false), is_kept, receive_bytes })
    }

    /// Reads the next datagram; blocks until there is one, or for [`LISTEN`].
    pub(super) fn receive(&self, datagram: &mut [u8]) -> Received {
        if self.closed.load(Ordering::Acquire) {
            return Received::Closed;
        }
        let (mut parts, mut control) = ([IoSliceMut::new(datagram)], [0; CONTROL_BYTES]);
        let read =
            recvmsg::<SockaddrStorage>(self.socket.as_raw_fd(), &mut parts, Some(&mut control), MsgFlags::empty());
        let message = match read {
            Ok(message) => message,
            Err(Errno::EAGAIN | Errno::EINTR) => return Received::Nothing,
            Err(_) => {
                // The kernel lacks memory, and a real-time thread must not retry at once.
                std::thread::sleep(PAUSE);
                return Received::Nothing;
            }
        };
        let source = message.address.as_ref().and_then(address);
        // Closed meanwhile: what was read has no sender.
        let Some(source) = source else { return Received::Nothing };
        let (mut waited_ns, mut dropped) = (0, 0);
        for control in message.cmsgs().into_iter().flatten() {
            match control {
                ControlMessageOwned::ScmTimestampns(stamp) => {
                    let arrived_ns = u64::try_from(stamp.num_nanoseconds()).ok();
                    waited_ns = arrived_ns.map_or(0, |arrived_ns| realtime_ns().saturating_sub(arrived_ns));
                }
                ControlMessageOwned::RxqOvfl(so_far) => dropped = so_far,
                _ => {}
            }
        }
        Received::Datagram { bytes: message.bytes, source, waited_ns, dropped }
    }

    /// From now on reading ends after this long without a datagram.
    pub(super) fn listen_for(&self, time: Duration) {
        // It is a socket of this process, and the time is not zero: that cannot fail.
        let _ = self.socket.set_read_timeout(Some(time));
    }

    /// Sends a datagram to the router at an address; never waits.
    pub(super) fn answer(&self, to: IpAddr, datagram: &[u8]) {
        let at = SocketAddr::new(to, self.port).into();
        // A refusal that does not leave counts as lost: the next one comes a second later.
        let _ = SockRef::from(&self.socket).send_to_with_flags(datagram, &at, MsgFlags::MSG_DONTWAIT.bits());
    }

    /// Ends the reading, even of a blocked thread; for a socket that is kept, after [`LISTEN`].
    pub(super) fn close(&self) {
        self.closed.store(true, Ordering::Release);
        if self.is_kept {
            // A shutdown would also affect later routers.
            return;
        }
        // An unconnected socket answers that it is not connected, and wakes its readers nevertheless.
        let _ = SockRef::from(&self.socket).shutdown(Shutdown::Both);
    }
}

/// Sends datagrams to one peer.
pub(super) struct OutSocket {
    own: IpAddr,
    peer: SocketAddr,
    /// At least this many bytes may wait in the kernel; more fail.
    waiting_bytes: usize,
    /// None while there is no route, as when the network is down.
    socket: Option<Socket>,
}

impl OutSocket {
    /// A socket with a send buffer of at least this many bytes, and at least the default.
    pub(super) fn new(own: IpAddr, peer: SocketAddr, waiting_bytes: usize) -> Self {
        Self { own, peer, waiting_bytes, socket: connect(own, peer, waiting_bytes).ok() }
    }

    /// Whether it might take a datagram.
    pub(super) fn has_room(&self) -> bool {
        let Some(socket) = &self.socket else { return true };
        let mut fds = [PollFd::new(socket.as_fd(), PollFlags::POLLOUT)];
        !matches!(poll(&mut fds, PollTimeout::ZERO), Ok(0))
    }

    /// Sends these pieces as one datagram; never waits. It fails while the network card has more than it can send:
    /// packages then wait in the router's queue, where important ones overtake.
    ///
    /// # Errors
    /// The datagram was not sent, or not because of an error of an earlier one.
    pub(super) fn send(&mut self, parts: &[IoSlice<'_>]) -> Result<(), Failure> {
        let socket = match &mut self.socket {
            Some(socket) => socket,
            none => none.insert(connect(self.own, self.peer, self.waiting_bytes).map_err(|error| Failure::of(&error))?),
        };
        // Without a list of pieces the kernel has less to copy.
        let send = |socket: &Socket| match parts {
            [whole] => socket.send(whole),
            parts => socket.send_vectored(parts),
        };
        let sent = loop {
            match send(socket) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                sent => break sent,
            }
        };
        let Err(error) = sent else { return Ok(()) };
        let failure = Failure::of(&error);
        match failure {
            // The error of an earlier datagram. This one was not sent: it is sent again, now without the error.
            Failure::NobodyThere => {
                let again = send(socket);
                again.map(drop).map_err(|error| Failure::of(&error)).and(Err(Failure::NobodyThere))
            }
            Failure::NoWay => {
                // The address may have gone and come back: open a new socket.
                self.socket = None;
                Err(failure)
            }
            _ => Err(failure),
        }
    }
}

pub(super) fn address(of: &SockaddrStorage) -> Option<IpAddr> {
    let v4 = of.as_sockaddr_in().map(|of| IpAddr::V4(of.ip()));
    v4.or_else(|| of.as_sockaddr_in6().map(|of| IpAddr::V6(of.ip())))
}

fn connect(own: IpAddr, peer: SocketAddr, waiting_bytes: usize) -> io::Result<Socket> {
    let socket = new_socket(peer)?;
    socket.set_nonblocking(true)?;
    // The kernel reports twice the requested size. Never less than the default.
    let is_less = socket.send_buffer_size()? < 2 * waiting_bytes;
    if is_less && setsockopt(&socket, sockopt::SndBufForce, &waiting_bytes).is_err() {
        socket.set_send_buffer_size(waiting_bytes)?;
    }
    socket.bind(&SocketAddr::new(own, 0).into())?;
    prefer(&socket, peer);
    socket.connect(&peer.into())?;
    Ok(socket)
}

/// Has datagrams to addresses such as this one go before others.
pub(super) fn prefer(socket: &Socket, like: SocketAddr) {
    // A refusal of the option is no failure: the network then treats these datagrams like others.
    let _ = if like.is_ipv4() { socket.set_tos_v4(TRAFFIC_CLASS) } else { socket.set_tclass_v6(TRAFFIC_CLASS) };
    // After the class, which sets a priority.
    let _ = socket.set_priority(PRIORITY);
}

pub(super) fn new_socket(of: SocketAddr) -> io::Result<Socket> {
    let socket = Socket::new(Domain::for_address(of), Type::DGRAM, Some(Protocol::UDP))?;
    if of.is_ipv6() {
        // Else a port taken here would be taken of all IPv4 addresses too.
        socket.set_only_v6(true)?;
    }
    Ok(socket)
}

/// Binds; errors that users can fix say how.
fn bind(socket: &Socket, own: SocketAddr) -> Result<(), SocketError> {
    socket.bind(&own.into()).map_err(|error| match error.kind() {
        io::ErrorKind::AddrInUse => SocketError::InUse(own),
        io::ErrorKind::AddrNotAvailable => SocketError::NotHere(own),
        _ => SocketError::Io(own, "binding a socket", error),
    })
}

#[cfg(test)]
mod tests;
