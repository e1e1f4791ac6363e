//! Ordinary traffic between nodes in time slots: a TUN device with packets that go behind all packages of modules.
//!
//! ```text
//!  ssh, HTTP ─▶ kernel ─▶ rohrpost0 ─ tunnel-out ─▶ router.I.3 ─▶ level 31 ═ slots
//!  slots ═▶ router.J.4 ─ tunnel-in ─▶ rohrpost0 ─▶ kernel
//! ```
//!
//! An IP packet is a package like any other, of the least priority, with a quota of its own. Only a little of it may
//! wait in the queue: more packets are dropped, which is how TCP learns the capacity of a network. Both threads are
//! ordinary ones.

use super::sender_cache::SenderCache;
use super::threads::Shared;
use crate::admission::{Addresses, Admission, PACKET, PACKET_PRIORITY, TUNNEL};
use crate::counts::Count;
use crate::frame::NodeIndex;
use crate::netlink::Netlink;
use crate::outbound::DIRECT_HEAD_BYTES;
use crate::settings::{QUOTA_BYTES_MIN, Settings};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use rohrpost_mailbox::{CreateError, Head, Name, Participant, Receiver, Shape, sys};
use rohrpost_network::KEPT_IN_BYTES;
use rohrpost_network::Tunnel;
use std::fs::File;
use std::io::{self, Read, Write};
use std::net::IpAddr;
use std::os::fd::AsFd;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// The kernel numbers the devices of one network.
const DEVICE: &str = "rohrpost%d";
/// Largest packet, where the largest datagram has room for it.
const MTU_MAX: usize = 1500;
/// Limit in the queue, for this node's packets alone: 64 of the largest. More are dropped.
const WAITING_BYTES_MAX: u64 = 64 * (MTU_MAX as u64).next_multiple_of(KEPT_IN_BYTES);
/// Slots of the mailbox that packets come to.
const SLOTS: u16 = 64;
/// The threads check this often whether the router ends.
const LOOK: Duration = Duration::from_millis(100);
const LOOK_MS: u8 = 100;

const _: () = assert!(WAITING_BYTES_MAX <= QUOTA_BYTES_MIN as u64, "it is dropped here before its quota drops it");

/// Counters of the tunnel.
#[derive(Default, Debug)]
pub struct Passed {
    /// Packets handed to the router for other nodes.
    pub sent: Count,
    /// Packets for other nodes that were dropped: too many waited.
    pub dropped: Count,
    /// Packets from or for an address that is not in the tunnel, or not of IPv4.
    pub stray: Count,
    /// Packets from other nodes, handed to the kernel.
    pub received: Count,
    /// Packets that a program of this node put there in another's name, or that the kernel did not take.
    pub refused: Count,
}

/// The device in the kernel.
pub(super) struct TunDevice {
    file: File,
    mtu: usize,
}

impl TunDevice {
    /// Makes it, in the network that the calling thread is in, and gives it the node's address.
    pub(super) fn open(settings: &Settings, tunnel: &Tunnel) -> io::Result<Self> {
        // In one datagram, never in fragments.
        let mtu = MTU_MAX.min(settings.datagram_bytes() - DIRECT_HEAD_BYTES);
        let (file, name) = sys::tun(DEVICE)?;
        let device = nix::net::if_::if_nametoindex(name.as_str())?;
        let mut kernel = Netlink::new()?;
        kernel.set_mtu(device, mtu as u32)?;
        kernel.add_address(device, tunnel.address(settings.own).into(), Some(tunnel.prefix))?;
        kernel.set_up(device, true)?;
        Ok(Self { file: file.into(), mtu })
    }

    fn twin(&self) -> io::Result<Self> {
        Ok(Self { file: self.file.try_clone()?, mtu: self.mtu })
    }
}

/// State of both threads.
struct Common {
    shared: Arc<Shared>,
    device: TunDevice,
    passed: Arc<Passed>,
}

/// From the kernel to other nodes.
pub(super) struct Out {
    common: Common,
    sender_cache: SenderCache,
    /// The router's name.
    own: Name,
    tunnel: Tunnel,
    node: NodeIndex,
    nodes: NodeIndex,
}

/// From other nodes to the kernel.
pub(super) struct In {
    common: Common,
    mailbox: Receiver,
    admission: Admission,
}

