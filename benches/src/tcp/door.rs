//! The link between a relay and its module: takes what the module sends, and hands over what arrives for it.

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use rohrpost_bench_local::hand_over::{HandOver, Lanes, Wake};
use rohrpost_bench_local::harness::{End, Failure, Link, OrFail, Shared};
use rohrpost_bench_local::ours::{Station, join, shape};
use rohrpost_mailbox::{Interest, Name, Receiver, Waiting, Watches};
use std::fs::File;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::fd::{AsFd, OwnedFd};
use std::path::Path;

const PIECE_BYTES: usize = 64 * 1024;
/// Mailboxes of a node.
const MODULE: Name = Name::new(1, 1, 0, 0);
const RELAY: Name = Name::new(1, 2, 0, 0);

/// Between a relay and its module.
pub(super) trait Door {
    /// Sleeps until the module has sent something or the socket is readable, and hands on what the module has sent.
    /// Returns whether the socket is readable.
    ///
    /// # Errors
    /// When that fails.
    fn wait(&mut self, socket: &mut TcpStream) -> Result<bool, Failure>;

    /// Hands a message over.
    ///
    /// # Errors
    /// When that fails.
    fn give(&mut self, message: &[u8]) -> Result<(), Failure>;
}

/// A module wakes its relay by a pipe through which the message goes, and is woken by a futex.
pub(super) struct BareRelayModule<'a> {
    out: File,
    hand_over: HandOver<'a>,
    piece: Vec<u8>,
}

/// What [`BareRelayModule`] needs, made before the processes are.
pub(super) struct Hall {
    lanes: Shared<Lanes>,
    /// Out of the pipe, and into it.
    pipe: (OwnedFd, OwnedFd),
}

impl Hall {
    pub(super) fn new() -> Result<Self, Failure> {
        Ok(Self { lanes: Shared::new()?, pipe: nix::unistd::pipe().or_fail("pipe")? })
    }

    /// For the relay.
    pub(super) fn door(&self) -> Result<BareRelayModule<'_>, Failure> {
        let hand_over = HandOver::new(&self.lanes, End::Pong, Wake::Futex);
        Ok(BareRelayModule { out: file(&self.pipe.0)?, hand_over, piece: vec![0; PIECE_BYTES] })
    }

    /// For the module.
    pub(super) fn module(&self) -> Result<DoorModule<'_>, Failure> {
        let hand_over = HandOver::new(&self.lanes, End::Ping, Wake::Futex);
        Ok(DoorModule { into: file(&self.pipe.1)?, hand_over })
    }
}

fn file(descriptor: &OwnedFd) -> Result<File, Failure> {
    descriptor.try_clone().map(File::from).or_fail("pipe")
}

impl Door for BareRelayModule<'_> {
    fn wait(&mut self, socket: &mut TcpStream) -> Result<bool, Failure> {
        let watched = [self.out.as_fd(), socket.as_fd()];
        let mut waits = watched.map(|descriptor| PollFd::new(descriptor, PollFlags::POLLIN));
        poll(&mut waits, PollTimeout::NONE).or_fail("poll")?;
        let [from_module, from_network] = waits.map(|wait| wait.any().unwrap_or(true));
        if from_module {
            let count = self.out.read(&mut self.piece).or_fail("pipe")?;
            socket.write_all(&self.piece[..count]).or_fail("write")?;
        }
        Ok(from_network)
    }

    fn give(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.hand_over.send(message)
    }
}

/// The module at such a door.
pub(super) struct DoorModule<'a> {
    into: File,
    hand_over: HandOver<'a>,
}

impl Link for DoorModule<'_> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.into.write_all(message).or_fail("pipe")
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        self.hand_over.receive(message)
    }
}

/// Both have a mailbox, as modules and the clients of nodes have.
pub(super) struct MailboxDoor {
    receiver: Receiver,
    watches: Watches,
    back: Station,
}

impl MailboxDoor {
    /// For the relay, on the node in this directory.
    pub(super) fn open(directory: &Path, socket: &TcpStream, bytes: usize) -> Result<Self, Failure> {
        let participant = join(directory, RELAY)?;
        let receiver = participant.receiver(RELAY, shape(bytes)?).or_fail("mailbox")?;
        let mut watches = Watches::new(&participant).or_fail("mailbox")?;
        watches.add(socket, Interest::Read).or_fail("mailbox")?;
        Ok(Self { receiver, watches, back: Station::open(directory, None, MODULE, bytes)? })
    }

    /// For the module.
    pub(super) fn module(directory: &Path, bytes: usize) -> Result<Station, Failure> {
        Station::open(directory, Some(MODULE), RELAY, bytes)
    }
}

impl Door for MailboxDoor {
    fn wait(&mut self, socket: &mut TcpStream) -> Result<bool, Failure> {
        self.watches.wait_any(&mut [&mut self.receiver], Waiting::default(), || false);
        while let Some(package) = self.receiver.try_receive() {
            socket.write_all(package.body()).or_fail("write")?;
        }
        Ok(self.watches.next_ready().is_some())
    }

    fn give(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.back.send(message)
    }
}
