//! Datagrams to a multicast group, as the kernel carries them.

use super::systems::GROUP;
use crate::lan::flow::{LOOK, Outlet};
use crate::one_way::Sink;
use nix::sys::socket::{AddressFamily, SockFlag, SockType, SockaddrIn, bind, setsockopt, socket, sockopt};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{OrFail, copy_whole};
use std::io::ErrorKind;
use std::net::{Ipv4Addr, SocketAddrV4, UdpSocket};
use std::os::fd::AsRawFd;

/// Two sockets at an address: one that sends to the group, and one of those that listen to it.
pub struct BareRobot {
    speaks: UdpSocket,
    listens: UdpSocket,
    room: Vec<u8>,
}

impl BareRobot {
    /// Opens them in the place where the calling thread is; for messages of so many bytes.
    ///
    /// # Errors
    /// When that is refused.
    pub fn open(own: Ipv4Addr, bytes: usize) -> Result<Self, Failure> {
        Ok(Self { speaks: speaker(own)?, listens: listener(own)?, room: vec![0; bytes + 1] })
    }
}

fn group() -> Result<SocketAddrV4, Failure> {
    GROUP.parse().or_fail("address of the group")
}

/// A socket that hears the group at this address.
pub(super) fn listener(own: Ipv4Addr) -> Result<UdpSocket, Failure> {
    let group = group()?;
    let listens = socket(AddressFamily::Inet, SockType::Datagram, SockFlag::empty(), None).or_fail("socket")?;
    setsockopt(&listens, sockopt::ReuseAddr, &true).or_fail("socket")?;
    bind(listens.as_raw_fd(), &SockaddrIn::from(group)).or_fail("socket")?;
    let listens = UdpSocket::from(listens);
    listens.join_multicast_v4(group.ip(), &own).or_fail("group")?;
    listens.set_read_timeout(Some(LOOK)).or_fail("socket")?;
    Ok(listens)
}

/// A socket that sends to the group from this address, which says by which device.
pub(super) fn speaker(own: Ipv4Addr) -> Result<UdpSocket, Failure> {
    let speaks = UdpSocket::bind((own, 0)).or_fail("socket")?;
    speaks.connect(group()?).or_fail("socket")?;
    Ok(speaks)
}

impl Sink for BareRobot {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.speaks.send(message).map(drop).or_fail("send")
    }
}

impl Outlet for BareRobot {
    fn receive(&mut self, message: &mut [u8]) -> Result<bool, Failure> {
        match self.listens.recv(&mut self.room) {
            Ok(bytes) => copy_whole(&self.room[..bytes], message).map(|()| true),
            Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(false),
            Err(error) => Err(Failure::of("recv", error)),
        }
    }
}
