//! Seals of systems that do not know each other beforehand: one key for each incarnation that sends, for all that hear
//! it.
//!
//! A key of a team is derived as those of the LAN are, but has no receiver: what is sealed once is opened by all. So
//! it proves no freshness; the challenges of [`team`](crate::team) do.

use super::keys::{Binding, Endpoint, KeyRing, Purpose};
use super::seal::{self, Seal};
use crate::frame::{self, NodeIndex};

/// The seals of one incarnation of a node of a system, by the place of the key.
pub(crate) struct TeamSeal(Vec<Seal>);

impl TeamSeal {
    /// Of an incarnation.
    pub(crate) fn new(keys: &KeyRing, system: u8, node: NodeIndex, incarnation: u64) -> Self {
        let (from, to) = (Endpoint { node, incarnation }, Endpoint::any(0));
        Self(keys.derive_all(&Binding { purpose: Purpose::Team, system, from, to }))
    }

    /// Seals a datagram with a written head where it lies, with the newest key. No sequence is sealed twice.
    pub(crate) fn close(&self, keys: &KeyRing, sequence: u64, datagram: &mut [u8]) {
        frame::write_key(keys.id(0), datagram);
        self.0[0].close(seal::of_sequence(sequence), datagram);
    }

    /// Opens what the key at a place sealed; none if it did not, or not so.
    pub(crate) fn open<'a>(&self, place: usize, sequence: u64, datagram: &'a mut [u8]) -> Option<&'a [u8]> {
        self.0.get(place)?.open(seal::of_sequence(sequence), datagram)
    }
}
