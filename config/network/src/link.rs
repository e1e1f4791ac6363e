//! Transmission times of packages and of the routers' own datagrams on a link.

use crate::setup::{Network, Security};
use crate::sizes::{
    ALIVE_BYTES, ETHERNET_BYTES, FRAGMENT_HEAD_BYTES, FRAME_HEAD_BYTES, HAND_OVER, HELLO_BYTES, RECORD_PART_HEAD_BYTES,
    REFUSAL_BYTES, TIME_BYTES,
};
use crate::table::{LATE, Tdma};
use rohrpost_mailbox::HEAD_BYTES as PACKAGE_HEAD_BYTES;

/// Frames of time in the windows of a system with time slots: the rule for clocks, and for bounds.
///
/// In each of its synchronisation windows the master sends a Sync to every other node. If the window has room for twice
/// as many frames, a warm-up goes before each of them. If it has room for a reply to each besides, replies go there
/// only, else in slots of the master, before all else. A slave sends a warm-up and a request in a slot, before all
/// else, at most once in a cycle. A node that hears no master sends a request to each master. A window has room for
/// frames that end before its guard even if it begins [`LATE`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TimeShare {
    /// A warm-up goes before each Sync.
    pub warm_ups: bool,
    /// Replies go in the synchronisation window alone.
    pub replies_in_synchronisation: bool,
    /// Frames of time at most in each slot of a node.
    pub frames_in_slot: usize,
}

impl TimeShare {
    /// `heads_bytes`: headers and seal of each datagram, see [`Network::around_bytes`].
    pub fn new(tdma: &Tdma, heads_bytes: usize, nodes: usize, masters: usize) -> Self {
        let bytes_s = tdma.link_bytes_s.max(1);
        Link { bytes_s, heads_bytes, datagram_bytes_max: 0, answer_bytes: 0, nodes, masters }.time_share(tdma)
    }
}

fn answer_bytes(security: Security) -> usize {
    match security {
        Security::None => REFUSAL_BYTES,
        Security::Keys => HELLO_BYTES,
    }
}

/// The link of a system with time slots, and the number of its nodes.
#[derive(Clone, Copy, Debug)]
pub struct Link {
    bytes_s: u64,
    heads_bytes: usize,
    datagram_bytes_max: usize,
    /// Largest message that goes once in a slot to an unknown node: a refusal, or a hello.
    answer_bytes: usize,
    nodes: usize,
    masters: usize,
}

impl Link {
    /// `nodes` are on the LAN, of which some may be `masters` of time.
    pub fn new(tdma: &Tdma, network: &Network, is_v6: bool, nodes: usize, masters: usize) -> Self {
        Self {
            bytes_s: tdma.link_bytes_s.max(1),
            heads_bytes: Network::around_bytes(is_v6, network.security),
            datagram_bytes_max: network.datagram_bytes_max,
            answer_bytes: answer_bytes(network.security),
            nodes,
            masters,
        }
    }

    /// Nodes besides the own one.
    pub fn others(&self) -> usize {
        self.nodes.saturating_sub(1)
    }

    /// Nodes that may be master of time.
    pub fn masters(&self) -> usize {
        self.masters
    }

    /// Time of a datagram on the wire, ns.
    pub fn wire_ns(&self, datagram_bytes: usize) -> u64 {
        let bytes = (datagram_bytes + self.heads_bytes + ETHERNET_BYTES) as u64;
        (bytes * 1_000_000_000).div_ceil(self.bytes_s)
    }

    /// How long a datagram keeps a slot busy, ns.
    pub fn takes_ns(&self, datagram_bytes: usize) -> u64 {
        self.wire_ns(datagram_bytes).max(HAND_OVER.as_nanos() as u64)
    }

    /// The same of the largest datagram.
    pub fn largest_ns(&self) -> u64 {
        self.takes_ns(self.datagram_bytes_max)
    }

    /// The same of a datagram of time.
    pub fn time_ns(&self) -> u64 {
        self.takes_ns(FRAME_HEAD_BYTES + TIME_BYTES)
    }

    /// Its time on the wire, ns.
    pub fn time_wire_ns(&self) -> u64 {
        self.wire_ns(FRAME_HEAD_BYTES + TIME_BYTES)
    }

    /// How long a keep-alive keeps a slot busy, ns.
    pub fn alive_ns(&self) -> u64 {
        self.takes_ns(FRAME_HEAD_BYTES + ALIVE_BYTES)
    }

