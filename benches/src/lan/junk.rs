//! A sender of unwanted datagrams, as fast as a processor can send.

use rohrpost_bench_local::harness::{Child, End, Failure, Gate, Placement, Scheduling, Shared, Zeroable, settle};
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// As long as a time datagram, so that the length does not show that it is junk.
const BYTES: usize = 108;
/// Datagrams a second to each port, if the processor can.
const WANTED_S: u64 = 500_000;
/// Datagrams between two looks at the clock.
const BURST: u64 = 64;
const ENDS_WITHIN: Duration = Duration::from_secs(5);

#[repr(C)]
struct JunkCounts {
    begun: Gate,
    over: AtomicU64,
    sent: AtomicU64,
}

// SAFETY: atomics only.
unsafe impl Zeroable for JunkCounts {}

/// A stream of junk to a node, until it is ended or dropped.
///
/// The sender shares the near processor: with two processors there is no third for it. The cost of a datagram until it
/// is dropped or in a socket is also spent on that processor, since the network of namespaces carries each datagram in
/// the thread that sends it.
pub struct Junk {
    counts: Shared<JunkCounts>,
    child: Child,
    began: Instant,
    ports: u64,
}

impl Junk {
    /// Starts it, to these ports of a node. `go` enters the sender's place on the network.
    ///
    /// # Errors
    /// When there can be no further process, or no socket.
    pub fn start(go: impl FnOnce() -> Result<(), Failure>, to: IpAddr, ports: &[u16]) -> Result<Self, Failure> {
        let counts = Shared::<JunkCounts>::new()?;
        let child = Child::start(|| {
            go()?;
            let sockets: Result<Vec<_>, Failure> = ports.iter().map(|port| open((to, *port).into())).collect();
            settle(End::Ping, Placement::TwoCores, Scheduling::Normal)?;
            counts.begun.meet(2)?;
            send(&sockets?, &counts)
        })?;
        counts.begun.meet(2)?;
        Ok(Self { counts, child, began: Instant::now(), ports: ports.len() as u64 })
    }

    /// Ends it, and returns the datagrams a second to each port.
    ///
    /// # Errors
    /// What it failed with.
    pub fn end(self) -> Result<f64, Failure> {
        let seconds = self.began.elapsed().as_secs_f64();
        let sent = self.counts.sent.load(Ordering::Acquire);
        self.counts.over.store(1, Ordering::Release);
        self.child.finish(Instant::now() + ENDS_WITHIN)?;
        Ok(sent as f64 / seconds / self.ports as f64)
    }
}

fn open(to: SocketAddr) -> Result<UdpSocket, Failure> {
    let opened = || {
        let socket = UdpSocket::bind("0.0.0.0:0")?;
        socket.connect(to)?;
        Ok(socket)
    };
    opened().map_err(|error: std::io::Error| Failure::of("udp socket", error))
}

/// Sends to each port in turn, until the end.
fn send(sockets: &[UdpSocket], counts: &JunkCounts) -> Result<(), Failure> {
    let (began, message) = (Instant::now(), [0x5a; BYTES]);
    let wanted_s = WANTED_S * sockets.len() as u64;
    while counts.over.load(Ordering::Acquire) == 0 {
        let sent = counts.sent.load(Ordering::Acquire);
        if sent > began.elapsed().as_nanos() as u64 * (wanted_s / 1_000) / 1_000_000 {
            std::hint::spin_loop();
            continue;
        }
        for socket in sockets.iter().cycle().take(BURST as usize) {
            // No socket may be open there, or its queue may be full: the cost is the same.
            let _ = socket.send(&message);
        }
        counts.sent.store(sent + BURST, Ordering::Release);
    }
    Ok(())
}
