//! Labs as tests, the demo and the benches use them. Without the right to make network namespaces there is nothing to
//! test here.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use nix::sys::socket::{getsockopt, sockopt};
use rohrpost_routers::lab::{DEVICE, Lab};
use rohrpost_testbed::lan;
use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// What takes longer does not come any more, however busy the computer is.
const PATIENCE: Duration = Duration::from_secs(20);

fn lab(addresses: &[&str], mtu: u16) -> Option<Lab> {
    let addresses: Vec<IpAddr> = addresses.iter().map(|address| address.parse().unwrap()).collect();
    lan::lab(&lan::specs(&addresses), mtu)
}

fn socket(lab: &Lab, node: &str, address: &str) -> UdpSocket {
    let _inside = lab.enter(node).unwrap();
    let socket = UdpSocket::bind((address.parse::<IpAddr>().unwrap(), 0)).unwrap();
    socket.set_read_timeout(Some(PATIENCE)).unwrap();
    socket
}

fn arrives(from: &UdpSocket, to: &UdpSocket) {
    from.send_to(b"hello", to.local_addr().unwrap()).unwrap();
    let mut buffer = [0; 16];
    let (bytes, source) = to.recv_from(&mut buffer).unwrap();
    assert_eq!((&buffer[..bytes], source), (&b"hello"[..], from.local_addr().unwrap()));
}

#[test]
fn every_node_reaches_every_other_from_the_first_datagram_on() {
    for addresses in [["10.77.0.1", "10.77.0.2", "192.168.9.255"], ["fd00::1", "fd00::2", "fd77:1::1"]] {
        let Some(lab) = lab(&addresses, 1500) else { return };
        let sockets = [0, 1, 2].map(|index| socket(&lab, &format!("n{index}"), addresses[index]));
        for from in &sockets {
            for to in &sockets {
                arrives(from, to);
            }
        }
    }
}

#[test]
fn a_node_beyond_reaches_one_node_and_the_others_reach_that_one_at_the_same_address() {
    for (addresses, home) in [
        (["10.77.0.1", "10.77.0.2"], "192.168.7.1"),
        (["10.77.0.1", "10.77.0.2"], "10.77.0.1"),
        (["fd00::1", "fd00::2"], "fd77::1"),
    ] {
        let Some(mut lab) = lab(&addresses, 1500) else { return };
        lab.join_beyond("n0", home.parse().unwrap(), &["far"]).unwrap();
        let far = lab.nodes().find(|node| node.name == "far").unwrap().address.to_string();
        let (home, other, far) =
            (socket(&lab, "n0", home), socket(&lab, "n1", addresses[1]), socket(&lab, "far", &far));
        for (from, to) in [(&home, &far), (&far, &home), (&other, &home), (&home, &other)] {
            arrives(from, to);
        }
        other.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
        // The kernel may know at once that there is no way.
        let _ = far.send_to(b"hello", other.local_addr().unwrap());
        assert_eq!(other.recv_from(&mut [0; 16]).unwrap_err().kind(), ErrorKind::WouldBlock, "nothing is handed on");
        lab.cut("far").unwrap();
        lab.fix("far").unwrap();
        arrives(&far, &home);
    }
}

#[test]
fn a_node_sees_the_lab_and_nothing_else() {
    let Some(lab) = lab(&["10.77.0.1", "10.77.0.2"], 1500) else { return };
    let devices = |node: &str| {
        let mut command = Command::new("cat");
        let child = lab.command(node, command.arg("/proc/self/net/dev").stdout(Stdio::piped())).unwrap();
        let said = String::from_utf8(child.wait_with_output().unwrap().stdout).unwrap();
        said.lines().filter_map(|line| Some(line.split_once(':')?.0.trim().to_owned())).collect::<BTreeSet<_>>()
    };
    assert_eq!(devices("n0"), [DEVICE, "lo"].map(str::to_owned).into());
    // A server of this computer, on all its addresses, is none there.
    let outside = UdpSocket::bind("0.0.0.0:0").unwrap();
    let inside = socket(&lab, "n0", "127.0.0.1");
    inside.connect(("127.0.0.1", outside.local_addr().unwrap().port())).unwrap();
    inside.send(b"hello").unwrap();
    assert_eq!(inside.recv(&mut [0; 16]).unwrap_err().kind(), ErrorKind::ConnectionRefused);
}

#[test]
fn a_thread_comes_back_and_its_children_stay() {
    let own = || std::fs::read_link("/proc/thread-self/ns/net").unwrap();
    let before = own();
    let Some(lab) = lab(&["10.77.0.1", "10.77.0.2"], 1500) else { return };
    assert_eq!(own(), before, "making a lab moves nobody");
    let inside = lab.enter("n0").unwrap();
    let there = own();
    let of_thread = std::thread::spawn(own).join().unwrap();
    drop(inside);
    assert!(there != before && of_thread == there && own() == before);
    let mut command = Command::new("readlink");
    let child = lab.command("n0", command.arg("/proc/self/ns/net").stdout(Stdio::piped())).unwrap();
    let of_child = String::from_utf8(child.wait_with_output().unwrap().stdout).unwrap();
    assert_eq!(of_child.trim(), there.to_str().unwrap());
}

