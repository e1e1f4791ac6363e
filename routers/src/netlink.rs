//! The part of rtnetlink that is needed here: make a bridge and pairs of veth, set devices up or down, give addresses.
//!
//! ```text
//!  nlmsghdr: length u32, type u16, flags u16, sequence u32, port u32
//!  then by type ifinfomsg, ifaddrmsg or rtmsg, then attributes: length u16, type u16, bytes, padded to 4
//! ```
//!
//! All in native byte order. Each request asks for an acknowledgement, an error number that is 0 on success. A socket
//! belongs to the network namespace of its thread when it was made.

use nix::sys::socket::{
    AddressFamily, MsgFlags, SockFlag, SockProtocol, SockType, recv, send, setsockopt, socket, sockopt,
};
use nix::sys::time::TimeVal;
use std::io;
use std::net::IpAddr;
use std::os::fd::{AsRawFd, OwnedFd};

/// Time for the kernel's answer; it answers within the call that asks.
const PATIENCE: TimeVal = TimeVal::new(5, 0);
const ANSWER_BYTES_MAX: usize = 32 << 10;

const HEAD_BYTES: usize = 16;
const NLMSG_ERROR: u16 = 2;
const RTM_NEWLINK: u16 = 16;
const RTM_GETLINK: u16 = 18;
const RTM_NEWADDR: u16 = 20;
const RTM_NEWROUTE: u16 = 24;
const NLM_F_REQUEST: u16 = 0x1;
const NLM_F_ACK: u16 = 0x4;
const NLM_F_EXCL: u16 = 0x200;
const NLM_F_CREATE: u16 = 0x400;

const IFLA_IFNAME: u16 = 3;
const IFLA_MTU: u16 = 4;
const IFLA_MASTER: u16 = 10;
const IFLA_LINKINFO: u16 = 18;
const IFLA_NET_NS_FD: u16 = 28;
const IFLA_INFO_KIND: u16 = 1;
const IFLA_INFO_DATA: u16 = 2;
const VETH_INFO_PEER: u16 = 1;
const IFA_ADDRESS: u16 = 1;
const IFA_LOCAL: u16 = 2;
const RTA_DST: u16 = 1;
const RTA_OIF: u16 = 4;
const RTA_GATEWAY: u16 = 5;

const IFF_UP: u32 = 0x1;
/// Up, with a carrier, and the kernel has noticed.
const IFF_RUNNING: u32 = 0x40;
/// The address is used at once, without duplicate detection.
const IFA_F_NODAD: u8 = 0x2;
const RT_TABLE_MAIN: u8 = 254;
const RTPROT_STATIC: u8 = 4;
const RT_SCOPE_UNIVERSE: u8 = 0;
const RT_SCOPE_LINK: u8 = 253;
const RTN_UNICAST: u8 = 1;

/// A device of a namespace, by its number there.
pub(crate) type DeviceIndex = u32;

/// A netlink socket of one namespace.
pub(crate) struct Netlink {
    socket: OwnedFd,
    sequence: u32,
}

/// A request under construction.
struct NetlinkMessage {
    kind: u16,
    flags: u16,
    bytes: Vec<u8>,
}

impl NetlinkMessage {
    fn new(kind: u16, flags: u16, fixed: &[u8]) -> Self {
        Self { kind, flags, bytes: [&[0; HEAD_BYTES], fixed].concat() }
    }

    fn attribute(mut self, kind: u16, value: &[u8]) -> Self {
        let length = 4 + value.len() as u16;
        self.bytes.extend_from_slice(&length.to_ne_bytes());
        self.bytes.extend_from_slice(&kind.to_ne_bytes());
        self.bytes.extend_from_slice(value);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self
    }

    /// An attribute that consists of attributes, behind some bytes of its own.
    fn nested(self, kind: u16, fixed: &[u8], fill: impl FnOnce(Self) -> Self) -> Self {
        let inner = fill(Self { kind: 0, flags: 0, bytes: fixed.to_vec() });
        self.attribute(kind, &inner.bytes)
    }

    fn number(self, kind: u16, value: u32) -> Self {
        self.attribute(kind, &value.to_ne_bytes())
    }

    fn text(self, kind: u16, value: &str) -> Self {
        self.attribute(kind, &[value.as_bytes(), &[0]].concat())
    }

    fn finish(mut self, sequence: u32) -> Vec<u8> {
        let length = self.bytes.len() as u32;
        self.bytes[0..4].copy_from_slice(&length.to_ne_bytes());
        self.bytes[4..6].copy_from_slice(&self.kind.to_ne_bytes());
        self.bytes[6..8].copy_from_slice(&(NLM_F_REQUEST | self.flags).to_ne_bytes());
        self.bytes[8..12].copy_from_slice(&sequence.to_ne_bytes());
        self.bytes
    }
}

