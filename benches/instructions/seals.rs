//! A datagram of 64 bytes, sealed and opened.

use super::Path;
use rohrpost_routers::frame::{FrameHead, FrameKind, HEAD_BYTES};
use rohrpost_routers::security::{Opened, TAG_BYTES};
use rohrpost_testbed::pair::SealedRouter;

const DATAGRAM_BYTES: usize = HEAD_BYTES + 64 + TAG_BYTES;

/// Seals a datagram.
pub(super) struct Seal {
    from: SealedRouter,
    to: SealedRouter,
    sequence: u64,
    datagram: [u8; DATAGRAM_BYTES],
}

impl Default for Seal {
    fn default() -> Self {
        let (mut from, mut to) = (SealedRouter::new(0), SealedRouter::new(1));
        from.acquaint(&mut to, 0);
        Self { from, to, sequence: 0, datagram: [0; DATAGRAM_BYTES] }
    }
}

impl Path for Seal {
    fn operate(&mut self) {
        let head = FrameHead {
            kind: FrameKind::Packages,
            system: 1,
            from: 0,
            to: 1,
            digest: 7,
            incarnation: 100,
            sequence: self.sequence,
        };
        self.from.sealing.seal(&head, &mut self.datagram).unwrap();
        self.sequence += 1;
    }
}

/// Opens a datagram.
#[derive(Default)]
pub(super) struct Open(Seal);

impl Path for Open {
    fn prepare(&mut self) {
        self.0.operate();
    }

    fn operate(&mut self) {
        let opened = self.0.to.opening.open(&mut self.0.datagram);
        assert!(matches!(opened, Ok(Opened::Frame(..))));
    }
}
