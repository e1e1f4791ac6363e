//! Time and bytes that datagrams take on a link.

use rohrpost_network::{ETHERNET_BYTES, Tdma};

/// The smallest packet that Ethernet carries; a smaller one is padded.
pub const PACKET_BYTES_MIN: usize = 46;
const SECOND_NS: u128 = 1_000_000_000;

/// A link, and the headers before each datagram on it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Wire {
    link_bytes_s: u64,
    heads_bytes: usize,
}

impl Wire {
    /// `heads_bytes`: bytes of IP and UDP headers for each datagram, see
    /// [`Settings::overhead_bytes`](crate::settings::Settings::overhead_bytes).
    pub fn new(tdma: &Tdma, heads_bytes: usize) -> Self {
        Self { link_bytes_s: tdma.link_bytes_s.max(1), heads_bytes }
    }

    /// Bytes of a datagram on the wire: headers of UDP, IP and Ethernet, padding, and the gap behind it.
    pub fn bytes(&self, datagram_bytes: usize) -> usize {
        (datagram_bytes + self.heads_bytes).max(PACKET_BYTES_MIN) + ETHERNET_BYTES
    }

    /// Time of a datagram on the wire, ns.
    pub fn ns(&self, datagram_bytes: usize) -> u64 {
        (self.bytes(datagram_bytes) as u128 * SECOND_NS).div_ceil(self.link_bytes_s.into()) as u64
    }

    /// Bytes that it carries in this time.
    pub fn bytes_in(&self, for_ns: u64) -> usize {
        (u128::from(for_ns) * u128::from(self.link_bytes_s) / SECOND_NS) as usize
    }

    /// The largest datagram that it carries in this time; none if not even an empty one.
    pub fn datagram_bytes_in(&self, for_ns: u64) -> Option<usize> {
        let packet_bytes = self.bytes_in(for_ns).checked_sub(ETHERNET_BYTES)?;
        (packet_bytes >= PACKET_BYTES_MIN.max(self.heads_bytes)).then(|| packet_bytes - self.heads_bytes)
    }
}
