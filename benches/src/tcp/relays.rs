//! The least cost of a hop over a TCP router: the same processes and hand-overs, without any inspection of messages.
//!
//! ```text
//!  ping ──pipe──▶ relay ══TCP══▶ relay ══TCP══▶ relay ──futex──▶ pong
//!  ping ◀─futex── relay ◀══TCP══ relay ◀══TCP══ relay ◀──pipe─── pong
//! ```
//! As the client of a node, an outer relay sleeps on its module's messages and on its socket at once, so a module wakes
//! it by a pipe; the middle one sleeps in epoll.

use super::door::{Door, Hall, MailboxDoor};
use super::systems::free_address;
use nix::sys::epoll::{Epoll, EpollCreateFlags, EpollEvent, EpollFlags, EpollTimeout};
use rohrpost_bench_local::harness::{
    Cell, Child, End, Failure, Gate, Link, OrFail, Scratch, Shared, check_children, settle, time_two_processes,
};
use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

/// The relays, and the process that starts them.
const ALL: u32 = 4;
/// The middle relay listens within this time.
const CONNECTS_WITHIN: Duration = Duration::from_secs(5);
const PIECE_BYTES: usize = 64 * 1024;

/// Times a package over the three relays; see [`time_two_processes`].
///
/// # Errors
/// What a relay failed with, else an end.
pub fn time_relays(cell: &Cell) -> Result<Vec<f64>, Failure> {
    let halls = [Hall::new()?, Hall::new()?];
    let hall = |end: End| &halls[end.index()];
    time(cell, |end, _| hall(end).door(), |end| hall(end).module())
}

/// The same with our mailboxes between modules and relays: what the TCP router and its clients cost beyond that is
/// their own.
///
/// # Errors
/// As [`time_relays`].
pub fn time_mailbox_relays(cell: &Cell) -> Result<Vec<f64>, Failure> {
    let scratch = Scratch::new()?;
    let directory = |end: End| scratch.directory().join(end.node());
    let door = |end, socket: &TcpStream| MailboxDoor::open(&directory(end), socket, cell.bytes);
    time(cell, door, |end| MailboxDoor::module(&directory(end), cell.bytes))
}

fn time<D: Door, M: Link>(
    cell: &Cell,
    door: impl Fn(End, &TcpStream) -> Result<D, Failure>,
    module: impl Fn(End) -> Result<M, Failure>,
) -> Result<Vec<f64>, Failure> {
    let (address, gate) = (free_address()?, Shared::<Gate>::new()?);
    let start = |place, work: &dyn Fn() -> Result<(), Failure>| {
        Child::start(|| {
            settle(place, cell.placement, cell.scheduling)?;
            work()
        })
    };
    let outer = |end| {
        start(end, &|| {
            let socket = reach(address, end)?;
            let door = door(end, &socket)?;
            gate.meet(ALL)?;
            relay(door, socket, cell.bytes)
        })
    };
    let mut relays = vec![start(End::Pong, &|| middle(address, &gate))?, outer(End::Ping)?, outer(End::Pong)?];
    gate.meet_children(&mut relays)?;
    let timed = time_two_processes(cell, |end, _| module(end));
    // One ends only when it fails, or when another does.
    check_children(&mut relays)?;
    timed
}

/// Beside a module, as the client of its node.
fn relay(mut door: impl Door, mut socket: TcpStream, bytes: usize) -> Result<(), Failure> {
    let (mut piece, mut message) = (vec![0; PIECE_BYTES], Vec::new());
    loop {
        if !door.wait(&mut socket)? {
            continue;
        }
        let count = socket.read(&mut piece).or_fail("outer relay")?;
        message.extend_from_slice(&piece[..count]);
        if count == 0 {
            return Err(Failure::Failed("the middle relay has gone".into()));
        }
        if message.len() >= bytes {
            door.give(&message[..bytes])?;
            message.drain(..bytes);
        }
    }
}

/// In the middle, as the TCP router.
fn middle(address: SocketAddr, gate: &Gate) -> Result<(), Failure> {
    let listener = TcpListener::bind(address).or_fail("middle relay")?;
    let mut sockets = [accept(&listener).or_fail("middle relay")?, accept(&listener).or_fail("middle relay")?];
    sockets.sort_by_key(|(end, _)| *end);
    let mut sockets = sockets.map(|(_, socket)| socket);
    let epoll = Epoll::new(EpollCreateFlags::EPOLL_CLOEXEC).or_fail("middle relay")?;
    for (socket, index) in sockets.iter().zip(0..) {
        let added = epoll.add(socket, EpollEvent::new(EpollFlags::EPOLLIN, index));
        added.or_fail("middle relay")?;
    }
    let (mut piece, mut events) = (vec![0; PIECE_BYTES], [EpollEvent::empty(); 2]);
    gate.meet(ALL)?;
    loop {
        let count = epoll.wait(&mut events, EpollTimeout::NONE).or_fail("middle relay")?;
        for event in &events[..count] {
            let from = event.data() as usize;
            let bytes = sockets[from].read(&mut piece).or_fail("middle relay")?;
            if bytes == 0 {
                return Err(Failure::Failed("an outer relay has gone".into()));
            }
            sockets[1 - from].write_all(&piece[..bytes]).or_fail("middle relay")?;
        }
    }
}

/// A connection, and the outer relay at its other end.
fn accept(listener: &TcpListener) -> io::Result<(u8, TcpStream)> {
    let (mut socket, _) = listener.accept()?;
    socket.set_nodelay(true)?;
    let mut end = [0];
    socket.read_exact(&mut end)?;
    Ok((end[0], socket))
}

/// A connection to the middle relay; its first byte names the outer relay.
fn reach(address: SocketAddr, end: End) -> Result<TcpStream, Failure> {
    let give_up = Instant::now() + CONNECTS_WITHIN;
    let mut socket = loop {
        match TcpStream::connect(address) {
            Err(error) if Instant::now() > give_up => return Err(Failure::of("outer relay", error)),
            Err(_) => std::thread::sleep(Duration::from_millis(2)),
            Ok(socket) => break socket,
        }
    };
    let told = socket.set_nodelay(true).and_then(|()| socket.write_all(&[u8::from(end == End::Pong)]));
    told.or_fail("outer relay")?;
    Ok(socket)
}
