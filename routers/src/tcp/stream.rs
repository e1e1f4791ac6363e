//! One connection of a session: bytes in and out, sealed or not, without waiting.

use super::pace::{ConnectionPace, Holding};
use super::seal::{Holder, Sealed};
use nix::libc;
use rohrpost_mailbox::monotonic_ns;
use socket2::{Domain, Protocol, SockRef, Socket, Type};
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};

/// Result of reading or writing.
#[derive(Debug)]
pub enum Moved {
    /// So many bytes, at least one.
    Bytes(usize),
    /// None for now.
    Nothing,
    /// The connection is over; without an error the other end has closed it.
    Over(Option<io::Error>),
}

/// A connection.
#[derive(Debug)]
pub struct Stream {
    socket: Paced,
    sealed: Option<Sealed>,
    pace: ConnectionPace,
}

/// A socket. Before each piece the kernel is asked whether it holds enough already: it checks itself only before it
/// begins a piece of its own, which may have 64 KiB.
#[derive(Debug)]
struct Paced {
    socket: TcpStream,
    /// None: as much as the kernel takes.
    piece_bytes: Option<usize>,
}

impl Read for Paced {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.socket.read(into)
    }
}

impl Write for Paced {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let Some(piece) = self.piece_bytes else { return self.socket.write(bytes) };
        let mut taken = 0;
        while taken < bytes.len() {
            let piece = &bytes[taken..bytes.len().min(taken + piece)];
            // Nothing is put behind it into the same piece of the kernel's.
            match SockRef::from(&self.socket).send_with_flags(piece, libc::MSG_EOR | libc::MSG_NOSIGNAL) {
                Ok(bytes) => taken += bytes,
                Err(_) if taken > 0 => break,
                Err(error) => return Err(error),
            }
        }
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Stream {
    /// Begins to connect; when it may be written to, [`Stream::connected`] says how that ended.
    ///
    /// # Errors
    /// What the system says.
    pub fn connect(to: SocketAddr, sealed: Option<Sealed>) -> io::Result<Self> {
        let socket = Socket::new(Domain::for_address(to), Type::STREAM, Some(Protocol::TCP))?;
        socket.set_nonblocking(true)?;
        match socket.connect(&to.into()) {
            Err(error) if error.raw_os_error() != Some(nix::errno::Errno::EINPROGRESS as i32) => return Err(error),
            _ => {}
        }
        Self::new(socket.into(), sealed)
    }

    /// A stream of an accepted connection.
    pub(super) fn new(socket: TcpStream, sealed: Option<Sealed>) -> io::Result<Self> {
        socket.set_nonblocking(true)?;
        socket.set_nodelay(true)?;
        let pace = ConnectionPace::default();
        SockRef::from(&socket).set_tcp_notsent_lowat(pace.unsent_bytes() as u32)?;
        Ok(Self { socket: Paced { socket, piece_bytes: pace.piece_bytes() }, sealed, pace })
    }

    /// Whether the connection that was begun is made.
    ///
    /// # Errors
    /// Why it is not.
    pub fn connected(&self) -> io::Result<()> {
        match self.socket.socket.take_error()? {
            Some(error) => Err(error),
            None => self.socket.socket.peer_addr().map(drop),
        }
    }

    /// Takes what has come.
    pub fn read(&mut self, into: &mut [u8]) -> Moved {
        moved(match &mut self.sealed {
            Some(sealed) => sealed.read(into, &mut self.socket),
            None => self.socket.read(into),
        })
    }

    /// Hands on bytes, as many as are taken. `waits`: there is more where they come from.
    pub fn write(&mut self, bytes: &[u8], waits: bool) -> Moved {
        let moved = moved(match &mut self.sealed {
            Some(sealed) => sealed.write(bytes, self.pace.unsent_bytes(), &mut self.socket),
            None => self.socket.write(bytes),
        });
        let taken = if let Moved::Bytes(taken) = moved { taken } else { 0 };
        let is_all = taken == bytes.len() && !self.has_unsent() && !waits;
        if let Some(holding) = self.pace.wrote(taken, is_all, monotonic_ns) {
            self.hold(holding);
        }
        moved
    }

    /// What the kernel keeps of this connection. If it does not like that, it goes on as before.
    fn hold(&mut self, Holding { unsent, held }: Holding) {
        self.socket.piece_bytes = self.pace.piece_bytes();
        let socket = SockRef::from(&self.socket.socket);
        let _ = socket.set_tcp_notsent_lowat(unsent as u32);
        if let Some(held) = held {
            // The kernel takes twice as much, for what it needs besides; of pieces like these that is little.
            let _ = socket.set_send_buffer_size(held as usize / 2);
        }
    }

    /// The round trip, ns, as far as that is known.
    pub(super) fn set_round_trip(&mut self, round_trip_ns: Option<u64>) {
        self.pace.set_round_trip(round_trip_ns);
    }

    /// Whether what is lost on the way takes seconds to be made good.
    pub(super) fn is_slow(&self) -> bool {
        self.pace.is_slow()
    }

    /// How many bytes are made ready for it at a time, so that what comes then waits no longer than it would in the
    /// kernel.
    pub(super) fn batch_bytes(&self) -> usize {
        self.pace.batch_bytes()
    }

    /// Hands on what was taken and has not left.
    ///
    /// # Errors
    /// When the connection is over.
    pub fn flush(&mut self) -> io::Result<()> {
        self.sealed.as_mut().map_or(Ok(()), |sealed| sealed.flush(&mut self.socket))
    }

    /// Whether something that was taken has not left.
    pub fn has_unsent(&self) -> bool {
        self.sealed.as_ref().is_some_and(Sealed::has_unsent)
    }

    /// Identity of the other end, if it has proved one.
    pub(super) fn holder(&self) -> Option<Holder> {
        self.sealed.as_ref().and_then(Sealed::holder)
    }

    /// Whether the other end must prove its identity.
    pub(super) fn is_sealed(&self) -> bool {
        self.sealed.is_some()
    }

    /// Nothing more is sent; what was said can still be read.
    pub(super) fn end(&self) {
        // It may be closed at the other end already.
        let _ = self.socket.socket.shutdown(Shutdown::Write);
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
        self.socket.socket.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::time::{Duration, Instant};

    const PATIENCE: Duration = Duration::from_secs(60);

    /// Writes what is made ready at a time until it is so; more waits all the time.
    fn write_until(stream: &mut Stream, what: &str, is_so: impl Fn(&Stream) -> bool) {
        let (began, piece) = (Instant::now(), vec![7; 64 * 1024]);
        while !is_so(stream) {
            assert!(began.elapsed() < PATIENCE, "waited in vain: {what}");
            match stream.write(&piece[..stream.batch_bytes()], true) {
                Moved::Bytes(_) => {}
                Moved::Nothing => std::thread::sleep(Duration::from_millis(1)),
                Moved::Over(error) => panic!("{error:?}"),
            }
        }
    }

    #[test]
    fn a_connection_that_was_slow_for_a_while_is_not_taken_for_slow_when_it_is_fast_again() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let stream = Stream::connect(listener.local_addr().unwrap(), None).unwrap();
        let (mut far, _) = listener.accept().unwrap();
        let is_fast = AtomicBool::new(false);
        std::thread::scope(|scope| {
            // Whatever fails, it is closed before the reader is waited for.
            let mut stream = stream;
            scope.spawn(|| {
                let mut taken = vec![0; 64 * 1024];
                while !is_fast.load(Ordering::Relaxed) {
                    std::thread::sleep(Duration::from_millis(10));
                    far.read_exact(&mut taken[..100]).unwrap();
                }
                while far.read(&mut taken).unwrap() > 0 {}
            });
            write_until(&mut stream, "it is known to be slow", Stream::is_slow);
            is_fast.store(true, Ordering::Relaxed);
            write_until(&mut stream, "it is known to be fast", |stream| !stream.is_slow());
            stream.end();
        });
    }
}
