//! Reads the fields of a frame, one after the other.

use super::BadSessionFrame;

/// Reads the fields of a frame, one after the other: the bytes that are not read yet.
pub(super) struct FieldReader<'a>(&'a [u8]);

impl<'a> FieldReader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], BadSessionFrame> {
        let (array, rest) = self.0.split_first_chunk().ok_or(BadSessionFrame::Damaged("a frame is cut short"))?;
        self.0 = rest;
        Ok(*array)
    }

    pub(super) fn byte(&mut self) -> Result<u8, BadSessionFrame> {
        self.array().map(u8::from_le_bytes)
    }

    pub(super) fn word(&mut self) -> Result<u32, BadSessionFrame> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn long(&mut self) -> Result<u64, BadSessionFrame> {
        self.array().map(u64::from_le_bytes)
    }

    /// Bytes that mean nothing yet.
    pub(super) fn zeroes<const N: usize>(&mut self) -> Result<(), BadSessionFrame> {
        match self.array::<N>()?.iter().all(|byte| *byte == 0) {
            true => Ok(()),
            false => Err(BadSessionFrame::Damaged("bytes that must be 0 are not")),
        }
    }

    /// All that is left.
    pub(super) fn rest(&mut self) -> &'a [u8] {
        std::mem::take(&mut self.0)
    }

    /// All that is left, a short text for people.
    pub(super) fn text(&mut self, bytes_max: usize) -> Result<&'a str, BadSessionFrame> {
        let text = std::str::from_utf8(self.rest()).map_err(|_| BadSessionFrame::Damaged("a text is not UTF-8"))?;
        let is_fine = text.len() <= bytes_max && !text.contains(char::is_control);
        if is_fine { Ok(text) } else { Err(BadSessionFrame::Damaged("a text is too long, or has control characters")) }
    }
}
