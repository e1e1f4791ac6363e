//! Sockets on the loopback.

use super::*;
use std::net::{Ipv4Addr, Ipv6Addr};
use std::sync::Arc;

const ONE: IpAddr = IpAddr::V4(Ipv4Addr::new(127, 0, 0, 1));
const OTHER: IpAddr = IpAddr::V4(Ipv4Addr::new(127, 0, 0, 2));

/// A port that is free now.
fn free_port(address: IpAddr) -> u16 {
    UdpSocket::bind((address, 0)).unwrap().local_addr().unwrap().port()
}

fn pair(address: IpAddr) -> (InSocket, OutSocket) {
    let at = SocketAddr::new(address, free_port(address));
    (InSocket::open(at, &[address], RECEIVE_BYTES).unwrap(), OutSocket::new(address, at, 0))
}

/// A socket while which is open the kernel says when datagrams came. Linux begins with that some time after the
/// first socket has asked for it, by a worker thread (`net_enable_timestamp`); until then it says when they are read.
fn stamped() -> InSocket {
    let (inside, mut outside) = pair(ONE);
    let pause = Duration::from_millis(1);
    for _ in 0..60_000 {
        outside.send(&[IoSlice::new(b"?")]).unwrap();
        std::thread::sleep(pause);
        let Received::Datagram { waited_ns, .. } = inside.receive(&mut [0; 10]) else { panic!() };
        if waited_ns >= pause.as_nanos() as u64 {
            return inside;
        }
    }
    panic!("the kernel does not say when a datagram came")
}

#[test]
fn parts_arrive_as_one_datagram_with_their_senders_address() {
    for address in [ONE, OTHER, IpAddr::V6(Ipv6Addr::LOCALHOST)] {
        let (inside, mut outside) = pair(address);
        outside.send(&[IoSlice::new(b"head"), IoSlice::new(b""), IoSlice::new(b"body")]).unwrap();
        let mut datagram = [0; 100];
        let Received::Datagram { bytes: 8, source, waited_ns, .. } = inside.receive(&mut datagram) else { panic!() };
        assert_eq!((source, &datagram[..8]), (address, &b"headbody"[..]));
        assert!((1..1_000_000_000).contains(&waited_ns), "the kernel stamped it: {waited_ns}");
        assert_eq!(inside.receive(&mut datagram), Received::Nothing);
        assert!(inside.receive_bytes >= 100_000, "{}", inside.receive_bytes);
    }
}

#[test]
fn closing_ends_a_thread_that_blocks_in_reading() {
    let (inside, _outside) = pair(ONE);
    let inside = Arc::new(inside);
    let reader = std::thread::spawn({
        let inside = inside.clone();
        move || while inside.receive(&mut [0; 10]) != Received::Closed {}
    });
    inside.close();
    reader.join().unwrap();
    assert_eq!(inside.receive(&mut [0; 10]), Received::Closed, "and any other");
}

#[test]
fn what_comes_while_nobody_reads_a_kept_socket_waits_for_the_next_one() {
    let at = SocketAddr::new(ONE, free_port(ONE));
    let mut keepers = listen(at.ip(), (at.port(), [Some(free_port(ONE)), None]), &[OTHER]);
    assert_eq!(listen(at.ip(), (at.port(), [None, None]), &[OTHER]).len(), 0, "it is open already");
    let (rest, keeper) = (keepers.pop().unwrap(), keepers.pop().unwrap());
    assert_ne!(UdpSocket::from(rest).local_addr().unwrap(), at, "the other one has the other port");
    let mut sender = OutSocket::new(OTHER, at, 0);
    let mut datagram = [0; 10];
    let _stamped = stamped();
    for life in 0..3_u8 {
        sender.send(&[IoSlice::new(&[life])]).unwrap();
        std::thread::sleep(Duration::from_millis(2));
        let inside = InSocket::kept(keeper.try_clone().ok(), at, &[OTHER], RECEIVE_BYTES).unwrap();
        let Received::Datagram { bytes: 1, waited_ns, .. } = inside.receive(&mut datagram) else { panic!() };
        assert_eq!(datagram[0], life);
        assert!(waited_ns >= 2_000_000, "the kernel says how long: {waited_ns}");
        inside.close();
        assert_eq!(inside.receive(&mut datagram), Received::Closed);
    }
    let elsewhere = SocketAddr::new(ONE, free_port(ONE));
    let error = InSocket::kept(Some(keeper), elsewhere, &[], RECEIVE_BYTES).err().unwrap();
    assert!(matches!(error, SocketError::Strange(..)) && error.to_string().contains("launch the node anew"), "{error}");
}

#[test]
fn an_address_in_use_and_one_of_another_computer_are_told_plainly() {
    let at = SocketAddr::new(ONE, free_port(ONE));
    let _first = InSocket::open(at, &[], REST_BYTES).unwrap();
    let error = InSocket::open(at, &[], REST_BYTES).err().unwrap();
    assert!(matches!(error, SocketError::InUse(_)) && error.to_string().contains("choose another `port`"), "{error}");
    // Reserved for documentation (RFC 5737), so no computer has it.
    let error = InSocket::open("192.0.2.1:21117".parse().unwrap(), &[], REST_BYTES).err().unwrap();
    assert!(matches!(error, SocketError::NotHere(_)) && error.to_string().contains("correct its `address`"), "{error}");
}

#[test]
fn a_socket_that_never_waits_has_the_room_it_asked_for() {
    let at = SocketAddr::new(ONE, free_port(ONE));
    let there = InSocket::open(at, &[ONE], REST_BYTES).unwrap();
    let usual = OutSocket::new(ONE, at, 0).socket.unwrap();
    assert!(usual.nonblocking().unwrap());
    for bytes in [1, usual.send_buffer_size().unwrap() * 2] {
        let mut sender = OutSocket::new(ONE, at, bytes);
        let socket = sender.socket.as_ref().unwrap();
        assert!(socket.nonblocking().unwrap());
        // Beyond the system's limit a right is needed.
        let limit = std::fs::read_to_string("/proc/sys/net/core/wmem_max").unwrap().trim().parse().unwrap();
        let least = usual.send_buffer_size().unwrap().max(2 * bytes.min(limit));
        assert!(socket.send_buffer_size().unwrap() >= least, "{bytes}");
        sender.send(&[IoSlice::new(b"hello")]).unwrap();
        assert!(matches!(there.receive(&mut [0; 10]), Received::Datagram { bytes: 5, .. }));
    }
    assert_eq!(Failure::of(&Errno::EAGAIN.into()), Failure::Full, "and is told when that is not enough");
}

#[test]
fn failures_have_a_cause_and_do_not_stay() {
    let at = SocketAddr::new(OTHER, free_port(OTHER));
    let mut sender = OutSocket::new(ONE, at, 0);
    let big = vec![0; 65_508];
    assert_eq!(sender.send(&[IoSlice::new(&big)]), Err(Failure::TooLong));
    assert_eq!(sender.send(&[IoSlice::new(b"to nobody")]), Ok(()), "it is not known yet");
    // Loopback answers at once.
    assert_eq!(sender.send(&[IoSlice::new(b"to nobody either")]), Err(Failure::NobodyThere));
    let there = InSocket::open(at, &[ONE], REST_BYTES).unwrap();
    let _ = sender.send(&[IoSlice::new(b"here")]);
    let mut datagram = [0; 10];
    let received = there.receive(&mut datagram);
    assert!(matches!(received, Received::Datagram { bytes: 4, source: ONE, .. }), "although an earlier one had failed");
}
