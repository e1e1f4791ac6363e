//! The socket of time: what it sends and takes is stamped by the kernel, where that can.
//!
//! The stamp of a datagram that left comes back by the socket's queue of errors, with the datagram itself: so which one
//! it is needs no counting.

use crate::frame::{FrameHead, NodeIndex};
use crate::security::TAG_BYTES;
use crate::shell::filter;
use crate::shell::socket::{address, new_socket, prefer};
use crate::time::{SentId, TIME_BYTES};
use nix::errno::Errno;
use nix::sys::socket::{
    ControlMessageOwned, MsgFlags, SockaddrStorage, TimestampingFlag, recvmsg, sendto, setsockopt, sockopt,
};
use nix::sys::time::TimeSpec;
use std::io::{self, IoSliceMut};
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::os::fd::{AsFd, AsRawFd, BorrowedFd};

/// A datagram that comes back has the heads of lower layers before it.
const RETURNED_BYTES: usize = TIME_BYTES + TAG_BYTES + 128;
const CONTROL_BYTES: usize = 512;

/// Socket for datagrams of time.
pub(super) struct TimeSocket {
    socket: UdpSocket,
    peers: Vec<SockaddrStorage>,
    control: Box<[u8]>,
    /// Length of a datagram of time.
    datagram_bytes: usize,
}

/// A datagram that came.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReceivedDatagram {
    pub(super) bytes: usize,
    pub(super) source: IpAddr,
    /// CLOCK_REALTIME when the kernel took it in.
    pub(super) realtime_ns: Option<u64>,
}

impl TimeSocket {
    /// Binds `own`; peers are reached at the port given with them.
    pub(super) fn open(own: SocketAddr, peers: &[SocketAddr], digest: u64, kernel_stamps: bool) -> io::Result<Self> {
        let socket = new_socket(own)?;
        prefer(&socket, own);
        let wanted = TimestampingFlag::SOF_TIMESTAMPING_TX_SOFTWARE
            | TimestampingFlag::SOF_TIMESTAMPING_RX_SOFTWARE
            | TimestampingFlag::SOF_TIMESTAMPING_SOFTWARE;
        if kernel_stamps {
            // Without them the clock stamps by itself, and says so.
            let _ = setsockopt(&socket, sockopt::Timestamping, &wanted);
        }
        socket.set_nonblocking(true)?;
        let others: Vec<IpAddr> = peers.iter().filter(|peer| **peer != own).map(SocketAddr::ip).collect();
        // Where the kernel refuses the filter, all datagrams are read; each is checked in any case.
        let _ = filter::take_time_only_from(&socket, &others, digest);
        socket.bind(&own.into())?;
        Ok(Self {
            socket: socket.into(),
            peers: peers.iter().copied().map(SockaddrStorage::from).collect(),
            control: vec![0; CONTROL_BYTES].into(),
            datagram_bytes: TIME_BYTES,
        })
    }

    /// Expects sealed datagrams from now on.
    pub(super) fn sealed(self) -> Self {
        Self { datagram_bytes: TIME_BYTES + TAG_BYTES, ..self }
    }

    /// Hands a datagram to the kernel. One that it does not take is lost, as on the wire; an error that an earlier one
    /// brought back is not in its way.
    pub(super) fn send(&self, to: NodeIndex, datagram: &[u8]) -> bool {
        let Some(peer) = self.peers.get(usize::from(to)) else { return false };
        let send = || sendto(self.socket.as_raw_fd(), datagram, peer, MsgFlags::MSG_DONTWAIT);
        match send() {
            Err(Errno::ECONNREFUSED | Errno::EINTR) => send().is_ok(),
            sent => sent.is_ok(),
        }
    }

    /// The next datagram that came.
    pub(super) fn receive(&mut self, datagram: &mut [u8]) -> Option<ReceivedDatagram> {
        let mut parts = [IoSliceMut::new(datagram)];
        let fd = self.socket.as_raw_fd();
        let message = loop {
            match recvmsg::<SockaddrStorage>(fd, &mut parts, Some(&mut self.control), MsgFlags::MSG_DONTWAIT) {
                // What an earlier datagram brought back: nobody listens there. It is told once.
                Err(Errno::ECONNREFUSED | Errno::EINTR) => {}
                Err(_) => return None,
                Ok(message) => break message,
            }
        };
        let bytes = if message.flags.contains(MsgFlags::MSG_TRUNC) { 0 } else { message.bytes };
        let source = message.address.as_ref().and_then(address)?;
        Some(ReceivedDatagram { bytes, source, realtime_ns: stamp(message.cmsgs().ok()?) })
    }

    /// The next datagram that left: which it was, and CLOCK_REALTIME then.
    pub(super) fn sent(&mut self) -> Option<(SentId, u64)> {
        let mut returned = [0; RETURNED_BYTES];
        loop {
            let mut parts = [IoSliceMut::new(&mut returned)];
            let flags = MsgFlags::MSG_ERRQUEUE | MsgFlags::MSG_DONTWAIT;
            let message =
                recvmsg::<SockaddrStorage>(self.socket.as_raw_fd(), &mut parts, Some(&mut self.control), flags).ok()?;
            let (bytes, stamp) = (message.bytes, stamp(message.cmsgs().ok()?));
            let datagram = bytes.checked_sub(self.datagram_bytes).map(|heads| &returned[heads..bytes]);
            // Its head can be read also where it is sealed.
            if let (Some(realtime_ns), Some(Ok((head, _)))) = (stamp, datagram.map(FrameHead::read)) {
                return Some((SentId { to: head.to, sequence: head.sequence }, realtime_ns));
            }
        }
    }
}

impl AsFd for TimeSocket {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}

fn stamp(mut messages: impl Iterator<Item = ControlMessageOwned>) -> Option<u64> {
    messages.find_map(|message| match message {
        ControlMessageOwned::ScmTimestampsns(stamps) => ns(stamps.system),
        _ => None,
    })
}

fn ns(time: TimeSpec) -> Option<u64> {
    let seconds = u64::try_from(time.tv_sec()).ok()?;
    let ns = seconds.checked_mul(1_000_000_000)?.checked_add(u64::try_from(time.tv_nsec()).ok()?)?;
    (ns != 0).then_some(ns)
}
