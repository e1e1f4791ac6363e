//! Descriptions that come in parts.

use super::check;
use crate::frame::DescriptionPart;

/// A description on its way, from the front.
#[derive(Default)]
pub(super) struct DescriptionAssembly {
    check: u32,
    len: u32,
    bytes: Vec<u8>,
}

impl DescriptionAssembly {
    /// Takes a part; the whole, once it is there. A part that is missing comes with the next round.
    pub(super) fn take(&mut self, part: &DescriptionPart<'_>) -> Option<Vec<u8>> {
        if part.offset == 0 {
            self.bytes.clear();
            (self.check, self.len) = (part.check, part.len);
        }
        let is_next = part.offset as usize == self.bytes.len() && (part.check, part.len) == (self.check, self.len);
        if !is_next {
            return None;
        }
        self.bytes.extend_from_slice(part.bytes);
        if self.bytes.len() < part.len as usize {
            return None;
        }
        let whole = std::mem::take(&mut self.bytes);
        (check(&whole) == self.check).then_some(whole)
    }
}