    /// Bytes of a record in a part of full length: what a largest datagram has room for.
    pub fn part_bytes(&self) -> usize {
        self.datagram_bytes_max.saturating_sub(FRAME_HEAD_BYTES + RECORD_PART_HEAD_BYTES).max(1)
    }

    /// Which frames of time go where.
    fn time_share(&self, tdma: &Tdma) -> TimeShare {
        let others = self.others();
        let sends_ns = tdma.synchronisation.saturating_sub(tdma.guard + LATE).as_nanos() as u64;
        let frames = (sends_ns / self.time_ns()) as usize;
        let replies_in_synchronisation = frames >= 3 * others;
        let replies = if replies_in_synchronisation { 0 } else { others };
        let frames_in_slot = replies.max(2).max(self.masters);
        TimeShare { warm_ups: frames >= 2 * others, replies_in_synchronisation, frames_in_slot }
    }

    /// Longest time of the routers' own messages in a slot, before any package, ns: frames of time, a keep-alive to
    /// each other node, and a refusal or a hello.
    pub fn said_ns(&self, tdma: &Tdma) -> u64 {
        let answer_ns = self.takes_ns(FRAME_HEAD_BYTES + self.answer_bytes);
        let frames = self.time_share(tdma).frames_in_slot;
        frames as u64 * self.time_ns() + self.others() as u64 * self.alive_ns() + answer_ns
    }

    /// Time of a package's datagrams, if none of them is shared with another package.
    pub fn package(&self, body_bytes: usize) -> Parcel {
        let whole = FRAME_HEAD_BYTES + PACKAGE_HEAD_BYTES + body_bytes;
        if whole <= self.datagram_bytes_max {
            let takes_ns = self.takes_ns(whole);
            // Another may follow it in the same datagram, which comes as one.
            let last_ns = self.largest_ns();
            let forward_ns = self.wire_ns(self.datagram_bytes_max);
            return Parcel { datagrams: 1, takes_ns, largest_ns: takes_ns, last_ns, end_ns: takes_ns, forward_ns };
        }
        let head_bytes = FRAME_HEAD_BYTES + FRAGMENT_HEAD_BYTES;
        let part_bytes = self.datagram_bytes_max - head_bytes;
        let full = (body_bytes.div_ceil(part_bytes) - 1) as u64;
        let last_bytes = head_bytes + body_bytes - full as usize * part_bytes;
        let end_ns = self.takes_ns(last_bytes);
        Parcel {
            datagrams: full + 1,
            takes_ns: full * self.largest_ns() + end_ns,
            largest_ns: self.largest_ns(),
            last_ns: end_ns,
            end_ns,
            forward_ns: self.wire_ns(last_bytes),
        }
    }
}

/// Time of a package in slots, in ns.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Parcel {
    /// Number of its datagrams.
    pub datagrams: u64,
    /// All of them.
    pub takes_ns: u64,
    /// The largest of them.
    pub largest_ns: u64,
    /// Its own part of the last one.
    pub end_ns: u64,
    /// The last one with all that may share it.
    pub last_ns: u64,
    /// The last one from a switch to the receiver.
    pub forward_ns: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn link(security: Security) -> Link {
        let around = Network::around_bytes(false, security);
        let datagram_bytes_max = 1500 - around;
        Link {
            bytes_s: 1_000_000,
            heads_bytes: around,
            datagram_bytes_max,
            answer_bytes: answer_bytes(security),
            nodes: 2,
            masters: 1,
        }
    }

    #[test]
    fn what_seals_is_counted_in_all_that_a_slot_carries() {
        let [open, sealed] = [Security::None, Security::Keys].map(link);
        // At a byte a microsecond.
        let tag_ns = 16_000;
        assert_eq!(sealed.time_wire_ns(), open.time_wire_ns() + tag_ns);
        assert_eq!(sealed.alive_ns(), open.alive_ns() + tag_ns);
        assert_eq!(sealed.package(100).takes_ns, open.package(100).takes_ns + tag_ns);
        assert_eq!(sealed.largest_ns(), open.largest_ns(), "a packet carries as much as before");
        assert_eq!(open.package(1472 - 52).datagrams, 1);
        assert_eq!(sealed.package(1472 - 52).datagrams, 2, "of which the seal takes its part");
    }
}