/// Why there is no tunnel.
#[derive(Debug, thiserror::Error)]
pub(super) enum TunnelError {
    #[error(
        "{0}; it needs CAP_NET_ADMIN, and /dev/net/tun (`modprobe tun`; in a container `--cap-add=NET_ADMIN --device \
         /dev/net/tun`)"
    )]
    Device(#[from] io::Error),
    #[error(transparent)]
    Mailbox(#[from] CreateError),
}

/// Both directions. `own` is the router's name; each direction is a participant of its own.
pub(super) fn ends(
    settings: &Settings,
    tunnel: &Tunnel,
    own: Name,
    shared: &Arc<Shared>,
    [sender, receiver]: &[Arc<Participant>; 2],
) -> Result<(Out, In, Arc<Passed>), TunnelError> {
    let device = TunDevice::open(settings, tunnel)?;
    let passed = Arc::new(Passed::default());
    let common = |device| Common { shared: shared.clone(), device, passed: passed.clone() };
    let shape = Shape { slots: SLOTS, body_bytes_max: MTU_MAX as u16, ..Shape::default() };
    let mailbox = receiver.receiver(own.with_local(TUNNEL), shape)?;
    let incoming = In { common: common(device.twin()?), mailbox, admission: settings.admission.clone() };
    let outgoing = Out {
        common: common(device),
        sender_cache: SenderCache::everywhere(sender),
        own: own.with_local(TUNNEL),
        tunnel: *tunnel,
        node: settings.own,
        nodes: settings.nodes.len() as NodeIndex,
    };
    Ok((outgoing, incoming, passed))
}

impl Out {
    /// Until the router ends.
    pub(super) fn run(mut self) {
        let mut packet = vec![0; self.common.device.mtu];
        while !self.common.shared.ends() {
            let mut fds = [PollFd::new(self.common.device.file.as_fd(), PollFlags::POLLIN)];
            if poll(&mut fds, PollTimeout::from(LOOK_MS)) != Ok(1) {
                continue;
            }
            match self.common.device.file.read(&mut packet) {
                Ok(bytes) => self.send(&packet[..bytes]),
                // The device is down: nothing comes for a while.
                Err(_) => std::thread::sleep(LOOK),
            }
        }
    }

    fn send(&mut self, packet: &[u8]) {
        let passed = self.common.passed.clone();
        let ends = Addresses::of(packet);
        let Some(node) = ends.and_then(|ends| node_of(&ends, &self.tunnel, self.node, self.nodes)) else {
            return passed.stray.add(1);
        };
        let to = Name::new(self.own.system(), self.own.class().0, node, TUNNEL);
        let head = Head {
            to,
            from: self.own,
            len: packet.len() as u16,
            kind: PACKET,
            priority: PACKET_PRIORITY,
            ..Head::default()
        };
        let full = self.common.shared.tunnel_bytes.load(Ordering::Relaxed) >= WAITING_BYTES_MAX;
        let count = if full || self.sender_cache.send(&head, packet).is_err() { &passed.dropped } else { &passed.sent };
        count.add(1);
    }
}

impl In {
    /// Until the router ends.
    pub(super) fn run(mut self) {
        let (Common { shared, device, passed }, admission) = (&mut self.common, &self.admission);
        while !shared.ends() {
            let Some(packet) = self.mailbox.receive_timeout(LOOK) else { continue };
            // Packets from other nodes were checked on their way in, but this mailbox is open to all of this node.
            let node = admission.tunnel_end(packet.head().from);
            let is_packet = node.is_some_and(|node| admission.is_packet_of(node, packet.body()));
            let taken = is_packet && device.file.write(packet.body()).is_ok();
            let count = if taken { &passed.received } else { &passed.refused };
            count.add(1);
        }
    }
}

/// The node that a packet of this node is for: both have an address of the tunnel.
fn node_of(ends: &Addresses, tunnel: &Tunnel, own: NodeIndex, nodes: NodeIndex) -> Option<NodeIndex> {
    let is_own = ends.source == IpAddr::from(tunnel.address(own));
    (0..nodes).find(|node| is_own && ends.destination == IpAddr::from(tunnel.address(*node)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::admission::v4;
    use std::net::Ipv4Addr;

    #[test]
    fn a_packet_of_the_own_address_goes_to_the_node_with_its_destination() {
        let tunnel = Tunnel { network: Ipv4Addr::new(10, 78, 0, 0), prefix: 24 };
        let packet = |from: [u8; 4], to: [u8; 4]| v4(from.into(), to.into(), b"payload");
        let own = [10, 78, 0, 2];
        for (bytes, node, why) in [
            (packet(own, [10, 78, 0, 1]), Some(0), "the first"),
            (packet(own, [10, 78, 0, 3]), Some(2), "the last"),
            (packet(own, [10, 78, 0, 4]), None, "behind it"),
            (packet(own, [10, 78, 0, 0]), None, "before the first"),
            (packet(own, [10, 78, 1, 1]), None, "so far behind that a byte does not tell"),
            (packet([10, 78, 0, 3], [10, 78, 0, 1]), None, "with the address of another node"),
            (packet([192, 168, 0, 7], [10, 78, 0, 1]), None, "from another network"),
            (packet(own, [10, 78, 0, 1])[..19].to_vec(), None, "cut short"),
        ] {
            let ends = Addresses::of(&bytes);
            assert_eq!(ends.and_then(|ends| node_of(&ends, &tunnel, 1, 3)), node, "{why}");
        }
    }
}
