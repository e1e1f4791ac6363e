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
        let group: SocketAddrV4 = GROUP.parse().or_fail("address of the group")?;
        let listens = socket(AddressFamily::Inet, SockType::Datagram, SockFlag::empty(), None).or_fail("socket")?;
        setsockopt(&listens, sockopt::ReuseAddr, &true).or_fail("socket")?;
        bind(listens.as_raw_fd(), &SockaddrIn::from(group)).or_fail("socket")?;
        let listens = UdpSocket::from(listens);
        listens.join_multicast_v4(group.ip(), &own).or_fail("group")?;
        listens.set_read_timeout(Some(LOOK)).or_fail("socket")?;
        // The source's address says by which device it goes.
        let speaks = UdpSocket::bind((own, 0)).or_fail("socket")?;
        speaks.connect(group).or_fail("socket")?;
        Ok(Self { speaks, listens, room: vec![0; bytes + 1] })
    }
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
