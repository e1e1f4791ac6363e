//! Hostile programs: connections with garbage, and some that send a hello a byte at a time.

use super::tally::Tally;
use nix::sys::socket::{AddressFamily, SockFlag, SockType, SockaddrIn, bind, connect, setsockopt, socket, sockopt};
use rohrpost_bench_local::harness::{Child, Failure, Shared};
use rohrpost_routers::session::frame::{SessionHello, SessionMessage};
use std::io::Write;
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, TcpStream};
use std::time::{Duration, Instant};

/// Connections with garbage, a second.
pub const PER_S: u32 = 1_000;
/// Connections that send a byte of a hello each so often: the TCP router closes them before the last byte.
const SLOW: usize = 64;
const BYTE_EACH: Duration = Duration::from_millis(100);
/// In groups of so many, since no process sleeps for so short a time.
const GROUP: u32 = 10;
/// The address of another computer than the crowd's.
const FROM: Ipv4Addr = Ipv4Addr::new(127, 0, 0, 66);
const GARBAGE_BYTES: usize = 512;

/// Active until this is dropped.
pub struct Hostile {
    child: Child,
    tally: Shared<Tally>,
}

impl Hostile {
    /// Starts it, like any other process.
    ///
    /// # Errors
    /// When there can be no further process.
    pub fn start(to: SocketAddr) -> Result<Self, Failure> {
        let tally = Shared::<Tally>::new()?;
        let child = Child::start(|| disturb(to, &tally))?;
        Ok(Self { child, tally })
    }

    /// Connections so far.
    ///
    /// # Errors
    /// What it failed with, if it has ended.
    pub fn connections(&mut self) -> Result<u64, Failure> {
        if self.child.has_ended()? {
            return Err(Failure::Failed("the hostile program has ended".into()));
        }
        Ok(self.tally.hostile.get())
    }
}

fn disturb(to: SocketAddr, tally: &Tally) -> Result<(), Failure> {
    let hello = hello();
    let mut slow: Vec<Option<(TcpStream, usize)>> = (0..SLOW).map(|_| None).collect();
    let (began, mut said) = (Instant::now(), Instant::now());
    let mut garbage = Garbage(0x9e37_79b9_7f4a_7c15);
    for number in 0.. {
        if number % GROUP == 0 {
            std::thread::sleep(
                (began + Duration::from_secs(1) / PER_S * number).saturating_duration_since(Instant::now()),
            );
        }
        if said.elapsed() > BYTE_EACH {
            said = Instant::now();
            slow.iter_mut().for_each(|slow| creep(slow, to, &hello));
        }
        if let Ok(mut stream) = reach(to) {
            // The other end may close it first.
            let _ = stream.write_all(&garbage.next(number, &hello));
            tally.hostile.add(1);
        }
    }
    Ok(())
}

/// Sends the next byte of a hello; after the last one, or when the connection is closed, another begins.
fn creep(slow: &mut Option<(TcpStream, usize)>, to: SocketAddr, hello: &[u8]) {
    let Some((mut stream, at)) = slow.take().or_else(|| Some((reach(to).ok()?, 0))) else { return };
    if hello.get(at).is_some_and(|byte| stream.write_all(&[*byte]).is_ok()) {
        *slow = Some((stream, at + 1));
    }
}

/// Closed by a reset, so that no port is blocked for a minute.
fn reach(to: SocketAddr) -> std::io::Result<TcpStream> {
    let SocketAddr::V4(to) = to else { return Err(std::io::ErrorKind::Unsupported.into()) };
    let made = socket(AddressFamily::Inet, SockType::Stream, SockFlag::SOCK_CLOEXEC, None)?;
    let at_once = libc::linger { l_onoff: 1, l_linger: 0 };
    setsockopt(&made, sockopt::Linger, &at_once)?;
    let fd = std::os::fd::AsRawFd::as_raw_fd(&made);
    bind(fd, &SockaddrIn::from(SocketAddrV4::new(FROM, 0)))?;
    connect(fd, &SockaddrIn::from(to))?;
    Ok(made.into())
}

/// A valid hello of an unknown installation.
fn hello() -> Vec<u8> {
    let mut bytes = Vec::new();
    let digest = 0x0bad;
    let hello = SessionHello {
        system: 9,
        reaches_own: false,
        common: digest,
        system_digest: digest,
        incarnation: 1,
        attempt: 1,
        asked_ns: 0,
        name: "nobody",
    };
    SessionMessage::Hello(hello).write(&mut bytes);
    bytes
}

/// Random numbers for the connections (xorshift).
struct Garbage(u64);

impl Garbage {
    /// Random bytes, nothing, a head that promises much, or a hello with other digests, in turn.
    fn next(&mut self, number: u32, hello: &[u8]) -> Vec<u8> {
        match number % 4 {
            0 => (0..GARBAGE_BYTES).map(|_| self.byte()).collect(),
            1 => Vec::new(),
            2 => [&0xffff_u32.to_le_bytes()[..], &[6, 0, 0, 0, self.byte()]].concat(),
            _ => hello.to_vec(),
        }
    }

    fn byte(&mut self) -> u8 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 as u8
    }
}
