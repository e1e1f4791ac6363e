//! Bytes within entries, and their sums.

use serde::{Deserialize, Serialize, Serializer};

/// Bytes that serde hands on as a whole, where they lie.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Deserialize)]
pub(crate) struct Blob<'a>(#[serde(borrow)] pub(crate) &'a [u8]);

impl Serialize for Blob<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(self.0)
    }
}

/// Odd, so that multiplying by it loses nothing.
const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;

/// Another word; of no two words the same. Of 0 it is not 0: memory that was never written has no sums that are right.
pub(super) fn spread(word: u32) -> u32 {
    // By an odd number, as above.
    (word ^ 0x5bd1_e995).wrapping_mul(0x9e37_79b1)
}

/// A sum of bytes, on top of an earlier one. Each step can be undone, so bytes that differ in one word have different
/// sums for sure. Against mistakes, not against malice.
pub(super) fn digest(before: u64, bytes: &[u8]) -> u64 {
    let step = |sum: u64, word: u64| {
        let sum = (sum ^ word).wrapping_mul(FACTOR);
        sum ^ (sum >> 32)
    };
    let words = bytes.chunks_exact(8);
    let mut last = [0; 8];
    let rest = words.remainder();
    last[..rest.len()].copy_from_slice(rest);
    let whole = words.fold(before, |sum, word| step(sum, u64::from_le_bytes(word.try_into().unwrap_or_default())));
    step(step(whole, u64::from_le_bytes(last)), bytes.len() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_flipped_bit_has_another_sum() {
        for len in [0, 1, 7, 8, 9, 24, 31] {
            let mut bytes: Vec<u8> = (0..len).collect();
            let sum = digest(7, &bytes);
            assert_ne!(digest(8, &bytes), sum, "{len} bytes, of others before");
            for bit in 0..usize::from(len) * 8 {
                bytes[bit / 8] ^= 1 << (bit % 8);
                assert_ne!(digest(7, &bytes), sum, "bit {bit} of {len} bytes");
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
            bytes.push(0);
            assert_ne!(digest(7, &bytes), sum, "{len} bytes, and a 0");
        }
    }

    #[test]
    fn a_blob_is_read_where_it_lies() {
        let bytes = postcard::to_stdvec(&(Blob(&[1, 2, 3]), 7u8)).unwrap();
        assert_eq!(bytes, [3, 1, 2, 3, 7]);
        let (blob, rest): (Blob<'_>, u8) = postcard::from_bytes(&bytes).unwrap();
        assert_eq!((blob, rest), (Blob(&[1, 2, 3]), 7));
    }
}
