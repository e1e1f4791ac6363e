//! A bad network between a client and its server, where a test wants one: all bytes go through a thread that makes them
//! late.
//!
//! ```text
//!  client ═ loopback ═▶ near ─▶ BandwidthQueue ─▶ far ═ TCP ═▶ server          and back by another BandwidthQueue
//! ```
//!
//! The client and its kernel see what they would see of such a network: what a line does not carry yet is not read, so
//! that it waits where it was sent from. When the client closes, what has not arrived at the server by then is gone.

use crate::impair::{BandwidthQueue, ImpairmentSettings};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use rohrpost_mailbox::monotonic_ns;
use socket2::{Domain, Protocol, Socket, Type};
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::os::fd::AsFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Limit of what sockets buffer before the line: what the line carries in this time.
const HELD: Duration = Duration::from_millis(50);
const HELD_BYTES_MIN: usize = 4 * 1024;
const HELD_BYTES_MAX: usize = 256 * 1024;
/// Segments of a network, in place of those of loopback, which are larger than what is held.
const SEGMENT_BYTES: u32 = 1448;
/// Taken at a time.
const PIECE_BYTES: usize = 64 * 1024;
/// The server is there within this time, or not at all.
const CONNECT: Duration = Duration::from_secs(5);
/// Whether it is to end is looked for this often.
const LOOK: Duration = Duration::from_millis(100);

/// The thread; dropped, it ends soon. Nobody waits for that: it may be connecting.
pub(super) struct BadLine {
    near: SocketAddr,
    ends: Arc<AtomicBool>,
}

impl BadLine {
    /// Begins a line to a server.
    ///
    /// # Errors
    /// What the system says.
    pub(super) fn begin(server: SocketAddr, settings: ImpairmentSettings) -> io::Result<Self> {
        let listener = Socket::new(Domain::IPV4, Type::STREAM, Some(Protocol::TCP))?;
        hold(&listener, &settings)?;
        listener.bind(&SocketAddr::from((Ipv4Addr::LOCALHOST, 0)).into())?;
        listener.listen(1)?;
        listener.set_nonblocking(true)?;
        let listener = TcpListener::from(listener);
        let (near, ends) = (listener.local_addr()?, Arc::new(AtomicBool::new(false)));
        let work = BadLineThread { server, settings, listener, ends: ends.clone(), connections: 0 };
        std::thread::Builder::new().name("tcp-bad-line".into()).spawn(move || work.run())?;
        Ok(Self { near, ends })
    }

    /// Where the client connects to.
    pub(super) fn near(&self) -> SocketAddr {
        self.near
    }
}

impl Drop for BadLine {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Release);
    }
}

/// A socket that holds little, if the line carries little.
fn hold(socket: &Socket, settings: &ImpairmentSettings) -> io::Result<()> {
    let Some(rate) = settings.rate_bytes_s else { return Ok(()) };
    let bytes = usize::try_from(rate.saturating_mul(HELD.as_millis() as u64) / 1000).unwrap_or(HELD_BYTES_MAX);
    socket.set_recv_buffer_size(bytes.clamp(HELD_BYTES_MIN, HELD_BYTES_MAX))?;
    socket.set_tcp_mss(SEGMENT_BYTES)
}

struct BadLineThread {
    server: SocketAddr,
    settings: ImpairmentSettings,
    listener: TcpListener,
    ends: Arc<AtomicBool>,
    connections: u64,
}

impl BadLineThread {
    fn run(mut self) {
        while !self.ends.load(Ordering::Acquire) {
            let mut listens = [PollFd::new(self.listener.as_fd(), PollFlags::POLLIN)];
            // Interrupted, or too long: it looks again.
            let _ = poll(&mut listens, millis(LOOK));
            let near = match self.listener.accept() {
                Ok((near, _)) => near,
                Err(error) if is_for_now(&error) => continue,
                Err(error) => {
                    tracing::debug!("the bad line takes no connection: {error}");
                    std::thread::sleep(LOOK);
                    continue;
                }
            };
            if let Err(error) = self.carry(&near) {
                // The client sees its connection end, and says so.
                tracing::debug!("a connection by the bad line: {error}");
            }
        }
    }