/// `struct ifinfomsg`.
fn link(device: DeviceIndex, flags: u32, change: u32) -> [u8; 16] {
    let mut bytes = [0; 16];
    bytes[4..8].copy_from_slice(&device.to_ne_bytes());
    bytes[8..12].copy_from_slice(&flags.to_ne_bytes());
    bytes[12..16].copy_from_slice(&change.to_ne_bytes());
    bytes
}

fn family(address: IpAddr) -> u8 {
    let family = if address.is_ipv4() { AddressFamily::Inet } else { AddressFamily::Inet6 };
    family as u8
}

fn octets(address: IpAddr) -> Vec<u8> {
    match address {
        IpAddr::V4(v4) => v4.octets().to_vec(),
        IpAddr::V6(v6) => v6.octets().to_vec(),
    }
}

impl Netlink {
    /// A socket in the namespace of this thread.
    pub(crate) fn new() -> io::Result<Self> {
        let socket = socket(AddressFamily::Netlink, SockType::Raw, SockFlag::SOCK_CLOEXEC, SockProtocol::NetlinkRoute)?;
        setsockopt(&socket, sockopt::ReceiveTimeout, &PATIENCE)?;
        Ok(Self { socket, sequence: 0 })
    }

    /// Makes a bridge.
    pub(crate) fn add_bridge(&mut self, device: DeviceIndex, name: &str, mtu: u32) -> io::Result<()> {
        let message = NetlinkMessage::new(RTM_NEWLINK, NLM_F_CREATE | NLM_F_EXCL, &link(device, 0, 0))
            .text(IFLA_IFNAME, name)
            .number(IFLA_MTU, mtu)
            .nested(IFLA_LINKINFO, &[], |info| info.attribute(IFLA_INFO_KIND, b"bridge"));
        self.ask(message).map(drop)
    }

    /// Makes a pair of veth: one end here, on a bridge, the other in another namespace.
    pub(crate) fn add_veth(
        &mut self,
        own: VethEnd<'_>,
        bridge: DeviceIndex,
        far: VethEnd<'_>,
        namespace: &impl AsRawFd,
        mtu: u32,
    ) -> io::Result<()> {
        let message = NetlinkMessage::new(RTM_NEWLINK, NLM_F_CREATE | NLM_F_EXCL, &link(own.device, 0, 0))
            .text(IFLA_IFNAME, own.name)
            .number(IFLA_MTU, mtu)
            .number(IFLA_MASTER, bridge)
            .nested(IFLA_LINKINFO, &[], |info| {
                info.attribute(IFLA_INFO_KIND, b"veth").nested(IFLA_INFO_DATA, &[], |data| {
                    data.nested(VETH_INFO_PEER, &link(far.device, 0, 0), |peer| {
                        peer.text(IFLA_IFNAME, far.name)
                            .number(IFLA_MTU, mtu)
                            .number(IFLA_NET_NS_FD, namespace.as_raw_fd() as u32)
                    })
                })
            });
        self.ask(message).map(drop)
    }

    /// Sets a device up or down.
    pub(crate) fn set_up(&mut self, device: DeviceIndex, up: bool) -> io::Result<()> {
        let flags = if up { IFF_UP } else { 0 };
        self.ask(NetlinkMessage::new(RTM_NEWLINK, 0, &link(device, flags, IFF_UP))).map(drop)
    }

    /// Moves a port to a bridge.
    pub(crate) fn set_bridge(&mut self, port: DeviceIndex, bridge: DeviceIndex) -> io::Result<()> {
        self.ask(NetlinkMessage::new(RTM_NEWLINK, 0, &link(port, 0, 0)).number(IFLA_MASTER, bridge)).map(drop)
    }

    /// Changes the largest packet.
    pub(crate) fn set_mtu(&mut self, device: DeviceIndex, mtu: u32) -> io::Result<()> {
        self.ask(NetlinkMessage::new(RTM_NEWLINK, 0, &link(device, 0, 0)).number(IFLA_MTU, mtu)).map(drop)
    }

    /// Gives a device an address. Neighbours share `prefix` bits with it, and are reached by the device; none: it has
    /// no neighbours.
    pub(crate) fn add_address(&mut self, device: DeviceIndex, address: IpAddr, prefix: Option<u8>) -> io::Result<()> {
        let octets = octets(address);
        let prefix_bits = prefix.unwrap_or(8 * octets.len() as u8);
        let mut fixed = [0; 8];
        fixed[0..4].copy_from_slice(&[family(address), prefix_bits, IFA_F_NODAD, RT_SCOPE_UNIVERSE]);
        fixed[4..8].copy_from_slice(&device.to_ne_bytes());
        let message = NetlinkMessage::new(RTM_NEWADDR, NLM_F_CREATE | NLM_F_EXCL, &fixed)
            .attribute(IFA_LOCAL, &octets)
            .attribute(IFA_ADDRESS, &octets);
        self.ask(message).map(drop)
    }

