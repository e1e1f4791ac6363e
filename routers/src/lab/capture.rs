//! What crosses the bridge of a lab, and when: each datagram as it comes in by the port of its sender.

use super::{Lab, LabError};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::socket::{
    AddressFamily, ControlMessageOwned, LinkAddr, MsgFlags, SockFlag, SockProtocol, SockType, recvmsg, setsockopt,
    socket, sockopt,
};
use nix::sys::time::TimeValLike;
use rohrpost_mailbox::{monotonic_ns, realtime_ns};
use std::io::{self, IoSliceMut};
use std::net::IpAddr;
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::time::Duration;

/// Buffer of the capture in the kernel, bytes.
const RECEIVE_BYTES: usize = 64 << 20;
/// The longest frame, and more.
const FRAME_BYTES: usize = 1 << 16;
const CONTROL_BYTES: usize = 128;
/// Readings of two clocks; the closest pair counts.
const READINGS: usize = 100;
/// `PACKET_OUTGOING` of `packet(7)`: the packet leaves by this port, and was seen when it came by another.
const OUTGOING: u8 = 4;
const ETHERNET_BYTES: usize = 14;
const UDP: u8 = 17;
const UDP_BYTES: usize = 8;

/// A datagram on its way.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Crossing<'a> {
    /// When the bridge took it from its sender, on the monotonic clock.
    pub at_ns: u64,
    /// The sender.
    pub source: IpAddr,
    /// The port that it goes to.
    pub port: u16,
    /// What is in it.
    pub datagram: &'a [u8],
}

/// Watches the bridge. What crosses it waits in the kernel, with the time, until [`Capture::drain`].
#[derive(Debug)]
pub struct Capture {
    socket: OwnedFd,
    /// By how much the clock of the kernel's stamps is ahead of the monotonic one. Both are slewed alike, so this is
    /// constant unless somebody sets one.
    ahead_ns: i64,
    frame: Box<[u8]>,
}

impl Lab {
    /// Begins to watch what crosses the bridge.
    ///
    /// # Errors
    /// When the system does not allow it.
    pub fn capture(&self) -> Result<Capture, LabError> {
        let socket = {
            let _inside = self.enter_bridge()?;
            open().map_err(|error| LabError::Device("watch the bridge".into(), error))?
        };
        Ok(Capture::of(socket))
    }
}

impl Capture {
    /// Reads from a packet socket that stamps what it receives: one with a filter, say.
    pub fn of(socket: OwnedFd) -> Self {
        Self { socket, ahead_ns: realtime_ahead_ns(), frame: vec![0; FRAME_BYTES].into() }
    }

    /// Waits for a frame, at most so long.
    pub fn wait(&self, patience: Duration) {
        let mut polled = [PollFd::new(self.socket.as_fd(), PollFlags::POLLIN)];
        // An interrupted wait is a short one.
        let _ = poll(&mut polled, PollTimeout::try_from(patience).unwrap_or(PollTimeout::MAX));
    }

    /// Hands out each UDP datagram that has crossed since. Never waits.
    pub fn drain(&mut self, mut seen: impl FnMut(Crossing<'_>)) {
        let ahead_ns = self.ahead_ns;
        self.drain_stamped(|stamp_ns, frame| {
            if let (Some(stamp_ns), Some((source, port, datagram))) = (stamp_ns, datagram(frame)) {
                seen(Crossing { at_ns: stamp_ns.saturating_add_signed(-ahead_ns), source, port, datagram });
            }
        });
    }

    /// Hands out each frame that has crossed since, whatever is in it. Never waits.
    pub fn drain_frames(&mut self, mut seen: impl FnMut(&[u8])) {
        self.drain_stamped(|_, frame| seen(frame));
    }

    fn drain_stamped(&mut self, mut seen: impl FnMut(Option<u64>, &[u8])) {
        let mut control = [0; CONTROL_BYTES];
        loop {
            let mut parts = [IoSliceMut::new(&mut self.frame)];
            let (socket, flags) = (self.socket.as_raw_fd(), MsgFlags::MSG_DONTWAIT);
            let Ok(message) = recvmsg::<LinkAddr>(socket, &mut parts, Some(&mut control), flags) else { return };
            let mut stamps = message.cmsgs().into_iter().flatten();
            let stamp_ns = stamps.find_map(|message| match message {
                ControlMessageOwned::ScmTimestampns(stamp) => u64::try_from(stamp.num_nanoseconds()).ok(),
                _ => None,
            });
            let came_in = message.address.is_some_and(|address| address.pkttype() != OUTGOING);
            let bytes = message.bytes;
            if let Some(frame) = self.frame.get(..bytes).filter(|_| came_in) {
                seen(stamp_ns, frame);
            }
        }
    }
}

/// From the readings of both clocks that were closest to each other.
fn realtime_ahead_ns() -> i64 {
    let read = |_| {
        let (before, real, after) = (monotonic_ns(), realtime_ns(), monotonic_ns());
        (after - before, real.cast_signed() - before.midpoint(after).cast_signed())
    };
    (0..READINGS).map(read).min().map_or(0, |(_, ahead_ns)| ahead_ns)
}

fn open() -> io::Result<OwnedFd> {
    let socket = socket(AddressFamily::Packet, SockType::Raw, SockFlag::SOCK_CLOEXEC, SockProtocol::EthAll)?;
    // Without the right to so much, as much as there is: what does not fit is not seen.
    let _ = setsockopt(&socket, sockopt::RcvBufForce, &RECEIVE_BYTES);
    setsockopt(&socket, sockopt::ReceiveTimestampns, &true)?;
    Ok(socket)
}

/// Source, port and contents of a frame that carries UDP; none of all others, fragments and options of IP included,
/// which routers do not send.
fn datagram(frame: &[u8]) -> Option<(IpAddr, u16, &[u8])> {
    let (ethernet, packet) = frame.split_at_checked(ETHERNET_BYTES)?;
    let (protocol, source, udp) = match ethernet[12..] {
        [8, 0] => {
            let (head, udp) = packet.split_first_chunk::<20>()?;
            let [a, b, c, d] = [head[12], head[13], head[14], head[15]];
            (head[9], IpAddr::from([a, b, c, d]), udp)
        }
        [0x86, 0xdd] => {
            let (head, udp) = packet.split_first_chunk::<40>()?;
            let source: [u8; 16] = head[8..24].try_into().ok()?;
            (head[6], IpAddr::from(source), udp)
        }
        _ => return None,
    };
    let (head, contents) = udp.split_first_chunk::<UDP_BYTES>()?;
    // Short frames are filled up.
    let len = usize::from(u16::from_be_bytes([head[4], head[5]])).checked_sub(UDP_BYTES)?;
    let port = u16::from_be_bytes([head[2], head[3]]);
    Some((source, port, contents.get(..len)?)).filter(|_| protocol == UDP)
}
