//! A replica that never ends: in each slot there are parts of full length behind all packages, to each peer in turn.
//! Its content says nothing, and nobody reads it: it takes time on the wire.

use super::station::{Io, Port, Sent};
use rohrpost_routers::frame::{self, FrameHead, FrameKind, NodeIndex, RecordPart};
use rohrpost_routers::settings::Settings;
use std::rc::Rc;

/// Parts have the socket behind those of packages and of time.
pub const PORT: Port = 2;

/// One incarnation of a router that sends it.
pub struct PartFlood {
    head: FrameHead,
    datagram_bytes: usize,
    peers: Vec<NodeIndex>,
}

impl PartFlood {
    /// Of a router that begins.
    pub fn new(settings: &Settings) -> Self {
        let Settings { system, own, digest, incarnation, .. } = *settings;
        let head =
            FrameHead { kind: FrameKind::RecordPart, system, from: own, to: own, digest, incarnation, sequence: 0 };
        Self { head, datagram_bytes: settings.network.datagram_bytes_max, peers: settings.peers().collect() }
    }

    /// The next part.
    pub fn next(&mut self, datagram: &mut [u8]) -> Option<(NodeIndex, usize)> {
        let to = *self.peers.get(self.head.sequence as usize % self.peers.len().max(1))?;
        let (head, content) = datagram[..self.datagram_bytes].split_at_mut(frame::HEAD_BYTES);
        let (head_of_part, bytes) = content.split_at_mut(frame::RECORD_PART_HEAD_BYTES);
        bytes.fill(7);
        let part = RecordPart {
            place: 0,
            generation: 0,
            description: 0,
            incarnation: 1,
            len: u32::MAX,
            offset: 0,
            sequence: self.head.sequence,
            epoch: 1,
            stamp_ns: 1,
            written_ns: 0,
            error_ns: 0,
            step: 0,
            sampled: 0,
            bytes,
        };
        head_of_part.copy_from_slice(&part.head_bytes());
        let written = FrameHead { to, ..self.head };
        head.copy_from_slice(&written.to_bytes(&[&*content]));
        self.head.sequence += 1;
        Some((to, self.datagram_bytes))
    }
}

/// Hands a part to the kernel.
pub fn send(io: &mut Io<'_>, to: NodeIndex, bytes: &[u8]) {
    io.oracle.saw("a part of a replica");
    io.sent.push(Sent { port: PORT, to: to.into(), bytes: Rc::from(bytes), handed: io.now, sealed_to: None });
}
