//! A socket filter in the kernel: it keeps only datagrams from nodes of the configuration.
//!
//! ```text
//!  datagram ─▶ source address among the nodes'? ─┬─ yes ─▶ the socket's queue ─▶ its reader wakes
//!                                                └─ no: dropped and counted in the kernel, no thread runs
//! ```
//!
//! A program of the classic packet filter: it needs no rights, and costs some nanoseconds a datagram. It checks the
//! address alone. A datagram with a forged node's address passes, and is checked like any other.

use crate::frame::{self, FrameKind};
use crate::security::TAG_BYTES;
use crate::time::TIME_BYTES;
use socket2::{SockFilter, SockRef};
use std::io;
use std::net::IpAddr;
use std::os::fd::AsFd;

/// Instructions: load a word at a fixed place; compare it; end with a verdict (`linux/filter.h`).
const LOAD: u16 = 0x20;
const JUMP_IF_EQUAL: u16 = 0x15;
const RETURN: u16 = 0x06;
const LOAD_LENGTH: u16 = 0x80;
const JUMP_IF_GREATER: u16 = 0x25;
const JUMP_IF_AT_LEAST: u16 = 0x35;
/// Offsets count from the IP head (`SKF_NET_OFF`), else from the UDP head.
const IP_HEAD: u32 = -0x0010_0000_i32 as u32;
/// Offset of the source address in an IP head.
const SOURCE_V4: u32 = 12;
const SOURCE_V6: u32 = 8;
/// Verdicts: how many bytes are kept.
const WHOLE: u32 = u32::MAX;
const NOTHING: u32 = 0;

/// From now on the socket takes only datagrams from these addresses. All are of the socket's family; others match
/// nothing. Datagrams that it already holds stay.
///
/// # Errors
/// The system's error: mostly that it has no memory for it.
pub(super) fn take_only_from(socket: &impl AsFd, addresses: &[IpAddr]) -> io::Result<()> {
    SockRef::from(socket).attach_filter(&program(addresses))
}

/// Filters a socket of time. It also takes, from anywhere, frames of time with another digest than this: a node
/// that hears these must know it, and refuse. Forged frames of that form are read, too.
///
/// # Errors
/// Like [`take_only_from`], for datagrams of time.
pub(super) fn take_time_only_from(socket: &impl AsFd, addresses: &[IpAddr], digest: u64) -> io::Result<()> {
    let mut program = program(addresses);
    // In place of the verdict for all others.
    program.pop();
    program.extend(time_of_others(digest));
    SockRef::from(socket).attach_filter(&program)
}

/// Keeps frames of time, sealed or not, with another digest than this.
fn time_of_others(digest: u64) -> [SockFilter; 12] {
    const UDP_HEAD: u32 = 8;
    let lengths = [TIME_BYTES, TIME_BYTES + TAG_BYTES].map(|bytes| UDP_HEAD + bytes as u32);
    let [first, last] = [FrameKind::Sync, FrameKind::Reply].map(frame::beginning).map(u32::from_be_bytes);
    let [low, high] = [0, 32].map(|shift| ((digest >> shift) as u32).swap_bytes());
    [
        SockFilter::new(LOAD_LENGTH, 0, 0, 0),
        SockFilter::new(JUMP_IF_EQUAL, 1, 0, lengths[0]),
        SockFilter::new(JUMP_IF_EQUAL, 0, 7, lengths[1]),
        SockFilter::new(LOAD, 0, 0, UDP_HEAD),
        SockFilter::new(JUMP_IF_GREATER, 5, 0, last),
        SockFilter::new(JUMP_IF_AT_LEAST, 0, 4, first),
        SockFilter::new(LOAD, 0, 0, UDP_HEAD + frame::DIGEST_AT),
        SockFilter::new(JUMP_IF_EQUAL, 0, 3, low),
        SockFilter::new(LOAD, 0, 0, UDP_HEAD + frame::DIGEST_AT + 4),
        SockFilter::new(JUMP_IF_EQUAL, 0, 1, high),
        SockFilter::new(RETURN, 0, 0, NOTHING),
        SockFilter::new(RETURN, 0, 0, WHOLE),
    ]
}

