//! How connections come in: the socket that listens, and those that may not stay.

use super::{LISTENER, ServerConnection, ServerError, ServerThread};
use crate::session::ClientIndex;
use crate::tcp::line_throttle::Topic;
use crate::tcp::seal::ServerSeal;
use crate::tcp::stream::Stream;
use nix::sys::epoll::{EpollEvent, EpollFlags};
use nix::sys::resource::{Resource, getrlimit, setrlimit};
use rohrpost_mailbox::monotonic_ns;
use socket2::{Domain, Protocol, Socket, Type};
use std::io;
use std::net::{SocketAddr, TcpListener};

/// Connections accepted before the clients have their turn.
const ACCEPTS: usize = 64;
/// Connections that the kernel keeps until they are accepted.
const BACKLOG: i32 = 1024;
/// Connections that cannot be sealed are closed after so long, and there are so many of them at most.
const PARTING_NS: u64 = 1_000_000_000;
const PARTING_MAX: usize = 64;
/// When accepting fails, since there is no descriptor left, it is tried again after so long.
const ACCEPT_AGAIN_NS: u64 = 100_000_000;

/// Each connection takes a descriptor. If the system does not grant so many, that is told when there is none left.
pub(super) fn raise_descriptors(wanted: u64) {
    if let Ok((soft, hard)) = getrlimit(Resource::RLIMIT_NOFILE)
        && soft < wanted
    {
        let _ = setrlimit(Resource::RLIMIT_NOFILE, wanted.min(hard).max(soft), hard);
    }
}

pub(super) fn listen(address: SocketAddr) -> Result<TcpListener, ServerError> {
    let listen = || {
        let socket = Socket::new(Domain::for_address(address), Type::STREAM, Some(Protocol::TCP))?;
        // One that died a moment ago has left connections that end slowly.
        socket.set_reuse_address(true)?;
        socket.set_nonblocking(true)?;
        socket.bind(&address.into())?;
        socket.listen(BACKLOG)?;
        Ok(TcpListener::from(socket))
    };
    listen().map_err(|error: io::Error| match error.kind() {
        io::ErrorKind::AddrInUse => ServerError::InUse(address),
        io::ErrorKind::AddrNotAvailable => ServerError::NotHere(address),
        _ => ServerError::Io(address, "a socket", error),
    })
}

impl ServerThread {
    pub(super) fn accept(&mut self) {
        let now_ns = monotonic_ns();
        for _ in 0..ACCEPTS {
            match self.listener.accept() {
                Ok((socket, peer)) => {
                    let sealed = self.seal.as_ref().map(ServerSeal::begin).transpose();
                    if let Ok(stream) = sealed.and_then(|sealed| Stream::new(socket, sealed)) {
                        self.take_in(now_ns, stream, peer);
                    }
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return,
                Err(error) => {
                    let line =
                        format!("cannot accept a connection: {error}; raise the limit of open files (ulimit -n)");
                    self.host.says(Topic::Accept, &line);
                    self.accept_ns = Some(now_ns + ACCEPT_AGAIN_NS);
                    return self.listen_for(EpollFlags::empty());
                }
            }
        }
    }

    /// Whether epoll tells of connections to be accepted.
    pub(super) fn listen_for(&self, flags: EpollFlags) {
        if let Err(error) = self.epoll.modify(&self.listener, &mut EpollEvent::new(flags, LISTENER)) {
            tracing::error!("epoll: {error}");
        }
    }

    fn take_in(&mut self, now_ns: u64, stream: Stream, peer: SocketAddr) {
        // Where there is no place, it is closed by being dropped.
        let Some(client) = self.server.accept(now_ns, peer, &mut self.host) else { return };
        let event = EpollEvent::new(EpollFlags::EPOLLIN, client.0.into());
        if self.epoll.add(&stream, event).is_err() {
            return self.server.closed(now_ns, client, &mut self.host);
        }
        let index = usize::from(client.0);
        if self.connections.len() <= index {
            self.connections.resize_with(index + 1, || None);
        }
        let peer = peer.to_string();
        self.connections[index] =
            Some(ServerConnection { is_known: !stream.is_sealed(), stream, peer, awaits_room: false });
    }

    /// A connection cannot be sealed. The other end reads why, if this one waits a moment before it closes.
    pub(super) fn unsealed(&mut self, client: ClientIndex, error: &io::Error) {
        let now_ns = monotonic_ns();
        let Some(ServerConnection { stream, peer, .. }) =
            self.connections.get_mut(usize::from(client.0)).and_then(Option::take)
        else {
            return;
        };
        self.host.refuses(Topic::Unsealed, format!("{peer} may not take part: {error}"));
        stream.end();
        // Closed when the place is needed, or the time is over; until then nothing is asked of it.
        if self.epoll.delete(&stream).is_ok() && self.parting.len() < PARTING_MAX {
            self.parting.push((now_ns + PARTING_NS, stream));
        }
        self.server.closed(now_ns, client, &mut self.host);
    }
}
