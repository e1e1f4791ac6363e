//! Datagrams from socket to socket, as the kernel carries them: one system call to send, one to receive.

use super::flow::{FILLER, Outlet, look_at, put_ends};
use super::wire::{Wire, address};
use crate::one_way::Sink;
use nix::sys::socket::{setsockopt, sockopt};
use rohrpost_bench_local::harness::{End, Failure, Link, OrFail};
use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::time::Duration;

/// Of the raw floor; its relays take the next ones.
const PORT: u16 = 20_117;
/// Receive buffer of the socket, as large as a router's.
const RECEIVE_BYTES: usize = 8 << 20;

/// A socket that sends to one other, and receives from that one alone.
pub struct Datagrams(UdpSocket);

impl Datagrams {
    /// Enters the end's place on the network and opens its socket there.
    ///
    /// # Errors
    /// When that is refused.
    pub fn open(wire: &Wire, end: End) -> Result<Self, Failure> {
        Self::between(wire, end, [PORT, PORT])
    }

    /// The same with these ports, the near one first.
    ///
    /// # Errors
    /// When that is refused.
    pub fn between(wire: &Wire, end: End, ports: [u16; 2]) -> Result<Self, Failure> {
        wire.enter(end)?;
        let [own, other] = [end, end.other()].map(|end| (address(end), ports[end.index()]).into());
        Self::connect(own, other)
    }

    /// From one address to another, in the place where the calling thread is.
    ///
    /// # Errors
    /// When that is refused.
    pub fn connect(own: SocketAddr, other: SocketAddr) -> Result<Self, Failure> {
        let opened = || -> io::Result<UdpSocket> {
            let socket = UdpSocket::bind(own)?;
            // Only root may exceed the system's limit; other users keep the limit.
            if setsockopt(&socket, sockopt::RcvBufForce, &RECEIVE_BYTES).is_err() {
                setsockopt(&socket, sockopt::RcvBuf, &RECEIVE_BYTES)?;
            }
            socket.connect(other)?;
            Ok(socket)
        };
        opened().map(Self).or_fail("udp socket")
    }

    /// Sets the timeout of receiving.
    ///
    /// # Errors
    /// When the kernel refuses it.
    pub fn with_patience(self, patience: Duration) -> Result<Self, Failure> {
        self.0.set_read_timeout(Some(patience)).or_fail("udp socket")?;
        Ok(self)
    }

    /// Receives a datagram of exactly this length; false when none came in time.
    fn take(&self, message: &mut [u8]) -> Result<bool, Failure> {
        loop {
            match self.0.recv(message) {
                Ok(bytes) if bytes == message.len() => return Ok(true),
                Ok(bytes) => return Err(Failure::Failed(format!("{bytes} bytes came, not {}", message.len()))),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(false),
                // The far socket was not open yet when something was sent; this error only reports that.
                Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => {}
                Err(error) => return Err(Failure::of("recv", error)),
            }
        }
    }
}

impl Link for Datagrams {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.0.send(message).map(drop).or_fail("send")
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        while !self.take(message)? {}
        Ok(())
    }
}

impl Sink for Datagrams {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        Link::send(self, message)
    }
}

impl Outlet for Datagrams {
    fn receive(&mut self, message: &mut [u8]) -> Result<bool, Failure> {
        self.take(message)
    }
}

/// The same out of memory as large as a record, and into such memory, one datagram behind the other: as parts of a
/// record go.
pub struct RawParts {
    datagrams: Datagrams,
    record: Vec<u8>,
    at: usize,
}

impl RawParts {
    /// Of datagrams like these.
    pub fn new(datagrams: Datagrams, record_bytes: usize) -> Self {
        Self { datagrams, record: vec![FILLER; record_bytes], at: 0 }
    }

    /// Where the next datagram lies.
    fn next(&mut self, bytes: usize) -> (&Datagrams, &mut [u8]) {
        let begin = if self.at + bytes > self.record.len() { 0 } else { self.at };
        self.at = begin + bytes;
        (&self.datagrams, &mut self.record[begin..begin + bytes])
    }
}

impl Sink for RawParts {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        let (datagrams, part) = self.next(message.len());
        put_ends(message, part);
        datagrams.0.send(part).map(drop).or_fail("send")
    }
}

impl Outlet for RawParts {
    fn receive(&mut self, message: &mut [u8]) -> Result<bool, Failure> {
        let (datagrams, part) = self.next(message.len());
        if !datagrams.take(part)? {
            return Ok(false);
        }
        look_at(part, message).map(|()| true)
    }
}
