//! Copies between plain memory and words that another process may write or read meanwhile.

use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes of a word.
const WORD: usize = size_of::<u64>();

/// Writes these bytes into the first words, as they lie in memory; the rest of the last word is 0.
#[inline]
pub(crate) fn store(words: &[AtomicU64], bytes: &[u8]) {
    // Whole words apart: a copy of a length that is not known at compile time is a call for each word.
    let (whole, rest) = bytes.as_chunks::<WORD>();
    for (word, bytes) in words.iter().zip(whole) {
        word.store(u64::from_ne_bytes(*bytes), Ordering::Relaxed);
    }
    if let (false, Some(word)) = (rest.is_empty(), words.get(whole.len())) {
        let mut last = [0; WORD];
        last[..rest.len()].copy_from_slice(rest);
        word.store(u64::from_ne_bytes(last), Ordering::Relaxed);
    }
}

/// Reads the first words into these bytes.
#[inline]
pub(crate) fn load(words: &[AtomicU64], bytes: &mut [u8]) {
    let (whole, rest) = bytes.as_chunks_mut::<WORD>();
    for (word, bytes) in words.iter().zip(whole.iter_mut()) {
        *bytes = word.load(Ordering::Relaxed).to_ne_bytes();
    }
    if let (false, Some(word)) = (rest.is_empty(), words.get(whole.len())) {
        let last = word.load(Ordering::Relaxed).to_ne_bytes();
        rest.copy_from_slice(&last[..rest.len()]);
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
