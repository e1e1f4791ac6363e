//! Ordinary traffic between nodes in time slots: somebody types, and a file is copied, through the tunnel, while
//! declared flows keep what was computed for them.
//!
//! If the tunnel's traffic went before packages, a third of them would be later than their bounds (it fills the slots
//! of one node at a time).

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "slots_common/mod.rs"]
mod common;

use common::declared::{flows_keep_their_bounds, segment};
use common::{PATIENCE, Segment};
use rohrpost_network::Tunnel;
use rohrpost_testbed::report;
use rohrpost_testbed::stalls::unless_stalled;
use std::io::{Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

const TUNNEL: Tunnel = Tunnel { network: Ipv4Addr::new(10, 78, 0, 0), prefix: 24 };
const TYPED_PORT: u16 = 5000;
const FILE_PORT: u16 = 5001;
/// Some thousand packets, more than may wait at a time.
const FILE_BYTES: usize = 3_000_000;
/// So many times somebody types something, and sees it.
const TYPED_MIN: usize = 40;

/// Listens in the tunnel of node 1, and connects there from node 0: both ends, and from where the second was seen to
/// come.
fn connection(segment: &Segment, port: u16) -> (TcpStream, TcpStream) {
    let there = SocketAddr::from((TUNNEL.address(1), port));
    let listener = {
        let _inside = segment.lab.enter("n1").unwrap();
        TcpListener::bind(there).unwrap()
    };
    let near = {
        let _inside = segment.lab.enter("n0").unwrap();
        TcpStream::connect_timeout(&there, PATIENCE).unwrap()
    };
    let (far, from) = listener.accept().unwrap();
    assert_eq!(from.ip(), TUNNEL.address(0), "from the address that the node has in the tunnel");
    for stream in [&near, &far] {
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.set_nodelay(true).unwrap();
    }
    (near, far)
}

/// Copies a file there, and back; whether it came back as it was.
fn copy_file(mut near: TcpStream, mut far: TcpStream) -> JoinHandle<bool> {
    let file: Vec<u8> = (0..FILE_BYTES).map(|at| ((at * 31) >> 3) as u8).collect();
    let back = std::thread::spawn(move || {
        let mut all = Vec::new();
        far.read_to_end(&mut all).unwrap();
        far.write_all(&all).unwrap();
    });
    std::thread::spawn(move || {
        near.write_all(&file).unwrap();
        near.shutdown(std::net::Shutdown::Write).unwrap();
        let mut heard = Vec::new();
        near.read_to_end(&mut heard).unwrap();
        back.join().unwrap();
        heard == file
    })
}

/// Somebody types until something is done, a few characters at a time, and waits until they are there; how often.
fn typed(mut near: TcpStream, far: TcpStream, mut is_done: impl FnMut() -> bool + Send + 'static) -> JoinHandle<usize> {
    let screen = std::thread::spawn(move || std::io::copy(&mut &far, &mut &far).unwrap());
    std::thread::spawn(move || {
        let mut times = 0;
        while !is_done() || times < TYPED_MIN {
            let said: Vec<u8> = (0..1 + times % 40).map(|at| (at * 7 + times) as u8).collect();
            near.write_all(&said).unwrap();
            let mut heard = vec![0; said.len()];
            near.read_exact(&mut heard).unwrap();
            assert_eq!(heard, said);
            times += 1;
        }
        drop(near);
        screen.join().unwrap();
        times
    })
}

#[test]
fn somebody_types_and_copies_a_file_and_declared_flows_keep_their_bounds() {
    unless_stalled(|stalls| {
        let Some(segment) = segment(Some(TUNNEL)) else { return Ok(()) };
        if segment.stations[0].shell().tunnel().is_none() {
            report::skipped("TUN devices");
            return Ok(());
        }
        segment.wait_until_all_send();
        let (near, far) = connection(&segment, FILE_PORT);
        let copied = std::sync::Arc::new(AtomicBool::new(false));
        let typed = {
            let (near, far) = connection(&segment, TYPED_PORT);
            let copied = copied.clone();
            typed(near, far, move || copied.load(Ordering::Relaxed))
        };
        let file = copy_file(near, far);
        let kept = flows_keep_their_bounds(&segment, stalls, "beside a tunnel in use", || {
            copied.store(file.is_finished(), Ordering::Relaxed);
            typed.is_finished()
        });
        assert!(file.join().unwrap(), "all came back as it was");
        println!("{FILE_BYTES} bytes there and back; typed {} times", typed.join().unwrap());

        let passed = |node: usize| segment.stations[node].shell().tunnel().unwrap();
        assert!(passed(0).sent.get() > 1000 && passed(1).received.get() > 1000, "{:?} {:?}", passed(0), passed(1));
        assert_eq!(passed(2).received.get(), 0, "it is no business of the third");
        let level = segment.stations[0].shell().settings().network.level(rohrpost_mailbox::Priority(0));
        assert_eq!(level, rohrpost_network::LEVEL_NOT_REAL_TIME);
        kept
    });
}
