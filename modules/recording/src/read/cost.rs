//! What the descriptions in a file may cost its reader. They are kept as long as it is read, and compressed a megabyte
//! of them takes some hundred bytes: the length of the file says nothing.

use crate::error::FileLimit;
use crate::format::DESCRIBED_BYTES_MAX;
use mcap::records::Metadata;

/// What a text of metadata takes besides its bytes and those of its key: two vectors, in a map with room for twice as
/// many.
const TEXT_BYTES: usize = 4 * size_of::<String>();

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

    /// Metadata that are kept.
    pub(crate) fn add_metadata(&mut self, its: &Metadata) -> Result<(), FileLimit> {
        let texts = its.metadata.iter().map(|(key, text)| TEXT_BYTES + key.len() + text.len());
        self.add(size_of::<Metadata>() + its.name.len() + texts.sum::<usize>(), 0)
    }

    /// Both.
    pub(crate) fn and(mut self, other: Self) -> Result<Self, FileLimit> {
        self.add(other.0, 0)?;
        Ok(self)
    }
}