    /// All addresses of a kind are reached by a device, directly.
    pub(crate) fn add_route_to_all(&mut self, device: DeviceIndex, like: IpAddr) -> io::Result<()> {
        let scope = if like.is_ipv4() { RT_SCOPE_LINK } else { RT_SCOPE_UNIVERSE };
        let fixed = [family(like), 0, 0, 0, RT_TABLE_MAIN, RTPROT_STATIC, scope, RTN_UNICAST, 0, 0, 0, 0];
        self.ask(NetlinkMessage::new(RTM_NEWROUTE, NLM_F_CREATE | NLM_F_EXCL, &fixed).number(RTA_OIF, device)).map(drop)
    }

    /// One address is reached by a device, directly or through another.
    pub(crate) fn add_route(&mut self, device: DeviceIndex, to: IpAddr, through: Option<IpAddr>) -> io::Result<()> {
        let scope = if to.is_ipv4() && through.is_none() { RT_SCOPE_LINK } else { RT_SCOPE_UNIVERSE };
        let octets = octets(to);
        let bits = 8 * octets.len() as u8;
        let fixed = [family(to), bits, 0, 0, RT_TABLE_MAIN, RTPROT_STATIC, scope, RTN_UNICAST, 0, 0, 0, 0];
        let message = NetlinkMessage::new(RTM_NEWROUTE, NLM_F_CREATE | NLM_F_EXCL, &fixed).attribute(RTA_DST, &octets);
        let message = match through {
            Some(through) => message.attribute(RTA_GATEWAY, &self::octets(through)),
            None => message,
        };
        self.ask(message.number(RTA_OIF, device)).map(drop)
    }

    /// Whether a device carries packets: it is up, and so is its other end.
    pub(crate) fn runs(&mut self, device: DeviceIndex) -> io::Result<bool> {
        let answer = self.ask(NetlinkMessage::new(RTM_GETLINK, 0, &link(device, 0, 0)))?;
        let flags = answer.get(HEAD_BYTES + 8..HEAD_BYTES + 12).and_then(|flags| flags.try_into().ok());
        Ok(u32::from_ne_bytes(flags.unwrap_or_default()) & IFF_RUNNING != 0)
    }

    /// Sends a request; returns the answer before its acknowledgement.
    fn ask(&mut self, message: NetlinkMessage) -> io::Result<Vec<u8>> {
        self.sequence += 1;
        let message = NetlinkMessage { flags: message.flags | NLM_F_ACK, ..message }.finish(self.sequence);
        send(self.socket.as_raw_fd(), &message, MsgFlags::empty())?;
        let mut found = Vec::new();
        let mut buffer = vec![0; ANSWER_BYTES_MAX];
        loop {
            let bytes = recv(self.socket.as_raw_fd(), &mut buffer, MsgFlags::empty())?;
            let mut rest = &buffer[..bytes];
            while let Some((kind, sequence, message, behind)) = split(rest) {
                rest = behind;
                if sequence != self.sequence {
                    continue;
                }
                if kind != NLMSG_ERROR {
                    found = message.to_vec();
                    continue;
                }
                let number = message.get(HEAD_BYTES..HEAD_BYTES + 4).and_then(|number| number.try_into().ok());
                return match i32::from_ne_bytes(number.unwrap_or_default()) {
                    0 => Ok(found),
                    number => Err(io::Error::from_raw_os_error(-number)),
                };
            }
        }
    }
}

/// Kind, sequence and bytes of the first message, and the rest.
fn split(bytes: &[u8]) -> Option<(u16, u32, &[u8], &[u8])> {
    let head = bytes.first_chunk::<HEAD_BYTES>()?;
    let length = u32::from_ne_bytes([head[0], head[1], head[2], head[3]]) as usize;
    let kind = u16::from_ne_bytes([head[4], head[5]]);
    let sequence = u32::from_ne_bytes([head[8], head[9], head[10], head[11]]);
    let message = bytes.get(..length).filter(|_| length >= HEAD_BYTES)?;
    Some((kind, sequence, message, bytes.get(length.next_multiple_of(4)..).unwrap_or_default()))
}

/// One end of a pair of veth.
#[derive(Clone, Copy)]
pub(crate) struct VethEnd<'a> {
    pub(crate) device: DeviceIndex,
    pub(crate) name: &'a str,
}
