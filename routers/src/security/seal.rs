//! One derived key at work: a datagram is sealed and opened where it lies.

use crate::frame::{self, HEAD_BYTES};
use ring::aead::{Aad, LessSafeKey, NONCE_LEN, Nonce};
pub use rohrpost_network::TAG_BYTES;

/// ChaCha20-Poly1305: as quick on a board without instructions for AES, and without tables that caches tell of.
pub(super) struct Seal(LessSafeKey);

impl Seal {
    pub(super) fn new(key: LessSafeKey) -> Self {
        Self(key)
    }

    /// Seals what lies between the head and the room for the tag, and writes the check over all of it. No two datagrams
    /// have one nonce.
    pub(super) fn close(&self, nonce: [u8; NONCE_LEN], datagram: &mut [u8]) {
        let (head, sealed) = datagram.split_at_mut(HEAD_BYTES);
        let (text, tag) = sealed.split_at_mut(sealed.len() - TAG_BYTES);
        let nonce = Nonce::assume_unique_for_key(nonce);
        let made = self.0.seal_in_place_separate_tag(nonce, Aad::from(frame::before_check(head)), text);
        tag.copy_from_slice(made.expect("a datagram is shorter than what a nonce is good for").as_ref());
        frame::write_check(datagram);
    }

    /// What was sealed; none if it was not sealed with this key, or not as it is now. Then what was in the datagram is
    /// spoilt.
    pub(super) fn open<'a>(&self, nonce: [u8; NONCE_LEN], datagram: &'a mut [u8]) -> Option<&'a [u8]> {
        let (head, sealed) = datagram.split_at_mut(HEAD_BYTES);
        let nonce = Nonce::assume_unique_for_key(nonce);
        let text = self.0.open_in_place(nonce, Aad::from(frame::before_check(head)), sealed).ok()?;
        Some(text)
    }
}

/// Nonce for a key of one incarnation: the number of the datagram.
pub(super) fn of_sequence(sequence: u64) -> [u8; NONCE_LEN] {
    let mut nonce = [0; NONCE_LEN];
    nonce[4..].copy_from_slice(&sequence.to_le_bytes());
    nonce
}

/// Nonce for a key of all incarnations of a node: the incarnation, and the number of its hello.
pub(super) fn of_hello(incarnation: u64, number: u32) -> [u8; NONCE_LEN] {
    let mut nonce = [0; NONCE_LEN];
    nonce[..8].copy_from_slice(&incarnation.to_le_bytes());
    nonce[8..].copy_from_slice(&number.to_le_bytes());
    nonce
}
