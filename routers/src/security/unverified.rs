//! Incarnations of a peer that have not proved that they live, but send datagrams of time that this node opens.

use super::seal::{self, Seal};
use crate::frame::FrameHead;

/// Number of incarnations of a peer that are remembered; a further one replaces the one that was heard longest ago.
const INCARNATIONS: usize = 2;

struct UnverifiedIncarnation {
    incarnation: u64,
    /// Place of the key of its seal.
    key: usize,
    seal: Seal,
    /// All of it that was overheard is below.
    next: u64,
}

/// The incarnations of one peer, the last one first.
#[derive(Default)]
pub(super) struct UnverifiedIncarnations([Option<UnverifiedIncarnation>; INCARNATIONS]);

impl UnverifiedIncarnations {
    /// Opens a datagram that is sealed with the key at a place. Without its seal, which is derived, none takes the
    /// place of another.
    pub(super) fn open<'a>(
        &mut self,
        (head, key): (&FrameHead, usize),
        datagram: &'a mut [u8],
        derive: impl FnOnce() -> Seal,
    ) -> Option<&'a [u8]> {
        let at =
            self.0.iter().position(|entry| entry.as_ref().is_some_and(|entry| entry.incarnation == head.incarnation));
        let known = at.and_then(|at| self.0[at].as_mut());
        let (nonce, after) = (seal::of_sequence(head.sequence), head.sequence.saturating_add(1));
        let text = match known {
            Some(entry) if entry.key == key => {
                let text = entry.seal.open(nonce, datagram)?;
                entry.next = entry.next.max(after);
                text
            }
            known => {
                let seal = derive();
                let text = seal.open(nonce, datagram)?;
                let next = known.map_or(after, |entry| entry.next.max(after));
                self.0[at.unwrap_or(INCARNATIONS - 1)] =
                    Some(UnverifiedIncarnation { incarnation: head.incarnation, key, seal, next });
                text
            }
        };
        self.0[..=at.unwrap_or(INCARNATIONS - 1)].rotate_right(1);
        Some(text)
    }

    /// First sequence of an incarnation from which on nothing was overheard.
    pub(super) fn next(&self, incarnation: u64) -> u64 {
        let mut entries = self.0.iter().flatten();
        entries.find(|entry| entry.incarnation == incarnation).map_or(0, |entry| entry.next)
    }
}