#[test]
fn a_cut_link_carries_nothing_and_a_restored_one_all() {
    let Some(lab) = lab(&["10.77.0.1", "10.77.0.2", "10.77.0.3"], 1500) else { return };
    let sockets = [0, 1, 2].map(|index| socket(&lab, &format!("n{index}"), &format!("10.77.0.{}", index + 1)));
    arrives(&sockets[0], &sockets[1]);
    lab.cut("n1").unwrap();
    // What was sent meanwhile does not come later either: the fixed link brings `hello` first.
    let _ = sockets[0].send_to(b"lost", sockets[1].local_addr().unwrap());
    arrives(&sockets[0], &sockets[2]);
    lab.fix("n1").unwrap();
    arrives(&sockets[2], &sockets[1]);
    arrives(&sockets[1], &sockets[0]);
}

#[test]
fn links_carry_packets_of_their_size() {
    let Some(lab) = lab(&["10.77.0.1", "10.77.0.2"], 9000) else { return };
    let mtu = || {
        // Asked anew: a socket keeps what it has learnt of its way.
        let socket = socket(&lab, "n0", "10.77.0.1");
        socket.connect("10.77.0.2:9".parse::<SocketAddr>().unwrap()).unwrap();
        getsockopt(&socket, sockopt::IpMtu).unwrap()
    };
    assert_eq!(mtu(), 9000);
    lab.set_mtu("n0", 1400).unwrap();
    assert_eq!(mtu(), 1400);
}

#[test]
fn nothing_is_left_when_it_is_dropped() {
    let devices = || std::fs::read_dir("/sys/class/net").unwrap().map(|entry| entry.unwrap().file_name());
    let before: BTreeSet<_> = devices().collect();
    let Some(lab) = lab(&["10.77.0.1", "10.77.0.2"], 1500) else { return };
    assert_eq!(devices().collect::<BTreeSet<_>>(), before, "it has no devices here");
    // A descriptor alone holds a namespace: once it is closed, a process in it is its last.
    let inside = lab.enter("n0").unwrap();
    let of_lab = std::fs::read_link("/proc/thread-self/ns/net").unwrap();
    drop(inside);
    let mut child = lab.command("n0", Command::new("cat").stdin(Stdio::piped())).unwrap();
    drop(lab);
    let held = |pid: u32| std::fs::read_link(format!("/proc/{pid}/ns/net")).ok();
    assert_eq!(held(child.id()), Some(of_lab.clone()));
    child.kill().unwrap();
    child.wait().unwrap();
    let holders = || {
        let processes = std::fs::read_dir("/proc").unwrap().flatten();
        processes.filter(|entry| std::fs::read_link(entry.path().join("ns/net")).is_ok_and(|ns| ns == of_lab)).count()
    };
    let start = Instant::now();
    while holders() > 0 {
        assert!(start.elapsed() < PATIENCE, "somebody still holds {}", of_lab.display());
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn a_node_that_is_not_there_is_named_with_those_that_are() {
    let Some(lab) = lab(&["10.77.0.1", "10.77.0.2"], 1500) else { return };
    let said = lab.enter("arm").unwrap_err().to_string();
    assert_eq!(said, "the lab has no node `arm`; its nodes are n0, n1");
    assert_eq!(lab.nodes().map(|node| node.name.as_str()).collect::<Vec<_>>(), ["n0", "n1"]);
    let said = lab.command("n0", &mut Command::new("/no/such/program")).unwrap_err().to_string();
    assert!(said.starts_with("cannot start /no/such/program: "), "{said}");
}

#[test]
fn a_network_that_was_divided_is_one_again() {
    let addresses = ["10.77.0.1", "10.77.0.2", "10.77.0.3", "10.77.0.4"];
    let Some(lab) = lab(&addresses, 1500) else { return };
    let sockets = [0, 1, 2, 3].map(|index| socket(&lab, &format!("n{index}"), addresses[index]));
    let [a, b, c, d] = &sockets;
    // The address is known: what waits for an address would be sent when it is found.
    arrives(a, c);
    arrives(d, b);
    lab.divide(&["n2", "n3"]).unwrap();
    arrives(a, b);
    arrives(c, d);
    a.send_to(b"lost", c.local_addr().unwrap()).unwrap();
    d.send_to(b"lost", b.local_addr().unwrap()).unwrap();
    lab.unite(&["n2", "n3"]).unwrap();
    // What had been sent would have come before this.
    arrives(a, c);
    arrives(d, b);
}
