//! One connection of a session: bytes in and out, without waiting.

use socket2::{Domain, Protocol, SockRef, Socket, Type};
use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};

/// What the kernel takes before it has sent it: what is more important than that waits for no more.
const UNSENT_BYTES: u32 = 32 * 1024;

/// What came of reading or writing.
#[derive(Debug)]
pub(super) enum Moved {
    /// So many bytes, at least one.
    Bytes(usize),
    /// None for now.
    Nothing,
    /// The connection is over; without an error the other end has closed it.
    Over(Option<io::Error>),
}

/// A connection.
#[derive(Debug)]
pub(super) struct Stream(TcpStream);

impl Stream {
    /// Begins to connect; when it may be written to, [`Stream::connected`] says how that ended.
    pub(super) fn connect(to: SocketAddr) -> io::Result<Self> {
        let socket = Socket::new(Domain::for_address(to), Type::STREAM, Some(Protocol::TCP))?;
        socket.set_nonblocking(true)?;
        match socket.connect(&to.into()) {
            Err(error) if error.raw_os_error() != Some(nix::errno::Errno::EINPROGRESS as i32) => return Err(error),
            _ => {}
        }
        Self::new(socket.into())
    }

    /// One that was accepted.
    pub(super) fn new(socket: TcpStream) -> io::Result<Self> {
        socket.set_nonblocking(true)?;
        socket.set_nodelay(true)?;
        SockRef::from(&socket).set_tcp_notsent_lowat(UNSENT_BYTES)?;
        Ok(Self(socket))
    }

    /// Whether the connection that was begun is made.
    pub(super) fn connected(&self) -> io::Result<()> {
        match self.0.take_error()? {
            Some(error) => Err(error),
            None => self.0.peer_addr().map(drop),
        }
    }

    pub(super) fn read(&mut self, into: &mut [u8]) -> Moved {
        moved(self.0.read(into))
    }

    pub(super) fn write(&mut self, bytes: &[u8]) -> Moved {
        moved(self.0.write(bytes))
    }
}

fn moved(result: io::Result<usize>) -> Moved {
    match result {
        Ok(0) => Moved::Over(None),
        Ok(bytes) => Moved::Bytes(bytes),
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Moved::Nothing,
        Err(error) => Moved::Over(Some(error)),
    }
}

impl AsFd for Stream {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}
