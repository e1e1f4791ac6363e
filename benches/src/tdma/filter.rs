//! A packet socket that receives only datagrams of routers: a flood beside them is not copied.

use libc::{BPF_ABS, BPF_B, BPF_H, BPF_JEQ, BPF_JMP, BPF_K, BPF_LD, BPF_RET, sock_filter, sock_fprog};
use nix::sys::socket::{AddressFamily, SockFlag, SockProtocol, SockType, setsockopt, socket, sockopt};
use rohrpost_bench_local::{Failure, OrFail};
use std::io;
use std::os::fd::{AsRawFd, OwnedFd};

/// Receive buffer.
const RECEIVE_BYTES: usize = 64 << 20;

/// Each datagram to one of these ports that comes in at the calling thread's place, with the kernel's stamp.
///
/// # Errors
/// When the system refuses it.
pub fn open(ports: [u16; 2]) -> Result<OwnedFd, Failure> {
    let socket = socket(AddressFamily::Packet, SockType::Raw, SockFlag::SOCK_CLOEXEC, SockProtocol::EthAll)
        .or_fail("packet socket")?;
    attach(&socket, &mut program(ports)).or_fail("filter of a packet socket")?;
    // Only root may exceed the system's limit; other users keep the limit.
    let _ = setsockopt(&socket, sockopt::RcvBufForce, &RECEIVE_BYTES);
    setsockopt(&socket, sockopt::ReceiveTimestampns, &true).or_fail("packet socket")?;
    Ok(socket)
}

/// Accepts IPv4 without options, UDP, to one of these ports, as a port of the bridge receives it, and not as a port
/// forwards it.
fn program(ports: [u16; 2]) -> [sock_filter; 11] {
    const PACKET_TYPE: i32 = libc::SKF_AD_OFF + libc::SKF_AD_PKTTYPE;
    /// As `packet(7)` has it.
    const OUTGOING: u32 = 4;
    const ETHERTYPE: i32 = 12;
    const PROTOCOL: i32 = 23;
    const PORT: i32 = 36;
    let load =
        |size, at: i32| sock_filter { code: (BPF_LD | size | BPF_ABS) as u16, jt: 0, jf: 0, k: at.cast_unsigned() };
    // Offsets of the next instruction: on a match, and otherwise.
    let is = |value: u32, jt, jf| sock_filter { code: (BPF_JMP | BPF_JEQ | BPF_K) as u16, jt, jf, k: value };
    let takes = |bytes| sock_filter { code: (BPF_RET | BPF_K) as u16, jt: 0, jf: 0, k: bytes };
    [
        load(BPF_B, PACKET_TYPE),
        is(OUTGOING, 8, 0),
        load(BPF_H, ETHERTYPE),
        is(libc::ETH_P_IP as u32, 0, 6),
        load(BPF_B, PROTOCOL),
        is(libc::IPPROTO_UDP as u32, 0, 4),
        load(BPF_H, PORT),
        is(ports[0].into(), 1, 0),
        is(ports[1].into(), 0, 1),
        takes(u32::MAX),
        takes(0),
    ]
}

fn attach(socket: &OwnedFd, program: &mut [sock_filter]) -> io::Result<()> {
    let attached = sock_fprog { len: program.len() as u16, filter: program.as_mut_ptr() };
    let (at, bytes) = ((&raw const attached).cast(), size_of::<sock_fprog>() as libc::socklen_t);
    // SAFETY: the kernel reads so many bytes there, and the instructions that they point to; all outlive the call, and
    // the kernel keeps no pointer.
    match unsafe { libc::setsockopt(socket.as_raw_fd(), libc::SOL_SOCKET, libc::SO_ATTACH_FILTER, at, bytes) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}
