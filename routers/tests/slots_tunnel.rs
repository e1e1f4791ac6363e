//! Ordinary traffic between nodes in time slots: TCP through the tunnel, in the slots, while packages of modules go on.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "slots_common/mod.rs"]
mod common;

use common::{Capture, PATIENCE, Segment, judge, label};
use rohrpost_config::Tunnel;
use std::io::{Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};

const TUNNEL: Tunnel = Tunnel { network: Ipv4Addr::new(10, 78, 0, 0), prefix: 24 };
/// Some hundred packets, more than may wait at a time.
const BYTES: usize = 400_000;
const PORT: u16 = 5000;

#[test]
fn tcp_goes_through_the_slots_and_packages_go_before_it() {
    let Some(segment) = Segment::with(Some(TUNNEL)) else { return };
    if segment.stations[0].shell().tunnel().is_none() {
        let _ = writeln!(std::io::stderr(), "SKIPPED, not tested: TUN devices cannot be made here");
        return;
    }
    segment.wait_until("all send", |segment| segment.stations.iter().all(common::Station::is_ready));
    let time = segment.stations[0].clock().record;
    let capture = Capture::start(&segment.lab);
    let there = SocketAddr::from((TUNNEL.address(1), PORT));
    let listener = {
        let _inside = segment.lab.enter("n1").unwrap();
        TcpListener::bind(there).unwrap()
    };
    // Sends back what comes, until there is no more.
    let echo = std::thread::spawn(move || {
        let (mut stream, from) = listener.accept().unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let mut all = Vec::new();
        stream.read_to_end(&mut all).unwrap();
        stream.write_all(&all).unwrap();
        from.ip()
    });
    let inside = segment.lab.enter("n0").unwrap();
    let mut stream = TcpStream::connect_timeout(&there, PATIENCE).unwrap();
    drop(inside);
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let said: Vec<u8> = (0..BYTES).map(|at| ((at * 31) >> 3) as u8).collect();
    let talk = std::thread::spawn({
        let said = said.clone();
        move || {
            stream.write_all(&said).unwrap();
            stream.shutdown(std::net::Shutdown::Write).unwrap();
            let mut heard = Vec::new();
            stream.read_to_end(&mut heard).unwrap();
            heard
        }
    });
    // Meanwhile packages of a module go the same way, and none is lost.
    let (mut receiver, mut sender) = (segment.stations[1].receiver(), segment.stations[0].sender(1));
    let mut id = 0;
    while !talk.is_finished() || id < 50 {
        sender.send(&label(0, 100, id), &[b"urgent"]).unwrap();
        assert_eq!(receiver.receive_timeout(PATIENCE).unwrap().head().id, id);
        id += 1;
    }
    assert!(talk.join().unwrap() == said, "all came back as it was");
    assert_eq!(echo.join().unwrap(), TUNNEL.address(0), "from the address that the node has in the tunnel");
    let judged = judge(&capture.end(), &time);
    // TDMA.md: 0.03 % to 0.5 % of wake-ups come late on a computer that works.
    assert!(judged.outside.len() * 100 <= judged.frames, "{} of {}", judged.outside.len(), judged.frames);
    let passed = |node: usize| segment.stations[node].shell().tunnel().unwrap();
    assert!(passed(0).sent.get() > 250 && passed(1).received.get() > 250, "{:?} {:?}", passed(0), passed(1));
    assert_eq!(passed(2).received.get(), 0, "it is no business of the third");
    let level = segment.stations[0].shell().settings().network.level(rohrpost_mailbox::Priority(0));
    assert_eq!(level, rohrpost_config::LEVEL_NOT_REAL_TIME);
}
