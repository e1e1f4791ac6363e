//! What the descriptions in a file may cost its reader. They are kept as long as it is read, and compressed a megabyte
//! of them takes some hundred bytes: the length of the file says nothing.

use crate::error::FileLimit;
use crate::format::DESCRIBED_BYTES_MAX;

/// What was taken of [`DESCRIBED_BYTES_MAX`] so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct DescribedBytes(usize);

impl DescribedBytes {
    /// Texts of so many bytes more, and types and descriptions that need so many: their vectors may have twice as much.
    pub(crate) fn add(&mut self, texts: usize, types: usize) -> Result<(), FileLimit> {
        let all = self.0.saturating_add(texts).saturating_add(types.saturating_mul(2));
        if all > DESCRIBED_BYTES_MAX {
            return Err(FileLimit::Described);
        }
        self.0 = all;
        Ok(())
    }
}