    /// Carries bytes until one of the two ends closes, or is gone.
    fn carry(&mut self, near: &TcpStream) -> io::Result<()> {
        near.set_nonblocking(true)?;
        near.set_nodelay(true)?;
        let far = Socket::new(Domain::for_address(self.server), Type::STREAM, Some(Protocol::TCP))?;
        hold(&far, &self.settings)?;
        far.connect_timeout(&self.server.into(), CONNECT)?;
        let far = TcpStream::from(far);
        far.set_nonblocking(true)?;
        far.set_nodelay(true)?;
        // Each connection has accidents of its own, and so has each way.
        let line = |stream| BandwidthQueue::new(self.settings, stream);
        let way = |stream| Direction { line: line(stream), is_over: false, is_full: false, is_cut: false };
        let (mut up, mut down) = (way(2 * self.connections), way(2 * self.connections + 1));
        self.connections += 1;
        let (mut piece, mut far_ended) = (vec![0; PIECE_BYTES], false);
        while !self.ends.load(Ordering::Acquire) {
            let now_ns = monotonic_ns();
            up.step(now_ns, near, &far, &mut piece);
            down.step(now_ns, &far, near, &mut piece);
            if up.is_over || down.is_cut || down.is_at_end() {
                return Ok(());
            }
            let until_ns = up.line.until_ns(now_ns).min(down.line.until_ns(now_ns));
            let wait = Duration::from_nanos(until_ns.saturating_sub(monotonic_ns())).min(LOOK);
            let mut sockets = [
                PollFd::new(near.as_fd(), up.wants(now_ns) | down.lacks()),
                PollFd::new(far.as_fd(), down.wants(now_ns) | up.lacks()),
            ];
            // What the server has said last may be on its way still. Of a socket that has ended poll would say so all
            // the time.
            let asked = if far_ended { &mut sockets[..1] } else { &mut sockets[..] };
            // Interrupted, it looks as well.
            let _ = poll(asked, millis(wait));
            let has_ended = |socket: &PollFd<'_>| {
                socket.revents().is_some_and(|seen| seen.intersects(PollFlags::POLLERR | PollFlags::POLLHUP))
            };
            if has_ended(&sockets[0]) {
                return Ok(());
            }
            far_ended |= has_ended(&sockets[1]);
        }
        Ok(())
    }
}

/// Rounded up, so that what is waited for has come.
fn millis(wait: Duration) -> PollTimeout {
    PollTimeout::try_from(wait.as_nanos().div_ceil(1_000_000) as u64).unwrap_or(PollTimeout::ZERO)
}

/// From one socket to the other.
struct Direction {
    line: BandwidthQueue,
    /// Nothing more comes.
    is_over: bool,
    /// The receiver takes nothing now.
    is_full: bool,
    /// Nor ever again.
    is_cut: bool,
}

impl Direction {
    fn step(&mut self, now_ns: u64, mut from: &TcpStream, mut to: &TcpStream, piece: &mut [u8]) {
        let room = self.line.room(now_ns).min(piece.len());
        if room > 0 && !self.is_over {
            match from.read(&mut piece[..room]) {
                Ok(0) => self.is_over = true,
                Ok(bytes) => self.line.push(now_ns, &piece[..bytes]),
                Err(error) => self.is_over = !is_for_now(&error),
            }
        }
        self.is_full = false;
        while !self.is_full && !self.is_cut {
            let arrived = self.line.arrived(now_ns);
            if arrived.is_empty() {
                break;
            }
            match to.write(arrived) {
                Ok(bytes) => self.line.took(bytes),
                Err(error) if is_for_now(&error) => self.is_full = true,
                Err(_) => self.is_cut = true,
            }
        }
    }

    fn is_at_end(&self) -> bool {
        self.is_over && self.line.is_empty()
    }

    /// What is waited for where it comes from.
    fn wants(&self, now_ns: u64) -> PollFlags {
        let takes = !self.is_over && self.line.room(now_ns) > 0;
        if takes { PollFlags::POLLIN } else { PollFlags::empty() }
    }

    /// What is waited for where it goes to.
    fn lacks(&self) -> PollFlags {
        if self.is_full { PollFlags::POLLOUT } else { PollFlags::empty() }
    }
}

fn is_for_now(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}
