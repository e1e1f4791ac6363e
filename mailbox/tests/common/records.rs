//! Records that tell whether they are whole, made so that a writer at full speed has only to copy them.
//!
//! ```text
//!  number │ content, which several records share │ sum of the content, mixed with the number
//! ```

use super::random::{Random, sum};

/// Bytes of the smallest: two words.
pub(crate) const RECORD_BYTES_MIN: usize = 16;

/// The contents, made once. Their number has no factor in common with a ring's frames: what lay in a frame before had
/// another one, mostly.
pub(crate) struct Records(Vec<Vec<u8>>);

impl Records {
    /// One content for each of these lengths of a record, in bytes.
    pub(crate) fn new(lengths: impl IntoIterator<Item = usize>) -> Self {
        let mut random = Random::new(7);
        let record = |len: usize| {
            let mut body: Vec<u8> = (0..len).map(|_| random.below(256) as u8).collect();
            let content = sum(&body[8..len - 8]);
            body[len - 8..].copy_from_slice(&content.to_le_bytes());
            body
        };
        Self(lengths.into_iter().map(record).collect())
    }

    fn of(&self, number: u64) -> &[u8] {
        &self.0[(number % self.0.len() as u64) as usize]
    }

    /// Bytes of the record of this number.
    pub(crate) fn len(&self, number: u64) -> usize {
        self.of(number).len()
    }

    /// Writes the record of this number into these bytes, which may be more than it has.
    pub(crate) fn fill(&self, number: u64, into: &mut [u8]) {
        let record = self.of(number);
        let into = &mut into[..record.len()];
        into.copy_from_slice(record);
        into[..8].copy_from_slice(&number.to_le_bytes());
        let end = into.last_chunk_mut::<8>().unwrap();
        *end = (u64::from_le_bytes(*end) ^ mix(number)).to_le_bytes();
    }

    /// # Panics
    /// When these bytes are not the record of this number, whole.
    pub(crate) fn check(&self, number: u64, body: &[u8]) {
        assert_eq!(body.len(), self.len(number), "torn: bytes of record {number}");
        let (content, end) = body.split_last_chunk::<8>().unwrap();
        let (first, content) = content.split_first_chunk::<8>().unwrap();
        let found = (u64::from_le_bytes(*first), u64::from_le_bytes(*end));
        assert_eq!(found, (number, sum(content) ^ mix(number)), "torn: record {number}");
    }
}

fn mix(number: u64) -> u64 {
    number.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(31)
}
