//! Copies between plain memory and words that another process may write or read meanwhile.

use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes of a word.
const WORD: usize = size_of::<u64>();

/// Writes these bytes into the first words, as they lie in memory; the rest of the last word is 0.
#[inline]
pub(crate) fn store(words: &[AtomicU64], bytes: &[u8]) {
    for (word, bytes) in words.iter().zip(bytes.chunks(WORD)) {
        let mut whole = [0; WORD];
        whole[..bytes.len()].copy_from_slice(bytes);
        word.store(u64::from_ne_bytes(whole), Ordering::Relaxed);
    }
}

/// Reads the first words into these bytes.
#[inline]
pub(crate) fn load(words: &[AtomicU64], bytes: &mut [u8]) {
    for (word, bytes) in words.iter().zip(bytes.chunks_mut(WORD)) {
        let whole = word.load(Ordering::Relaxed).to_ne_bytes();
        bytes.copy_from_slice(&whole[..bytes.len()]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_out_as_they_went_in() {
        let words: [AtomicU64; 4] = Default::default();
        let bytes: [u8; 32] = std::array::from_fn(|at| at as u8 + 1);
        for len in 0..=32 {
            store(&words, &bytes[..len]);
            let mut copy = vec![0; len];
            load(&words, &mut copy);
            assert_eq!(copy, bytes[..len]);
        }
    }
}
