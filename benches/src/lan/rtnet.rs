//! Error of a slave's time by RTnet's formula (RTnet's TDMA revision 2.1a): a broadcast each cycle, and no filter.
//!
//! ```text
//!  slave   ── request ──▶ master ── reply ──▶ slave        100 times, once at the start: the mean is one way
//!  master  ── synchronisation, each cycle, with the time at which it was handed to the network ──▶ slave
//!  offset = time in it + one way − the kernel's receive stamp
//! ```
//! Both ends read the same clock, so any offset that the slave computes is its error.

use super::wire::{Wire, address};
use nix::sys::socket::{ControlMessageOwned, MsgFlags, SockaddrIn, recvmsg, setsockopt, sockopt};
use nix::sys::time::TimeSpec;
use rohrpost_bench_local::harness::{
    Child, End, Failure, Gate, OrFail, Placement, Samples, Scheduling, Shared, Zeroable, settle,
};
use rohrpost_mailbox::realtime_ns;
use std::io::IoSliceMut;
use std::net::{Ipv4Addr, UdpSocket};
use std::os::fd::AsRawFd;
use std::time::{Duration, Instant};

const PORT: u16 = 20_130;
/// As many as RTnet does.
const CALIBRATIONS: usize = 100;
/// RTnet's own default.
const CYCLE: Duration = Duration::from_millis(5);
/// Bytes of each message: two stamps.
const MESSAGE_BYTES: usize = 16;
const GRACE: Duration = Duration::from_secs(30);

#[repr(C)]
struct ExchangeTurn {
    gate: Gate,
    samples: Samples,
}

// SAFETY: atomics only.
unsafe impl Zeroable for ExchangeTurn {}

/// Error of a slave on the far end after each of so many synchronisations, µs.
///
/// # Errors
/// When an end fails.
pub fn errors_us(wire: &Wire, synchronisations: usize) -> Result<Vec<f64>, Failure> {
    let turn = Shared::<ExchangeTurn>::new()?;
    let open = |end| {
        let socket = Stamped::open(wire, end)?;
        settle(end, Placement::TwoCores, Scheduling::Fifo)?;
        turn.gate.meet(2)?;
        Ok::<_, Failure>(socket)
    };
    let master = Child::start(|| master(&open(End::Ping)?, synchronisations))?;
    let slave = Child::start(|| slave(&open(End::Pong)?, synchronisations, &turn.samples))?;
    let deadline = Instant::now() + CYCLE * (synchronisations + CALIBRATIONS) as u32 + GRACE;
    slave.finish(deadline)?;
    master.finish(deadline)?;
    Ok(turn.samples.all())
}

fn master(socket: &Stamped, synchronisations: usize) -> Result<(), Failure> {
    for _ in 0..CALIBRATIONS {
        let (_, received_ns) = socket.receive()?;
        socket.send(address(End::Pong), [received_ns, realtime()])?;
    }
    for _ in 0..synchronisations {
        std::thread::sleep(CYCLE);
        socket.send(Ipv4Addr::BROADCAST.into(), [0, realtime()])?;
    }
    Ok(())
}

fn slave(socket: &Stamped, synchronisations: usize, samples: &Samples) -> Result<(), Failure> {
    let mut all_ns = 0.0;
    for _ in 0..CALIBRATIONS {
        std::thread::sleep(CYCLE);
        let sent_ns = realtime();
        socket.send(address(End::Ping), [0, 0])?;
        let ([at_master_ns, answered_ns], received_ns) = socket.receive()?;
        let (round_trip_ns, there_ns) = (received_ns - sent_ns, answered_ns - at_master_ns);
        all_ns += (round_trip_ns - there_ns) as f64 / 2.0;
    }
    let one_way_ns = all_ns / CALIBRATIONS as f64;
    for _ in 0..synchronisations {
        let ([_, sent_ns], received_ns) = socket.receive()?;
        let offset_ns = one_way_ns - (received_ns - sent_ns) as f64;
        samples.push(offset_ns.abs() / 1000.0);
    }
    Ok(())
}

/// A socket that reports the kernel's receive stamps.
struct Stamped(UdpSocket);

impl Stamped {
    fn open(wire: &Wire, end: End) -> Result<Self, Failure> {
        wire.enter(end)?;
        let opened = || {
            // Not bound to the end's own address, which receives no broadcasts.
            let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, PORT))?;
            socket.set_broadcast(true)?;
            setsockopt(&socket, sockopt::ReceiveTimestampns, &true)?;
            Ok::<_, std::io::Error>(socket)
        };
        opened().map(Self).or_fail("socket of RTnet's formula")
    }

    fn send(&self, to: std::net::IpAddr, stamps_ns: [i64; 2]) -> Result<(), Failure> {
        let mut message = [0; MESSAGE_BYTES];
        let (first, second) = message.split_at_mut(MESSAGE_BYTES / 2);
        first.copy_from_slice(&stamps_ns[0].to_le_bytes());
        second.copy_from_slice(&stamps_ns[1].to_le_bytes());
        self.0.send_to(&message, (to, PORT)).map(drop).or_fail("send")
    }

    /// The stamps in the next message, and when the kernel received it.
    fn receive(&self) -> Result<([i64; 2], i64), Failure> {
        let mut message = [0; MESSAGE_BYTES];
        let mut parts = [IoSliceMut::new(&mut message)];
        let mut space = nix::cmsg_space!(TimeSpec);
        let received = recvmsg::<SockaddrIn>(self.0.as_raw_fd(), &mut parts, Some(&mut space), MsgFlags::empty())
            .or_fail("recvmsg")?;
        let stamps = received.cmsgs().or_fail("receive stamp")?;
        let stamp = stamps.into_iter().find_map(|stamp| match stamp {
            ControlMessageOwned::ScmTimestampns(time) => Some(time.tv_sec() * 1_000_000_000 + time.tv_nsec()),
            _ => None,
        });
        let stamp = stamp.ok_or_else(|| Failure::Failed("the kernel stamps no datagrams".into()))?;
        let long = |half: &[u8]| half.try_into().map(i64::from_le_bytes).unwrap_or_default();
        let (first, second) = message.split_at(MESSAGE_BYTES / 2);
        Ok(([long(first), long(second)], stamp))
    }
}

/// Now, signed, since differences are.
fn realtime() -> i64 {
    realtime_ns() as i64
}
