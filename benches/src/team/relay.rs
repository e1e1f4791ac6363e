//! The least that a router of a team can be: a process that takes datagrams and hands each over in shared memory.

use super::bare::{listener, speaker};
use crate::floors::ring::{Futex, RingReceiver, SharedRing};
use crate::lan::flow::Outlet;
use crate::one_way::{Sink, Source};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{Child, OrFail, Shared, copy_whole};
use std::io::ErrorKind;
use std::net::{Ipv4Addr, UdpSocket};

/// What follows a message in the ring: it came, or nothing did for a while, so that its receiver looks at the clock.
const CAME: u8 = 1;

/// A relay for each robot, until this is dropped.
pub struct Relays {
    rings: Vec<Shared<SharedRing>>,
    relays: Vec<Child>,
    own: Ipv4Addr,
    bytes: usize,
}

/// A robot behind its relay; what it says goes to the group at once.
pub struct RelayedRobot<'a> {
    speaks: UdpSocket,
    ring: Futex<'a, RingReceiver<'a>>,
    room: Vec<u8>,
}

impl Relays {
    /// Starts so many, for messages of so many bytes; `enter` runs in each process before, to move it to its place.
    ///
    /// # Errors
    /// When there can be no further memory or process.
    pub fn start(
        robots: u8,
        own: Ipv4Addr,
        bytes: usize,
        enter: impl Fn() -> Result<(), Failure>,
    ) -> Result<Self, Failure> {
        let rings = (0..robots).map(|_| Shared::new()).collect::<Result<Vec<_>, _>>()?;
        let relay = |ring: &Shared<SharedRing>| {
            Child::start(|| {
                enter()?;
                hand_over(&listener(own)?, &mut Futex::sender(ring), bytes)
            })
        };
        let relays = rings.iter().map(relay).collect::<Result<_, _>>()?;
        Ok(Self { rings, relays, own, bytes })
    }

    /// Processes of the relays.
    pub fn pids(&self) -> Vec<i32> {
        self.relays.iter().map(Child::pid).collect()
    }

    /// Opens the robot of this system, in the process that will use it, at its place.
    ///
    /// # Errors
    /// When a socket is refused.
    pub fn robot(&self, system: u8) -> Result<RelayedRobot<'_>, Failure> {
        let ring = Futex::receiver(&self.rings[usize::from(system) - 1]);
        Ok(RelayedRobot { speaks: speaker(self.own)?, ring, room: vec![0; self.bytes + 1] })
    }
}

fn hand_over(listens: &UdpSocket, ring: &mut impl Sink, bytes: usize) -> Result<(), Failure> {
    let mut room = vec![0; bytes + 1];
    loop {
        room[bytes] = match listens.recv(&mut room[..bytes]) {
            Ok(_) => CAME,
            Err(error) if error.kind() == ErrorKind::WouldBlock => 0,
            Err(error) => return Err(Failure::of("recv", error)),
        };
        ring.send(&room)?;
    }
}

impl Sink for RelayedRobot<'_> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.speaks.send(message).map(drop).or_fail("send")
    }
}

impl Outlet for RelayedRobot<'_> {
    fn receive(&mut self, message: &mut [u8]) -> Result<bool, Failure> {
        self.ring.receive(&mut self.room)?;
        let (text, came) = self.room.split_at(message.len());
        copy_whole(text, message).map(|()| came == [CAME])
    }
}
