//! What a node sends and hears goes through a relay on the bridge, which holds every frame back for the same time, or
//! keeps some from the node.

use super::{NODES, Segment, name};
use nix::net::if_::if_nametoindex;
use nix::sys::socket::{
    AddressFamily, LinkAddr, MsgFlags, SockFlag, SockProtocol, SockType, SockaddrLike, recvfrom, sendto, socket,
};
use rohrpost_mailbox::monotonic_ns;
use rohrpost_mailbox::sys::{Scheduling, schedule};
use rohrpost_routers::frame::FrameHead;
use std::collections::VecDeque;
use std::os::fd::{AsRawFd, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// As `packet(7)` has it: it leaves by this port.
const OUTGOING: u8 = 4;
/// Where UDP over IPv4 has its checksum. The kernel fills it in when a frame leaves the computer, which this one does
/// not.
const CHECKSUM_AT: std::ops::Range<usize> = 40..42;
const UDP_AT: usize = 23;
const UDP: u8 = 17;
const FRAME_BYTES: usize = 1 << 12;

/// Of UDP over IPv4 in Ethernet.
const HEADS_BYTES: usize = 42;

/// Which datagrams do not come to the node.
pub(crate) type Keeps = fn(&FrameHead) -> bool;

/// Runs until it is dropped; then the node is on the bridge again.
pub(crate) struct Relay<'a> {
    segment: &'a Segment,
    node: u8,
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<u64>>,
}

struct Held {
    leaves_ns: u64,
    port: usize,
    frame: Vec<u8>,
}

impl<'a> Relay<'a> {
    pub(crate) fn start(segment: &'a Segment, node: u8, holds: Duration, keeps: Keeps) -> Self {
        let (socket, ports) = {
            let _inside = segment.lab.enter_bridge().unwrap();
            let flags = SockFlag::SOCK_CLOEXEC | SockFlag::SOCK_NONBLOCK;
            let socket = socket(AddressFamily::Packet, SockType::Raw, flags, SockProtocol::EthAll).unwrap();
            let port = |node: u8| if_nametoindex(name(node).as_str()).unwrap() as usize;
            (socket, (0..NODES).map(port).collect::<Vec<_>>())
        };
        let ends = Arc::new(AtomicBool::new(false));
        let (own, ending) = (ports[usize::from(node)], ends.clone());
        let others: Vec<usize> = ports.into_iter().filter(|port| *port != own).collect();
        let thread = std::thread::spawn(move || run(&socket, own, &others, holds, keeps, &ending));
        // It runs before: meanwhile there are copies, but no pause.
        segment.lab.divide(&[&name(node)]).unwrap();
        Self { segment, node, ends, thread: Some(thread) }
    }

    /// Ends it; how many frames it has carried.
    pub(crate) fn end(mut self) -> u64 {
        self.segment.lab.unite(&[&name(self.node)]).unwrap();
        self.ends.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap()
    }
}

impl Drop for Relay<'_> {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
    }
}

/// From the node to all others, and from each of those to the node, which takes what is for it.
fn run(socket: &OwnedFd, own: usize, others: &[usize], holds: Duration, keeps: Keeps, ends: &AtomicBool) -> u64 {
    // Where it is not allowed, the relay is late now and then.
    let _ = schedule(Scheduling::Fifo(1));
    let (mut held, mut carried) = (VecDeque::new(), 0);
    let mut buffer = [0; FRAME_BYTES];
    while !ends.load(Ordering::Relaxed) {
        while let Ok((bytes, Some(from))) = recvfrom::<LinkAddr>(socket.as_raw_fd(), &mut buffer) {
            let to = match from.ifindex() {
                _ if from.pkttype() == OUTGOING => continue,
                port if port == own => others,
                port if others.contains(&port) => std::slice::from_ref(&own),
                _ => continue,
            };
            let head = buffer[..bytes].get(HEADS_BYTES..).map(FrameHead::parse);
            if from.ifindex() != own && matches!(head, Some(Ok((head, _))) if keeps(&head)) {
                continue;
            }
            let mut frame = buffer[..bytes].to_vec();
            if frame.get(UDP_AT) == Some(&UDP) && bytes >= CHECKSUM_AT.end {
                frame[CHECKSUM_AT].fill(0);
            }
            let leaves_ns = monotonic_ns() + holds.as_nanos() as u64;
            held.extend(to.iter().map(|port| Held { leaves_ns, port: *port, frame: frame.clone() }));
        }
        while let Some(Held { port, frame, .. }) = held.pop_front_if(|held: &mut Held| held.leaves_ns <= monotonic_ns())
        {
            carried += u64::from(sendto(socket.as_raw_fd(), &frame, &at(port), MsgFlags::empty()).is_ok());
        }
        std::thread::sleep(Duration::from_micros(50));
    }
    carried
}

/// A port, for frames that have their addresses in them.
fn at(port: usize) -> LinkAddr {
    let mut bytes = [0; size_of::<nix::libc::sockaddr_ll>()];
    bytes[..2].copy_from_slice(&(AddressFamily::Packet as u16).to_ne_bytes());
    bytes[4..8].copy_from_slice(&(port as i32).to_ne_bytes());
    // SAFETY: these are the bytes of a `sockaddr_ll`, as long as one.
    unsafe { LinkAddr::from_raw(bytes.as_ptr().cast(), Some(bytes.len() as u32)) }.unwrap()
}
