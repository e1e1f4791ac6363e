//! One connection of a session: bytes in and out, sealed or not, without waiting.

use super::seal::{Holder, Sealed};
use socket2::{Domain, Protocol, SockRef, Socket, Type};
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
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
pub(super) struct Stream {
    socket: TcpStream,
    sealed: Option<Sealed>,
}

impl Stream {
    /// Begins to connect; when it may be written to, [`Stream::connected`] says how that ended.
    pub(super) fn connect(to: SocketAddr, sealed: Option<Sealed>) -> io::Result<Self> {
        let socket = Socket::new(Domain::for_address(to), Type::STREAM, Some(Protocol::TCP))?;
        socket.set_nonblocking(true)?;
        match socket.connect(&to.into()) {
            Err(error) if error.raw_os_error() != Some(nix::errno::Errno::EINPROGRESS as i32) => return Err(error),
            _ => {}
        }
        Self::new(socket.into(), sealed)
    }

    /// One that was accepted.
    pub(super) fn new(socket: TcpStream, sealed: Option<Sealed>) -> io::Result<Self> {
        socket.set_nonblocking(true)?;
        socket.set_nodelay(true)?;
        SockRef::from(&socket).set_tcp_notsent_lowat(UNSENT_BYTES)?;
        Ok(Self { socket, sealed })
    }

    /// Whether the connection that was begun is made.
    pub(super) fn connected(&self) -> io::Result<()> {
        match self.socket.take_error()? {
            Some(error) => Err(error),
            None => self.socket.peer_addr().map(drop),
        }
    }

    pub(super) fn read(&mut self, into: &mut [u8]) -> Moved {
        moved(match &mut self.sealed {
            Some(sealed) => sealed.read(into, &mut self.socket),
            None => self.socket.read(into),
        })
    }

    pub(super) fn write(&mut self, bytes: &[u8]) -> Moved {
        moved(match &mut self.sealed {
            Some(sealed) => sealed.write(bytes, &mut self.socket),
            None => self.socket.write(bytes),
        })
    }

    /// Hands on what was taken and has not left.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        self.sealed.as_mut().map_or(Ok(()), |sealed| sealed.flush(&mut self.socket))
    }

    /// Whether something that was taken has not left.
    pub(super) fn has_unsent(&self) -> bool {
        self.sealed.as_ref().is_some_and(Sealed::has_unsent)
    }

    /// Who the other end is, if it has shown that.
    pub(super) fn holder(&self) -> Option<Holder> {
        self.sealed.as_ref().and_then(Sealed::holder)
    }

    /// Whether the other end must show who it is.
    pub(super) fn is_sealed(&self) -> bool {
        self.sealed.is_some()
    }

    /// Nothing more is sent; what was said can still be read.
    pub(super) fn end(&self) {
        // It may be closed at the other end already.
        let _ = self.socket.shutdown(Shutdown::Write);
    }
}

fn moved(result: io::Result<usize>) -> Moved {
    match result {
        Ok(0) => Moved::Over(None),
        Ok(bytes) => Moved::Bytes(bytes),
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Moved::Nothing,
        // By TLS: closed without a farewell, which a process that dies says not either.
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Moved::Over(None),
        Err(error) => Moved::Over(Some(error)),
    }
}

impl AsFd for Stream {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}