/// Compares with one address after the other, each word by word.
fn program(addresses: &[IpAddr]) -> Vec<SockFilter> {
    let of_one = |address: &IpAddr| {
        let (place, bytes) = match address {
            IpAddr::V4(address) => (SOURCE_V4, address.octets().to_vec()),
            IpAddr::V6(address) => (SOURCE_V6, address.octets().to_vec()),
        };
        let words: Vec<_> =
            bytes.chunks_exact(4).map(|word| u32::from_be_bytes([word[0], word[1], word[2], word[3]])).collect();
        let last = words.len() - 1;
        let compared = words.into_iter().enumerate().flat_map(move |(index, word)| {
            // A mismatch continues behind this address's verdict.
            let behind = (2 * (last - index) + 1) as u8;
            let at = IP_HEAD.wrapping_add(place + 4 * index as u32);
            [SockFilter::new(LOAD, 0, 0, at), SockFilter::new(JUMP_IF_EQUAL, 0, behind, word)]
        });
        compared.chain([SockFilter::new(RETURN, 0, 0, WHOLE)])
    };
    addresses.iter().flat_map(of_one).chain([SockFilter::new(RETURN, 0, 0, NOTHING)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{FrameHead, HEAD_BYTES};
    use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
    use rohrpost_network::NODES_MAX;
    use std::net::{Ipv4Addr, Ipv6Addr, UdpSocket};
    use std::time::Duration;

    const PEER: Ipv4Addr = Ipv4Addr::new(127, 0, 0, 2);
    const STRANGER: Ipv4Addr = Ipv4Addr::new(127, 0, 0, 3);

    /// The largest possible number of nodes; those in `last` come after all others.
    fn nodes(last: &[IpAddr]) -> Vec<IpAddr> {
        let many = (0..NODES_MAX as u8 - last.len() as u8).map(|node| IpAddr::V4(Ipv4Addr::new(127, 9, 9, node)));
        many.chain(last.iter().copied()).collect()
    }

    fn receive(socket: &UdpSocket) -> Option<u8> {
        let mut datagram = [0; 10];
        socket.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        (socket.recv_from(&mut datagram).ok()?.0 == 1).then_some(datagram[0])
    }

    #[test]
    fn what_strangers_send_wakes_nobody_and_takes_no_room() {
        let inside = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let at = inside.local_addr().unwrap();
        take_only_from(&inside, &nodes(&[PEER.into()])).unwrap();
        let [peer, stranger, third] =
            [PEER, STRANGER, Ipv4Addr::LOCALHOST].map(|own| UdpSocket::bind((own, 0)).unwrap());
        for _ in 0..1000 {
            // Loopback: it has come, or is dropped, when this returns.
            stranger.send_to(&[1; 1400], at).unwrap();
            third.send_to(&[2], at).unwrap();
        }
        let mut fds = [PollFd::new(inside.as_fd(), PollFlags::POLLIN)];
        assert_eq!(poll(&mut fds, PollTimeout::ZERO), Ok(0), "nobody is woken");
        peer.send_to(&[3], at).unwrap();
        assert_eq!(receive(&inside), Some(3), "what a node sends comes at once, whatever was sent before");
        inside.set_nonblocking(true).unwrap();
        assert!(inside.recv(&mut [0; 10]).is_err(), "and nothing else");
    }

    #[test]
    fn an_address_of_ipv6_counts_in_all_its_words() {
        let inside = UdpSocket::bind((Ipv6Addr::LOCALHOST, 0)).unwrap();
        let outside = UdpSocket::bind((Ipv6Addr::LOCALHOST, 0)).unwrap();
        let own = Ipv6Addr::LOCALHOST.segments();
        let differs_in = |place: usize| {
            let mut segments = own;
            segments[place] ^= 1;
            IpAddr::V6(Ipv6Addr::from(segments))
        };
        let others: Vec<_> = (0..own.len()).map(differs_in).collect();
        take_only_from(&inside, &others).unwrap();
        outside.send_to(&[1], inside.local_addr().unwrap()).unwrap();
        let all: Vec<_> = others.into_iter().chain([Ipv6Addr::LOCALHOST.into()]).collect();
        take_only_from(&inside, &all).unwrap();
        outside.send_to(&[2], inside.local_addr().unwrap()).unwrap();
        assert_eq!(receive(&inside), Some(2), "the first was not from one of these");
    }

    #[test]
    fn a_filter_of_as_many_nodes_as_there_may_be_is_taken() {
        let inside = UdpSocket::bind((Ipv6Addr::LOCALHOST, 0)).unwrap();
        let own = Ipv6Addr::LOCALHOST;
        let many = (1..NODES_MAX as u16).map(|node| IpAddr::V6(Ipv6Addr::new(0xfd00, 0, 0, 0, 0, 0, 0, node)));
        take_only_from(&inside, &many.chain([own.into()]).collect::<Vec<_>>()).unwrap();
        UdpSocket::bind((own, 0)).unwrap().send_to(&[7], inside.local_addr().unwrap()).unwrap();
        assert_eq!(receive(&inside), Some(7));
    }

    #[test]
    fn of_strangers_only_the_time_of_another_configuration_is_taken() {
        const DIGEST: u64 = 0x1122_3344_5566_7788;
        let inside = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let stranger = UdpSocket::bind((STRANGER, 0)).unwrap();
        take_time_only_from(&inside, &nodes(&[]), DIGEST).unwrap();
        let at = inside.local_addr().unwrap();
        let frame = |kind, digest| {
            let head = FrameHead { kind, system: 1, from: 0, to: 1, digest, incarnation: 5, sequence: 0 };
            let rest = [7; TIME_BYTES - HEAD_BYTES];
            [&head.to_bytes(&[&rest])[..], &rest].concat()
        };
        inside.set_nonblocking(true).unwrap();
        for (name, datagram, is_taken) in [
            ("another low half", frame(FrameKind::Sync, DIGEST ^ 1), true),
            ("another high half", frame(FrameKind::Reply, DIGEST ^ 1 << 63), true),
            ("sealed", [frame(FrameKind::Request, 3), vec![0; TAG_BYTES]].concat(), true),
            ("this configuration", frame(FrameKind::Sync, DIGEST), false),
            ("packages", frame(FrameKind::Packages, 3), false),
            ("a hello", frame(FrameKind::Hello, 3), false),
            ("too long", [frame(FrameKind::Sync, 3), vec![0]].concat(), false),
            ("too short", frame(FrameKind::Sync, 3)[..TIME_BYTES - 1].to_vec(), false),
            ("junk", vec![0x5a; TIME_BYTES], false),
        ] {
            // Loopback: it has come, or is dropped, when this returns.
            stranger.send_to(&datagram, at).unwrap();
            assert_eq!(inside.recv(&mut [0; 200]).is_ok(), is_taken, "{name}");
        }
    }

    #[test]
    fn nobody_is_taken_where_there_is_nobody_else() {
        let inside = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        take_only_from(&inside, &[]).unwrap();
        UdpSocket::bind((PEER, 0)).unwrap().send_to(&[1], inside.local_addr().unwrap()).unwrap();
        let mut fds = [PollFd::new(inside.as_fd(), PollFlags::POLLIN)];
        assert_eq!(poll(&mut fds, PollTimeout::ZERO), Ok(0));
    }
}
